#include "isac/runtime/control_setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <span>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/params.hpp"
#include "isac/record/sha256.hpp"
#include "isac/record/tables.hpp"

namespace isac::runtime {
namespace {

namespace fs = std::filesystem;

constexpr double kOvershoot = 1.1, kSpeedMargin = 1.5, kForceWarning = 0.9;

[[noreturn]] void refuse(const std::string& code, const std::string& text,
                         const std::filesystem::path& file) {
  throw Error(ErrorKind::kBadInput, code, text, {file.string(), 0, 0});
}

void narrow(control::JointLimits<double>& limits, const record::RigLimits& rig) {
  limits.delta_pressure = std::min(limits.delta_pressure, rig.delta_pressure);
  limits.pressure = std::min(limits.pressure, rig.pressure);
  limits.angle_low = std::max(limits.angle_low, -rig.angle);
  limits.angle_high = std::min(limits.angle_high, rig.angle);
  limits.speed = std::min(limits.speed, rig.speed);
}

control::JointWatchSettings<double> watch_of(const record::RigLimits& rig, const SetupWishes& wishes) {
  return {.pressure = {.soft = rig.pressure, .hard = kOvershoot * rig.pressure},
          .delta_pressure = {.soft = rig.delta_pressure, .hard = kOvershoot * rig.delta_pressure},
          .angle = {.soft = rig.angle, .hard = kOvershoot * rig.angle},
          .speed = {.soft = rig.speed, .hard = kSpeedMargin * rig.speed},
          .force = {.soft = kForceWarning * rig.force, .hard = rig.force},
          .following = wishes.following,
          .following_time = wishes.following_time};
}

void finish(ControlSettings& settings, const record::Rig& rig, const SetupWishes& wishes) {
  settings.fault.period = std::llround(1e9 / wishes.rate);
  settings.fault.stale_after = std::max<std::int64_t>(5'000'000, 2 * settings.fault.period);
  for (auto& joint : settings.joint) {
    narrow(joint.limits, rig.limits);
    joint.structure = wishes.structure;
    if (wishes.structure == control::Structure::kPid) joint.position = wishes.pid;
  }
  settings.watch.fill(watch_of(rig.limits, wishes));
  settings.encoder.fill(
      {.largest_speed = kSpeedMargin * rig.limits.speed, .frozen_pressure = 0.5 * kPascalPerKgfCm2});
}

}  // namespace

LoadedTable load_table(const std::filesystem::path& path) {
  LoadedTable loaded;
  loaded.source = path.filename().string() + " sha256:" + record::sha256_of_file(path);
  std::ifstream file(path, std::ios::binary);
  std::string magic(models::kParameterTableMagic.size(), '\0');
  file.read(magic.data(), static_cast<std::streamsize>(magic.size()));
  if (magic != std::string_view(models::kParameterTableMagic.data(), models::kParameterTableMagic.size())) {
    loaded.table = record::parameter_table(record::read_params(path), &loaded.warnings);
    return loaded;
  }
  const std::string bytes = magic + std::string(std::istreambuf_iterator<char>(file), {});
  const Status status = models::load_parameter_table(std::as_bytes(std::span(bytes)), loaded.table);
  if (!ok(status)) {
    refuse("table_refused",
           std::string("the parameter table is refused: ") + describe(status) +
               "; make it anew with isac-identify export",
           path);
  }
  return loaded;
}

ControlSettings control_settings(const models::ParameterTable& table, const record::Rig& rig,
                                 const SetupWishes& wishes, Warnings& warnings) {
  ControlSettings settings;
  int left_out = 0;
  for (int k = 0; k < table.joint_count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const std::string joint = "joint " + std::to_string(k + 1);
    if (const Status status = control::settings_of(table, k, settings.joint[i]); !ok(status)) {
      refuse(
          "parameters_incomplete",
          joint +
              " cannot be driven with these parameters: it needs A, B, C, D, wheel radius, p0 and the four "
              "gains, within limits (" +
              describe(status) + "); fit and tune it first",
          {});
    }
    int others = 0;
    if (const Status status = control::feed_forward_of(table, k, settings.feed_forward[i], others);
        !ok(status)) {
      refuse("effect_unknown",
             joint +
                 " has an effect that this program does not know; use the program that "
                 "fitted it",
             {});
    }
    left_out += others;
    control::JointSettings<double>& own = settings.joint[i];
    own.predict_dead_time = wishes.predict_dead_time;
    if (wishes.predict_dead_time && !(own.inertia > 0 && own.valve.dead_time > 0)) {
      refuse("predictor_without_model",
             joint +
                 " has no inertia or no dead time of its valve in these parameters; identify the valve unit "
                 "and give the "
                 "inertia, or leave the predictor out",
             {});
    }
  }
  if (left_out > 0) {
    warnings.push_back(
        {"effects_not_fed_forward",
         fmt::format("{} effect{} of the model cannot be fed forward and {} left to the feedback", left_out,
                     left_out == 1 ? "" : "s", left_out == 1 ? "is" : "are")});
  }
  finish(settings, rig, wishes);
  return settings;
}

control::PidGains<double> testbed_pid_gains() noexcept {
  return {.proportional = 0.4 * kPascalPerKgfCm2,
          .integral = 7.0 * kPascalPerKgfCm2,
          .derivative = 0.08 * kPascalPerKgfCm2};
}

void compensate_arm(ControlSettings& settings, const record::ArmFile& arm,
                    const models::ParameterTable& table, const fs::path& arm_file) {
  if (arm.joints != table.joint_count) {
    refuse(
        "arm_of_other_joints",
        fmt::format("the arm has {} joints and the parameters are of {}; give the arm that belongs to them",
                    arm.joints, table.joint_count),
        arm_file);
  }
  settings.compensate = true;
  settings.chain = arm.chain;
  settings.coupling = arm.coupling;
  for (std::size_t i = 0; i < arm.middle.size(); ++i) settings.chain.links[i].theta_offset += arm.middle[i];
  if (table.has_masses) {
    if (arm.mass_names.size() != table.masses.size()) {
      refuse("arm_of_other_masses",
             fmt::format(
                 "the arm has {} masses and the parameters have {}; identify the masses with this arm file",
                 arm.mass_names.size(), table.masses.size()),
             arm_file);
    }
    for (std::size_t m = 0; m < table.masses.size(); ++m) settings.chain.masses[m].mass = table.masses[m];
  }
  for (int k = 0; k < arm.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    control::JointLimits<double>& limits = settings.joint[i].limits;
    limits.angle_low = std::max(limits.angle_low, arm.limits.lower[i]);
    limits.angle_high = std::min(limits.angle_high, arm.limits.upper[i]);
  }
}

control::ArmReach<double> reach_of(const record::ArmFile& arm, const ControlSettings& settings,
                                   const fs::path& arm_file) {
  control::ArmReach<double> reach;
  reach.geometry.l1 = arm.chain.links[0].d;
  reach.geometry.l2 = arm.chain.links[2].d;
  reach.geometry.l3 = -arm.chain.links[2].a;
  reach.geometry.l4 = arm.chain.links[3].d;
  reach.geometry.l5 = -arm.chain.tool.x;
  const models::Chain<double, 6> known = models::soft_arm_chain(reach.geometry);
  constexpr double kSame = 1e-9;  // m, rad: what a length in a text file is good for
  bool same = arm.joints == 6 && arm.chain.tool_link == known.tool_link &&
              std::abs(arm.chain.tool.y) + std::abs(arm.chain.tool.z) < kSame;
  for (std::size_t i = 0; i < known.links.size(); ++i) {
    const models::DhLink<double>&a = arm.chain.links[i], &b = known.links[i];
    same = same && std::abs(a.alpha - b.alpha) + std::abs(a.a - b.a) + std::abs(a.d - b.d) +
                           std::abs(a.theta_offset - b.theta_offset) <
                       kSame;
  }
  if (!same) {
    refuse("arm_without_inverse",
           "is not built like the seed's arm (table 4.1), whose inverse kinematics alone is known; give "
           "points of joint "
           "angles to isac-run trajectory instead",
           arm_file);
  }
  reach.coupling = arm.coupling;
  reach.middle = arm.middle;
  for (std::size_t i = 0; i < reach.speed.size(); ++i) {
    const control::JointLimits<double>& limits = settings.joint[i].limits;
    reach.limits.lower[i] = limits.angle_low;
    reach.limits.upper[i] = limits.angle_high;
    reach.speed[i] = limits.speed;
  }
  return reach;
}

ControlSettings testbed_control_settings(const record::Rig& rig, const SetupWishes& wishes) {
  ControlSettings settings;
  settings.joint[0] = control::testbed_settings<double>();
  finish(settings, rig, wishes);
  return settings;
}

std::string finding_words(const control::Finding& finding) {
  using control::FaultCode;
  std::string where;
  const bool channel = finding.code == FaultCode::kInputCode || finding.code == FaultCode::kInputAtEnd;
  if (finding.joint >= 0 && !channel) where = fmt::format("joint {}: ", finding.joint + 1);
  if (finding.joint >= 0 && channel) where = fmt::format("channel {}: ", finding.joint);
  struct Shown {
    double scale;
    const char* unit;
  };
  const Shown shown = [&]() -> Shown {
    switch (finding.code) {
      case FaultCode::kPressureLimit:
      case FaultCode::kDeltaPressureLimit:
        return {1.0 / kPascalPerKgfCm2, "kg/cm2"};
      case FaultCode::kAngleLimit:
      case FaultCode::kFollowingError:
        return {1.0, "rad"};
      case FaultCode::kSpeedLimit:
        return {1.0, "rad/s"};
      case FaultCode::kForceLimit:
        return {1.0, "N"};
      case FaultCode::kTorqueLimit:
        return {1.0, "N m"};
      case FaultCode::kInputCode:
      case FaultCode::kInputAtEnd:
      case FaultCode::kEncoderJump:
        return {1.0, "counts"};
      case FaultCode::kStaleSample:
        return {1.0, "s"};
      case FaultCode::kOverrun:
        return {1.0, "late cycles"};
      default:
        return {0.0, ""};
    }
  }();
  std::string text = where + describe(finding.code);
  if (shown.scale != 0.0) {
    text += fmt::format(" ({:.4g} {}, limit {:.4g} {})", shown.scale * static_cast<double>(finding.value),
                        shown.unit, shown.scale * static_cast<double>(finding.limit), shown.unit);
  }
  return text;
}

}  // namespace isac::runtime
