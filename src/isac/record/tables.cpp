#include "isac/record/tables.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <string_view>

#include "isac/core/crc32.hpp"
#include "isac/core/error.hpp"
#include "isac/models/effects.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/tables_text.hpp"
#include "isac/record/toml_quantity.hpp"

namespace isac::record {
namespace {

using models::JointField;

/// A name in params.toml, the field it fills, and the dimension it must have (an angle in it is not counted).
struct Slot {
  std::string_view name;
  JointField field;
  Dimension dimension;
};

constexpr Slot kJointSlots[] = {
    {"A", JointField::kA, {.mass = 1, .time = -2}},
    {"B", JointField::kB, {.length = 2}},
    {"C", JointField::kC, {.length = 2, .mass = 1, .time = 1}},
    {"D", JointField::kD, {.length = 2, .mass = 1, .time = -1}},
};
constexpr Slot kPcuSlots[] = {
    {"K_C", JointField::kValveGain, dimension::kNone},
    {"T_C", JointField::kValveLag, dimension::kTime},
    {"dead_time", JointField::kValveDeadTime, dimension::kTime},
    {"T_fill", JointField::kValveLagFill, dimension::kTime},
    {"T_vent", JointField::kValveLagVent, dimension::kTime},
};
constexpr Slot kGainSlots[] = {
    {"K_P_position", JointField::kPositionP, dimension::kTorque},
    {"K_I_position", JointField::kPositionI, {.length = 2, .mass = 1, .time = -3}},
    {"K_P_torque", JointField::kTorqueP, {.length = -3}},
    {"K_I_torque", JointField::kTorqueI, {.length = -3, .time = -1}},
};
struct ConstantSlot {
  std::string_view name;
  JointField field;
};
constexpr ConstantSlot kConstants[] = {
    {"wheel_radius_m", JointField::kWheelRadius},
    {"initial_pressure_Pa", JointField::kInitialPressure},
    {"inertia_kg_m2", JointField::kInertia},
};

/// The table while it is filled: which parameters of each effect were given.
struct Draft : models::ParameterTable {
  std::array<unsigned, models::kMaxTableEffects> given{};
};

[[noreturn]] void refuse(std::string code, std::string text) {
  throw Error(ErrorKind::kBadInput, std::move(code), std::move(text));
}

std::string title(const ParamsSection& section) {
  return "[" + section.name + "]" + (section.label.empty() ? "" : " '" + section.label + "'");
}

void warn(Warnings* warnings, std::string code, std::string text) {
  if (warnings != nullptr) warnings->push_back({std::move(code), std::move(text)});
}

/// The value can be used; says why not otherwise.
bool usable(const Estimated& value, const ParamsSection& section, Warnings* warnings) {
  if (value.identifiable && std::isfinite(value.value)) return true;
  warn(warnings, "left_out",
       value.name + " of " + title(section) + " is not known and was left out" +
           (value.reason.empty() ? "." : ": " + value.reason));
  return false;
}

double in_si(const Estimated& value, const ParamsSection& section, Dimension wanted) {
  const auto unit = parse_compound_unit(value.unit);
  wanted.angle = 0;
  if (unit) {
    Dimension found = unit->dimension;
    found.angle = 0;
    if (found == wanted) return value.value * unit->scale + unit->offset;
  }
  refuse("dimension_wrong",
         value.name + " of " + title(section) + " is in '" + value.unit +
             "', which a controller's joint cannot take; give it in the unit of docs/formats.md");
}

template <std::size_t n>
const Slot* find_slot(const Slot (&slots)[n], std::string_view name) {
  const auto* found = std::ranges::find(slots, name, &Slot::name);
  return found == std::end(slots) ? nullptr : found;
}

/// The seed's own terms under their catalogue names ("viscous_damping" is D).
const Slot* find_joint_slot(std::string_view name) {
  if (const Slot* slot = find_slot(kJointSlots, name)) return slot;
  const int effect = models::find_effect(name);
  if (effect < 0) return nullptr;
  for (const Slot& slot : kJointSlots) {
    if (models::find_effect(slot.name) == effect) return &slot;
  }
  return nullptr;
}

models::TableEffect& effect_record(Draft& table, int effect, std::uint8_t joint) {
  const models::EffectInfo& info = models::effect_catalogue()[static_cast<std::size_t>(effect)];
  const std::uint32_t hash = models::effect_id_hash(info.id);
  for (int i = 0; i < table.effect_count; ++i) {
    models::TableEffect& present = table.effects[static_cast<std::size_t>(i)];
    if (present.id_hash == hash && present.joint == joint) return present;
  }
  if (table.effect_count == models::kMaxTableEffects) {
    refuse("too_many_effects", "has more than " + std::to_string(models::kMaxTableEffects) +
                                   " effects, which is all a table can carry; remove the least important");
  }
  models::TableEffect& fresh = table.effects[static_cast<std::size_t>(table.effect_count++)];
  fresh.id_hash = hash;
  fresh.joint = joint;
  fresh.parameter_count = static_cast<std::uint8_t>(info.parameter_count);
  return fresh;
}

/// Index of a parameter in its effect, by its name or, with a single parameter, by the effect's id; −1 otherwise.
int parameter_index(const models::EffectInfo& info, std::string_view name) {
  for (int i = 0; i < info.parameter_count; ++i) {
    if (name == info.parameters[i].name) return i;
  }
  const int named = models::find_effect(name);  // an alias is as good as the id
  const bool is_id = named >= 0 && models::effect_catalogue()[static_cast<std::size_t>(named)].id ==
                                       std::string_view(info.id);
  return info.parameter_count == 1 && is_id ? 0 : -1;
}

/// Puts `value` into the record of an effect named by its id, or by "id.parameter".
bool add_effect(Draft& table, const ParamsSection& section, const Estimated& value, std::string_view id,
                std::uint8_t joint, Warnings* warnings) {
  const int effect = models::find_effect(id);
  if (effect < 0) return false;
  const models::EffectInfo& info = models::effect_catalogue()[static_cast<std::size_t>(effect)];
  std::string_view name = value.name;
  if (const std::size_t dot = name.find('.'); dot != std::string_view::npos) name.remove_prefix(dot + 1);
  const int index = parameter_index(info, name);
  if (index < 0) return false;
  if (!usable(value, section, warnings)) return true;
  double si = 0;
  if (value.unit == info.parameters[index].unit) {
    si = value.value * info.parameters[index].si_per_unit;
  } else if (const auto unit = parse_compound_unit(value.unit)) {
    si = value.value * unit->scale;
  } else {
    refuse("unit_unknown", value.name + " of " + title(section) + " has the unknown unit '" + value.unit +
                               "'; give it in '" + info.parameters[index].unit + "'");
  }
  models::TableEffect& record = effect_record(table, effect, joint);
  record.parameters[static_cast<std::size_t>(index)] = si;
  table.given[static_cast<std::size_t>(&record - table.effects.data())] |= 1u << static_cast<unsigned>(index);
  return true;
}

void set_if_finite(models::JointParameters& joint, JointField field, double value) {
  if (std::isfinite(value)) joint.set(field, value);
}

void fill_joint(Draft& table, std::uint8_t index, const ParamsSection& section, Warnings* warnings) {
  models::JointParameters& joint = table.joints[index];
  for (const Estimated& value : section.values) {
    if (const Slot* slot = find_joint_slot(value.name)) {
      if (usable(value, section, warnings)) joint.set(slot->field, in_si(value, section, slot->dimension));
    } else if (!add_effect(table, section, value, value.name.substr(0, value.name.find('.')), index,
                           warnings)) {
      warn(warnings, "left_out",
           value.name + " of " + title(section) + " is no term of the catalogue and was left out.");
    }
  }
  for (const auto& [name, value] : section.constants) {
    const auto* slot = std::ranges::find(kConstants, name, &ConstantSlot::name);
    if (slot != std::end(kConstants)) set_if_finite(joint, slot->field, value);
  }
  set_if_finite(joint, JointField::kDeltaPressureLow, section.box.delta_pressure_low);
  set_if_finite(joint, JointField::kDeltaPressureHigh, section.box.delta_pressure_high);
  set_if_finite(joint, JointField::kAngleLow, section.box.angle_low);
  set_if_finite(joint, JointField::kAngleHigh, section.box.angle_high);
  set_if_finite(joint, JointField::kSpeedLow, section.box.speed_low);
  set_if_finite(joint, JointField::kSpeedHigh, section.box.speed_high);
}

/// A section that holds for the joint of its label, or without one for all joints.
template <std::size_t n>
void fill_shared(models::ParameterTable& table, const std::vector<const ParamsSection*>& joints,
                 const ParamsSection& section, const Slot (&slots)[n], Warnings* warnings) {
  bool used = false;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (!section.label.empty() && section.label != joints[i]->label) continue;
    for (const Estimated& value : section.values) {
      const Slot* slot = find_slot(slots, value.name);
      if (slot != nullptr && usable(value, section, used ? nullptr : warnings)) {
        table.joints[i].set(slot->field, in_si(value, section, slot->dimension));
      }
    }
    used = true;
  }
  if (!used)
    warn(warnings, "left_out", title(section) + " belongs to no [[joint]] of this file and was left out.");
}

void fill_masses(models::ParameterTable& table, const ParamsSection& section, Warnings* warnings) {
  constexpr std::string_view kNames[] = {"m1", "m2", "m3"};
  for (std::size_t i = 0; i < table.masses.size(); ++i) {
    const auto value = std::ranges::find(section.values, kNames[i], &Estimated::name);
    if (value == section.values.end() || !usable(*value, section, nullptr)) {
      warn(warnings, "left_out", title(section) + " needs m1, m2 and m3, and was left out.");
      table.masses = {};
      return;
    }
    table.masses[i] = in_si(*value, section, dimension::kMass);
  }
  table.has_masses = true;
}

void fill_effects(Draft& table, const ParamsSection& section, Warnings* warnings) {
  std::uint8_t joint = models::kAllJoints;
  for (const auto& [name, value] : section.constants) {
    if (name != "joint") continue;
    if (!(value >= 1 && value <= table.joint_count && value == std::floor(value))) {
      refuse("value_out_of_range", "constant 'joint' of " + title(section) + " names none of the " +
                                       std::to_string(table.joint_count) + " joints; count them from 1");
    }
    joint = static_cast<std::uint8_t>(value - 1);
  }
  for (const Estimated& value : section.values) {
    if (!add_effect(table, section, value, section.label, joint, warnings)) {
      warn(warnings, "left_out",
           value.name + " of " + title(section) + " is no parameter of the catalogue and was left out.");
    }
  }
}

/// An effect with a parameter missing would be computed with a zero that nobody identified: it is left out as a whole.
void drop_incomplete_effects(Draft& table, Warnings* warnings) {
  int kept = 0;
  for (int i = 0; i < table.effect_count; ++i) {
    const models::TableEffect effect = table.effects[static_cast<std::size_t>(i)];
    if (table.given[static_cast<std::size_t>(i)] == (1u << effect.parameter_count) - 1) {
      table.effects[static_cast<std::size_t>(kept++)] = effect;
      continue;
    }
    for (const models::EffectInfo& info : models::effect_catalogue()) {
      if (models::effect_id_hash(info.id) != effect.id_hash) continue;
      warn(warnings, "left_out", std::string(info.id) + " lacks one of its parameters and was left out.");
    }
  }
  for (int i = kept; i < table.effect_count; ++i) table.effects[static_cast<std::size_t>(i)] = {};
  table.effect_count = kept;
}

/// parameter_table with the file's name in its errors.
models::ParameterTable table_of_file(const Params& params, const std::string& source_name,
                                     Warnings& warnings) {
  try {
    return parameter_table(params, &warnings);
  } catch (const Error& error) {
    throw Error(error.kind(), error.code(), error.text(), {source_name, 0, 0});
  }
}

class Packer {
 public:
  void unsigned_value(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::byte>(value >> (8 * i)));
  }
  void real(double value) { unsigned_value(std::bit_cast<std::uint64_t>(value), 8); }
  std::vector<std::byte> bytes;
};

}  // namespace

models::ParameterTable parameter_table(const Params& params, Warnings* warnings) {
  std::vector<const ParamsSection*> joints;
  for (const ParamsSection& section : params.sections) {
    if (section.name == "joint") joints.push_back(&section);
  }
  if (joints.empty()) {
    throw Error(
        ErrorKind::kAnswerIsNo, "nothing_to_deploy",
        "has no [[joint]] section, so there is nothing to deploy; run isac-identify joint with -o first");
  }
  if (joints.size() > static_cast<std::size_t>(models::kMaxTableJoints)) {
    refuse("too_many_joints", "has " + std::to_string(joints.size()) + " joints, and a table carries " +
                                  std::to_string(models::kMaxTableJoints) +
                                  "; export each arm's file by itself");
  }
  Draft table;
  table.joint_count = static_cast<int>(joints.size());
  for (std::size_t i = 0; i < joints.size(); ++i)
    fill_joint(table, static_cast<std::uint8_t>(i), *joints[i], warnings);
  for (const ParamsSection& section : params.sections) {
    if (section.name == "pcu") fill_shared(table, joints, section, kPcuSlots, warnings);
    if (section.name == "gains") fill_shared(table, joints, section, kGainSlots, warnings);
    if (section.name == "masses") fill_masses(table, section, warnings);
    if (section.name == "effects") fill_effects(table, section, warnings);
  }
  drop_incomplete_effects(table, warnings);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (const Status status = models::detail::check_joint(table.joints[i]); !ok(status)) {
      refuse("value_out_of_range",
             title(*joints[i]) + " cannot be deployed: " + describe(status) +
                 "; radius, inertia and time constants must be greater than zero and the box not empty");
    }
  }
  if (const Status status = models::check_parameter_table(table); !ok(status)) {
    refuse("value_out_of_range",
           std::string("the masses or effects cannot be deployed: ") + describe(status));
  }
  return table;
}

std::vector<std::byte> pack_parameter_table(const models::ParameterTable& table) {
  Packer out;
  for (const char letter : models::kParameterTableMagic)
    out.unsigned_value(static_cast<unsigned char>(letter), 1);
  out.unsigned_value(models::kParameterTableVersion, 2);
  out.unsigned_value(static_cast<std::uint64_t>(table.joint_count), 1);
  out.unsigned_value(static_cast<std::uint64_t>(table.effect_count), 1);
  out.unsigned_value(models::parameter_table_bytes(table.joint_count, table.effect_count), 4);
  out.unsigned_value(table.has_masses ? 1 : 0, 4);
  for (int i = 0; i < 3; ++i) out.unsigned_value(0, 4);
  for (const double mass : table.masses) out.real(mass);
  for (int i = 0; i < table.joint_count; ++i) {
    const models::JointParameters& joint = table.joints[static_cast<std::size_t>(i)];
    out.unsigned_value(joint.present, 4);
    out.unsigned_value(0, 4);
    for (const double value : joint.value) out.real(value);
  }
  for (int i = 0; i < table.effect_count; ++i) {
    const models::TableEffect& effect = table.effects[static_cast<std::size_t>(i)];
    out.unsigned_value(effect.id_hash, 4);
    out.unsigned_value(effect.joint, 1);
    out.unsigned_value(effect.parameter_count, 1);
    out.unsigned_value(0, 2);
    for (const double parameter : effect.parameters) out.real(parameter);
  }
  out.unsigned_value(crc32(out.bytes), 4);
  return std::move(out.bytes);
}

DeploymentTables make_tables(const Params& params, const std::string& source_name) {
  DeploymentTables out;
  const models::ParameterTable table = table_of_file(params, source_name, out.warnings);
  out.binary = pack_parameter_table(table);
  out.header = table_header(table, out.binary, params, source_name);
  out.actuator_csv = actuator_csv(table, params);
  out.control_csv = control_csv(table, params);
  out.markdown = table_markdown(table, params, source_name);
  return out;
}

std::vector<std::filesystem::path> write_tables(const Params& params, const std::filesystem::path& stem,
                                                const std::string& source_name) {
  const DeploymentTables tables = make_tables(params, source_name);
  std::vector<std::filesystem::path> written;
  const auto write = [&stem, &written](const char* suffix, std::string_view text) {
    written.push_back(stem.string() + suffix);
    write_atomically(written.back(), text);
  };
  write(".h", tables.header);
  write(".bin", {reinterpret_cast<const char*>(tables.binary.data()), tables.binary.size()});
  write("_actuator.csv", tables.actuator_csv);
  if (!tables.control_csv.empty()) write("_control.csv", tables.control_csv);
  write(".md", tables.markdown);
  return written;
}

}  // namespace isac::record
