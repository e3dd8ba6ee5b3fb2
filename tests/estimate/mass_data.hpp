/// @file
/// Arms and poses for the mass tests. Seeds are local, so every test's numbers are its own.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "isac/estimate/mass_fit.hpp"

namespace isac::estimate::test {

inline constexpr double kTruth[3] = {1.750, 0.450, 0.140};  // kg, table 4.1

/// The seed's right arm with the limits of data/arms/right_soft_arm.toml and table 6.1's actuators (their errors zero).
inline MassArm soft_arm() {
  MassArm arm;
  arm.chain = models::soft_arm_chain(models::SoftArmGeometry<double>{});
  arm.coupling = models::soft_arm_coupling<double>();
  const double degrees[6] = {85.5, 102.6, 128.2, 128.2, 171, 171};
  for (std::size_t j = 0; j < 6; ++j) {
    arm.limits.upper[j] = degrees[j] * 3.14159265358979 / 180;
    arm.limits.lower[j] = -arm.limits.upper[j];
  }
  arm.mass_names = {"m1", "m2", "m3"};
  const double A[6] = {-143000, -108000, -80600, -80600, -37600, -37600};
  const double B[6] = {3200, 970, 334, 329, 138, 134};  // N cm²/kg
  const double wheel[6] = {0.030, 0.025, 0.020, 0.020, 0.015, 0.015};
  for (std::size_t j = 0; j < 6; ++j) arm.actuators.push_back({A[j], B[j] / 98066.5, wheel[j] / 2, 0, 0});
  return arm;
}

/// θ = (0, −45°, −45°, 0, 90°, 0) with the torques of docs/errata.md on joints 2, 3 and 5.
inline MassPose pose_of_6_4() {
  const double q = 3.14159265358979323846 / 4;
  MassPose pose;
  pose.name = "row 1";
  pose.angle = {0, -q, -q, 0, 2 * q, 0};
  pose.torque.fill(std::nan(""));
  pose.torque[1] = -4.6117;
  pose.torque[2] = -1.2581;
  pose.torque[4] = -0.2197;
  return pose;
}

/// Random poses held by actuators with torques (on the arm's joints) noisy by `noise`, N m.
inline std::vector<MassPose> random_poses(const MassArm& arm, int count, double noise, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> angle(-1.2, 1.2);
  std::vector<MassPose> poses;
  for (int i = 0; i < count; ++i) {
    MassPose pose;
    pose.name = "row " + std::to_string(i + 1);
    for (double& a : pose.angle) a = angle(random);
    const ArmVector gravity = models::gravity_torque(arm.chain, pose.angle);
    for (std::size_t j = 0; j < 6; ++j) pose.torque[j] = -gravity[j] + noise * normal(random);
    poses.push_back(pose);
  }
  return poses;
}

inline bool has_warning(const MassFit& fit, const std::string& code) {
  for (const Warning& warning : fit.warnings)
    if (warning.code == code) return true;
  return false;
}

inline std::string text_of(const MassFit& fit, const std::string& code) {
  for (const Warning& warning : fit.warnings)
    if (warning.code == code) return warning.text;
  return {};
}

}  // namespace isac::estimate::test
