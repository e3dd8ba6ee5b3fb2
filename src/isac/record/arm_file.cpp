#include "isac/record/arm_file.hpp"

#include <array>
#include <cmath>
#include <set>

#include "isac/record/toml_document.hpp"
#include "isac/record/toml_quantity.hpp"

namespace isac::record {
namespace {

constexpr Dimension kStiffness{.mass = 1, .time = -2};
constexpr Dimension kPressureGain{.length = 2};
constexpr Dimension kCubicDamping{.length = 2, .mass = 1, .time = 1};
constexpr Dimension kDamping{.length = 2, .mass = 1, .time = -1};
constexpr Dimension kAcceleration{.length = 1, .time = -2};
constexpr std::size_t kMostJoints = 6;
using Row = models::JointVector<double, 6>;

void require_positive(const TomlSection& section, std::string_view key, double value) {
  if (value > 0) return;
  section.fail(
      key, "value_out_of_range",
      "'" + std::string(key) + "' is " + shown(*section.raw().get(key)) + "; it must be greater than zero");
}

void read_into(const TomlSection& section, std::string_view key, const Dimension& dimension, double& target) {
  if (const auto value = section.quantity(key, dimension)) target = *value;
}

void read_positive(const TomlSection& section, std::string_view key, const Dimension& dimension,
                   double& target, double factor = 1) {
  const auto value = section.quantity(key, dimension);
  if (!value) return;
  require_positive(section, key, *value);
  target = *value * factor;
}

/// `count` plain numbers in brackets.
std::vector<double> numbers(const toml::node& node, const std::string& file, const std::string& what,
                            std::size_t count) {
  const std::string mend = "; write " + std::to_string(count) + " plain numbers in square brackets";
  const auto* array = node.as_array();
  if (array == nullptr) fail_at(node, file, "type_wrong", what + " is " + shown(node) + mend);
  if (array->size() != count)
    fail_at(node, file, "length_wrong", what + " has " + std::to_string(array->size()) + " entries" + mend);
  std::vector<double> out;
  for (const toml::node& entry : *array) {
    const auto value = entry.value<double>();
    if (!entry.is_number() || !value || !std::isfinite(*value))
      fail_at(entry, file, "type_wrong", what + " holds " + shown(entry) + mend);
    out.push_back(*value);
  }
  return out;
}

models::Vec3<double> read_position(const TomlSection& section, const std::string& file) {
  const auto texts = section.texts("position");
  const std::string mend = R"(; write three lengths, like ["-165 mm", "0 mm", "200 mm"])";
  if (texts.size() != 3) {
    section.fail("position", texts.empty() ? "value_missing" : "length_wrong",
                 "'position' has " + std::to_string(texts.size()) + " entries" + mend);
  }
  std::array<double, 3> xyz{};
  for (std::size_t i = 0; i < 3; ++i) {
    const Quantity quantity = parse_quantity(texts[i]);
    if (quantity.problem != Quantity::Problem::kNone || quantity.unit.dimension != dimension::kLength) {
      const toml::node& entry = *section.raw().get("position")->as_array()->get(i);
      fail_at(entry, file, quantity.problem == Quantity::Problem::kNone ? "dimension_wrong" : "unit_unknown",
              "'position' holds " + toml_string(texts[i]) + ", which is not a length" + mend);
    }
    xyz[i] = quantity.value;
  }
  return {xyz[0], xyz[1], xyz[2]};
}

int read_link(const TomlSection& section, int joints) {
  const auto link = section.number("link");
  if (!link) section.fail("link", "value_missing", "says no 'link'; add it, counted from 1 at the base");
  if (!(*link >= 1 && *link <= joints && *link == std::floor(*link))) {
    section.fail(
        "link", "value_out_of_range",
        "'link' is " + shown(*section.raw().get("link")) + "; write one of 1 to " + std::to_string(joints));
  }
  return static_cast<int>(*link) - 1;
}

void read_joint(const toml::table& table, const std::string& file, std::size_t index, ArmFile& arm) {
  const TomlSection section(table, "[joint]", file, {"alpha", "a", "d", "theta_offset", "middle"});
  models::DhLink<double>& link = arm.chain.links[index];
  read_into(section, "alpha", dimension::kAngle, link.alpha);
  read_into(section, "a", dimension::kLength, link.a);
  read_into(section, "d", dimension::kLength, link.d);
  read_into(section, "theta_offset", dimension::kAngle, link.theta_offset);
  read_into(section, "middle", dimension::kAngle, arm.middle[index]);
}

void read_mass(const toml::table& table, const std::string& file, ArmFile& arm) {
  const TomlSection section(table, "[mass]", file, {"name", "link", "position", "value"});
  const auto name = section.text("name");
  if (!name || name->empty())
    section.fail("name", "value_missing", "a [[mass]] has no 'name'; add one, like name = \"m1\"");
  for (const std::string& other : arm.mass_names) {
    if (other == *name)
      section.fail("name", "name_twice",
                   "a second mass is called " + toml_string(*name) + "; give it another name");
  }
  models::PointMass<double>& mass = arm.chain.masses[arm.mass_names.size()];
  mass.link = read_link(section, arm.joints);
  mass.position = read_position(section, file);
  mass.mass = 0;
  if (const auto value = section.quantity("value", dimension::kMass)) {
    if (*value < 0) require_positive(section, "value", *value);
    mass.mass = *value;
  }
  arm.mass_names.push_back(*name);
  arm.chain.mass_count = static_cast<int>(arm.mass_names.size());
}

ArmActuator read_actuator(const toml::table& table, const std::string& file, std::size_t index,
                          ArmFile& arm) {
  const TomlSection section(
      table, "[actuator]", file,
      {"lower", "upper", "A", "B", "C", "D", "A_error", "B_error", "chain_wheel_diameter", "torque_noise"});
  read_into(section, "lower", dimension::kAngle, arm.limits.lower[index]);
  read_into(section, "upper", dimension::kAngle, arm.limits.upper[index]);
  if (!(arm.limits.lower[index] < arm.limits.upper[index])) {
    section.fail(section.has("upper") ? "upper" : "lower", "value_out_of_range",
                 "the joint's 'upper' limit is not above its 'lower' one; exchange or mend them");
  }
  ArmActuator actuator;
  if (const auto stiffness = section.quantity("A", kStiffness)) {
    if (*stiffness >= 0) {
      section.fail("A", "value_out_of_range",
                   "'A' is " + shown(*section.raw().get("A")) + "; it must be below zero: muscles pull back");
    }
    actuator.A = *stiffness;
  }
  read_positive(section, "B", kPressureGain, actuator.B);
  read_positive(section, "C", kCubicDamping, actuator.C);
  read_positive(section, "D", kDamping, actuator.D);
  read_positive(section, "A_error", kStiffness, actuator.A_error);
  read_positive(section, "B_error", kPressureGain, actuator.B_error);
  read_positive(section, "chain_wheel_diameter", dimension::kLength, actuator.wheel_radius, 0.5);
  read_positive(section, "torque_noise", dimension::kTorque, actuator.torque_noise);
  return actuator;
}

void read_coupling(const TomlSection& top, const std::string& file, ArmFile& arm) {
  for (std::size_t i = 0; i < kMostJoints; ++i) arm.coupling[i][i] = 1;
  if (!top.has("coupling")) return;
  const toml::node& node = *top.raw().get("coupling");
  const auto joints = static_cast<std::size_t>(arm.joints);
  const auto* rows = node.as_array();
  if (rows == nullptr || rows->size() != joints) {
    fail_at(node, file, rows == nullptr ? "type_wrong" : "length_wrong",
            "'coupling' must be a list of " + std::to_string(joints) + " rows, one per arm angle");
  }
  for (std::size_t i = 0; i < joints; ++i) {
    const auto row = numbers(*rows->get(i), file, "a row of 'coupling'", joints);
    arm.coupling[i] = Row{};
    for (std::size_t j = 0; j < joints; ++j) arm.coupling[i][j] = row[j];
  }
  models::Coupling<double, 6> ignored;
  if (!ok(models::inverse_coupling<double, 6>(arm.coupling, ignored))) {
    fail_at(node, file, "value_out_of_range",
            "'coupling' cannot be inverted, so arm angles do not tell the joint angles; mend its rows");
  }
}

void read_gravity(const toml::table& table, const std::string& file, ArmFile& arm) {
  const TomlSection section(table, "gravity", file, {"acceleration", "direction"});
  double size = 9.81;
  read_positive(section, "acceleration", kAcceleration, size);
  std::vector<double> way{0, 0, -1};
  if (section.has("direction")) way = numbers(*section.raw().get("direction"), file, "'direction'", 3);
  const double length = std::hypot(way[0], way[1], way[2]);
  if (!(length > 0))
    section.fail("direction", "value_out_of_range",
                 "'direction' is no direction; write the way things fall, like [0, 0, -1]");
  arm.chain.gravity = {size * way[0] / length, size * way[1] / length, size * way[2] / length};
}

void require_list(const std::string& file, bool there, const char* list, const char* example) {
  if (there) return;
  throw Error(ErrorKind::kBadInput, "section_missing",
              "has no section [[" + std::string(list) + "]]; add one per " + list + ", with " + example,
              {file, 1, 1});
}

}  // namespace

ArmFile parse_arm(const std::string& text, const std::string& file) {
  const toml::table root = parse_toml(text, file);
  const TomlSection top(root, "", file,
                        {"format", "name", "joint", "coupling", "mass", "tool", "gravity", "actuator"});
  top.require_format("isac.arm/1");
  ArmFile arm;
  arm.name = top.text("name").value_or("");
  const auto joints = top.tables("joint");
  require_list(file, !joints.empty(), "joint", "alpha, a, d and theta_offset");
  if (joints.size() > kMostJoints)
    fail_at(*joints[kMostJoints], file, "too_many",
            "is joint " + std::to_string(kMostJoints + 1) + "; an arm may have six at most");
  arm.joints = static_cast<int>(joints.size());
  for (std::size_t i = 0; i < joints.size(); ++i) read_joint(*joints[i], file, i, arm);
  read_coupling(top, file, arm);
  const auto masses = top.tables("mass");
  require_list(file, !masses.empty(), "mass", "name, link and position");
  if (masses.size() > models::kMaxMasses)
    fail_at(*masses[models::kMaxMasses], file, "too_many",
            "is one mass too many; an arm may have " + std::to_string(models::kMaxMasses));
  for (const toml::table* mass : masses) read_mass(*mass, file, arm);
  arm.chain.tool_link = arm.joints - 1;
  if (const auto* table = top.table("tool")) {
    const TomlSection tool(*table, "tool", file, {"link", "position"});
    arm.chain.tool_link = read_link(tool, arm.joints);
    arm.chain.tool = read_position(tool, file);
  }
  if (const auto* gravity = top.table("gravity")) read_gravity(*gravity, file, arm);
  arm.limits.lower.fill(-kPi);
  arm.limits.upper.fill(kPi);
  const auto actuators = top.tables("actuator");
  if (!actuators.empty() && actuators.size() != joints.size())
    fail_at(*actuators.back(), file, "length_wrong",
            "there are " + std::to_string(actuators.size()) + " [[actuator]] and " +
                std::to_string(joints.size()) + " [[joint]]; give none or one each");
  for (std::size_t i = 0; i < actuators.size(); ++i)
    arm.actuators.push_back(read_actuator(*actuators[i], file, i, arm));
  return arm;
}

ArmFile read_arm(const std::filesystem::path& path) {
  return parse_arm(read_text_file(path), path.string());
}

}  // namespace isac::record
