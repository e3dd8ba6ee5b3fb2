/// @file
/// The recordings of a calibration, in the order to make them (seed E.3 and Calibration_x0).
///
/// | recordings | person | valves | `# calibration:` |
/// | --- | --- | --- | --- |
/// | calibration-force_0N | force sensors flat, nothing on them | vented | F1 = 0 N, F2 = 0 N |
/// | calibration-valve_CODE | force sensors stay off the rig | both at the code, settled | p1_cmd = CODE, p2_cmd = CODE |
/// | calibration-F1_149.1N … F2_… | the weight hung on one sensor | vented | F1 = 149.1 N |
/// | calibration-pressure_2.50 … | both pressure sensors on the supply | vented | p1 = 2.5 kg/cm2, p2 = … |
/// | calibration-middle_1 … 6 | all sensors back in the rig, bar free | stiff, from either side | angle = middle + |
///
/// Valves run while the force sensors are off the rig: at 5 kg/cm² both muscles pull more than the sensors' 200 N. The
/// middle is approached from both sides and settles at three small Δp, so that the valves' own error, which turns the
/// joint by −B Δp/(A r), can be taken out of it (docs/derivations/calibration.md).
///
/// Units: SI. Threads: pure. Errors: throws isac::Error (usage): weight_beyond_limit, supply_beyond_limit,
/// supply_one_level. Source: seed E.3.1 to E.3.3, D.2.2. Example: `make_programs("calibrate", options)`.
#pragma once

#include <vector>

#include "isac/series/excitation.hpp"

namespace isac::series {

inline constexpr double kSeedWeight = 149.1;  ///< N, four gallons of water (seed E.3.3)

[[nodiscard]] std::vector<Program> calibration_programs(const ExcitationOptions& options);

}  // namespace isac::series
