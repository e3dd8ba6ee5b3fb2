/// @file
/// A planned experiment, run by run, and the programs that play it: what isac-explain asks for and isac-log --plan records.
///
/// | experiment | person | valves |
/// | --- | --- | --- |
/// | constant-pressure | sweeps the bar by hand, ± amplitude, up to peak_speed | Δp held; a swing moves the mean pressure |
/// | constant-angle | clamps the bar at `middle` | a swing moves Δp about delta_pressure |
/// | free | lets go of the bar | a swing moves Δp about delta_pressure |
/// | pcu-step | clamps the bar at its middle | a swing moves both pressures about mean_pressure together |
///
///   triangle, sine    c + s·w(t/P) with |w| ≤ 1, begun at c
///   steps             c, then c + s and c − s for half a period each
///   hold              c
///
/// No command leaves [0, pressure limit] or |Δp| ≤ its limit, and no sweep the angle or speed limit: a plan that would is
/// refused before a valve opens. Files are named plan<round>-<number>-<experiment>, so that a later plan adds to a dataset.
///
/// Units: SI. Threads: pure. Errors: throws isac::Error (bad input): plan_empty, plan_experiment, plan_beyond_limit,
/// plan_too_long; the text names the run, the number and the limit. Source: docs/formats.md (`isac.plan/1`), seed 3.2 to 4.1.
/// Example: `auto programs = plan_programs(record::read_plan("plan.toml"), options, 1);`
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "isac/series/excitation.hpp"

namespace isac::series {

inline constexpr double kLongestPlannedRun = 3600;  ///< s

struct PlanRun {
  std::string experiment = {};  ///< "constant-pressure", "constant-angle", "free", "pcu-step"
  double duration = 30;         ///< s
  double delta_pressure = 0;    ///< Pa
  double mean_pressure = std::numeric_limits<double>::quiet_NaN();  ///< Pa; NaN: the rig's initial pressure
  double amplitude = 0.4;                                           ///< rad, of the hand's sweep
  double middle = std::numeric_limits<double>::quiet_NaN();  ///< rad; NaN: where the bar rests (clamped: 0)
  double peak_speed = 1;                                     ///< rad/s, of the hand's sweep
  double pressure_swing = 0;                                 ///< Pa
  double pressure_period = 8;                                ///< s
  std::string waveform = {};  ///< "triangle", "sine", "steps", "hold"; empty: triangle
  friend bool operator==(const PlanRun&, const PlanRun&) = default;
};

struct Plan {
  std::string reason = {};                  ///< one sentence: what the runs are for
  std::vector<std::string> separates = {};  ///< ids of the effects that they tell apart
  std::vector<PlanRun> runs = {};
};

/// `round` counts the plans recorded into one dataset, from 1.
[[nodiscard]] std::vector<Program> plan_programs(const Plan& plan, const ExcitationOptions& options,
                                                 int round);

}  // namespace isac::series
