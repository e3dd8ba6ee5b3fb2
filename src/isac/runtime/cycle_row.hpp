/// @file
/// What the control loop knows of one cycle: plain memory, for the log, the flight recorder and the status line.
///
/// Units: SI; card time in ns since the loop's first sample. Real time: trivially copyable. Errors: none.
/// Values that do not exist (a sensor that is not wired) are NaN.
#pragma once

#include <cstdint>
#include <limits>

#include "isac/card/card.hpp"
#include "isac/control/fault_machine.hpp"
#include "isac/control/joint_settings.hpp"
#include "isac/runtime/joint_wiring.hpp"

namespace isac::runtime {

inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// What a joint is asked for.
struct JointAim {
  double angle = 0, velocity = 0, acceleration = 0;  ///< rad, rad/s, rad/s²
  double torque = 0;                                 ///< N m, in torque mode
};

struct JointCycle {
  double angle = 0, velocity = 0;
  double p1 = kUnknown, p2 = kUnknown, F1 = kUnknown, F2 = kUnknown;
  JointAim aim;
  double p1_cmd = 0, p2_cmd = 0;  ///< Pa, the controller's command before it becomes codes; 0 while vented
  double torque = 0, asked_torque = 0;  ///< N m, fed back and asked of the inner loop
  std::uint8_t limited = 0;             ///< control::LimitFlag
};

enum class Phase : std::uint8_t {
  kChecking,  ///< disarmed: the samples are looked at
  kRunUp,     ///< armed: the pressures rise to p0
  kControl,
  kVented  ///< faulted
};

struct CycleRow {
  std::int64_t time_ns = 0;
  std::int64_t cycle = 0;
  Phase phase = Phase::kChecking;
  control::RunState state = control::RunState::kDisarmed;
  control::Mode mode = control::Mode::kVented;
  control::Finding finding;   ///< of this cycle
  std::uint8_t warnings = 0;  ///< control::WarningFlag
  bool arm = false;           ///< level of the arm switch
  bool answered = false;      ///< the card gave a sample
  PerJoint<JointCycle> joint;
  card::Sample sample;
  card::Command command;
};

}  // namespace isac::runtime
