#include "isac/record/params.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <tuple>

#include "isac/record/csv_writer.hpp"
#include "isac/record/toml_document.hpp"
#include "isac/record/toml_quantity.hpp"

namespace isac::record {
namespace {

constexpr std::array<std::string_view, 5> kKnownSections = {"joint", "pcu", "gains", "masses", "effects"};
constexpr std::array<std::string_view, 2> kAlwaysArrays = {"joint", "effects"};

/// [low, high] of an interval.
void read_pair(const TomlSection& section, std::string_view key, const std::string& file, double& low,
               double& high) {
  const toml::node* node = section.raw().get(key);
  if (node == nullptr) return;
  const auto* array = node->as_array();
  if (array == nullptr || array->size() != 2 || !(*array)[0].is_number() || !(*array)[1].is_number()) {
    fail_at(*node, file, "type_wrong",
            "'" + std::string(key) + "' is " + shown(*node) + "; write two numbers, [low, high]");
  }
  low = *(*array)[0].value<double>();
  high = *(*array)[1].value<double>();
}

Estimated read_estimate(const std::string& name, const toml::node& node, const std::string& file) {
  const auto* table = node.as_table();
  if (table == nullptr) {
    fail_at(node, file, "type_wrong",
            "parameter '" + name + "' is " + shown(node) + "; write it like { value = 1.5, unit = \"N m\" }");
  }
  const TomlSection section(*table, "parameters." + name, file,
                            {"value", "unit", "std_error", "ci95", "identifiable", "reason", "remark"});
  Estimated estimate;
  estimate.name = name;
  const auto value = section.number("value");
  if (!value)
    section.fail("value", "value_missing",
                 "parameter '" + name + "' has no 'value'; add it, or nan if it is not known");
  const auto unit = section.text("unit");
  if (!unit)
    section.fail("unit", "unit_missing",
                 "parameter '" + name + "' has no 'unit'; add one, like unit = \"N m\" or \"-\"");
  estimate.value = *value;
  estimate.unit = *unit;
  estimate.std_error = section.number("std_error").value_or(estimate.std_error);
  if (estimate.std_error < 0) {
    section.fail("std_error", "value_out_of_range",
                 "'std_error' of '" + name + "' is negative; it is a standard deviation, so zero or more");
  }
  read_pair(section, "ci95", file, estimate.ci_low, estimate.ci_high);
  estimate.identifiable = section.boolean("identifiable").value_or(true);
  estimate.reason = section.text("reason").value_or(section.text("remark").value_or(""));
  return estimate;
}

/// Keys of a table in the order of the file (toml++ sorts them).
std::vector<std::pair<std::string, const toml::node*>> in_file_order(const toml::table& table) {
  std::vector<std::tuple<std::uint32_t, std::uint32_t, std::string, const toml::node*>> all;
  for (const auto& [key, node] : table) {
    all.emplace_back(key.source().begin.line, key.source().begin.column, std::string(key.str()), &node);
  }
  std::ranges::sort(all);
  std::vector<std::pair<std::string, const toml::node*>> out;
  for (auto& [line, column, key, node] : all) out.emplace_back(std::move(key), node);
  return out;
}

ParamsSection read_section(const std::string& name, const toml::table& table, const std::string& file) {
  const TomlSection section(table, name, file, {"label", "sources", "box", "constants", "parameters"});
  ParamsSection out;
  out.name = name;
  out.label = section.text("label").value_or("");
  out.sources = section.texts("sources");
  if (const auto* box = section.table("box")) {
    const TomlSection inner(*box, name + ".box", file, {"delta_pressure_Pa", "angle_rad", "speed_rad_s"});
    read_pair(inner, "delta_pressure_Pa", file, out.box.delta_pressure_low, out.box.delta_pressure_high);
    read_pair(inner, "angle_rad", file, out.box.angle_low, out.box.angle_high);
    read_pair(inner, "speed_rad_s", file, out.box.speed_low, out.box.speed_high);
  }
  if (const auto* constants = section.table("constants")) {
    const TomlSection inner(*constants, name + ".constants", file, {});
    for (const auto& [key, node] : in_file_order(*constants))
      out.constants.emplace_back(key, *inner.number(key));
  }
  if (const auto* parameters = section.table("parameters")) {
    for (const auto& [key, node] : in_file_order(*parameters))
      out.values.push_back(read_estimate(key, *node, file));
  }
  return out;
}

/// A section of the standard's own name, or another that is shaped like one.
bool is_section(std::string_view key, const toml::node& node) {
  if (std::ranges::find(kKnownSections, key) != kKnownSections.end()) return true;
  const auto has_shape = [](const toml::table& table) {
    return table.get("parameters") != nullptr && std::ranges::all_of(table, [](const auto& entry) {
             const std::string_view name = entry.first.str();
             return name == "label" || name == "sources" || name == "box" || name == "constants" ||
                    name == "parameters";
           });
  };
  if (const auto* table = node.as_table()) return has_shape(*table);
  const auto* array = node.as_array();
  return array != nullptr && !array->empty() &&
         std::ranges::all_of(*array, [&has_shape](const toml::node& entry) {
           return entry.is_table() && has_shape(*entry.as_table());
         });
}

std::string format_rest(const toml::table& table) {
  if (table.empty()) return {};
  std::ostringstream out;
  out << toml::toml_formatter(table) << "\n";
  return out.str();
}

std::string pair_text(double low, double high) {
  return "[" + exact_number(low) + ", " + exact_number(high) + "]";
}

bool any_known(double low, double high) {
  return !std::isnan(low) || !std::isnan(high);
}

std::string box_text(const ValidityBox& box) {
  std::string out;
  const auto add = [&out](const char* key, double low, double high) {
    if (any_known(low, high))
      out += std::string(out.empty() ? "" : ", ") + key + " = " + pair_text(low, high);
  };
  add("delta_pressure_Pa", box.delta_pressure_low, box.delta_pressure_high);
  add("angle_rad", box.angle_low, box.angle_high);
  add("speed_rad_s", box.speed_low, box.speed_high);
  return out.empty() ? out : "box = { " + out + " }\n";
}

std::string estimate_text(const Estimated& value) {
  std::string out = key_text(value.name) + " = { value = " + exact_number(value.value) +
                    ", unit = " + toml_string(value.unit) + ", std_error = " + exact_number(value.std_error) +
                    ", ci95 = " + pair_text(value.ci_low, value.ci_high) +
                    ", identifiable = " + (value.identifiable ? "true" : "false");
  if (!value.reason.empty())
    out += (value.identifiable ? ", remark = " : ", reason = ") + toml_string(value.reason);
  return out + " }\n";
}

std::string section_text(const ParamsSection& section, bool as_array) {
  const std::string name = key_text(section.name);
  std::string out = as_array ? "\n[[" + name + "]]\n" : "\n[" + name + "]\n";
  if (!section.label.empty()) out += "label = " + toml_string(section.label) + "\n";
  if (!section.sources.empty()) {
    out += "sources = [\n";
    for (const std::string& source : section.sources) out += "  " + toml_string(source) + ",\n";
    out += "]\n";
  }
  out += box_text(section.box);
  if (!section.constants.empty()) {
    std::string inner;
    for (const auto& [key, value] : section.constants) {
      inner += (inner.empty() ? "" : ", ") + key_text(key) + " = " + exact_number(value);
    }
    out += "constants = { " + inner + " }\n";
  }
  out += "[" + name + ".parameters]\n";
  for (const Estimated& value : section.values) out += estimate_text(value);
  return out;
}

}  // namespace

const ParamsSection* Params::find(const std::string& name, const std::string& label) const {
  const auto found = std::ranges::find_if(sections, [&](const ParamsSection& s) {
    return s.name == name && (label.empty() || s.label == label);
  });
  return found == sections.end() ? nullptr : &*found;
}

Params parse_params(const std::string& text, const std::string& file) {
  toml::table root = parse_toml(text, file);
  const TomlSection top(root, "", file, {});
  top.require_format("isac.params/1");
  Params params;
  params.created = top.text("created").value_or("");

  using Found = std::tuple<std::uint32_t, std::string, const toml::table*>;
  std::vector<Found> found;
  toml::table other_keys, other_tables;
  for (const auto& [key, node] : root) {
    const std::string name(key.str());
    if (name == "format" || name == "created") continue;
    if (is_section(name, node)) {
      for (const toml::table* table : top.tables(name))
        found.emplace_back(table->source().begin.line, name, table);
    } else if (node.is_table() || node.is_array_of_tables()) {
      other_tables.insert(key, node);
    } else {
      other_keys.insert(key, node);
    }
  }
  std::ranges::stable_sort(found, {}, [](const Found& one) { return std::get<0>(one); });
  for (const Found& one : found) {
    const std::string& name = std::get<1>(one);
    const toml::table& table = *std::get<2>(one);
    ParamsSection section = read_section(name, table, file);
    const auto twice = [&section](const ParamsSection& other) {
      return other.name == section.name && other.label == section.label;
    };
    if (std::ranges::any_of(params.sections, twice)) {
      fail_at(table, file, "section_twice",
              "[" + name + "]" + (section.label.empty() ? "" : " '" + section.label + "'") +
                  " stands in the file twice; give it another label or keep one");
    }
    params.sections.push_back(std::move(section));
  }
  params.other_keys = format_rest(other_keys);
  params.other_tables = format_rest(other_tables);
  return params;
}

Params read_params(const std::filesystem::path& path) {
  return parse_params(read_text_file(path), path.string());
}

std::string format_params(const Params& params) {
  std::string out = "format = \"isac.params/1\"\n";
  if (!params.created.empty()) out += "created = " + toml_string(params.created) + "\n";
  out += params.other_keys;
  for (const ParamsSection& section : params.sections) {
    const auto same_name = [&section](const ParamsSection& s) { return s.name == section.name; };
    const bool as_array = std::ranges::find(kAlwaysArrays, section.name) != kAlwaysArrays.end() ||
                          std::ranges::count_if(params.sections, same_name) > 1;
    out += section_text(section, as_array);
  }
  if (!params.other_tables.empty()) out += "\n" + params.other_tables;
  return out;
}

void update_params(const std::filesystem::path& path, const Params& fresh) {
  Params merged = fresh;
  if (std::filesystem::exists(path)) {
    merged = read_params(path);
    merged.created = fresh.created.empty() ? merged.created : fresh.created;
    for (const ParamsSection& section : fresh.sections) {
      const auto same = [&section](const ParamsSection& s) {
        return s.name == section.name && s.label == section.label;
      };
      const auto old = std::ranges::find_if(merged.sections, same);
      if (old != merged.sections.end()) {
        *old = section;
      } else {
        merged.sections.push_back(section);
      }
    }
  }
  write_atomically(path, format_params(merged), true);
}

}  // namespace isac::record
