/// @file
/// What the variables of an explanation are called, in a sentence: one table for the summary, the report and its pictures.
///
/// Threads: pure. Errors: none; a variable that is not in the table is called by its id.
/// Source: docs/notation.md. Example: `variable_in_words("velocity")` is "speed φ̇".
#pragma once

#include <string>
#include <vector>

namespace isac::explain {

/// "delta_pressure" → "pressure difference Δp".
[[nodiscard]] std::string variable_in_words(const std::string& variable, bool linear_axis = false);
[[nodiscard]] std::vector<std::string> variables_in_words(const std::vector<std::string>& variables,
                                                          bool linear_axis = false);
/// By the unit of a position, a speed or a force: "m", "m/s", "N".
[[nodiscard]] bool of_linear_axis(const std::string& unit);

}  // namespace isac::explain
