/// @file
/// A simulated arm and a fixed story for it, one source for the firmware and for the host's run: what both are asked.
///
///   p_1,2: dead time of kDeadTicks, then the valve unit's lag;  I φ̈ = T(φ, Δp, φ̇) + Kᵀ τ_g(K φ) − T_c φ̇/(|φ̇| + v_c)
///   in float, semi-implicit Euler at the period of the loop; counts of an encoder of 8000 to the turn
///
/// The plant has the table's coefficients with inertia 20 % more and a friction that the table does not know. The encoder's
/// steps can swallow a bit that went wrong, so every tick's pressures and angles are compared, not where the arm ends.
/// The story, kStoryTicks of 0.5 ms: armed after the plausibility pass, sines on six joints, torque mode, hold, position again;
/// then seven faults, each acknowledged and armed again. Units: SI. Real time: no heap, noexcept. Threads: one.
/// Errors: none. Source: models/joint_torque.hpp, valve_unit.hpp, arm/chain.hpp. Example: tests/embedded/twin.hpp.
#pragma once

#include <cmath>
#include <limits>

#include "arm_loop.hpp"
#include "isac/models/joint_motion.hpp"
#include "isac/models/valve_unit.hpp"

namespace isac::embedded {

inline constexpr int kStoryTicks = 8000;

class SimulatedArm {
 public:
  /// At rest, vented, at angle 0, with what the controller of `loop` was told about its joints.
  void start(const ArmLoop& loop) noexcept {
    chain_ = loop.arm().chain;
    coupling_ = loop.arm().coupling;
    for (std::size_t i = 0; i < kJoints; ++i) {
      const control::JointSettings<float>& s = loop.arm().joints[i].settings();
      joint_[i] =
          Joint{.muscle = s.muscle, .valve = s.valve, .radius = s.wheel_radius, .inertia = 1.2f * s.inertia};
    }
  }

  /// One period with these pressures asked of the valves.
  void step(const std::array<float, 2 * kJoints>& pressure, float dt) noexcept {
    models::JointVector<float, 6> angle{};
    for (std::size_t i = 0; i < kJoints; ++i) angle[i] = joint_[i].angle;
    const models::JointVector<float, 6> theta = models::multiply<float, 6>(coupling_, angle);
    const models::JointVector<float, 6> load =
        models::multiply_transposed<float, 6>(coupling_, models::gravity_torque(chain_, theta));
    for (std::size_t i = 0; i < kJoints; ++i) {
      Joint& j = joint_[i];
      models::PressurePair<float>& tube = j.tube[next_];
      j.pressure.muscle_1 = models::valve_step(j.valve, j.pressure.muscle_1, tube.muscle_1, dt);
      j.pressure.muscle_2 = models::valve_step(j.valve, j.pressure.muscle_2, tube.muscle_2, dt);
      tube = {pressure[2 * i], pressure[2 * i + 1]};
      const float friction = kFriction * j.velocity / (models::magnitude(j.velocity) + kFrictionSpeed);
      const float torque = models::joint_torque(j.muscle, j.radius, j.angle,
                                                models::delta_pressure_of(j.pressure), j.velocity);
      j.velocity += models::joint_acceleration(j.inertia, torque, load[i] - friction) * dt;
      j.angle += j.velocity * dt;
    }
    next_ = next_ + 1 == kDeadTicks ? 0 : next_ + 1;
  }

  [[nodiscard]] std::uint32_t count(std::size_t joint) const noexcept {
    constexpr float kCountsPerRadian = static_cast<float>(kCountsPerTurn / (2.0 * kPi));
    const float counts = std::floor(joint_[joint].angle * kCountsPerRadian);
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(counts)) & (kCounterModulus - 1);
  }
  [[nodiscard]] float angle(std::size_t joint) const noexcept { return joint_[joint].angle; }

 private:
  static constexpr std::size_t kDeadTicks = 8;                       ///< 4 ms
  static constexpr float kFriction = 0.05f, kFrictionSpeed = 0.02f;  ///< N m, rad/s
  struct Joint {
    models::JointCoefficients<float> muscle{};
    models::ValveUnit<float> valve{};
    float radius = 0, inertia = 1;
    float angle = 0, velocity = 0;
    models::PressurePair<float> pressure{};
    std::array<models::PressurePair<float>, kDeadTicks> tube{};
  };
  models::Chain<float, 6> chain_;
  models::Coupling<float, 6> coupling_{};
  std::array<Joint, kJoints> joint_{};
  std::size_t next_ = 0;
};

/// What the story does to the arm from a tick on, and what must be found.
struct Blow {
  int tick;
  control::FaultCode expected;
};
inline constexpr std::array<Blow, 7> kBlows = {{{1800, control::FaultCode::kInputCode},
                                                {2600, control::FaultCode::kReadFailed},
                                                {3400, control::FaultCode::kCommandNotFinite},
                                                {4200, control::FaultCode::kEncoderJump},
                                                {5000, control::FaultCode::kStaleSample},
                                                {5800, control::FaultCode::kOverrun},
                                                {6700, control::FaultCode::kFollowingError}}};
inline constexpr int kLateTicks = 25;          ///< of the overrun, each a period late
inline constexpr int kBlockedTicks = 500;      ///< of the desired angle that nobody can follow
inline constexpr int kAcknowledgeAfter = 520;  ///< ticks after a blow
inline constexpr int kArmAfter = 640;
inline constexpr int kFirstArm = 150;

/// The story's tick `k`: the same sample and wishes for the same arm, on every machine.
class Story {
 public:
  void at(int k, const SimulatedArm& arm, Sample& sample, Wanted& wanted) noexcept {
    using enum control::FaultCode;
    const int blow = blow_at(k);
    const int since = blow < 0 ? k : k - kBlows[static_cast<std::size_t>(blow)].tick;
    const control::FaultCode kind = blow < 0 ? kNone : kBlows[static_cast<std::size_t>(blow)].expected;

    now_ += kind == kOverrun && since < kLateTicks ? 2 * kPeriodNs : kPeriodNs;
    sample = Sample{.now = now_, .sampled = now_ - 20'000, .supply = 2000u + static_cast<unsigned>(k % 7)};
    for (std::size_t i = 0; i < kJoints; ++i) sample.count[i] = arm.count(i);
    sample.arm = blow < 0 ? k >= kFirstArm : since < kAcknowledgeAfter || since >= kArmAfter;
    sample.acknowledge = blow >= 0 && since >= kAcknowledgeAfter && since < kArmAfter;

    wanted.mode = k < 900 || k >= 1300 ? control::Mode::kPosition
                  : k < 1100           ? control::Mode::kTorque
                                       : control::Mode::kHold;
    for (std::size_t i = 0; i < kJoints; ++i) {
      const float rate = 1.0f + 0.7f * static_cast<float>(i), size = 0.15f;
      const float phase = rate * (5e-4f * static_cast<float>(k));
      wanted.joint[i] = {.angle = size * std::sin(phase),
                         .velocity = size * rate * std::cos(phase),
                         .acceleration = -size * rate * rate * std::sin(phase)};
    }
    if (kind == kInputCode && since == 0) sample.supply = kSupplyMaxCode + 1;
    if (kind == kReadFailed && since == 0) sample.answered = false;
    if (kind == kCommandNotFinite && since == 0)
      wanted.joint[3].angle = std::numeric_limits<float>::quiet_NaN();
    if (kind == kEncoderJump && since == 0)
      sample.count[1] = (sample.count[1] + 4000) & (kCounterModulus - 1);
    if (kind == kStaleSample && since == 0) sample.sampled = now_ - 6'000'000;
    if (kind == kFollowingError && since < kBlockedTicks) wanted.joint[4].angle = 1.0f;
  }

 private:
  [[nodiscard]] static int blow_at(int k) noexcept {
    int last = -1;
    for (std::size_t i = 0; i < kBlows.size(); ++i)
      if (k >= kBlows[i].tick) last = static_cast<int>(i);
    return last;
  }
  std::int64_t now_ = 1'000'000'000;
};

/// What is kept of every tick, by the firmware and by the host, byte for byte the same but for the counts.
struct TickRecord {
  std::array<float, 2 * kJoints> pressure{};
  std::array<float, kJoints> angle{};          ///< rad, of the simulated arm, before the tick
  std::array<std::uint32_t, kJoints> count{};  ///< of the encoders, before the tick
  std::uint8_t state = 0, fault = 0, limited = 0;
  std::int8_t where = -1;
  std::uint32_t control_instructions = 0;  ///< of ArmLoop::control(); 0 on the host
  std::uint32_t tick_instructions = 0;     ///< of the whole tick; 0 on the host
};
static_assert(sizeof(TickRecord) == 108, "no padding: records are compared as bytes");
inline constexpr std::size_t kComparedBytes = 100;

/// What the firmware found out about itself, before and after the ticks.
struct RunRecord {
  std::uint32_t status = 0;  ///< of ArmLoop::start
  std::uint32_t ticks = 0;
  std::uint32_t empty_instructions = 0;  ///< counted between two readings of the timer
  std::uint32_t known_instructions = 0;  ///< the same around a loop of kKnownInstructions
  std::uint32_t start_stack = 0;         ///< bytes, deepest
  std::uint32_t tick_stack = 0;          ///< bytes, deepest of all ticks
  std::uint32_t loop_bytes = 0;          ///< sizeof(ArmLoop)
};
inline constexpr std::uint32_t kKnownInstructions = 2000;

inline TickRecord record_of(const SimulatedArm& arm, const Sample& sample, const Valves& valves) noexcept {
  TickRecord record{.pressure = valves.pressure,
                    .count = sample.count,
                    .state = static_cast<std::uint8_t>(valves.state),
                    .fault = static_cast<std::uint8_t>(valves.fault),
                    .limited = valves.limited,
                    .where = valves.where};
  for (std::size_t i = 0; i < kJoints; ++i) record.angle[i] = arm.angle(i);
  return record;
}

}  // namespace isac::embedded
