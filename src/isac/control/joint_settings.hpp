/// @file
/// Everything the controller of one joint is told before it starts, and the values that pass through it at every tick.
///
/// Structures: kPid (seed 5.1: position → Δp), kCascade (5.2: position → torque → Δp, the torque measured),
/// kModelBased (5.3: the same, the torque from the actuator model). PI-CMBPI (5.4) is kModelBased with the arm's
/// compensation in `JointReference::load`.
/// Modes: kVented, kHold (the angle at which the mode was entered), kPosition, kTorque (a set torque; 0: led by hand).
///
/// Units: SI. Gains: kPid Pa/rad, Pa/(rad s), Pa s/rad; cascades N m/rad, N m/(rad s) outside, Pa/(N m), Pa/(N m s) inside.
/// Real time: values only. Errors: check() as below. Source: seed chapter 5. Example: `testbed_settings<double>()`.
#pragma once

#include <cstdint>

#include "isac/control/limits.hpp"
#include "isac/control/pid.hpp"
#include "isac/core/units.hpp"
#include "isac/models/joint_torque.hpp"
#include "isac/models/valve_unit.hpp"

namespace isac::control {

enum class Structure : std::uint8_t { kPid, kCascade, kModelBased };
enum class Mode : std::uint8_t { kVented, kHold, kPosition, kTorque };

/// Which Δp the actuator model is given (no pressure sensor is needed for either).
enum class ModelPressure : std::uint8_t {
  kCommanded,  ///< the seed's: what the valves were last asked for
  kPredicted,  ///< the same through the valve unit's gain and lag, without its dead time
};

template <class S>
struct JointSettings {
  Structure structure = Structure::kModelBased;
  models::JointCoefficients<S> muscle{};
  S wheel_radius{};                                ///< m
  S mean_pressure = S(3.0 * kPascalPerKgfCm2);     ///< Pa, p0
  S inertia{};                                     ///< kg m²; only the dead-time predictor needs it
  models::ValveUnit<S> valve{};                    ///< for kPredicted and the predictor
  PidGains<S> position{}, torque{};                ///< outer (or only) loop, inner loop
  S derivative_filter = S(0.005);                  ///< s, of K_D of the position loop
  AntiWindup anti_windup = AntiWindup::kTakeBack;  ///< of both loops
  int outer_every = 10;  ///< inner ticks per step of the outer loop: 2 kHz and 0.2 kHz
  ModelPressure model_pressure = ModelPressure::kCommanded;
  bool predict_dead_time = false;
  JointLimits<S> limits{};
};

/// kOutOfRange or kNotFinite for settings that cannot drive a joint.
template <class S>
[[nodiscard]] Status check(const JointSettings<S>& s) noexcept {
  const models::JointCoefficients<S>& q = s.muscle;
  if (!finite(q.A, q.B, q.C, q.D, s.wheel_radius, s.mean_pressure, s.inertia, s.valve.gain, s.valve.lag,
              s.valve.dead_time))
    return Status::kNotFinite;
  for (const PidGains<S>& gains : {s.position, s.torque}) {
    const Status status = check(PidSettings<S>{.gains = gains, .derivative_filter = s.derivative_filter});
    if (!ok(status)) return status;
  }
  const bool muscle = q.B > S(0.0) && s.wheel_radius > S(0.0) && s.mean_pressure > S(0.0);
  const bool valve = s.valve.gain > S(0.0) && s.valve.lag >= S(0.0) && s.valve.dead_time >= S(0.0);
  const bool predictor = !s.predict_dead_time || (s.inertia > S(0.0) && q.A < S(0.0));
  return muscle && valve && predictor && s.outer_every >= 1 ? check(s.limits) : Status::kOutOfRange;
}

/// The seed's testbed and the gains it found for PI-MBPI (5.3): inner 0.1 and 10, outer 4.0 and 8.0.
template <class S>
[[nodiscard]] constexpr JointSettings<S> testbed_settings() noexcept {
  JointSettings<S> s;
  s.muscle = models::testbed_parameters<S>();
  s.wheel_radius = S(models::kTestbedWheelRadius);
  s.inertia = S(0.0085);
  s.position = {.proportional = S(4.0), .integral = S(8.0)};
  s.torque = {.proportional = S(0.1 * kPascalPerKgfCm2), .integral = S(10.0 * kPascalPerKgfCm2)};
  return s;
}

template <class S>
struct JointMeasurement {
  S angle{};     ///< rad
  S velocity{};  ///< rad/s
  S torque{};    ///< N m, (F2 − F1) r; only kCascade reads it
};

template <class S>
struct JointReference {
  S angle{};   ///< rad, in kPosition
  S torque{};  ///< N m, in kTorque
  S load{};    ///< N m, added to the torque asked for: compensation and feed-forward (the seed's d_T)
};

template <class S>
struct JointCommand {
  models::PressurePair<S> pressure{};  ///< Pa; both 0: vented
  S delta_pressure{};                  ///< Pa
  S wanted_torque{};                   ///< N m, what the inner loop was asked for, load included
  S torque{};                          ///< N m, fed back: measured or from the model
  std::uint8_t limited = 0;            ///< LimitFlag
  bool vented = true;
};

}  // namespace isac::control
