/// @file
/// `plan.toml` (`isac.plan/1`): the experiment to record next, run by run; isac-explain writes it, isac-log --plan records it.
///
/// Every dimensional value is a string with its unit, as in rig.toml. A run needs `experiment` and `duration`; what the
/// other keys mean stands in series/plan_programs.hpp. Limits of a rig are not known here: plan_programs() holds them.
/// Threads: pure functions but write_plan. Throws isac::Error (bad input) with file, line and column.
/// Source: docs/formats.md. Example: `auto plan = isac::record::read_plan("plan.toml");`
#pragma once

#include <filesystem>
#include <string>

#include "isac/series/plan_programs.hpp"

namespace isac::record {

[[nodiscard]] series::Plan read_plan(const std::filesystem::path& path);
[[nodiscard]] series::Plan parse_plan(const std::string& text, const std::string& file_name);
/// The text of a `plan.toml` that parse_plan reads back to the same values.
[[nodiscard]] std::string format_plan(const series::Plan& plan);
/// Writes it whole or not at all.
void write_plan(const std::filesystem::path& path, const series::Plan& plan);

}  // namespace isac::record
