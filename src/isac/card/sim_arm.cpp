#include "isac/card/sim_arm.hpp"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/arm_file.hpp"
#include "isac/simulate/random.hpp"

namespace isac::card {
namespace {

using Text = std::string_view;

constexpr double kStepsPerTurn = 8000;
constexpr double kFullPressure = 5.0 * kPascalPerKgfCm2;  // at the highest code
constexpr double kFrictionAt = 2.0 * kPascalPerKgfCm2;    // Δp of the torque that `friction` is a share of
constexpr double kPlantStep = 5e-4;  // s; without slack nothing is stiffer than the friction
constexpr std::int64_t kPlantStepNs = 500'000, kReadTimeNs = 1000;

/// What the words say before the arm is put together.
struct ArmWords {
  std::string file;
  double friction = 0.01, load = 0, inertia = 0.002, lag = 0.17, valve_scatter = 0;
  std::uint64_t seed = 1;
  simulate::ArmVector pull{}, spring{}, zero{};
};

[[noreturn]] void refuse(Text option, Text value, const std::string& expected) {
  throw Error(ErrorKind::kUsage, "sim_option_value",
              "sim:arm= option '" + std::string(option) + "' has '" + std::string(value) + "'; it needs " +
                  expected + ".");
}

template <class Number>
bool parse(Text text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

double number(Text option, Text text, double low, double high) {
  double value = 0;
  if (!parse(text, value) || !(value >= low) || !(value <= high)) {
    std::array<char, 96> range{};
    std::snprintf(range.data(), range.size(), "a number from %g to %g", low, high);
    refuse(option, text, range.data());
  }
  return value;
}

/// "J:X": a number for one joint.
void of_joint(Text option, Text text, double limit, simulate::ArmVector& out) {
  const auto colon = text.find(':');
  unsigned joint = 0;
  if (colon == Text::npos || !parse(text.substr(0, colon), joint) || joint < 1 ||
      joint > simulate::kArmJoints)
    refuse(option, text, "a joint from 1 to 6, a colon and a number, like 2:0.3");
  out[joint - 1] = number(option, text.substr(colon + 1), -limit, limit);
}

struct Option {
  const char* name;
  const char* help;
  void (*apply)(ArmWords& words, Text name, Text value);
};

constexpr std::array kOptions{
    Option{"arm", "FILE: arm.toml of the arm as it truly is", [](ArmWords& w, Text, Text v) { w.file = v; }},
    Option{"friction", "share of each joint's torque at 2 kg/cm2 (0.01)",
           [](ArmWords& w, Text n, Text v) { w.friction = number(n, v, 0, 0.5); }},
    Option{"load", "kg in the hand (0)", [](ArmWords& w, Text n, Text v) { w.load = number(n, v, 0, 10); }},
    Option{"pull", "J:X, N m: a hose pulls on joint J",
           [](ArmWords& w, Text n, Text v) { of_joint(n, v, 100, w.pull); }},
    Option{"spring", "J:X, N m/rad: a hose springs back on joint J",
           [](ArmWords& w, Text n, Text v) { of_joint(n, v, 1000, w.spring); }},
    Option{"zero", "J:X, rad: the encoder of joint J reads X too much",
           [](ArmWords& w, Text n, Text v) { of_joint(n, v, 1, w.zero); }},
    Option{"inertia", "kg m2, of each joint itself (0.002)",
           [](ArmWords& w, Text n, Text v) { w.inertia = number(n, v, 1e-4, 10); }},
    Option{"T_C", "s, lag of the valve units (0.17)",
           [](ArmWords& w, Text n, Text v) { w.lag = number(n, v, 1e-3, 10); }},
    Option{"valve_scatter", "kg/cm2, standard deviation of the valves' offsets (0)",
           [](ArmWords& w, Text n, Text v) { w.valve_scatter = number(n, v, 0, 1); }},
    Option{"seed", "whole number, 1: of that scatter",
           [](ArmWords& w, Text n, Text v) {
             if (!parse(v, w.seed)) refuse(n, v, "a whole number not below 0");
           }},
};

void apply(ArmWords& words, Text word) {
  const auto equals = word.find('=');
  const Text name = word.substr(0, equals);
  std::string known;
  for (const Option& option : kOptions) {
    if (name == option.name && equals != Text::npos)
      return option.apply(words, name, word.substr(equals + 1));
    known += (known.empty() ? "" : ", ") + std::string(option.name);
  }
  throw Error(
      ErrorKind::kUsage, "sim_option_unknown",
      "sim:arm= has no option '" + std::string(word) + "'; it knows " + known + ", each with = and a value.");
}

ArmWords words_of(Text text) {
  ArmWords words;
  while (!text.empty()) {
    const auto comma = text.find(',');
    apply(words, text.substr(0, comma));
    text.remove_prefix(comma == Text::npos ? text.size() : comma + 1);
  }
  return words;
}

simulate::ArmPlantConfig plant_of(const record::ArmFile& file, const ArmWords& words) {
  bool complete =
      file.joints == static_cast<int>(simulate::kArmJoints) && file.actuators.size() == simulate::kArmJoints;
  for (const record::ArmActuator& a : file.actuators)
    complete = complete && std::isfinite(a.A + a.B + a.C + a.D + a.wheel_radius);
  if (!complete) {
    throw Error(ErrorKind::kBadInput, "arm_incomplete",
                "cannot be simulated: that needs six joints and six [[actuator]] with A, B, C, D and "
                "chain_wheel_diameter",
                {words.file, 0, 0});
  }
  simulate::ArmPlantConfig config;
  config.chain = file.chain;
  config.coupling = file.coupling;
  config.load = words.load;
  config.step = kPlantStep;
  simulate::Random random(words.seed, simulate::Random::kCalibration);
  for (std::size_t i = 0; i < simulate::kArmJoints; ++i) {
    const record::ArmActuator& a = file.actuators[i];
    config.chain.links[i].theta_offset += file.middle[i];
    simulate::ArmJointConfig& joint = config.joints[i];
    joint.muscle = {.A = a.A, .B = a.B, .C = a.C, .D = a.D};
    joint.wheel_radius = a.wheel_radius;
    joint.inertia = words.inertia;
    joint.friction = words.friction * a.B * a.wheel_radius * kFrictionAt;
    joint.pull = words.pull[i];
    joint.pull_stiffness = words.spring[i];
    for (simulate::ValveUnit& valve : joint.valve) {
      valve.fill_lag = valve.vent_lag = words.lag;
      valve.offset = words.valve_scatter * kPascalPerKgfCm2 * random.normal();
    }
  }
  return config;
}

double pascal(std::uint32_t code) noexcept {
  return static_cast<double>(code) * kFullPressure / SimArmCard::kMaxValveCode;
}

}  // namespace

bool names_an_arm(std::string_view text) {
  return text.starts_with("arm=") || text.find(",arm=") != Text::npos;
}

SimArmConfig parse_sim_arm(std::string_view text) {
  const ArmWords words = words_of(text);
  return {.plant = plant_of(record::read_arm(words.file), words), .encoder_zero = words.zero};
}

Opened open_sim_arm(std::string_view text) {
  const SimArmConfig config = parse_sim_arm(text);
  return {.card = std::make_unique<SimArmCard>(std::make_shared<simulate::ArmPlant>(config.plant),
                                               config.encoder_zero),
          .person = nullptr};
}

std::string sim_arm_help() {
  std::string help;
  for (const Option& option : kOptions) help += "  " + std::string(option.name) + "=  " + option.help + "\n";
  return help;
}

SimArmCard::SimArmCard(std::shared_ptr<simulate::ArmPlant> plant, const simulate::ArmVector& encoder_zero)
    : encoder_zero_(encoder_zero), plant_(std::move(plant)) {
  plant_->rest_at({}, 0);
  command_plant();
}

SimArmCard::~SimArmCard() {
  plant_->command({});
}

Shape SimArmCard::shape() const noexcept {
  return {.encoders = kEncoders,
          .inputs = 0,
          .outputs = kOutputs,
          .encoder_modulus = kEncoderModulus,
          .input_max_code = kMaxValveCode,
          .output_max_code = kMaxValveCode};
}

Status SimArmCard::wait_until(std::int64_t time_ns) noexcept {
  apply_vent();
  if (time_ns <= now_ns_) return Status::kOk;
  const std::int64_t begun = now_ns_ / kPlantStepNs, end = time_ns / kPlantStepNs;
  now_ns_ = time_ns;
  return plant_->run(static_cast<double>(end - begun) * kPlantStep);
}

Status SimArmCard::read(Sample& sample) noexcept {
  apply_vent();
  sample = Sample{};
  sample.time_ns = last_stamp_ns_ = std::max(now_ns_, last_stamp_ns_ + 1);
  for (std::size_t i = 0; i < simulate::kArmJoints; ++i) {
    const double steps = std::floor((plant_->angle()[i] + encoder_zero_[i]) * kStepsPerTurn / (2 * kPi));
    if (!std::isfinite(steps)) return Status::kDeviceError;
    sample.encoder[i] = static_cast<std::uint32_t>(static_cast<std::int64_t>(steps)) & (kEncoderModulus - 1);
  }
  now_ns_ += kReadTimeNs;
  return Status::kOk;
}

Status SimArmCard::write(const Command& command) noexcept {
  apply_vent();
  for (const std::uint32_t code : command.output)
    if (code > kMaxValveCode) return Status::kOutOfRange;
  outputs_ = command;
  command_plant();
  return Status::kOk;
}

Status SimArmCard::vent() noexcept {
  vent_asked_.store(true, std::memory_order_release);
  return Status::kOk;
}

Status SimArmCard::outputs(Command& command) const noexcept {
  command = vent_asked_.load(std::memory_order_acquire) ? Command{} : outputs_;
  return Status::kOk;
}

void SimArmCard::apply_vent() noexcept {
  if (!vent_asked_.exchange(false, std::memory_order_acq_rel)) return;
  outputs_ = Command{};
  command_plant();
}

void SimArmCard::command_plant() noexcept {
  simulate::ArmPressures u{};
  for (std::size_t i = 0; i < simulate::kArmJoints; ++i)
    u[i] = {pascal(outputs_.output[2 * i]), pascal(outputs_.output[2 * i + 1])};
  plant_->command(u);
}

}  // namespace isac::card
