/// @file
/// What chains and subsystems are called and in which unit they are told; numbers as a person would write them.
///
/// What variables are called: variable_words.hpp. Threads: pure. Errors: none. Source: docs/notation.md.
#pragma once

#include <string>

#include "isac/explain/prepared.hpp"
#include "isac/models/effect_types.hpp"

namespace isac::explain {

struct Label {
  std::string signal, unit;
  double scale = 1;  ///< from SI to `unit`
};
[[nodiscard]] Label label_of(const Prepared& data, Chain chain);
/// What a sentence calls it: a chain's signal, or "balance of the free joint's motion".
[[nodiscard]] std::string in_words(const Label& label);
/// A unit of the catalogue on this axis: on a linear one rad is m, a torque is a force and "kg m2" a mass; what grows with
/// a power of speed or angle has that power of m beneath ("N m s3" is "N s3/m3").
[[nodiscard]] std::string axis_unit(const std::string& unit, const BaselineModel& baseline);
[[nodiscard]] std::string upper_first(std::string text);
[[nodiscard]] const char* subsystem_name(models::Subsystem where) noexcept;
/// Three significant digits, without a power of ten where four zeros do.
[[nodiscard]] std::string rounded(double value, int digits = 3);
/// "T_c = 0.0098 ± 0.0004 N m" (standard error).
[[nodiscard]] std::string with_error(const std::string& name, double value, double error,
                                     const std::string& unit);

}  // namespace isac::explain
