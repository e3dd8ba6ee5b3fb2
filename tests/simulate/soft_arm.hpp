/// @file
/// The right Soft Arm as a plant: lengths, masses and muscles of data/arms, and a middle position, for the tests of this folder.
#pragma once

#include <string>

#include "isac/record/arm_file.hpp"
#include "isac/simulate/arm_plant.hpp"

namespace isac::test {

/// θ at φ = 0: the pose of 6.4, so that the experiments stay in the middle of the muscles' range (decision 0140).
inline const simulate::ArmVector kMiddle = {0, -kPi / 4, -kPi / 4, 0, kPi / 2, 0};

inline simulate::ArmPlantConfig soft_arm_config() {
  const record::ArmFile file =
      record::read_arm(std::string(ISAC_SOURCE_DIR) + "/data/arms/right_soft_arm.toml");
  simulate::ArmPlantConfig config;
  config.chain = file.chain;
  config.coupling = file.coupling;
  for (std::size_t i = 0; i < simulate::kArmJoints; ++i) {
    const record::ArmActuator& a = file.actuators[i];
    config.chain.links[i].theta_offset += kMiddle[i];
    config.joints[i].muscle = {.A = a.A, .B = a.B, .C = a.C, .D = a.D};
    config.joints[i].wheel_radius = a.wheel_radius;
  }
  return config;
}

}  // namespace isac::test
