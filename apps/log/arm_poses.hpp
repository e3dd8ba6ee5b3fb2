/// @file
/// isac-log --arm arm.toml --plan poses.csv: an arm held in planned poses instead of a joint swept.
///
/// Throws isac::Error: usage, bad input, stopped. Source: runtime/pose_session.hpp.
#pragma once

#include <string>

namespace isac::apps {

struct ArmPoseWords {
  std::string arm, plan, card, folder, json;
  std::string limit_delta_pressure, limit_speed, side;
  double rate = 200;
  bool overwrite = false;
};

/// Holds the poses, writes FOLDER/poses.csv, says how each went; 0 where all stood at rest, else 1.
int log_arm_poses(const ArmPoseWords& words);

}  // namespace isac::apps
