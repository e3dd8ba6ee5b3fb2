/// @file
/// isac-explain POSES --arm arm.toml: what is hidden in the poses of an arm.
///
/// Throws isac::Error: usage, bad input, answer is no. Source: estimate/pose_explain.hpp.
#pragma once

#include <string>

#include "common/poses.hpp"

namespace CLI {
class App;
}

namespace isac::apps {

struct ArmExplainWords : PoseWords {
  std::string masses;
  bool doubt_masses = false, free_masses = false;
};

void add_arm_options(CLI::App& app, ArmExplainWords& words);

/// `words.runs` and `maps` are those of the call. Prints or writes the answer; 0.
int explain_arm(const ArmExplainWords& words, const std::string& json, const std::string& report);

}  // namespace isac::apps
