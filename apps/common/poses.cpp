#include "common/poses.hpp"

#include <algorithm>
#include <cmath>

#include "common/dataset.hpp"
#include "common/quantity.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/params.hpp"

namespace isac::apps {
namespace {

double error_of(double value) {
  return std::isfinite(value) ? value : 0;
}

estimate::MassArm mass_arm(const record::ArmFile& file) {
  estimate::MassArm arm;
  arm.chain = file.chain;
  arm.joints = file.joints;
  arm.coupling = file.coupling;
  arm.middle = file.middle;
  arm.limits = file.limits;
  arm.mass_names = file.mass_names;
  for (const record::ArmActuator& a : file.actuators)
    arm.actuators.push_back({a.A, a.B, a.wheel_radius, error_of(a.A_error), error_of(a.B_error)});
  return arm;
}

/// A, B and their standard errors from params.toml: the sections [[joint]] labelled "1", "2" ….
void take_actuators(const std::string& path, estimate::MassArm& arm) {
  const record::Params params = record::read_params(path);
  arm.actuators.resize(static_cast<std::size_t>(arm.joints));
  for (std::size_t j = 0; j < arm.actuators.size(); ++j) {
    const record::ParamsSection* section = params.find("joint", std::to_string(j + 1));
    if (section == nullptr) {
      throw Error(ErrorKind::kBadInput, "joint_missing",
                  "has no [[joint]] with label = \"" + std::to_string(j + 1) +
                      "\"; the actuators are told from there, one section per joint",
                  {path, 0, 0});
    }
    estimate::MassActuator& actuator = arm.actuators[j];
    for (const Estimated& value : section->values) {
      const auto unit = parse_unit(value.unit);
      if (!unit || !value.identifiable) continue;
      if (value.name == "A") {
        actuator.A = value.value * unit->scale;
        actuator.A_error = error_of(value.std_error) * unit->scale;
      } else if (value.name == "B") {
        actuator.B = value.value * unit->scale;
        actuator.B_error = error_of(value.std_error) * unit->scale;
      }
    }
    for (const auto& [name, value] : section->constants)
      if (name == "wheel_radius_m") actuator.wheel_radius = value;
  }
}

bool has_any(const series::Recording& recording, const std::string& family) {
  return std::any_of(recording.columns.begin(), recording.columns.end(), [&](const series::Column& column) {
    return column.name.size() == family.size() + 1 && column.name.starts_with(family) &&
           column.name.back() >= '1' && column.name.back() <= '6';
  });
}

/// Column `family`1… of a row; a missing column is NaN where `required` is false, else an error that names it.
void take(const series::Recording& recording, const std::string& family, int joints, std::size_t row,
          bool required, estimate::ArmVector& out) {
  for (int j = 0; j < joints; ++j) {
    const std::string name = family + std::to_string(j + 1);
    const series::Column* column = required ? &recording.column(name) : recording.find(name);
    out[static_cast<std::size_t>(j)] = column != nullptr ? column->values[row] : std::nan("");
  }
}

/// A column of plain numbers; counts and `1` are both fine.
double plain(const series::Recording& recording, const std::string& name, std::size_t row, double fallback) {
  const series::Column* column = recording.find(name);
  return column != nullptr && std::isfinite(column->values[row]) ? column->values[row] : fallback;
}

bool uses_actuator_angles(const series::Recording& recording, const PoseWords& words) {
  if (words.angles == "auto") return !has_any(recording, "theta") && has_any(recording, "phi");
  return words.angles == "phi";
}

void append_poses(const series::Recording& recording, const estimate::MassFitOptions& options, int joints,
                  bool many_files, std::vector<estimate::MassPose>& poses) {
  if (!options.from_pressures && !has_any(recording, "tau")) {
    (void)recording.column("tau1");  // throws, and says what the file has
  }
  for (std::size_t i = 0; i < recording.rows(); ++i) {
    estimate::MassPose pose;
    pose.name =
        (many_files ? short_name(recording.source) + " " : std::string()) + "row " + std::to_string(i + 1);
    pose.torque.fill(std::nan(""));
    pose.delta_pressure.fill(std::nan(""));
    take(recording, options.actuator_angles ? "phi" : "theta", joints, i, true, pose.angle);
    if (options.from_pressures) {
      take(recording, "dp", joints, i, false, pose.delta_pressure);
    } else {
      take(recording, "tau", joints, i, false, pose.torque);
    }
    pose.load = plain(recording, "load", i, 1);
    pose.target = std::lround(plain(recording, "pose", i, -1));
    const double side = plain(recording, "approach", i, 0);
    pose.approach = side > 0 ? 1 : side < 0 ? -1 : 0;
    poses.push_back(std::move(pose));
  }
}

estimate::MassFitOptions options_of(const PoseWords& words, const record::ArmFile& file) {
  estimate::MassFitOptions options;
  options.torques_by_model = words.by_model;
  if (words.torques == "gravity") options.sign = estimate::TorqueSign::kGravity;
  if (words.torques == "actuator") options.sign = estimate::TorqueSign::kActuator;
  for (std::size_t j = 0; j < file.actuators.size(); ++j)
    options.torque_noise[j] = file.actuators[j].torque_noise;
  if (!words.noise.empty()) {
    const double noise = parse_quantity(words.noise, dimension::kTorque, "--torque-noise");
    if (!(noise > 0))
      throw Error(ErrorKind::kUsage, "torque_noise", "--torque-noise must be greater than zero");
    options.torque_noise.fill(noise);
  }
  return options;
}

/// What a step of the encoders is worth in torque, joint by joint, where nothing is told of the noise: σ = |A| r² q/√12.
void take_resolution(const series::Recording& recording, const estimate::MassArm& arm,
                     estimate::MassFitOptions& options) {
  const auto found = recording.metadata.find("angle_resolution");
  if (!options.from_pressures || found == recording.metadata.end()) return;
  for (const double noise : options.torque_noise)
    if (std::isfinite(noise)) return;
  const double step = parse_quantity(found->second, dimension::kAngle, "# angle_resolution");
  for (std::size_t j = 0; j < arm.actuators.size(); ++j) {
    const estimate::MassActuator& a = arm.actuators[j];
    options.torque_noise[j] = -a.A * a.wheel_radius * a.wheel_radius * step / std::sqrt(12.0);
  }
}

}  // namespace

Poses read_poses(const PoseWords& words, bool hash) {
  Poses out;
  out.file = record::read_arm(words.arm);
  out.arm = mass_arm(out.file);
  if (!words.actuators.empty()) take_actuators(words.actuators, out.arm);
  out.options = options_of(words, out.file);
  if (words.runs.empty()) return out;
  const Files files = find_files(words.runs, {}, {});
  const record::ReadOptions reading{.map = parse_maps(words.maps), .require_time = false, .hash = hash};
  out.recordings = read_all(files.runs, reading);
  estimate::MassFitOptions& options = out.options;
  options.actuator_angles = uses_actuator_angles(out.recordings.front(), words);
  options.from_pressures = !has_any(out.recordings.front(), "tau") && has_any(out.recordings.front(), "dp");
  if (options.torques_by_model && !options.from_pressures && !options.actuator_angles) {
    throw Error(ErrorKind::kUsage, "angles_wrong",
                "--by-model needs the actuators' own angles and torques: record phi1… with tau1…, or dp1… "
                "(pressure differences)");
  }
  take_resolution(out.recordings.front(), out.arm, options);
  for (const series::Recording& recording : out.recordings)
    append_poses(recording, options, out.arm.joints, out.recordings.size() > 1, out.poses);
  return out;
}

}  // namespace isac::apps
