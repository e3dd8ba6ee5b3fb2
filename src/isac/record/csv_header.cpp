#include "isac/record/csv_header.hpp"

#include <algorithm>
#include <set>

#include "isac/core/units.hpp"
#include "isac/record/column_catalogue.hpp"
#include "isac/record/csv_metadata.hpp"
#include "isac/record/csv_text.hpp"

namespace isac::record {
namespace {

constexpr std::size_t kMostColumns = 4096;
constexpr char kSeparators[] = {'\t', ';', ','};
constexpr std::string_view kManyUnits =
    "s, rad, deg, rad/s, Pa, bar, kg/cm2, N, N m, m, count, V, A, K, - or %, or leave the brackets out";

struct Field {
  std::string text;  ///< unquoted, trimmed
  std::string name;  ///< without its unit
  std::string unit;  ///< inside the brackets
  bool bracketed = false;
  bool bad_brackets = false;
  Place place;
};

std::size_t count_outside_quotes(std::string_view text, char wanted) noexcept {
  std::size_t count = 0;
  bool quoted = false;
  for (char c : text) {
    if (c == '"') quoted = !quoted;
    if (c == wanted && !quoted) ++count;
  }
  return count;
}

[[noreturn]] void refuse(const Field& field, const char* code, const std::string& text) {
  throw Error(ErrorKind::kBadInput, code, text, field.place);
}

void split_unit(Field& field) {
  const std::string_view text = field.text;
  field.name = field.text;
  if (text.ends_with(']')) {
    const std::size_t open = text.rfind('[');
    if (open == std::string_view::npos) {
      field.bad_brackets = true;
      return;
    }
    field.bracketed = true;
    field.name = trimmed(text.substr(0, open));
    field.unit = trimmed(text.substr(open + 1, text.size() - open - 2));
  } else {
    field.bad_brackets = text.find('[') != std::string_view::npos;
  }
}

std::vector<Field> split_header(std::string_view line, char separator, const Place& place) {
  std::vector<Field> fields;
  std::size_t i = 0;
  for (;;) {
    Field field;
    while (i < line.size() && line[i] == ' ') ++i;
    field.place = {place.file, place.line, character_column(line, i)};
    while (i < line.size() && line[i] != separator) {
      if (line[i] != '"') {
        field.text += line[i++];
        continue;
      }
      for (++i;; ++i) {
        if (i == line.size())
          refuse(field, "header_quote", "a quoted name is not closed; add the missing \" to the header");
        if (line[i] != '"') {
          field.text += line[i];
        } else if (i + 1 < line.size() && line[i + 1] == '"') {
          field.text += line[i++];
        } else {
          break;
        }
      }
      ++i;
    }
    field.text = std::string(trimmed(field.text));
    split_unit(field);
    fields.push_back(std::move(field));
    if (i == line.size()) return fields;
    if (fields.size() == kMostColumns) {
      refuse(fields.back(), "column_too_many",
             "the header has more than 4096 columns; split the recording into several files");
    }
    ++i;
  }
}

bool looks_like_number(std::string_view text) noexcept {
  return !text.empty() && text.find_first_of("0123456789") != std::string_view::npos &&
         text.find_first_not_of("0123456789+-.,eE ") == std::string_view::npos;
}

const ColumnMap* find_map(const Field& field, const std::vector<ColumnMap>& maps) {
  for (const ColumnMap& map : maps) {
    if (map.header == field.text || (map.header == field.name && !field.name.empty())) return &map;
  }
  return nullptr;
}

std::string in_brackets(std::string_view name) {
  return std::string(name) + " [unit]";
}

// Unit text of the column after the maps had their say.
std::string unit_of(const Field& field, const ColumnMap* map) {
  if (map == nullptr || map->unit.empty()) return field.unit;
  const auto own = parse_unit(field.unit);
  const auto given = parse_unit(map->unit);
  if (field.bracketed && own && given && (own->dimension != given->dimension || own->scale != given->scale)) {
    refuse(field, "map_unit_contradicts",
           "the header says [" + field.unit + "] and the map of " + shown(map->name) + " says " + map->unit +
               "; leave the unit out of --map, or mend the one that is wrong");
  }
  return map->unit;
}

ColumnPlan plan_column(const Field& field, const ColumnMap* map) {
  if (field.bad_brackets && map == nullptr) {
    refuse(field, "header_brackets",
           "the brackets of " + shown(field.text) + " do not enclose a unit at its end; write `name [unit]`");
  }
  const std::string name = map != nullptr ? map->name : field.name;
  if (name.empty()) {
    refuse(field, "header_name_empty",
           "a column has no name; write `name [unit]`, or remove the separator that opens an empty column");
  }
  const std::string unit_text = unit_of(field, map);
  const auto known = find_known_column(name);
  const bool missing = unit_text.empty();
  if (missing && !known) return {.name = name, .unit = "", .scale = 1.0, .offset = 0.0};
  const std::string would_do = known ? std::string(known->units) : std::string(kManyUnits);
  if (missing) {
    refuse(field, "unit_missing",
           "the column " + shown(name) + " has no unit; write " + in_brackets(name) + " with " + would_do +
               ", or give it with --map " + name + "=\"" + field.text + "\":<unit>");
  }
  const auto unit = parse_unit(unit_text);
  if (!unit) {
    refuse(field, "unit_unknown",
           "the unit " + shown(unit_text) + " of the column " + shown(name) + " is not known; write " +
               would_do);
  }
  if (known && unit->dimension != known->dimension) {
    refuse(field, "unit_wrong",
           "the unit " + shown(unit_text) + " of the column " + shown(name) +
               " measures something else; write " + would_do);
  }
  return {.name = name, .unit = si_text(unit->dimension), .scale = unit->scale, .offset = unit->offset};
}

void check_maps_used(const std::vector<Field>& fields, const std::vector<ColumnMap>& maps,
                     const Place& place) {
  for (const ColumnMap& map : maps) {
    const bool used =
        std::any_of(fields.begin(), fields.end(), [&](const Field& f) { return find_map(f, maps) == &map; });
    if (used) continue;
    std::string have;
    for (const Field& field : fields) {
      if (have.size() < 200) have += (have.empty() ? "" : ", ") + shown(field.text);
    }
    throw Error(ErrorKind::kBadInput, "map_header_missing",
                "no column has the header " + shown(map.header) + " that --map " + map.name +
                    "= names; the file has " + have,
                place);
  }
}

}  // namespace

char find_separator(std::string_view header, std::string_view first_row) noexcept {
  for (char separator : kSeparators) {
    const std::size_t count = count_outside_quotes(header, separator);
    if (count > 0 && count == count_outside_quotes(first_row, separator)) return separator;
  }
  char best = ',';
  std::size_t most = 0;
  for (char separator : kSeparators) {
    const std::size_t count = count_outside_quotes(header, separator);
    if (count > most) {
      most = count;
      best = separator;
    }
  }
  return best;
}

Header parse_header(std::string_view line, std::string_view first_row, const ReadOptions& options,
                    const Place& place) {
  check_text(line, place);
  Header header;
  header.separator = find_separator(line, first_row);
  const std::vector<Field> fields = split_header(line, header.separator, place);
  if (std::all_of(fields.begin(), fields.end(), [](const Field& f) { return looks_like_number(f.text); })) {
    refuse(fields.front(), "header_missing",
           "the first line is numbers, not a header; put a line such as `time [s],angle [deg]` in front "
           "(without a leading #)");
  }
  check_maps_used(fields, options.map, place);

  std::set<std::string> names;
  for (const Field& field : fields) {
    ColumnPlan column = plan_column(field, find_map(field, options.map));
    if (!names.insert(column.name).second) {
      refuse(field, "column_duplicate",
             "the column " + shown(column.name) + " is there twice; rename or remove one of the two");
    }
    if (column.name == "time") header.time = header.columns.size();
    header.columns.push_back(std::move(column));
  }
  if (options.require_time && header.time == kNoColumn) {
    refuse(fields.front(), "column_missing",
           "the header has no column 'time'; add `time [s]`, or name the column that holds it with --map "
           "time=\"<header>\":s");
  }
  return header;
}

std::string header_field(std::string_view name, std::string_view unit) {
  std::string text(name);
  if (!unit.empty()) {
    text.append(" [").append(unit).append("]");
  } else if (name.find_first_of("[]") != std::string_view::npos || looks_like_number(name)) {
    text +=
        " []";  // so that brackets in the name are not taken for a unit, nor a header of numbers for a row
  }
  const bool plain = text.find_first_of(",;\t\"#") == std::string::npos;
  if (plain) return text;
  std::string out = "\"";
  for (char c : text) {
    out += c;
    if (c == '"') out += '"';
  }
  return out + '"';
}

}  // namespace isac::record
