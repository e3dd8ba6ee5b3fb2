#include "isac/record/rig.hpp"

#include <charconv>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>

#include "isac/record/toml_document.hpp"
#include "isac/record/toml_quantity.hpp"

namespace isac::record {
namespace {

enum class Sign { kPositive, kNotNegative };

/// A quantity that replaces `target` where the file gives it, held to its sign.
void read_into(const TomlSection& section, std::string_view key, const Dimension& dimension, Sign sign,
               double& target, double factor = 1) {
  const auto value = section.quantity(key, dimension);
  if (!value) return;
  if (*value < 0 || (sign == Sign::kPositive && *value * factor == 0)) {
    section.fail(key, "value_out_of_range",
                 "'" + std::string(key) + "' is " + shown(*section.raw().get(key)) + "; it must be " +
                     (sign == Sign::kPositive ? "greater than zero" : "zero or more"));
  }
  target = *value * factor;
}

void read_joint(const toml::table& table, const std::string& file, RigJoint& joint) {
  const TomlSection section(table, "joint", file, {"chain_wheel_diameter", "initial_pressure", "inertia"});
  read_into(section, "chain_wheel_diameter", dimension::kLength, Sign::kPositive, joint.wheel_radius, 0.5);
  read_into(section, "initial_pressure", dimension::kPressure, Sign::kPositive, joint.initial_pressure);
  read_into(section, "inertia", dimension::kInertia, Sign::kPositive, joint.inertia);
}

void read_encoder(const toml::table& table, const std::string& file, RigEncoder& encoder) {
  const TomlSection section(table, "encoder", file, {"steps_per_turn", "middle"});
  if (const auto steps = section.number("steps_per_turn")) {
    if (!(*steps > 0) || !std::isfinite(*steps)) {
      section.fail("steps_per_turn", "value_out_of_range",
                   "'steps_per_turn' is " + shown(*section.raw().get("steps_per_turn")) +
                       "; it must be greater than zero");
    }
    encoder.steps_per_turn = *steps;
  }
  if (const auto middle = section.quantity("middle", dimension::kCount)) {
    if (*middle != std::nearbyint(*middle) || std::abs(*middle) > std::numeric_limits<int>::max()) {
      section.fail("middle", "value_out_of_range",
                   "'middle' is " + shown(*section.raw().get("middle")) + "; write a whole number of counts");
    }
    encoder.middle_count = static_cast<int>(*middle);
  }
}

void read_sensors(const toml::table& table, const std::string& file, RigSensors& sensors) {
  const TomlSection section(table, "sensors", file,
                            {"force_noise", "pressure_noise", "angle_noise", "torque_noise", "force_lag"});
  read_into(section, "force_noise", dimension::kForce, Sign::kNotNegative, sensors.force_noise);
  read_into(section, "pressure_noise", dimension::kPressure, Sign::kNotNegative, sensors.pressure_noise);
  read_into(section, "angle_noise", dimension::kAngle, Sign::kNotNegative, sensors.angle_noise);
  read_into(section, "torque_noise", dimension::kTorque, Sign::kNotNegative, sensors.torque_noise);
  read_into(section, "force_lag", {.time = 1}, Sign::kNotNegative, sensors.force_lag);
}

void read_limits(const toml::table& table, const std::string& file, RigLimits& limits) {
  const TomlSection section(table, "limits", file, {"delta_pressure", "pressure", "angle", "speed", "force"});
  read_into(section, "delta_pressure", dimension::kPressure, Sign::kPositive, limits.delta_pressure);
  read_into(section, "pressure", dimension::kPressure, Sign::kPositive, limits.pressure);
  read_into(section, "angle", dimension::kAngle, Sign::kPositive, limits.angle);
  read_into(section, "speed", dimension::kAngularVelocity, Sign::kPositive, limits.speed);
  read_into(section, "force", dimension::kForce, Sign::kPositive, limits.force);
}

void read_card(const toml::table& table, const std::string& file, RigCard& card) {
  const TomlSection section(table, "card", file, {"device", "sample_rate"});
  card.device = section.text("device").value_or("");
  read_into(section, "sample_rate", {.time = -1}, Sign::kPositive, card.sample_rate);
}

/// What a channel's signal is measured in; nothing for a signal of the user's own.
const Dimension* dimension_of_signal(std::string_view signal) {
  static constexpr Dimension kPressure = dimension::kPressure, kForce = dimension::kForce,
                             kTorque = dimension::kTorque, kAngle = dimension::kAngle;
  if (signal == "F1" || signal == "F2" || signal == "force") return &kForce;
  if (signal == "p1" || signal == "p2" || signal == "p1_cmd" || signal == "p2_cmd" || signal == "pressure" ||
      signal == "p_supply") {
    return &kPressure;
  }
  if (signal == "torque" || signal.starts_with("tau")) return &kTorque;
  if (signal == "angle" || signal.starts_with("phi") || signal.starts_with("theta")) return &kAngle;
  return nullptr;
}

bool is_channel(std::string_view channel) {
  int index = -1;
  const std::size_t letters = channel.find_first_of("0123456789");
  if (letters == std::string_view::npos) return false;
  const auto [end, error] = std::from_chars(channel.data() + letters, channel.data() + channel.size(), index);
  if (error != std::errc() || end != channel.data() + channel.size()) return false;
  if (channel.size() - letters > 1 && channel[letters] == '0') return false;
  const std::string_view kind = channel.substr(0, letters);
  return (kind == "ai" && index <= 7) || (kind == "ao" && index <= 11) || (kind == "enc" && index <= 5);
}

/// The gain in SI per count, "0.0488 N/count"; its unit must fit the signal.
double read_gain(const TomlSection& section, const std::string& signal) {
  const auto text = section.text("gain");
  if (!text)
    section.fail("gain", "value_missing",
                 "a [[calibration]] has no 'gain'; add one, like gain = \"0.0488 N/count\"");
  const Quantity gain = parse_quantity(*text);
  const auto refuse = [&section, &text](const char* code, const std::string& why) {
    section.fail("gain", code, "'gain' is " + toml_string(*text) + ", " + why);
  };
  if (gain.problem == Quantity::Problem::kNoNumber || gain.problem == Quantity::Problem::kNotFinite) {
    refuse("number_missing", "which is not a number with a unit; write it like \"0.0488 N/count\"");
  }
  Dimension wanted = gain.unit.dimension;
  if (const Dimension* known = dimension_of_signal(signal)) wanted = *known;
  wanted.count = -1;
  if (gain.problem != Quantity::Problem::kNone || gain.unit.dimension != wanted) {
    const Dimension signal_dimension =
        dimension_of_signal(signal) ? *dimension_of_signal(signal) : dimension::kForce;
    refuse("dimension_wrong", "and " + signal + " needs a unit per count, like \"0.0488 " +
                                  std::string(usual_unit(signal_dimension)) + "/count\"");
  }
  if (gain.value == 0) refuse("value_out_of_range", "and a channel of gain zero tells nothing; calibrate it");
  return gain.value;
}

RigChannel read_channel(const toml::table& table, const std::string& file) {
  const TomlSection section(table, "[calibration]", file, {"signal", "channel", "offset", "gain"});
  RigChannel channel;
  const auto signal = section.text("signal");
  if (!signal || signal->empty()) {
    section.fail("signal", "value_missing",
                 "a [[calibration]] has no 'signal'; add one, like signal = \"F1\"");
  }
  const auto name = section.text("channel");
  if (!name || !is_channel(*name)) {
    section.fail("channel", "value_out_of_range",
                 "'channel' is " + (name ? toml_string(*name) : std::string("missing")) +
                     "; write one of ai0…ai7, ao0…ao11, enc0…enc5");
  }
  channel.signal = *signal;
  channel.channel = *name;
  channel.offset = section.quantity("offset", dimension::kCount).value_or(0.0);
  channel.gain = read_gain(section, channel.signal);
  return channel;
}

/// Lines "key = "value unit"" of what is given.
class Lines {
 public:
  explicit Lines(std::string header) : header_(std::move(header)) {}
  void quantity(std::string_view key, double value, std::string_view unit) {
    if (std::isnan(value)) return;
    std::string number = exact_number(value);
    if (number.ends_with(".0")) number.resize(number.size() - 2);
    body_ += std::string(key) + " = \"" + number + " " + std::string(unit) + "\"\n";
  }
  void raw(std::string_view key, const std::string& value) {
    body_ += std::string(key) + " = " + value + "\n";
  }
  [[nodiscard]] std::string text(bool even_if_empty = false) const {
    return body_.empty() && !even_if_empty ? std::string() : "\n" + header_ + "\n" + body_;
  }

 private:
  std::string header_, body_;
};

}  // namespace

Rig parse_rig(const std::string& text, const std::string& file) {
  const toml::table root = parse_toml(text, file);
  const TomlSection top(root, "", file,
                        {"format", "name", "joint", "encoder", "sensors", "limits", "card", "calibration"});
  top.require_format("isac.rig/1");
  Rig rig;
  rig.name = top.text("name").value_or("");
  const toml::table* joint = top.table("joint");
  if (joint == nullptr) {
    throw Error(ErrorKind::kBadInput, "section_missing",
                "has no section [joint]; add it, with chain_wheel_diameter = \"38 mm\" and initial_pressure "
                "= \"3.0 kg/cm2\"",
                {file, 1, 1});
  }
  read_joint(*joint, file, rig.joint);
  if (const auto* table = top.table("encoder")) read_encoder(*table, file, rig.encoder);
  if (const auto* table = top.table("sensors")) read_sensors(*table, file, rig.sensors);
  if (const auto* table = top.table("limits")) read_limits(*table, file, rig.limits);
  if (const auto* table = top.table("card")) read_card(*table, file, rig.card);
  std::set<std::string> signals, channels;
  for (const toml::table* table : top.tables("calibration")) {
    rig.calibration.push_back(read_channel(*table, file));
    const RigChannel& channel = rig.calibration.back();
    if (!signals.insert(channel.signal).second || !channels.insert(channel.channel).second) {
      fail_at(*table, file, "channel_twice",
              "calibrates signal '" + channel.signal + "' or channel '" + channel.channel +
                  "' a second time; keep one of them");
    }
  }
  return rig;
}

Rig read_rig(const std::filesystem::path& path) {
  return parse_rig(read_text_file(path), path.string());
}

std::string format_rig(const Rig& rig) {
  std::string out = "format = \"isac.rig/1\"\n";
  if (!rig.name.empty()) out += "name = " + toml_string(rig.name) + "\n";

  Lines joint("[joint]");
  joint.quantity("chain_wheel_diameter", 2 * rig.joint.wheel_radius, "m");
  joint.quantity("initial_pressure", rig.joint.initial_pressure, "Pa");
  joint.quantity("inertia", rig.joint.inertia, "kg m2");

  Lines encoder("[encoder]");
  encoder.raw("steps_per_turn", exact_number(rig.encoder.steps_per_turn));
  encoder.raw("middle", "\"" + std::to_string(rig.encoder.middle_count) + " count\"");

  Lines sensors("[sensors]");
  sensors.quantity("force_noise", rig.sensors.force_noise, "N");
  sensors.quantity("pressure_noise", rig.sensors.pressure_noise, "Pa");
  sensors.quantity("angle_noise", rig.sensors.angle_noise, "rad");
  sensors.quantity("torque_noise", rig.sensors.torque_noise, "N m");
  sensors.quantity("force_lag", rig.sensors.force_lag, "s");

  Lines limits("[limits]");
  limits.quantity("delta_pressure", rig.limits.delta_pressure, "Pa");
  limits.quantity("pressure", rig.limits.pressure, "Pa");
  limits.quantity("angle", rig.limits.angle, "rad");
  limits.quantity("speed", rig.limits.speed, "rad/s");
  limits.quantity("force", rig.limits.force, "N");

  Lines card("[card]");
  if (!rig.card.device.empty()) card.raw("device", toml_string(rig.card.device));
  card.quantity("sample_rate", rig.card.sample_rate, "Hz");

  out += joint.text(true) + encoder.text() + sensors.text() + limits.text() + card.text();
  for (const RigChannel& channel : rig.calibration) {
    Lines lines("[[calibration]]");
    lines.raw("signal", toml_string(channel.signal));
    lines.raw("channel", toml_string(channel.channel));
    lines.quantity("offset", channel.offset, "count");
    const Dimension* dimension = dimension_of_signal(channel.signal);
    const char* unit = dimension != nullptr ? si_unit_text(*dimension) : "1";
    lines.quantity("gain", channel.gain, std::string(unit) + "/count");
    out += lines.text();
  }
  return out;
}

}  // namespace isac::record
