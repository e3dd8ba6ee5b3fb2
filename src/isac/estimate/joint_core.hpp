/// @file
/// The estimate itself: from rows to parameters, covariance and what could not be fitted. fit_joint() puts words to it.
///
/// Order: rank → least squares → robust scale and weights from the noise of the regressors → robust fit (twice, so that the scale is
/// that of the robust residual) → correction for errors in variables → blocks → covariance.
/// Threads: pure. Errors: none. Source: docs/derivations/joint_fit.md.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "isac/estimate/angle_zero.hpp"
#include "isac/estimate/identifiability.hpp"
#include "isac/estimate/joint_fit.hpp"
#include "isac/estimate/joint_rows.hpp"
#include "isac/estimate/joint_terms.hpp"
#include "isac/estimate/residual_tests.hpp"

namespace isac::estimate {

struct JointCore {
  bool converged = false;
  std::string report;
  Rank rank;                   ///< over linear, then nonlinear parameters
  Eigen::VectorXd theta;       ///< SI, linear then nonlinear; 0 where not fitted
  Eigen::MatrixXd covariance;  ///< SI, NaN where not fitted
  Eigen::VectorXd degrees_of_freedom;
  Eigen::VectorXd inflation;
  double spread = 0;                    ///< robust standard deviation of the residual
  std::vector<double> residual, omega;  ///< of the rows as fitted (filtered, if so chosen)
  std::size_t outliers = 0;
  std::vector<BlockRange> blocks;
  double block_seconds = 0;
  double correlation_seconds = 0;
  bool blocks_cut_short = false;    ///< the record is too short for blocks as long as the noise remembers
  std::vector<const double*> used;  ///< columns that were fitted
  ZeroFit zero;
};

[[nodiscard]] JointCore estimate_joint(const JointRows& rows, JointTerms& terms,
                                       const JointFitOptions& options, const RowRecipe& recipe);

/// Blocks of equal time within each run, as near to `seconds` as goes; a run shorter than that is one block.
[[nodiscard]] std::vector<BlockRange> time_blocks(const JointRows& rows, double seconds);

/// Correlation time [s] of the residual, from run-wise means over bins of `bin_seconds` or more.
[[nodiscard]] double residual_correlation_time(const JointRows& rows, std::span<const double> residual,
                                               double limit, double bin_seconds);

}  // namespace isac::estimate
