/// @file
/// The header line of a recording: its dialect, its columns, and what each column's numbers must be multiplied by.
///
/// `name [unit]`, names may be quoted; `ColumnMap`s rename foreign headers and give them a unit. Known names must have a
/// unit of their dimension; unknown names may have any known unit, or none, and are kept.
/// Throws isac::Error (bad input) with line and column of the header's field.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"

namespace isac::record {

/// The separator that the header and the first row agree on: tab, semicolon or comma.
[[nodiscard]] char find_separator(std::string_view header, std::string_view first_row) noexcept;

struct ColumnPlan {
  std::string name;    ///< canonical name
  std::string unit;    ///< SI text of what is delivered, "" where the file gives none
  double scale = 1.0;  ///< SI = file · scale + offset
  double offset = 0.0;
};

inline constexpr std::size_t kNoColumn = static_cast<std::size_t>(-1);

struct Header {
  char separator = ',';
  std::vector<ColumnPlan> columns;  ///< in the file's order
  std::size_t time = kNoColumn;     ///< index of `time`
};

/// `place` is the header's line; `first_row` may be empty.
[[nodiscard]] Header parse_header(std::string_view line, std::string_view first_row,
                                  const ReadOptions& options, const Place& place);

/// `text` quoted for a header if it has to be; the inverse of what parse_header does to a name.
[[nodiscard]] std::string header_field(std::string_view name, std::string_view unit);

}  // namespace isac::record
