/// @file
/// Where the output-error fit of a motion begins: a linear fit on smoothed derivatives for each of a few lags.
///
///   I φ̈ − A r² φ − B r q + C φ̇³ + D φ̇ + T_c tanh(φ̇/v_s) + G sin φ = 0,   q = u / (1 + T s)
///
/// Equation error is biased by noise, which is why it only begins the search. Threads: pure.
/// Source: docs/derivations/motion_fit.md.
#pragma once

#include <span>
#include <vector>

#include "isac/estimate/motion_fit.hpp"
#include "isac/estimate/motion_pass.hpp"

namespace isac::estimate::motion {

/// Starts, best first by equation error; entries of `options.start` that are numbers are kept. Empty when the scale of the
/// torques is free (nothing known or held that has a torque).
[[nodiscard]] std::vector<MotionVector> find_starts(std::span<const Prepared> runs,
                                                    const MotionOptions& options);

}  // namespace isac::estimate::motion
