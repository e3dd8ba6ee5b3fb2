/// @file
/// N joints of an arm in one tick: compensation for all, then each joint's loops (seed 6.2, figure 6.1).
///
///   load_i = τ_φ,i of compensation.hpp + T_ff,i of feed_forward.hpp;   JointController of joint i with that load
///
/// Angles are the actuators' (φ); the coupling to arm angles (θ) is inside. With every joint in torque mode and torque 0
/// the arm can be led by hand and stays where it is let go (seed 6.3).
/// Shapes: arrays of N. Units: SI. Real time: constant time, no heap, no lock, noexcept. Threads: one.
/// Errors: the first joint that fails is named in `failed`, all N commands say "vented", and every joint is vented until it
/// is given a mode again. Source: seed 5.4, 6.2, 6.3. Example: tests/control/arm_test.cpp.
#pragma once

#include <array>
#include <cstddef>

#include "isac/control/compensation.hpp"
#include "isac/control/feed_forward.hpp"
#include "isac/control/joint_controller.hpp"

namespace isac::control {

template <class S>
struct ArmReference {
  S angle{}, velocity{}, acceleration{};  ///< rad, rad/s, rad/s², desired motion of the joint
  S torque{};                             ///< N m, in torque mode
};

template <class S, int N>
class ArmController {
 public:
  static constexpr std::size_t kJoints = static_cast<std::size_t>(N);
  template <class T>
  using PerJoint = std::array<T, kJoints>;

  PerJoint<JointController<S>> joints;    ///< configure() and set_mode() each
  PerJoint<FeedForward<S>> feed_forward;  ///< empty: nothing
  models::Chain<S, N> chain;              ///< masses and lengths; without masses nothing is compensated
  models::Coupling<S, N> coupling{};      ///< θ = K φ
  InertiaShare inertia = InertiaShare::kFirstJoint;
  bool compensate = true;  ///< false: PI-MBPI

  [[nodiscard]] Status step(const PerJoint<JointMeasurement<S>>& now, const PerJoint<ArmReference<S>>& wanted,
                            const S& dt, PerJoint<JointCommand<S>>& command, int& failed) noexcept {
    models::JointVector<S, N> load{};
    if (compensate) {
      models::JointVector<S, N> angle, acceleration;
      for (std::size_t i = 0; i < kJoints; ++i) {
        angle[i] = now[i].angle;
        const Mode mode = joints[i].mode();
        acceleration[i] = mode == Mode::kPosition ? wanted[i].acceleration : S(0.0);
      }
      load = compensation_torque<S, N>(chain, coupling, angle, acceleration, inertia, twists_);
    }
    time_ += dt;
    for (std::size_t i = 0; i < kJoints; ++i) {
      if (joints[i].mode() == Mode::kPosition) load[i] += feed_forward[i].torque(desired_point(i, wanted[i]));
      const JointReference<S> reference{
          .angle = wanted[i].angle, .torque = wanted[i].torque, .load = load[i]};
      const Status status = joints[i].step(now[i], reference, dt, command[i]);
      if (!ok(status)) {
        vent(command);
        failed = static_cast<int>(compensate ? culprit(i, now, wanted) : i);
        return status;
      }
      delta_pressure_[i] = command[i].delta_pressure;
    }
    return Status::kOk;
  }

 private:
  [[nodiscard]] models::JointPoint<S> desired_point(std::size_t i,
                                                    const ArmReference<S>& wanted) const noexcept {
    const JointSettings<S>& s = joints[i].settings();
    return {.delta_pressure = delta_pressure_[i],
            .mean_pressure = s.mean_pressure,
            .angle = wanted.angle,
            .velocity = wanted.velocity,
            .acceleration = wanted.acceleration,
            .time = time_,
            .wheel_radius = s.wheel_radius,
            .reference_pressure = s.mean_pressure,
            .stiffness = s.muscle.A,
            .pressure_gain = s.muscle.B,
            .cubic_damping = s.muscle.C,
            .damping = s.muscle.D};
  }

  /// Through the compensation a value that is no number reaches every joint: whose was it? `noticed` if nobody's.
  [[nodiscard]] static std::size_t culprit(std::size_t noticed, const PerJoint<JointMeasurement<S>>& now,
                                           const PerJoint<ArmReference<S>>& wanted) noexcept {
    for (std::size_t i = 0; i < kJoints; ++i)
      if (!finite(now[i].angle, wanted[i].acceleration)) return i;
    return noticed;
  }

  void vent(PerJoint<JointCommand<S>>& command) noexcept {
    for (std::size_t i = 0; i < kJoints; ++i) {
      command[i] = JointCommand<S>{};
      static_cast<void>(joints[i].set_mode(Mode::kVented));  // being vented is never refused
      delta_pressure_[i] = S(0.0);
    }
  }

  LinkTwists<S, N> twists_;
  PerJoint<S> delta_pressure_{};  ///< Pa, commanded last
  S time_{};
};

}  // namespace isac::control
