/// @file
/// How isac-identify shows parameters, tests and warnings on the terminal, and numbers in its JSON details.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "isac/core/estimated.hpp"

namespace isac::apps {

/// A table: name, value, standard error, 95 % interval, unit; a refused parameter shows its reason.
void print_parameters(const std::vector<Estimated>& parameters);
void print_warnings(const Warnings& warnings);
/// A JSON number, or null where the value is not known.
[[nodiscard]] nlohmann::ordered_json json_number(double value);

}  // namespace isac::apps
