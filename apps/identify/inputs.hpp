/// @file
/// From a recording to the run that a joint's fit speaks of.
///
/// Throws isac::Error: bad input (what was read cannot be used).
#pragma once

#include <string>

#include "common/dataset.hpp"
#include "isac/estimate/joint_fit.hpp"
#include "isac/record/rig.hpp"
#include "isac/series/recording.hpp"

namespace isac::apps {

/// Which signals of a recording are output and position, and the wheel that turns forces into torque.
struct JointSignals {
  std::string output = "torque";  ///< computed from F1, F2 and the wheel radius where the column is absent
  std::string position = "angle";
  bool needs_pressure = true;  ///< the terms contain one of the pressures
  double wheel_radius = 0;     ///< m
};

[[nodiscard]] estimate::JointRun joint_run(const series::Recording& recording, const JointSignals& signals);

}  // namespace isac::apps
