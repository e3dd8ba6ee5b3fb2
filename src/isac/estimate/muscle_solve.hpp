/// @file
/// One muscle model fitted to prepared runs by Ceres, with the gradient of the model and the censoring of readings at the stop.
///
/// Internal to the room `estimate`. Units: SI. Threads: pure functions. Errors: none; `converged` tells.
/// Source: docs/derivations/muscle_fit.md.
#pragma once

#include <string>
#include <vector>

#include "isac/estimate/muscle_catalogue.hpp"
#include "isac/estimate/muscle_points.hpp"

namespace isac::estimate {

struct MuscleSolution {
  bool converged = false;
  std::string summary;
  std::vector<double> parameters;  ///< scaled, all of the model's
  std::vector<double> std_errors;  ///< scaled; NaN where fixed or not determined
  std::vector<double> zeros;       ///< N, per run
  double degrees_of_freedom = 1;
  double weighted_sse = 0;
  double points = 0;
};

/// `fixed` marks parameters that stay at 0. Zeros are fitted along where `fit_zeros`.
[[nodiscard]] MuscleSolution solve_muscle(const MuscleModelEntry& model, const std::vector<PreparedRun>& runs,
                                          const std::vector<bool>& fixed, double diameter, bool fit_zeros);

/// Residuals (weighted) and, if not null, their row-major Jacobian by the scaled parameters and, behind them, the zeros.
void muscle_residuals(const MuscleModelEntry& model, const std::vector<PreparedRun>& runs, double diameter,
                      const std::vector<double>& parameters, const std::vector<double>& zeros,
                      std::vector<double>& residuals, std::vector<double>* jacobian);

}  // namespace isac::estimate
