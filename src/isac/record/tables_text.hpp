/// @file
/// The deployment table as text: C header, CSV like the seed's tables 6.1 and 6.2, Markdown. Internal to record/tables.
///
/// Units: the header is SI; CSV and Markdown use the reporting units of docs/notation.md, written beside the values.
/// Threads: pure functions. Errors: std::bad_alloc only; the table has been checked before.
/// Source: seed tables 6.1, 6.2. Example: `actuator_csv(parameter_table(params), params)`.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "isac/models/parameter_table.hpp"
#include "isac/record/params.hpp"

namespace isac::record {

[[nodiscard]] std::string table_header(const models::ParameterTable& table, std::span<const std::byte> binary,
                                       const Params& params, const std::string& source_name);
[[nodiscard]] std::string actuator_csv(const models::ParameterTable& table, const Params& params);
/// Empty when no joint has gains.
[[nodiscard]] std::string control_csv(const models::ParameterTable& table, const Params& params);
[[nodiscard]] std::string table_markdown(const models::ParameterTable& table, const Params& params,
                                         const std::string& source_name);

}  // namespace isac::record
