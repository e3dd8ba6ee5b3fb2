/// @file
/// Runs that could be recorded next, and what each would record: what experiment.hpp chooses from.
///
///   φ(t)    hand-driven m + a (0.92 sin θ + 0.08 sin 0.62 θ), θ̇ = v/(0.97 a);  clamped m;
///           free I φ̈ = T(φ, φ̇, p1, p2) with all torques of the model, where dry friction may hold the joint
///   p(t)    T_C ṗ = K_C u − p, begun settled; u(t) as isac-log --plan would play it (series/plan_programs.hpp)
///   F(t)    the measured common part, scaled by the mean pressure, ∓ T/(2 r)
///
/// A would-be run is free of noise: noise enters through the weights of the fit. A run is possible if its commands keep the
/// limits, the joint the angle, and the force sensors their range.
/// Units: SI inside; PlannedRun as it says. Threads: pure. Errors: none; what is not possible is empty.
/// Source: seed 3.2 to 4.1; docs/derivations/experiment.md.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "isac/explain/explanation.hpp"
#include "isac/explain/fit.hpp"
#include "isac/series/excitation.hpp"
#include "isac/series/plan_programs.hpp"

namespace isac::explain {

/// What the rig and its recordings so far allow for.
struct RigRange {
  series::ExcitationOptions limits;
  double angle = 0.4;        ///< rad, farthest that a planned motion goes
  double speed = 6;          ///< rad/s
  double mean_force = 0;     ///< N, (F1 + F2)/2 at `mean_pressure`; 0 where forces are not known
  double mean_pressure = 0;  ///< Pa, (p1 + p2)/2 of what has been recorded
  double force_slope = 0;    ///< N/Pa, of the mean force with the mean pressure
  double stiffness = 0;      ///< N m/rad, −A r² of the model; 0 where there is none
  double force_limit = 200;  ///< N
  double least_force =
      0;  ///< N, below which no muscle is let: it hangs slack, unless a moving joint was recorded there
  bool moves_freely = false;   ///< the inertia is known, so that a free joint says something
  bool free_torque = false;    ///< rows of the torque are taken from free runs too
  bool valves = false;         ///< commands are recorded: the valve unit is in the model
  double day_offset = 0;       ///< s, when the next run would begin
  double row_spacing = 0.008;  ///< s
  double free_row_noise =
      0;  ///< N m, of a row of the motion chain if none has been recorded: the encoder's steps

  /// N, (F1 + F2)/2 at a mean pressure; nothing pushes.
  [[nodiscard]] double common_force(double pressure) const noexcept {
    return std::max(0.0, mean_force + force_slope * (pressure - mean_pressure));
  }
};

[[nodiscard]] RigRange range_of(const Predictor& predictor, const ModelPoint& model,
                                const series::ExcitationOptions& limits);

/// A parameter of the baseline by its name, or `otherwise` where the baseline has none of that name.
[[nodiscard]] double base_value(const Predictor& predictor, const ModelPoint& model, const char* name,
                                double otherwise);

/// About 150 of them, of all kinds, in a fixed order.
[[nodiscard]] std::vector<PlannedRun> candidate_runs(const RigRange& range, const RigFacts& rig);

/// rad/s, peak, of an arm that leads the bar to and fro.
[[nodiscard]] double fastest_by_hand(double amplitude) noexcept;

/// At least one period of what swings or sweeps, and ten seconds.
[[nodiscard]] double least_seconds(const PlannedRun& run);

/// The plan of isac-log for one run.
[[nodiscard]] series::PlanRun plan_run(const PlannedRun& run);

/// The dataset of one run that `model` would record. Empty if the rig must not or cannot do it.
[[nodiscard]] std::optional<Prepared> would_record(const Predictor& recorded, const ModelPoint& model,
                                                   const RigRange& range, const PlannedRun& run);

}  // namespace isac::explain
