/// @file
/// An explanation in sentences, the same on the terminal, in the JSON answer and in the report.
///
/// Units: those the explanation carries. Threads: pure functions. Errors: std::bad_alloc only.
/// Example: `verdict_sentence(e)` is "Coulomb friction is missing from the model of the muscle (confidence 97 %)."
#pragma once

#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"

namespace isac::report {

/// The explanation's own summary, or one made of its verdict.
[[nodiscard]] std::string verdict_sentence(const explain::Explanation& e);
/// How far simulation and measurement are apart, before and after, beside the noise floor; empty if nothing is known.
[[nodiscard]] std::string gap_sentence(const explain::Explanation& e);
/// "83 %", or "all" and "none": the floor is known to some per cent, and what lies beyond is its error.
[[nodiscard]] std::string share_closed_in_words(double share);
[[nodiscard]] std::string region_sentence(const explain::Region& region);
/// "T_c = 0.301 ± 0.012 N m, v_s = …".
[[nodiscard]] std::string parameters_in_words(const explain::Candidate& candidate);
/// "pcu" → "valve unit".
[[nodiscard]] std::string subsystem_in_words(const std::string& subsystem);
/// "motion" → "motion (I φ̈ = T)".
[[nodiscard]] std::string signal_in_words(const std::string& signal);
/// The catalogue's plain letters as a report writes them: "-T_c sgn(w)" → "−T_c sgn(φ̇)".
[[nodiscard]] std::string equation_in_words(const std::string& equation);
/// 0.973 → "97 %"; never "100 %" of what is not certain; "–" for NaN.
[[nodiscard]] std::string percent(double share);
/// "a", "a and b", "a, b and c".
[[nodiscard]] std::string joined(const std::vector<std::string>& words);
/// The first letter as a capital, where it is one of a … z.
[[nodiscard]] std::string upper_first(std::string text);

}  // namespace isac::report
