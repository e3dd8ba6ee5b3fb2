/// @file
/// The least squares behind plant_fit.hpp: a record on an even grid, its residuals, where to begin, one solution.
///
///   x = (log K, log T_C, log T_J, log ζ, L/scale, φ_0/size, load/reach, q/scale²);  `LagForm` says which of them are searched for
///   r_k = (φ_k − φ(t_k; x))/size − φ_0/size                                            averaged over `thin` rows
/// Units: SI inside the plant, x and r without. Threads: pure. Errors: plant_problem() throws isac::Error "no_usable_data".
/// Source: docs/derivations/tuning.md. Example: `solve(problem, starts_of(problem).front().x, LagForm::kLag)`.
#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "isac/tune/plant_fit.hpp"

namespace isac::tune {

enum PlantUnknown {
  kLogGain,
  kLogLag,
  kLogTime,
  kLogDamping,
  kDeadTime,
  kOffset,
  kLoad,
  kBend,
  kPlantUnknowns
};
using PlantVector = std::array<double, kPlantUnknowns>;

/// The joint's own form; the same with L of either sign (a lead beyond all lags is dead time below zero); and with (1 + q s²)
/// too: what it needs there says how far the record is from the form.
enum class LagForm { kLag, kShiftedLag, kBentLag };

struct PlantProblem {
  ExperimentRecord record;   ///< on an even grid
  std::vector<double> mean;  ///< rad, of the angle over `thin` rows
  std::vector<double> load;  ///< 0 at rest, the command's reach from its first change on
  double interval = 0, size = 1, scale = 1, known_dead_time = 0;
  bool fit_dead_time = true;
  std::size_t thin = 1;  ///< rows to a residual

  [[nodiscard]] std::size_t residuals() const { return mean.size(); }
};

[[nodiscard]] PlantProblem plant_problem(const ExperimentRecord& record, const PlantFitOptions& options);

[[nodiscard]] LagPlant plant_of(const PlantProblem& problem, const PlantVector& x);

/// φ on the record's grid.
[[nodiscard]] std::vector<double> motion_of(const PlantProblem& problem, const PlantVector& x);

/// False where one is not finite.
bool residuals_of(const PlantProblem& problem, const PlantVector& x, double* residuals);

struct PlantSolution {
  PlantVector x{};
  double cost = std::numeric_limits<double>::infinity();  ///< half the sum of squares
  bool converged = false;
  std::string summary;
};

/// Best first; at most four.
[[nodiscard]] std::vector<PlantVector> starts_of(const PlantProblem& problem);

[[nodiscard]] PlantSolution solve(const PlantProblem& problem, const PlantVector& start, LagForm form);

}  // namespace isac::tune
