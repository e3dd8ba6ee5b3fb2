/// @file
/// One first-order step with dead time, fitted: p = p_a + G (1 − exp(−(s − L)/T)) for s > L, p_a before.
///
/// Start: for given T, every split of the rows into "before" and "behind" the onset is a linear problem whose sums follow by
/// recursion, so the sum of squares over all L, kinks included, is exact in one pass; T by a grid and golden section.
/// Then Ceres with the analytic Jacobian. Covariance: (JᵀJ)⁻¹ Jᵀ Γ J (JᵀJ)⁻¹, Γ from an autoregressive model of the residuals
/// plus the quantisation of readings that rest. Internal to the room `estimate`. Units: SI. Threads: pure functions.
/// Errors: none; `ok` tells. Source: docs/derivations/pcu_fit.md.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "isac/estimate/step_data.hpp"

namespace isac::estimate {

/// Order of parameters everywhere: p_a, G = p_b − p_a, T, L.
using StepParameters = std::array<double, 4>;

/// Residuals y − model and, if `jacobian` is not null, its row-major n × 4 derivative.
void step_residuals(std::span<const double> s, std::span<const double> y, const StepParameters& parameters,
                    double* residuals, double* jacobian);

struct StepFit {
  bool ok = false;         ///< a minimum inside the data was found
  bool converged = false;  ///< Ceres says so too
  StepParameters parameters{};
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  double degrees_of_freedom = 0;  ///< of the variance, under coloured noise
  double correlation_rows = 1;    ///< rows per independent one
  double sse = 0;
  std::vector<double> residuals;
  std::string summary;
};

/// Global minimum over L ≥ `earliest` for all T, before Ceres. Returns parameters and their sum of squares.
[[nodiscard]] std::pair<StepParameters, double> search_step(const StepData& data, double earliest);

[[nodiscard]] StepFit fit_step(const StepData& data, double earliest);

}  // namespace isac::estimate
