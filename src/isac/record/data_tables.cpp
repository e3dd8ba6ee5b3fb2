#include "isac/record/data_tables.hpp"

#include <cmath>

#include "isac/core/error.hpp"
#include "isac/record/toml_document.hpp"
#include "isac/record/toml_quantity.hpp"

namespace isac::record {
namespace {

void read_units(const toml::table& table, const std::string& file, DataTable& data) {
  const TomlSection section(table, "units", file, {});
  for (const auto& [key, node] : table) {
    const std::string unit = *section.text(key.str());
    if (!parse_compound_unit(unit)) {
      fail_at(node, file, "unit_unknown",
              "the unit of '" + std::string(key.str()) + "' is " + toml_string(unit) +
                  ", which is not a known unit; use one of docs/formats.md");
    }
    data.units[std::string(key.str())] = unit;
  }
}

std::map<std::string, DataCell> read_row(const toml::table& table, const std::string& file,
                                         const DataTable& data) {
  std::map<std::string, DataCell> row;
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    if (const auto* text = node.as_string()) {
      row[name] = text->get();
    } else if (node.is_number()) {
      const double value = *node.value<double>();
      const bool has_unit =
          data.units.contains(name) || (name == "value" && table.get_as<std::string>("unit") != nullptr);
      if (!has_unit) {
        fail_at(node, file, "unit_missing",
                "the number '" + name + "' has no unit; name it under [units], \"-\" for a plain number");
      }
      if (!std::isfinite(value)) {
        fail_at(node, file, "number_not_finite",
                "'" + name + "' is " + shown(node) + "; leave out a cell that is not known");
      }
      row[name] = value;
    } else {
      fail_at(node, file, "type_wrong",
              "'" + name + "' is " + shown(node) + "; a cell is a number or a text");
    }
  }
  if (const auto unit = row.find("unit"); unit != row.end() && row.contains("value")) {
    const auto* text = std::get_if<std::string>(&unit->second);
    if (text == nullptr || !parse_compound_unit(*text)) {
      fail_at(*table.get("unit"), file, "unit_unknown",
              "the unit of this row is " + shown(*table.get("unit")) +
                  ", which is not a known unit; use one of docs/formats.md");
    }
  }
  return row;
}

const DataCell* find_cell(const DataTable& data, std::size_t row, const std::string& column) {
  const auto cell = data.rows.at(row).find(column);
  return cell == data.rows.at(row).end() ? nullptr : &cell->second;
}

[[noreturn]] void fail_cell(const DataTable& data, std::size_t row, const std::string& column,
                            const char* needed) {
  throw Error(ErrorKind::kBadInput, "type_wrong",
              "row " + std::to_string(row + 1) + ", '" + column + "' is not " + needed + "; mend the table",
              {data.file, 0, 0});
}

}  // namespace

double DataTable::number(std::size_t row, const std::string& column) const {
  const DataCell* cell = find_cell(*this, row, column);
  if (cell == nullptr) return std::numeric_limits<double>::quiet_NaN();
  if (const auto* value = std::get_if<double>(cell)) return *value;
  fail_cell(*this, row, column, "a number");
}

std::string DataTable::text(std::size_t row, const std::string& column) const {
  const DataCell* cell = find_cell(*this, row, column);
  if (cell == nullptr) return {};
  if (const auto* value = std::get_if<std::string>(cell)) return *value;
  fail_cell(*this, row, column, "a text");
}

double DataTable::si(std::size_t row, const std::string& column) const {
  const double printed = number(row, column);
  const auto unit = units.find(column);
  const std::string name = unit != units.end() ? unit->second : text(row, "unit");
  const auto parsed = parse_compound_unit(name);
  return parsed ? printed * parsed->scale + parsed->offset : std::numeric_limits<double>::quiet_NaN();
}

std::size_t DataTable::find(const std::string& column, std::string_view value) const {
  for (std::size_t row = 0; row < rows.size(); ++row) {
    if (text(row, column) == value) return row;
  }
  throw Error(ErrorKind::kBadInput, "row_missing",
              "has no row whose '" + column + "' is '" + std::string(value) + "'; add it", {file, 0, 0});
}

DataTable parse_data(const std::string& text, const std::string& file) {
  const toml::table root = parse_toml(text, file);
  const TomlSection top(root, "", file,
                        {"format", "title", "origin", "licence", "notes", "errata", "units", "row"});
  top.require_format("isac.data/1");
  DataTable data;
  data.file = file;
  for (const auto& [key, target] :
       {std::pair{"title", &data.title}, {"origin", &data.origin}, {"licence", &data.licence}}) {
    const auto found = top.text(key);
    if (!found || found->empty()) {
      top.fail(key, "value_missing",
               "does not give its " + std::string(key) + "; a table without it cannot be trusted or shared");
    }
    *target = *found;
  }
  data.notes = top.texts("notes");
  data.errata = top.texts("errata");
  if (const auto* units = top.table("units")) read_units(*units, file, data);
  for (const toml::table* row : top.tables("row")) data.rows.push_back(read_row(*row, file, data));
  if (data.rows.empty()) top.fail("row", "value_missing", "has no [[row]]; a table needs at least one");
  return data;
}

DataTable read_data(const std::filesystem::path& path) {
  return parse_data(read_text_file(path), path.string());
}

}  // namespace isac::record
