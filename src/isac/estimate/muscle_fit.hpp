/// @file
/// Muscle models M1 to M6 fitted to recordings of force, pressure and contraction, and ranked on recordings held out.
///
///   minimise Σ over runs, branches, points  w (F_measured − z_run − max(0, F_model(p, ε + δ/l0, ε̇; θ)))²        by Ceres
///
/// max(0, ·): a muscle does not push. z_run is the force sensor's zero in that run (it differs by test; see ZeroHandling).
/// δ is the end correction: full contraction shrinks with length as ε_full = ε_∞ − δ/l0, because the ends do not contract;
/// δ follows from the full contractions of muscles of several lengths, that is from lengths alone, never from held-out
/// forces. Readings at the sensor's lower stop are censored: they count only where the model lies above the stop. Filling and
/// exhausting branches weigh the same, so the fit follows the mean path; their distance is the width of the hysteresis.
/// Held-out runs are scored with the same zero, stop and slack for every model and law. docs/derivations/muscle_fit.md.
///
/// Units: SI inside (Pa, N, m); contraction ε = (l0 − l)/l0, dimensionless; parameters in the unit each names. Intervals:
/// sandwich over branches of runs, Student's t; they speak of this muscle under this model, misfit included.
/// Threads: pure function of its arguments. Errors: throws isac::Error: "no_usable_data" (answer is no) without a usable row;
/// unknown model ids and columns of unequal length are usage errors. Every numerical outcome is data in the result.
/// Source: seed 2.1 to 2.19; models in models/muscle_geometry.hpp, models/muscle_empirical.hpp.
/// Example: `fit_muscle(train, heldout).ranking.front().id`.
#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"

namespace isac::estimate {

/// One recording of one muscle; columns of equal length, SI, NaN where missing.
struct MuscleRun {
  std::string name;
  std::string sha256;
  std::vector<double> time;         ///< s; may be empty where `contraction_rate` is given or nothing moves
  std::vector<double> pressure;     ///< Pa
  std::vector<double> force;        ///< N, tension positive
  std::vector<double> contraction;  ///< ε = (l0 − l)/l0
  std::vector<double> contraction_rate;  ///< 1/s; empty: from contraction and time
  std::vector<double>
      filling;  ///< > 0 while filling, ≤ 0 while exhausting; empty: from the pressure's course
  double rest_length = std::numeric_limits<double>::quiet_NaN();  ///< m, l0
  double full_contraction =
      std::numeric_limits<double>::quiet_NaN();  ///< ε of the unloaded muscle at full pressure
  double force_zero =
      std::numeric_limits<double>::quiet_NaN();  ///< N, reading without load; see ZeroHandling
  double pressure_zero = 0;                      ///< Pa, reading without pressure
  double force_floor = -std::numeric_limits<double>::infinity();  ///< N, lower stop of the sensor's reading
};

enum class ZeroHandling {
  kRecorded,  ///< `force_zero`; where that is NaN, the median reading at the run's lowest pressures
  kFitted,    ///< one offset per run is fitted along, in held-out runs too (for models and laws alike)
  kNone,      ///< readings as they stand
};

/// A muscle of the same make, for the end correction: lengths only.
struct MuscleLength {
  double rest_length = 0;       ///< m
  double full_contraction = 0;  ///< -
};

struct MuscleFitOptions {
  std::vector<std::string> models;  ///< ids (see muscle_model_ids()); empty: all
  ZeroHandling zero = ZeroHandling::kRecorded;
  double end_length = std::numeric_limits<
      double>::quiet_NaN();  ///< m, δ; NaN: from full contractions, 0 where they are of one length
  std::vector<MuscleLength> known_muscles;  ///< beside the runs' own, for δ
  double diameter = 0.01;  ///< m, D0 (2 r0): M2 and M5 know only its product with their other constants
  int bins = 60;           ///< per run and branch: runs are condensed to this many mean points over pressure
};

struct MuscleRunResult {
  std::string name;
  bool heldout = false;
  double rmse = std::numeric_limits<double>::quiet_NaN();  ///< N, all samples
  double zero = 0;                                         ///< N, offset taken off this run
  std::size_t samples = 0;
  std::size_t censored = 0;  ///< samples at the sensor's stop
  std::vector<double> pressure, contraction, measured,
      predicted;  ///< binned, for pictures; measured less zero
};

struct MuscleModelResult {
  std::string id;        ///< "bridgestone"
  std::string name;      ///< "M2 Bridgestone"
  std::string equation;  ///< as text
  bool converged = false;
  std::string solver_summary;
  std::vector<Estimated> parameters;
  double train_rmse = std::numeric_limits<double>::quiet_NaN();    ///< N
  double heldout_rmse = std::numeric_limits<double>::quiet_NaN();  ///< N, what the ranking goes by
  double aic = std::numeric_limits<double>::quiet_NaN();  ///< on the training points; for information only
  std::vector<MuscleRunResult> runs;
  Warnings warnings;
};

/// Distance of the filling and the exhausting branch at equal pressure.
struct HysteresisWidth {
  std::string run;
  double mean =
      std::numeric_limits<double>::quiet_NaN();  ///< N, exhausting less filling, averaged over pressure
  double worst = std::numeric_limits<double>::quiet_NaN();        ///< N
  double at_pressure = std::numeric_limits<double>::quiet_NaN();  ///< Pa, where it is worst
};

struct MuscleFit {
  std::vector<MuscleModelResult>
      ranking;  ///< best first: by held-out rmse, or by training rmse when nothing is held out
  std::vector<HysteresisWidth> hysteresis;
  double end_length = 0;  ///< m, δ as used
  Warnings warnings;

  [[nodiscard]] const MuscleModelResult* find(const std::string& id) const noexcept;
};

/// Ids that MuscleFitOptions::models knows, M1 to M6 and their documented extensions.
[[nodiscard]] std::span<const char* const> muscle_model_ids() noexcept;

[[nodiscard]] MuscleFit fit_muscle(std::span<const MuscleRun> runs, std::span<const MuscleRun> heldout,
                                   const MuscleFitOptions& options = {});

/// Scores any other law under the same treatment of zero, stop and branches: `law(pressure Pa, contraction,
/// run)` in N.
[[nodiscard]] std::vector<MuscleRunResult> score_muscle_law(
    std::span<const MuscleRun> runs, const std::function<double(double, double, const MuscleRun&)>& law,
    const MuscleFitOptions& options = {});

}  // namespace isac::estimate
