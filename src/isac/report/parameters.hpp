/// @file
/// The parameter table that every report of a fit shows, and the list of its warnings.
///
/// Refused parameters stand in the table by name with "not identified", and once more in a box with the sweep that would
/// mend them. Internal to the report room. Units: those the parameters carry. Threads: pure. Errors: std::bad_alloc only.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"
#include "isac/report/document.hpp"

namespace isac::report {

void add_parameters(Document& page, std::span<const Estimated> parameters, const std::string& caption);
[[nodiscard]] std::vector<std::string> warning_texts(const Warnings& warnings);
/// "value ± error unit" for a sentence or a card, "not identified" when refused.
[[nodiscard]] std::string in_words(const Estimated& parameter);

}  // namespace isac::report
