/// @file
/// References that a hand or a command follows, shared by the days (`day.cpp`, `protocol_day.cpp`).
#pragma once

#include <functional>
#include <vector>

#include "rig.hpp"

namespace blind {

using Reference = std::function<double(double)>;  ///< of the time in s

/// Sines of uneven frequencies and phases, peak about one.
Reference multisine(Random& random, double slowest, double fastest, int count);
/// Levels held for a while (s), as a table; the last one stays.
Reference levels(const std::vector<double>& values, double hold);
/// There and back between ±1 by hand: no two strokes are equally fast or equally long. Speeds in 1/s.
Reference triangle(Random& random, double speed_low, double speed_high, double seconds);
/// A hand follows offset + amplitude · reference as three lags of 1/35 s: no jumps in the acceleration.
void follow(RunPlan& run, const Reference& reference, double offset, double amplitude, int rows);
/// No muscle may be pulled slack: |T| < 0.9 (F1 + F2) r at both ends. Largest angle in rad at Δp and mean pressure.
double reach(const Rig& rig, double delta, double mean);
/// Commands of one row, within 0 to 5 kg/cm2.
void command(RunPlan& run, double delta, double mean);
/// Each valve by itself, as the references say.
void command_each(RunPlan& run, const Reference& first, const Reference& second, int rows);
inline int rows_of(double seconds) {
  return static_cast<int>(seconds * kRate);
}

}  // namespace blind
