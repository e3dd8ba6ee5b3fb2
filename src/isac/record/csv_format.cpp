#include "isac/record/csv_format.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>

#include "isac/record/csv_header.hpp"
#include "isac/record/csv_metadata.hpp"
#include "isac/record/csv_text.hpp"

namespace isac::record {

std::string metadata_line(const std::string& key, const std::string& value, const std::string& file) {
  std::string flat(value);
  for (char& c : flat) {
    if (static_cast<std::uint8_t>(c) < 0x20 || c == 0x7F) c = ' ';
  }
  flat = std::string(trimmed(flat));
  const std::string line = "# " + key + ": " + flat;
  Metadata read_back;
  read_back.add_line(line, {file, 0, 0});
  if (!read_back.has(key, flat)) {
    throw Error(ErrorKind::kBadInput, "metadata_unwritable",
                "the metadata key " + shown(key) +
                    " cannot be written; use a word without ':' and without spaces around it",
                {file, 0, 0});
  }
  return line + "\n";
}

std::string header_line(const std::vector<std::pair<std::string, std::string>>& columns,
                        const std::string& file) {
  std::string line;
  for (const auto& [name, unit] : columns) {
    if (&name != &columns.front().first) line += ',';
    line += header_field(name, unit);
  }
  ReadOptions any;
  any.require_time = false;
  const Header header = parse_header(line, {}, any, {file, 0, 0});
  bool same = header.columns.size() == columns.size();
  for (std::size_t i = 0; same && i < columns.size(); ++i) same = header.columns[i].name == columns[i].first;
  if (!same) {
    throw Error(ErrorKind::kBadInput, "column_unwritable",
                "the header " + shown(line) +
                    " would not be read back as it is; use names without spaces around them",
                {file, 0, 0});
  }
  return line + "\n";
}

void append_number(std::string& text, double value, int decimals) {
  if (std::isnan(value)) {
    text += "nan";
    return;
  }
  std::array<char, 512> digits{};  // 309 digits before the point, at most 100 behind it
  char* const end = digits.data() + digits.size();
  const auto result = decimals < 0 ? std::to_chars(digits.data(), end, value)
                                   : std::to_chars(digits.data(), end, value, std::chars_format::fixed,
                                                   decimals < 100 ? decimals : 100);
  text.append(digits.data(), result.ptr);
}

}  // namespace isac::record
