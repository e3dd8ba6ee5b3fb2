#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "isac/core/error.hpp"
#include "isac/estimate/mass_problem.hpp"

namespace isac::estimate {
namespace {

/// Mean of the finite entries, joint by joint; NaN where there is none.
ArmVector mean_of(const std::vector<const MassPose*>& rows, ArmVector MassPose::*field) {
  ArmVector sum{};
  for (std::size_t j = 0; j < kArmJoints; ++j) {
    double total = 0, count = 0;
    for (const MassPose* row : rows) {
      if (!std::isfinite((row->*field)[j])) continue;
      total += (row->*field)[j];
      count += 1;
    }
    sum[j] = count > 0 ? total / count : std::nan("");
  }
  return sum;
}

ArmVector middle_of(const ArmVector& a, const ArmVector& b) {
  ArmVector out{};
  for (std::size_t j = 0; j < kArmJoints; ++j) out[j] = (a[j] + b[j]) / 2;
  return out;
}

struct Group {
  std::vector<const MassPose*> up, down, untold;
};

}  // namespace

std::vector<MassPose> average_approaches(std::span<const MassPose> rows, std::vector<double>& noise_factor,
                                         ArmVector& friction, Warnings& warnings) {
  std::vector<MassPose> out;
  noise_factor.clear();
  friction.fill(std::nan(""));
  std::map<std::pair<long, double>, Group> groups;
  for (const MassPose& row : rows) {
    if (row.target < 0) {
      out.push_back(row);
      noise_factor.push_back(1);
      continue;
    }
    Group& group = groups[{row.target, row.load}];
    (row.approach > 0 ? group.up : row.approach < 0 ? group.down : group.untold).push_back(&row);
  }
  ArmVector sum{}, count{};
  std::string one_sided;
  for (const auto& [key, group] : groups) {
    MassPose pose;
    pose.name = "pose " + std::to_string(key.first);
    pose.target = key.first;
    pose.load = key.second;
    std::vector<const MassPose*> all = group.up;
    all.insert(all.end(), group.down.begin(), group.down.end());
    all.insert(all.end(), group.untold.begin(), group.untold.end());
    if (!group.up.empty() && !group.down.empty()) {
      for (const auto field : {&MassPose::angle, &MassPose::torque, &MassPose::delta_pressure})
        pose.*field = middle_of(mean_of(group.up, field), mean_of(group.down, field));
      noise_factor.push_back(0.5 * std::sqrt(1.0 / static_cast<double>(group.up.size()) +
                                             1.0 / static_cast<double>(group.down.size())));
      const ArmVector high = mean_of(group.up, &MassPose::torque);
      const ArmVector low = mean_of(group.down, &MassPose::torque);
      for (std::size_t j = 0; j < kArmJoints; ++j) {
        if (!std::isfinite(high[j] - low[j])) continue;
        sum[j] += (high[j] - low[j]) / 2;
        count[j] += 1;
      }
    } else {
      for (const auto field : {&MassPose::angle, &MassPose::torque, &MassPose::delta_pressure})
        pose.*field = mean_of(all, field);
      noise_factor.push_back(1 / std::sqrt(static_cast<double>(all.size())));
      one_sided += (one_sided.empty() ? "" : ", ") + std::to_string(key.first);
    }
    out.push_back(std::move(pose));
  }
  for (std::size_t j = 0; j < kArmJoints; ++j)
    if (count[j] > 0) friction[j] = sum[j] / count[j];
  if (!one_sided.empty()) {
    warnings.push_back({"approach_one_sided",
                        "Pose " + one_sided +
                            " was not approached from both sides, so friction is part of its torques; hold "
                            "it once from each side (column 'approach [1]', 1 and -1)."});
  }
  return out;
}

MassReading read_mass_poses(MassProblem& problem, std::span<const MassPose> recorded,
                            const MassFitOptions& options, bool noise_known) {
  MassReading out;
  const MassArm& arm = problem.arm;
  std::vector<MassPose> rows;
  std::string without;
  for (const MassPose& pose : recorded) {
    bool complete = true;
    for (std::size_t j = 0; j < static_cast<std::size_t>(arm.joints); ++j)
      complete = complete && std::isfinite(pose.angle[j]);
    if (complete) {
      rows.push_back(pose);
    } else {
      without += (without.empty() ? "" : ", ") + pose.name;
    }
  }
  if (!without.empty())
    out.warnings.push_back({"angle_missing", "Left out, because an angle is missing: " + without + "."});
  if (options.from_pressures) torques_from_pressures(problem, rows);
  problem.poses = average_approaches(rows, out.noise_factor, out.friction, out.warnings);
  out.sign = options.from_pressures ? TorqueSign::kActuator : options.sign;
  const bool find = out.sign == TorqueSign::kAuto;
  if (find) out.sign = TorqueSign::kGravity;
  fill_data(problem, options, out.noise_factor, out.sign, noise_known);
  if (problem.data.empty()) {
    throw Error(
        ErrorKind::kAnswerIsNo, "no_usable_data",
        "no pose has all its angles and at least one torque; record theta1… (or phi1…) with tau1… (or dp1…)");
  }
  if (find) {
    for (std::size_t k = 0; k < arm.mass_names.size(); ++k)
      problem.unknowns.push_back({MassUnknown::Kind::kMass, k, arm.mass_names[k], "kg"});
    out.sign = find_sign(problem);
    fill_data(problem, options, out.noise_factor, out.sign, noise_known);
  }
  return out;
}

}  // namespace isac::estimate
