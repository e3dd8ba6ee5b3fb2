/// @file
/// What the kinematics firmware writes for every pose: instructions of each calculation, and how far back the round trip came.
///
/// Units: instructions; m; rad. Threads: a value. Source: seed 4.3, 4.4. Example: apps/embedded/kinematics_firmware.cpp.
#pragma once

#include <cstdint>

namespace isac::embedded {

inline constexpr int kKinematicsPoses = 256;

struct KinematicsRecord {
  std::uint32_t frames = 0;        ///< 0_T_1 … 0_T_6
  std::uint32_t tool = 0;          ///< place of the hand, frames included
  std::uint32_t inverse = 0;       ///< all solutions
  std::uint32_t nearest = 0;       ///< of them, inside the limits
  std::uint32_t gravity = 0;       ///< torques of three masses through the coupling
  std::uint32_t compensation = 0;  ///< gravity, and inertia of joint one
  std::uint32_t solutions = 0;
  float back = 0;  ///< m, largest distance of a solution's wrist from where it should be
};

}  // namespace isac::embedded
