/// @file
/// One run through valves, muscles, joint and sensors. An integrator of its own: steps of `step` seconds, the lags
/// exact, a free joint by the classical Runge-Kutta method, dry friction with a true sign and with stick events.
#pragma once

#include "hidden.hpp"
#include "rig.hpp"

namespace blind {

inline constexpr double kWrittenStep = 1e-4;  ///< s, of the integrator for what is written

/// `step` divides a row's 2 ms; coarser while a strength is being sought.
Signals simulate(const Rig& rig, const RunPlan& run, const Hidden& hidden, double step = kWrittenStep);

}  // namespace blind
