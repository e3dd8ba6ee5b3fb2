/// @file
/// `sim:params=FILE`: the simulated rig with the parameters and effects of a params.toml, as identified and explained.
///
/// Taken from the first joint of the file: A, B, C, D, wheel, p0, inertia, K_C, T_C (or T_fill, T_vent), dead time, and every
/// effect whose parameters are all known. What the file does not say stays as it was. A transport delay that stands both as an
/// effect and as the valve's dead time counts once.
/// Not for the loop. Errors: throws isac::Error (bad input: the file; answer is no: no joint in it).
/// Source: docs/formats.md (`isac.params/1`). Example: `apply_params(config, "params.toml");`
#pragma once

#include <string>

#include "isac/simulate/rig_config.hpp"

namespace isac::card {

void apply_params(simulate::RigConfig& config, const std::string& path);

}  // namespace isac::card
