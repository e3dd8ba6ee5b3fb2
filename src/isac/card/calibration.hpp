/// @file
/// What each code of the testbed means when nothing else is known: the seed's wiring and nominal gains.
///
///   physical = (count − offset) · gain
///
/// | signal | channel | offset | gain | nominal |
/// | --- | --- | --- | --- | --- |
/// | angle | enc0 | 0 | 2π/8000 rad | 8000 steps a turn (seed C.4) |
/// | F1, F2 | ai0, ai2 | 205 | 200 N / 4096 | 0 … 10 V for 200 N, zero at 0.5 V so that a small push is seen
/// (E.1.5) | | p1, p2 | ai4, ai6 | 0 | 10 kg/cm² / 4096 | 0 … 10 V for 10 kg/cm² | | p1_cmd, p2_cmd | ao0,
/// ao1 | 0 | 5 kg/cm² / 4095 | 0 … 4095 → 4 … 20 mA → 0 … 5 kg/cm² (C.4, E.3.1) |
///
/// Units: SI per count. Real time: not for the loop (allocates). Errors: none.
/// Source: seed C.4, E.1.3 to E.1.5, E.3. Example: `for (const auto& c : card::default_calibration()) …`
#pragma once

#include <vector>

#include "isac/record/rig.hpp"

namespace isac::card {

[[nodiscard]] std::vector<record::RigChannel> default_calibration();

/// The same with force sensors of `force_range` N over 0 … 10 V ("sim:force_range=1000").
[[nodiscard]] std::vector<record::RigChannel> default_calibration(double force_range);

}  // namespace isac::card
