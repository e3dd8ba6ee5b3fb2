/// @file
/// How sure a step fit is: covariance of its parameters under coloured noise and quantisation.
///
/// Internal to the room `estimate`. Units: SI. Threads: pure functions. Errors: none; `ok` is false where JᵀJ is singular.
/// Source: docs/derivations/pcu_fit.md.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "isac/estimate/step_fit.hpp"

namespace isac::estimate {

/// Autocovariance γ_0, γ_1, … of a zero-mean stationary sequence by an autoregression (order by AIC, at most 12), up to the lag
/// where it has died out. White noise gives one element.
[[nodiscard]] std::vector<double> modelled_autocovariance(std::span<const double> residuals);

struct StepCovariance {
  bool ok = false;
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  double degrees_of_freedom = 0;
  double correlation_rows = 1;
};

/// `jacobian` is row-major n × 4.
[[nodiscard]] StepCovariance step_covariance(std::span<const double> jacobian,
                                             std::span<const double> residuals, const StepData& data,
                                             const StepParameters& parameters);

/// Two-sided 95 % quantile of Student's t.
[[nodiscard]] double student_95(double degrees_of_freedom);
/// Upper tail of the chi-square distribution.
[[nodiscard]] double chi_square_tail(double statistic, double degrees_of_freedom);

}  // namespace isac::estimate
