/// @file
/// The shapes from which the search for an effect starts: values of the parameters that are not amplitudes (width, time constant, onset), on
/// grids that follow what the data reaches.
///
/// Units: SI. Threads: pure. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <vector>

#include "isac/explain/hypothesis.hpp"

namespace isac::explain {

/// How far the data reaches: what shapes are worth a start.
struct Reach {
  double angle_low = 0, angle_high = 0, free_low = 0, free_high = 0, speed = 0, pressure_high = 0,
         command_high = 0, rate = 0, force = 0, run_seconds = 0, day_seconds = 0, interval = 0.002;
  std::vector<double> pressure_lows;  ///< of each muscle in each run, lowest first
};

[[nodiscard]] Reach reach_of(const Prepared& data);

/// All combinations of an effect's grids, amplitudes at their typical values.
[[nodiscard]] std::vector<Values> shapes_of(const models::EffectInfo& info, const Reach& reach);
/// Stops on one side or on both, within what the joint reached.
[[nodiscard]] std::vector<Values> stops(const models::EffectInfo& info, double low, double high);
/// A wheel slips while hands are on the rig: between two runs. (Within one, `place_slip` finds the moment.)
[[nodiscard]] std::vector<Values> slips_between(const models::EffectInfo& info, const Prepared& data);

}  // namespace isac::explain
