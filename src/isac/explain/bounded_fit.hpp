/// @file
/// Nonlinear least squares within bounds, for a few parameters and very many rows.
///
///   min ½ |r(x)|²,  l ≤ x ≤ u;   step: min ½ dᵀ(JᵀJ + λ diag JᵀJ) d + (Jᵀr)ᵀ d,  l ≤ x + d ≤ u
///
/// The bounds are part of the step's own problem, solved exactly by its active set. A trust region that only projects its step back onto
/// the bounds (as Ceres 2.1 does) creeps where the best point lies on a bound, and tolerances lie there often.
/// A parameter that the data do not feel, |J_i|² (u_i − l_i)² < tolerance · |r|², is not moved in that step.
/// Threads: a function. Errors: none; `converged` is false where the residual is not finite or the rounds ran out.
/// Source: Nocedal and Wright, Numerical Optimization, 10.3 and 16.7.
#pragma once

#include <Eigen/Core>
#include <functional>

namespace isac::explain {

/// Residual at x and, if asked for, its Jacobian (column-major, rows × parameters). False: not defined there.
using Evaluate =
    std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian)>;

struct BoundedFit {
  Eigen::VectorXd x, residual;
  Eigen::MatrixXd curvature;  ///< JᵀJ where the last step began; empty where there was none
  double loss = 0;            ///< |r|²
  int rounds = 0;
  bool converged = false;
};

struct BoundedOptions {
  int rounds = 30;
  double tolerance = 1e-7;  ///< of the loss: a step that promises less is not taken
};

[[nodiscard]] BoundedFit bounded_fit(const Evaluate& evaluate, Eigen::VectorXd start,
                                     const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                                     const BoundedOptions& options = {});

/// min ½ dᵀHd + gᵀd within bounds, H positive definite.
[[nodiscard]] Eigen::VectorXd bounded_quadratic(const Eigen::MatrixXd& H, const Eigen::VectorXd& g,
                                                const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);

}  // namespace isac::explain
