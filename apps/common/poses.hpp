/// @file
/// From the words of a call to an arm and the poses it was held in: arm.toml, --actuators, recordings with theta or phi, tau or dp.
///
/// Throws isac::Error: usage (a word), bad input (a file, a missing column).
#pragma once

#include <string>
#include <vector>

#include "isac/estimate/mass_fit.hpp"
#include "isac/record/arm_file.hpp"
#include "isac/series/recording.hpp"

namespace isac::apps {

struct PoseWords {
  std::vector<std::string> runs, maps;
  std::string arm, actuators, angles = "auto", torques = "auto", noise;
  bool by_model = false;
};

struct Poses {
  record::ArmFile file;
  estimate::MassArm arm;
  estimate::MassFitOptions options;  ///< what the files and words say of angles, torques and their noise
  std::vector<series::Recording> recordings;
  std::vector<estimate::MassPose> poses;
};

/// Without recordings the poses stay empty. `hash`: the recordings' SHA-256 too.
[[nodiscard]] Poses read_poses(const PoseWords& words, bool hash);

}  // namespace isac::apps
