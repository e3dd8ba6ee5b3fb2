/// @file
/// The zero of a counted angle, which nothing tells better than to half an encoder step.
///
///   r_i = y_i − x_iᵀ θ − (φ₀ + φ_run) ∂T/∂φ_i,   φ₀ ~ (0, (q/2)²),   φ_run ~ (0, q²/12) for each run at rest
///
/// A counter that cuts off reads half a step too little on average, one that was zeroed elsewhere another part of it: one
/// constant for all rows, φ₀. While the joint moves the rest of the error changes from row to row and is noise; in a clamped
/// run it is one number for the whole run, φ_run. Both are fitted along with their priors, never reported as parameters.
/// Units: rad (m). Threads: pure. Errors: none. Source: docs/derivations/errors_in_variables.md.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "isac/estimate/block_covariance.hpp"
#include "isac/estimate/joint_fit.hpp"
#include "isac/estimate/joint_rows.hpp"
#include "isac/estimate/robust.hpp"

namespace isac::estimate {

struct ZeroFit {
  std::vector<double> column;                 ///< ∂(prediction)/∂(angle); empty: not used
  std::vector<RobustProblem::Local> resting;  ///< rows of the runs at rest
  double half_step = 0;                       ///< rad
  double slope = 0;                           ///< mean of the column
  double weight = 0, resting_weight = 0;      ///< λ = spread² / σ₀²
  double value = 0, std_error = 0;            ///< rad
};

/// Adds the zero's column and the resting runs' parts to `problem`, or renews them at `theta`. False: nothing to move.
[[nodiscard]] bool set_zero(const JointRows& rows, const JointTerms& terms, const Eigen::VectorXd& theta,
                            double step, double spread, RobustProblem& problem, ZeroFit& zero);

/// λ of the zero and of the resting runs' own, behind `kept` parameters of `size`; `spread` also gives the variance of the score.
[[nodiscard]] Prior prior_of(const ZeroFit& zero, std::size_t kept, int size, double spread = 0);

/// Parameters with places for the zero, which begins at zero, or as they are if they have them.
[[nodiscard]] Eigen::VectorXd with_zero(const Eigen::VectorXd& theta, std::size_t kept, std::size_t nonlinear,
                                        const RobustProblem& problem);

/// In words for the answer.
[[nodiscard]] AngleZero angle_zero(const ZeroFit& zero, const JointFitOptions& options);

/// Is the constant that was fitted no more than half a step makes?
[[nodiscard]] ResidualTest zero_test(const AngleZero& zero, const ZeroFit& fit,
                                     const JointFitOptions& options);

}  // namespace isac::estimate
