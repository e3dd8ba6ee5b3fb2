/// @file
/// The words behind "sim:": `sim:seed=3,noise=coloured,effect=coulomb_friction:0.3`.
///
/// | option | unit | meaning |
/// | --- | --- | --- |
/// | seed=N | | of noise, jitter, hand and miscalibration; the same seed gives the same codes |
/// | noise=none, white, coloured | | of forces and pressures (coloured) |
/// | force_noise=X, pressure_noise=X | N, kg/cm2 | standard deviations (0.3, 0.004) |
/// | hum=X | N | 60 Hz mains hum on the forces (0) |
/// | force_range=X | N | of the force sensors over 0 … 10 V (200); the pre-tension moves with it |
/// | jitter=on, off | | late sampling instants, noisy stamps (on) |
/// | drop=X | | chance of a wake-up one period late (0) |
/// | miscalibrated=on, off | | gains, zeros and the encoder's middle off the data sheet (off) |
/// | params=FILE | | parameters and effects of a params.toml (sim_params.hpp); later words win |
/// | effect=ID:X:… | SI | a hidden effect of docs/effects.md; may be given several times |
/// | A, B, C, D | N/m, N cm2/kg, N m s3, N m s | of eq 3.10 |
/// | radius, inertia, p0 | m, kg m2, kg/cm2 | of the joint |
/// | K_C, T_C, T_fill, T_vent, dead_time | -, s | of both valve units; T_C sets T_fill and T_vent |
///
/// Not for the loop (allocates). Errors: parse_sim throws isac::Error (usage) that names the word and lists what it could be;
/// for params=FILE (bad input) with the place in the file.
#pragma once

#include <string>
#include <string_view>

#include "isac/simulate/rig_config.hpp"

namespace isac::card {

/// `text` is what follows "sim:".
[[nodiscard]] simulate::RigConfig parse_sim(std::string_view text);
/// One line per option.
[[nodiscard]] std::string sim_help();

}  // namespace isac::card
