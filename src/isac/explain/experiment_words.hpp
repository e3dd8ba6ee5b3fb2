/// @file
/// What to do next, in a sentence for the person at the rig.
///
/// Runs as they are recorded (by hand, clamped, free, valve steps), or the change of the rig that tells two effects apart where
/// no recording does: from a table by pairs of effects, then by the sensor that is in doubt.
/// Units: as written in the sentence. Threads: pure. Errors: none. Source: docs/effects.md ("told apart by").
#pragma once

#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"

namespace isac::explain {

/// "Record 40 s by hand at a mean pressure of 2.2 kg/cm2 …: it separates X from Y by about 9 sigma (now 0.8)."
[[nodiscard]] std::string words_for_runs(const std::vector<PlannedRun>& runs, const std::string& term_a,
                                         const std::string& term_b, double now, double expected);

/// "No recording separates X from Y (0.4 sigma at best): read the forces unloaded …"
[[nodiscard]] std::string words_for_hardware(const std::string& id_a, const std::string& id_b,
                                             const std::string& term_a, const std::string& term_b,
                                             double reach);

/// What at the rig tells the two apart.
[[nodiscard]] std::string hardware_action(const std::string& id_a, const std::string& id_b);

}  // namespace isac::explain
