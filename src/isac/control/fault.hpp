/// @file
/// What can go wrong in a live loop, named; what was found, where, and by how much.
///
/// A fault stops the loop (fault_machine.hpp); a warning does not. Units: SI in `value` and `limit`, unless said.
/// Real time: values only, no heap, noexcept. Errors: none. Source: the loop's safety behaviours, decision 0090.
/// Example: `describe(FaultCode::kFollowingError)` is "the joint does not follow".
#pragma once

#include <cstdint>

namespace isac::control {

enum class FaultCode : std::uint8_t {
  kNone,
  kCommandNotFinite,  ///< the controller's command, or what it was asked for, is not a number
  kSensorNotFinite,
  kReadFailed,   ///< the card did not answer
  kInputCode,    ///< an analogue code above its maximum: nobody answers (value, limit in counts)
  kInputAtEnd,   ///< an analogue code at 0 or at its maximum for too long: open circuit or saturation
  kStaleSample,  ///< the sample is not newer than the last one, or too old
  kOverrun,      ///< too many late ticks
  kPressureLimit,
  kDeltaPressureLimit,
  kAngleLimit,
  kSpeedLimit,
  kForceLimit,
  kTorqueLimit,
  kFollowingError,
  kEncoderJump,
  kOperator,  ///< a person stopped it
};

enum WarningFlag : std::uint8_t {
  kEncoderFrozen = 1,  ///< the pressures moved and the encoder did not
  kNearLimit = 2,      ///< beyond a soft limit
  kTickLate = 4,       ///< this tick came at least one period late
};

struct Finding {
  FaultCode code = FaultCode::kNone;
  std::int8_t joint = -1;  ///< index from 0; −1: the loop as a whole
  float value = 0;         ///< what was seen
  float limit = 0;         ///< what it may be
  [[nodiscard]] constexpr bool found() const noexcept { return code != FaultCode::kNone; }
  friend constexpr bool operator==(const Finding&, const Finding&) noexcept = default;
};

[[nodiscard]] constexpr const char* describe(FaultCode code) noexcept {
  switch (code) {
    case FaultCode::kNone:
      return "no fault";
    case FaultCode::kCommandNotFinite:
      return "the command is not a number";
    case FaultCode::kSensorNotFinite:
      return "a sensor gave no number";
    case FaultCode::kReadFailed:
      return "the card did not answer";
    case FaultCode::kInputCode:
      return "an input gave a code that its converter does not have";
    case FaultCode::kInputAtEnd:
      return "an input stays at the end of its range";
    case FaultCode::kStaleSample:
      return "the sample is old";
    case FaultCode::kOverrun:
      return "the loop came too late too often";
    case FaultCode::kPressureLimit:
      return "a pressure is beyond its limit";
    case FaultCode::kDeltaPressureLimit:
      return "the pressure difference is beyond its limit";
    case FaultCode::kAngleLimit:
      return "the angle is beyond its limit";
    case FaultCode::kSpeedLimit:
      return "the speed is beyond its limit";
    case FaultCode::kForceLimit:
      return "a force is beyond its limit";
    case FaultCode::kTorqueLimit:
      return "the torque is beyond its limit";
    case FaultCode::kFollowingError:
      return "the joint does not follow";
    case FaultCode::kEncoderJump:
      return "the encoder jumped";
    case FaultCode::kOperator:
      return "a person stopped the run";
  }
  return "unknown fault";
}

}  // namespace isac::control
