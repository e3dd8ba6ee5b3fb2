/// @file
/// `arm.toml` (`isac.arm/1`): a serial arm of one to six turning joints, its masses, its limits and its actuators.
///
///   (i−1)_T_i from alpha, a, d, theta_offset (seed 4.9, Craig's convention),   θ = K φ + middle (seed D.2.2)
///
/// Lists: [[joint]] one per arm angle θ, base first; [[mass]]; [[actuator]] none or one per joint angle φ: limits of φ, A, B, C, D,
/// chain wheel, and how well they are known; [tool]; [gravity]; `coupling` = rows of K, the identity where it is not given.
/// Same strictness as rig.toml: every dimensional value is a text with its unit; a bare number, an unknown key, a wrong dimension, a list of the
/// wrong length or a coupling that cannot be inverted is an error with line and column. Values here are SI; NaN means "not
/// given". An arm of fewer than six joints fills the chain with steps that do nothing.
/// Threads: pure functions. Throws isac::Error (bad input). Source: docs/formats.md; seed 4.3, tables 4.1, 4.3, 6.1.
/// Example: `auto arm = isac::record::read_arm("data/arms/right_soft_arm.toml");`
#pragma once

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "isac/models/arm/coupling.hpp"
#include "isac/models/arm/soft_arm.hpp"

namespace isac::record {

/// One pair of muscles on a chain wheel, T = A r² φ + B r Δp − C φ̇³ − D φ̇; NaN where not given.
struct ArmActuator {
  double A = std::numeric_limits<double>::quiet_NaN();             ///< N/m
  double B = std::numeric_limits<double>::quiet_NaN();             ///< N/Pa
  double C = std::numeric_limits<double>::quiet_NaN();             ///< N m s³
  double D = std::numeric_limits<double>::quiet_NaN();             ///< N m s
  double wheel_radius = std::numeric_limits<double>::quiet_NaN();  ///< m, half of `chain_wheel_diameter`
  double A_error = std::numeric_limits<double>::quiet_NaN();       ///< N/m, standard error
  double B_error = std::numeric_limits<double>::quiet_NaN();       ///< N/Pa, standard error
  double torque_noise = std::numeric_limits<double>::quiet_NaN();  ///< N m, of one measured pose
};

struct ArmFile {
  std::string name;
  int joints = 0;                           ///< 1 to 6
  models::Chain<double, 6> chain;           ///< masses are the start values, 0 where not given
  models::Coupling<double, 6> coupling{};   ///< K
  models::JointVector<double, 6> middle{};  ///< rad, arm angles at φ = 0
  models::JointLimits<double> limits;       ///< of φ, ±π where not given
  std::vector<std::string> mass_names;      ///< "m1" …
  std::vector<ArmActuator> actuators;       ///< none, or one per joint
};

[[nodiscard]] ArmFile read_arm(const std::filesystem::path& path);
[[nodiscard]] ArmFile parse_arm(const std::string& text, const std::string& file_name);

}  // namespace isac::record
