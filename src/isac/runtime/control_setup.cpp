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
    if (wishes.measured_torque) joint.structure = control::Structure::kCascade;
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
