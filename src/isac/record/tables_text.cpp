#include "isac/record/tables_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/models/effects.hpp"
#include "isac/record/toml_quantity.hpp"

namespace isac::record {
namespace {

using models::JointField;
using models::JointParameters;
using models::ParameterTable;

/// C names of the fields, in the order of JointField, with the comment that gives their unit.
struct FieldText {
  const char* name;
  const char* unit;
};
constexpr FieldText kFields[models::kJointFields] = {
    {"A", "N/m"},
    {"B", "N/Pa"},
    {"C", "N m s3"},
    {"D", "N m s"},
    {"wheel_radius", "m"},
    {"initial_pressure", "Pa"},
    {"inertia", "kg m2"},
    {"delta_pressure_low", "Pa"},
    {"delta_pressure_high", "Pa"},
    {"angle_low", "rad"},
    {"angle_high", "rad"},
    {"speed_low", "rad/s"},
    {"speed_high", "rad/s"},
    {"valve_gain", "1"},
    {"valve_lag", "s"},
    {"valve_dead_time", "s"},
    {"position_p", "N m/rad"},
    {"position_i", "N m/(rad s)"},
    {"torque_p", "Pa/(N m)"},
    {"torque_i", "Pa/(N m s)"},
    {"valve_lag_fill", "s"},
    {"valve_lag_vent", "s"},
};

/// A column of the tables for people: field, heading, unit, and how many of that unit one SI unit makes.
struct TableColumn {
  JointField field;
  const char* name;
  const char* csv_unit;
  const char* shown_unit;
  double csv_per_si;
  double shown_per_si;
};
constexpr TableColumn kActuator[] = {
    {JointField::kA, "A", "N/m", "N/m", 1, 1},
    {JointField::kB, "B", "N cm2/kg", "N cm²/kg", kPascalPerKgfCm2, kPascalPerKgfCm2},
    {JointField::kC, "C", "N m s3", "N m s³", 1, 1},
    {JointField::kD, "D", "N m s", "N m s", 1, 1},
    {JointField::kWheelRadius, "chain_wheel_diameter", "m", "m", 2, 2},
};
constexpr TableColumn kControl[] = {
    {JointField::kPositionP, "K_P_position", "N m/rad", "N m/rad", 1, 1},
    {JointField::kPositionI, "K_I_position", "N m/rad s", "N m/(rad s)", 1, 1},
    {JointField::kTorqueP, "K_P_torque", "Pa/N m", "kg/cm²/(N m)", 1, 1 / kPascalPerKgfCm2},
    {JointField::kTorqueI, "K_I_torque", "Pa/N m s", "kg/cm²/(N m s)", 1, 1 / kPascalPerKgfCm2},
};

std::vector<const ParamsSection*> joint_sections(const Params& params) {
  std::vector<const ParamsSection*> joints;
  for (const ParamsSection& section : params.sections) {
    if (section.name == "joint") joints.push_back(&section);
  }
  return joints;
}

/// Text for a comment: no end of comment, no line break, whatever the label holds.
std::string harmless(std::string text) {
  for (char& letter : text) {
    if (static_cast<unsigned char>(letter) < 0x20 || letter == '/' || letter == '\\' || letter == '|' ||
        letter == '*' || letter == '?') {
      letter = ' ';
    }
  }
  return text;
}

/// The estimate behind a field of a joint, in the unit it was reported in; nullptr for constants and gains.
const Estimated* estimate_of(const ParamsSection& section, const char* name) {
  const auto found = std::ranges::find(section.values, name, &Estimated::name);
  if (found == section.values.end() || !found->identifiable) return nullptr;
  return &*found;
}

/// The reported digits where they are in the table's unit, else converted from SI.
double shown_value(const ParamsSection& section, const JointParameters& joint, const TableColumn& column,
                   double per_si, const char* unit) {
  const Estimated* estimate = estimate_of(section, column.name);
  if (estimate != nullptr && estimate->unit == unit) return estimate->value;
  return joint[column.field] * per_si;
}

double shown_error(const ParamsSection& section, const TableColumn& column) {
  const Estimated* estimate = estimate_of(section, column.name);
  if (estimate == nullptr) return std::numeric_limits<double>::quiet_NaN();
  if (estimate->unit == column.csv_unit) return estimate->std_error;
  const auto from = parse_compound_unit(estimate->unit), to = parse_compound_unit(column.csv_unit);
  return from && to ? estimate->std_error * from->scale / to->scale
                    : std::numeric_limits<double>::quiet_NaN();
}

std::string cell(double value) {
  return std::isnan(value) ? std::string() : exact_number(value);
}

std::string joint_comments(const std::vector<const ParamsSection*>& joints) {
  std::string out;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    out += fmt::format("# joint {}: {}\n", i + 1, harmless(joints[i]->label));
  }
  return out;
}

std::string bytes_text(std::span<const std::byte> bytes) {
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    out += fmt::format("{}0x{:02X}u{}", i % 16 == 0 ? "  " : " ", std::to_integer<unsigned>(bytes[i]),
                       i + 1 == bytes.size() ? "\n"
                       : i % 16 == 15        ? ",\n"
                                             : ",");
  }
  return out;
}

const char* effect_name(std::uint32_t hash) {
  for (const models::EffectInfo& info : models::effect_catalogue()) {
    if (models::effect_id_hash(info.id) == hash) return info.id;
  }
  return "unknown";
}

std::string joint_initializer(const JointParameters& joint, const std::string& label) {
  std::string out = fmt::format("  {{ /* {} */\n    0x{:08X}u,\n", harmless(label), joint.present);
  for (int i = 0; i < models::kJointFields; ++i) {
    out += fmt::format("    {}{} /* {} */\n", exact_number(joint.value[static_cast<std::size_t>(i)]),
                       i + 1 < models::kJointFields ? "," : "", kFields[i].name);
  }
  return out + "  }";
}

std::string markdown_row(const std::vector<std::string>& cells) {
  std::string out = "|";
  for (const std::string& text : cells) out += " " + text + " |";
  return out + "\n";
}

std::string rule(std::size_t columns) {
  std::string out = "| --- |";
  for (std::size_t i = 1; i < columns; ++i) out += " ---: |";
  return out + "\n";
}

template <std::size_t n>
bool any_known(const ParameterTable& table, const TableColumn (&columns)[n]) {
  for (int i = 0; i < table.joint_count; ++i) {
    for (const TableColumn& column : columns) {
      if (table.joints[static_cast<std::size_t>(i)].has(column.field)) return true;
    }
  }
  return false;
}

}  // namespace

std::string table_header(const ParameterTable& table, std::span<const std::byte> binary, const Params& params,
                         const std::string& source_name) {
  const auto joints = joint_sections(params);
  const auto crc = static_cast<std::uint32_t>(models::detail::read_unsigned(binary, binary.size() - 4, 4));
  std::string out = fmt::format(
      "/* Deployment table of the ISAC toolkit, made by `isac-identify export` from {}{}.\n"
      "   Do not edit: the next export overwrites this file. All values are SI. C11 and C++20. */\n"
      "#ifndef ISAC_PARAMETERS_H\n#define ISAC_PARAMETERS_H\n\n#include <stdint.h>\n\n"
      "#define ISAC_PARAMETERS_VERSION {}u\n#define ISAC_PARAMETERS_CRC32 0x{:08X}u /* of "
      "isac_parameters_binary */\n"
      "#define ISAC_PARAMETERS_JOINTS {}\n#define ISAC_PARAMETERS_EFFECTS {}\n#define ISAC_PARAMETERS_BYTES "
      "{}\n\n"
      "#if defined(__GNUC__)\n#define ISAC_PARAMETERS_MAY_BE_UNUSED __attribute__((__unused__))\n#else\n"
      "#define ISAC_PARAMETERS_MAY_BE_UNUSED\n#endif\n\n",
      harmless(source_name), params.created.empty() ? "" : " of " + harmless(params.created),
      models::kParameterTableVersion, crc, table.joint_count, table.effect_count, binary.size());

  out +=
      "/* Bit i of `present` is set where the i-th value below it is known; others are zero and must not be "
      "used. */\n"
      "typedef struct {\n  uint32_t present;\n";
  for (const FieldText& field : kFields)
    out += fmt::format("  double {}; /* {} */\n", field.name, field.unit);
  out +=
      "} isac_joint_parameters;\n\n"
      "/* id_hash: FNV-1a of the effect's id; joint: index from 0, 255 for all. */\n"
      "typedef struct {\n  uint32_t id_hash;\n  uint8_t joint;\n  uint8_t parameter_count;\n  double "
      "parameters[4];\n"
      "} isac_effect_parameters;\n\n"
      "static const isac_joint_parameters isac_joints[ISAC_PARAMETERS_JOINTS] ISAC_PARAMETERS_MAY_BE_UNUSED "
      "= {\n";
  for (int i = 0; i < table.joint_count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    out += joint_initializer(table.joints[index], joints[index]->label) +
           (i + 1 < table.joint_count ? ",\n" : "\n");
  }
  out += "};\n\n";
  if (table.effect_count > 0) {
    out +=
        "static const isac_effect_parameters isac_effects[ISAC_PARAMETERS_EFFECTS] "
        "ISAC_PARAMETERS_MAY_BE_UNUSED = {\n";
    for (int i = 0; i < table.effect_count; ++i) {
      const models::TableEffect& effect = table.effects[static_cast<std::size_t>(i)];
      out += fmt::format("  {{ 0x{:08X}u /* {} */, {}u, {}u, {{ {}, {}, {}, {} }} }}{}\n", effect.id_hash,
                         effect_name(effect.id_hash), effect.joint, effect.parameter_count,
                         exact_number(effect.parameters[0]), exact_number(effect.parameters[1]),
                         exact_number(effect.parameters[2]), exact_number(effect.parameters[3]),
                         i + 1 < table.effect_count ? "," : "");
    }
    out += "};\n\n";
  }
  out += fmt::format(
      "#define ISAC_PARAMETERS_HAVE_MASSES {}\n"
      "static const double isac_masses[3] ISAC_PARAMETERS_MAY_BE_UNUSED = {{ {}, {}, {} }}; /* kg */\n\n",
      table.has_masses ? 1 : 0, exact_number(table.masses[0]), exact_number(table.masses[1]),
      exact_number(table.masses[2]));
  out +=
      "/* The packed binary of the same values, with magic, version and CRC-32, for a loader that checks "
      "them. */\n"
      "static const uint8_t isac_parameters_binary[ISAC_PARAMETERS_BYTES] ISAC_PARAMETERS_MAY_BE_UNUSED = "
      "{\n" +
      bytes_text(binary) + "};\n\n#endif\n";
  return out;
}

std::string actuator_csv(const ParameterTable& table, const Params& params) {
  const auto joints = joint_sections(params);
  std::string out = "# table: actuator parameters\n" + joint_comments(joints) + "joint [-]";
  for (const TableColumn& column : kActuator) out += fmt::format(",{} [{}]", column.name, column.csv_unit);
  for (const TableColumn& column : kActuator) {
    if (column.field != JointField::kWheelRadius)
      out += fmt::format(",{}_std_error [{}]", column.name, column.csv_unit);
  }
  out += '\n';
  for (std::size_t i = 0; i < joints.size(); ++i) {
    out += std::to_string(i + 1);
    for (const TableColumn& column : kActuator) {
      out += "," + cell(shown_value(*joints[i], table.joints[i], column, column.csv_per_si, column.csv_unit));
    }
    for (const TableColumn& column : kActuator) {
      if (column.field != JointField::kWheelRadius) out += "," + cell(shown_error(*joints[i], column));
    }
    out += '\n';
  }
  return out;
}

std::string control_csv(const ParameterTable& table, const Params& params) {
  if (!any_known(table, kControl)) return {};
  const auto joints = joint_sections(params);
  std::string out = "# table: control parameters\n" + joint_comments(joints) + "joint [-]";
  for (const TableColumn& column : kControl) out += fmt::format(",{} [{}]", column.name, column.csv_unit);
  out += '\n';
  for (std::size_t i = 0; i < joints.size(); ++i) {
    out += std::to_string(i + 1);
    for (const TableColumn& column : kControl)
      out += "," + cell(table.joints[i][column.field] * column.csv_per_si);
    out += '\n';
  }
  return out;
}

std::string table_markdown(const ParameterTable& table, const Params& params,
                           const std::string& source_name) {
  const auto joints = joint_sections(params);
  std::string out =
      fmt::format("# Parameters of {}\n\n## Actuators (value ± standard error)\n\n", harmless(source_name));
  std::vector<std::string> cells = {"Joint"};
  for (const TableColumn& column : kActuator) {
    cells.push_back(fmt::format(
        "{} [{}]", column.field == JointField::kWheelRadius ? "Chain-wheel diameter" : column.name,
        column.shown_unit));
  }
  out += markdown_row(cells) + rule(cells.size());
  for (std::size_t i = 0; i < joints.size(); ++i) {
    cells = {joints[i]->label.empty() ? std::to_string(i + 1) : harmless(joints[i]->label)};
    for (const TableColumn& column : kActuator) {
      const double value =
          shown_value(*joints[i], table.joints[i], column, column.csv_per_si, column.csv_unit);
      const double error = shown_error(*joints[i], column);
      cells.push_back(!table.joints[i].has(column.field) ? "not known"
                      : std::isfinite(error)             ? fmt::format("{:.6g} ± {:.2g}", value, error)
                                                         : fmt::format("{:.6g}", value));
    }
    out += markdown_row(cells);
  }
  if (any_known(table, kControl)) {
    out += "\n## Control parameters (outer loop: position, inner loop: torque)\n\n";
    cells = {"Joint"};
    for (const TableColumn& column : kControl)
      cells.push_back(fmt::format("{} [{}]", column.name, column.shown_unit));
    out += markdown_row(cells) + rule(cells.size());
    for (std::size_t i = 0; i < joints.size(); ++i) {
      cells = {joints[i]->label.empty() ? std::to_string(i + 1) : harmless(joints[i]->label)};
      for (const TableColumn& column : kControl) {
        cells.push_back(table.joints[i].has(column.field)
                            ? fmt::format("{:.6g}", table.joints[i][column.field] * column.shown_per_si)
                            : "not known");
      }
      out += markdown_row(cells);
    }
  }
  if (table.has_masses) {
    out += fmt::format(
        "\n## Masses\n\n| m1 [kg] | m2 [kg] | m3 [kg] |\n| ---: | ---: | ---: |\n| {:.6g} | {:.6g} | {:.6g} "
        "|\n",
        table.masses[0], table.masses[1], table.masses[2]);
  }
  return out;
}

}  // namespace isac::record
