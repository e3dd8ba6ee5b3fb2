/// @file
/// Text of a recording: its metadata lines, its header, its numbers, as csv_reader reads them back.
///
/// Throws isac::Error (bad input) rather than write what the reader would refuse.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "isac/core/error.hpp"

namespace isac::record {

/// "# key: value\n"; line breaks in the value become spaces. Throws metadata_unwritable for a key that cannot be read back.
[[nodiscard]] std::string metadata_line(const std::string& key, const std::string& value,
                                        const std::string& file);

/// The header line of {name, unit} pairs, with its line feed; checked by reading it.
[[nodiscard]] std::string header_line(const std::vector<std::pair<std::string, std::string>>& columns,
                                      const std::string& file);

/// Appends `value`: shortest exact form for decimals < 0, else that many digits behind the point; "nan" for NaN.
void append_number(std::string& text, double value, int decimals);

}  // namespace isac::record
