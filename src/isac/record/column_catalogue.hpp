/// @file
/// The column names that the toolkit knows, and the dimension each must have (docs/formats.md, "Recording").
///
/// Threads: pure functions on constant tables. Throws std::bad_alloc only.
/// Example: `find_known_column("phi3")->dimension == dimension::kAngle`.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "isac/core/units.hpp"

namespace isac::record {

struct KnownColumn {
  Dimension dimension;
  std::string_view units;  ///< the units that would do, for sentences: "rad, deg or turn"
};

/// What is known about `name`, or nothing; numbered families (theta1…6, ai0…7) are in.
[[nodiscard]] std::optional<KnownColumn> find_known_column(std::string_view name) noexcept;

/// SI text of any dimension, made of base units where it has no name ("m kg s-2"); parse_unit reads it back with scale 1.
[[nodiscard]] std::string si_text(const Dimension& dimension);

}  // namespace isac::record
