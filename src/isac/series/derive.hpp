/// @file
/// Quantities that follow from others of the same row: torque of a muscle pair, pressure difference and mean.
///
///   T  = (F2 − F1) r       (seed 3.1 with the sign of docs/formats.md; muscle 2 turns the joint to positive angles)
///   Δp = (p2 − p1)/2,  p0 = (p1 + p2)/2
///
/// Units: SI (N, m, Pa, N m). A missing sample (NaN) on either side gives a missing sample.
/// Threads: pure functions. Errors: columns of unequal length are a programmer's error (assertion); `add_torque` throws
/// isac::Error (bad input) where F1 or F2 is absent or the radius is not a positive number.
/// Example: `if (!run.find("torque")) add_torque(run, rig.joint.wheel_radius);`
#pragma once

#include <span>
#include <vector>

#include "isac/series/recording.hpp"

namespace isac::series {

[[nodiscard]] std::vector<double> torque_from_forces(std::span<const double> F1, std::span<const double> F2,
                                                     double wheel_radius);
[[nodiscard]] std::vector<double> pressure_difference(std::span<const double> p1, std::span<const double> p2);
[[nodiscard]] std::vector<double> mean_pressure(std::span<const double> p1, std::span<const double> p2);

/// Appends the column `torque` if the recording has none; what it has is left alone.
void add_torque(Recording& recording, double wheel_radius);

}  // namespace isac::series
