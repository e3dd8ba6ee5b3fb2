#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/column_catalogue.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/record/csv_text.hpp"

namespace isac::record {
namespace {

[[noreturn]] void refuse(const char* code, const std::string& text) {
  throw Error(ErrorKind::kUsage, code, text);
}

}  // namespace

ColumnMap parse_column_map(std::string_view text) {
  const std::string example = "write it like angle=\"Joint Pos (deg)\":deg";
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos)
    refuse("map_malformed", "--map " + shown(text) + " has no '='; " + example);
  ColumnMap map{.name = std::string(trimmed(text.substr(0, equals))), .header = {}, .unit = {}};
  if (map.name.empty())
    refuse("map_malformed", "--map " + shown(text) + " names no column before the '='; " + example);

  std::string_view rest = trimmed(text.substr(equals + 1));
  if (rest.starts_with('"')) {
    const std::size_t close = rest.rfind('"');
    if (close == 0) refuse("map_malformed", "--map " + shown(text) + " does not close its quote; " + example);
    map.header = trimmed(rest.substr(1, close - 1));
    rest = trimmed(rest.substr(close + 1));
    if (!rest.empty() && rest.front() != ':')
      refuse("map_malformed", "--map " + shown(text) + " needs ':' behind the quote; " + example);
    if (!rest.empty()) map.unit = trimmed(rest.substr(1));
    if (!rest.empty() && map.unit.empty())
      refuse("map_malformed", "--map " + shown(text) + " ends at the ':'; " + example);
  } else if (const std::size_t colon = rest.rfind(':'); colon != std::string_view::npos) {
    map.header = trimmed(rest.substr(0, colon));
    map.unit = trimmed(rest.substr(colon + 1));
    if (map.unit.empty()) refuse("map_malformed", "--map " + shown(text) + " ends at the ':'; " + example);
  } else {
    map.header = rest;  // the header's own [unit] holds
  }
  if (map.header.empty())
    refuse("map_malformed", "--map " + shown(text) + " names no header of the file; " + example);

  if (map.unit.empty()) return map;
  const auto unit = parse_unit(map.unit);
  const auto known = find_known_column(map.name);
  const std::string would_do =
      known ? "; write " + std::string(known->units) : "; docs/formats.md lists the units";
  if (!unit)
    refuse("unit_unknown",
           "the unit " + shown(map.unit) + " of --map " + map.name + " is not known" + would_do);
  if (known && unit->dimension != known->dimension) {
    refuse("unit_wrong",
           "the unit " + shown(map.unit) + " of --map " + map.name + " measures something else" + would_do);
  }
  return map;
}

}  // namespace isac::record
