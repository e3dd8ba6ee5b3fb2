/// @file
/// The hypotheses behind pose_explain.hpp: what each would add to the torques of the recorded poses, and its best parameters.
///
///   r_h(β) = (y − g(θ; m) − X_h β)/σ, whitened by L⁻¹ with L Lᵀ = 1 + N Nᵀ
///
/// All but the angle's zero are linear in β; that one by Gauss-Newton. Units: SI. Threads: const functions may run side by side.
/// Errors: none. Source: docs/derivations/pose_explain.md.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "isac/estimate/mass_problem.hpp"
#include "isac/estimate/pose_explain.hpp"

namespace isac::estimate {

struct PoseHypothesis {
  std::string id, name;
  int joint = -1;
  std::vector<std::string> parameters, units;
  Eigen::MatrixXd columns;  ///< dy/dβ, over the noise, not whitened; at β = 0
  bool is_zero = false;     ///< y is not linear in β: moved_residual()
  MassUnknown zero;         ///< which
};

/// Residuals of the arm as its file has it, over the noise.
[[nodiscard]] Eigen::VectorXd pose_residual(const MassProblem& problem, const Eigen::VectorXd& masses);
/// Columns of what is known with errors: masses and actuators, per standard error, over the noise.
[[nodiscard]] Eigen::MatrixXd pose_nuisances(const MassProblem& problem, const Eigen::VectorXd& masses,
                                             const std::vector<double>& mass_errors);
[[nodiscard]] std::vector<PoseHypothesis> pose_hypotheses(const MassProblem& problem,
                                                          const Eigen::VectorXd& masses,
                                                          const PoseExplainOptions& options);
/// Residuals with the angle of `zero` moved by `shift`, and their derivative by it, over the noise.
void moved_residual(const MassProblem& problem, const Eigen::VectorXd& masses, const MassUnknown& zero,
                    double shift, Eigen::VectorXd& residual, Eigen::VectorXd& column);

}  // namespace isac::estimate
