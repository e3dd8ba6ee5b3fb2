/// @file
/// One run through valves, muscles, joint and sensors. An integrator of its own: steps of `step` seconds, the lags
/// exact, a free joint by the classical Runge-Kutta method, dry friction with a true sign and with stick events.
#pragma once

#include "hidden.hpp"
#include "rig.hpp"

namespace blind {

inline constexpr double kWrittenStep = 1e-4;  ///< s, of the integrator for what is written

/// `step` divides a row's 2 ms; coarser while a strength is being sought.
/// move_rig, then read_sensors.
Signals simulate(const Rig& rig, const RunPlan& run, const Hidden& hidden, double step = kWrittenStep);

/// What valves, muscles and joint do, as sensors would say it that only lag (Hidden::force_lag).
Signals move_rig(const Rig& rig, const RunPlan& run, const Hidden& hidden, double step = kWrittenStep);

/// What the sensors make of it: skew, play, offsets, gains, drifts, slip, hum, spikes, saturation.
void read_sensors(const Hidden& hidden, const RunPlan& run, Signals& signals);

}  // namespace blind
