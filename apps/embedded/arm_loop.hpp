/// @file
/// The control tick of a six-joint arm as a firmware runs it: table in, then each tick a sample in and twelve pressures out.
///
///   sense()   counts → angles and speeds; watches; the fault machine
///   control() compensation, feed-forward, torque model, both loops of six joints (control/arm_controller.hpp)
///   valves()  what the valves may have: the command, or zero pressure unless armed and without a fault
///   tick()    the three of them, once per period
///
/// Units: SI; counts of the encoders, 8000 to the turn, 24 bits; time in ns. Scalar: float, narrowed from the table once.
/// Real time: constant time but for branches, no heap, no lock, noexcept; the instructions and the stack of a tick stand in
/// docs/how-to/deploy.md. Threads: one.
/// Errors: start() says why a table is refused; a loop that was not started, or refused its table, never arms.
/// Source: seed 6.2, 6.3; decisions 0090, 0130. Example: apps/embedded/firmware.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "isac/control/arm_controller.hpp"
#include "isac/control/fault_machine.hpp"
#include "isac/control/velocity_estimate.hpp"
#include "isac/control/watches.hpp"

namespace isac::embedded {

inline constexpr std::size_t kJoints = 6;
inline constexpr std::uint32_t kCountsPerTurn = 8000;
inline constexpr std::uint32_t kCounterModulus = 1u << 24;
inline constexpr std::uint32_t kSupplyMaxCode = 4095;
inline constexpr std::int64_t kPeriodNs = 500'000;  ///< 2 kHz
inline constexpr float kPastTheBox = 0.2f;  ///< rad beyond the table's box at which the angle is a fault
inline constexpr float kFollowing = 0.5f;   ///< rad, for 0.1 s: the joint does not follow

/// What the card gave.
struct Sample {
  std::int64_t now = 0, sampled = 0;           ///< ns
  std::array<std::uint32_t, kJoints> count{};  ///< of the encoders
  std::uint32_t supply = 0;                    ///< code of the supply pressure's converter
  bool answered = true;                        ///< did the card answer?
  bool arm = false, disarm = false, acknowledge = false;
};

/// What the operator or the path wants.
struct Wanted {
  control::Mode mode = control::Mode::kHold;
  std::array<control::ArmReference<float>, kJoints> joint{};
};

struct Valves {
  std::array<float, 2 * kJoints> pressure{};  ///< Pa: muscles 1 and 2 of joint 1, then of joint 2 …
  control::RunState state = control::RunState::kDisarmed;
  control::FaultCode fault = control::FaultCode::kNone;
  std::int8_t where = -1;    ///< joint or channel of the fault
  std::uint8_t limited = 0;  ///< LimitFlag of any joint
};

class ArmLoop {
 public:
  /// Takes over a whole, plausible table, once (kNotPermitted after that); until it has, nothing arms.
  [[nodiscard]] Status start(std::span<const std::byte> table) noexcept;
  [[nodiscard]] bool started() const noexcept { return started_; }

  void sense(const Sample& sample, const Wanted& wanted) noexcept;
  void control() noexcept;
  [[nodiscard]] Valves valves() const noexcept;

  [[nodiscard]] Valves tick(const Sample& sample, const Wanted& wanted) noexcept {
    sense(sample, wanted);
    control();
    return valves();
  }

  [[nodiscard]] const control::ArmController<float, 6>& arm() const noexcept { return arm_; }
  [[nodiscard]] const control::FaultMachine& machine() const noexcept { return machine_; }
  /// Effects of the table that nobody can feed forward.
  [[nodiscard]] int effects_left_out() const noexcept { return left_out_; }

 private:
  template <class T>
  using PerJoint = std::array<T, kJoints>;

  [[nodiscard]] Status take(const models::ParameterTable& table) noexcept;

  control::ArmController<float, 6> arm_;
  control::FaultMachine machine_;
  control::InputWatch supply_{kSupplyMaxCode};
  PerJoint<control::EncoderWatch<float>> encoder_;
  PerJoint<control::JointWatch<float>> watch_;
  PerJoint<control::VelocityEstimate<float>> speed_;
  PerJoint<control::JointMeasurement<float>> now_{};
  PerJoint<control::JointCommand<float>> command_{};
  PerJoint<control::ArmReference<float>> wanted_{};
  std::int64_t last_ns_ = 0;
  float dt_ = 0;
  int left_out_ = 0;
  bool started_ = false, has_last_ = false;
};

}  // namespace isac::embedded
