/// @file
/// What tuning knows of one joint: the model that was identified, and the same as a third-order lag with dead time.
///
///   Δp → φ:  G(s) = K e^(−L s) / ((1 + T_C s)(1 + 2 ζ T_J s + T_J² s²)),   K = K_C K_J          seed 4.1, 4.4 to 4.6
///
/// (1 + q s²) behind it stands in for lags (q > 0) and leads (q < 0) that this form has not; only fits use it (plant_fit.hpp).
/// The lag form holds near the middle (C = 0, no limits). It is what a step or a relay can tell without force sensors.
/// Units: SI; K in rad/Pa. Real time: not for the loop. Threads: values. Errors: none here; lag_plant() returns a Status.
/// Source: docs/derivations/tuning.md. Example: `LagPlant g; if (ok(lag_plant(joint, g))) …`
#pragma once

#include "isac/control/joint_settings.hpp"
#include "isac/models/joint_motion.hpp"
#include "isac/models/joint_torque.hpp"
#include "isac/models/valve_unit.hpp"

namespace isac::tune {

struct JointModel {
  models::JointCoefficients<double> muscle{};
  double wheel_radius = 0;                        ///< m
  double inertia = 0;                             ///< kg m²
  double mean_pressure = 3.0 * kPascalPerKgfCm2;  ///< Pa, p0
  models::ValveUnit<double> valve{};
  control::JointLimits<double> limits{};
};

/// The seed's testbed, with its valve unit and without dead time.
[[nodiscard]] inline JointModel testbed_model() noexcept {
  return {.muscle = models::testbed_parameters<double>(),
          .wheel_radius = models::kTestbedWheelRadius,
          .inertia = 0.0085};
}

/// How the controller samples: seed 5.3, 2 kHz inside, 0.2 kHz outside.
struct Sampling {
  double interval = 5e-4;  ///< s, of the inner loop
  int outer_every = 10;
  double velocity_filter = 0.010;    ///< s, of the speed that the actuator model is given; 0: none
  double derivative_filter = 0.005;  ///< s, of K_D
};

struct LagPlant {
  double gain = 0;           ///< rad/Pa, K
  double lag = 0;            ///< s, T_C
  double time_constant = 0;  ///< s, T_J
  double damping = 0;        ///< -, ζ
  double dead_time = 0;      ///< s, L
  double bend = 0;           ///< s², q of (1 + q s²), of either sign; a joint model has none
};

/// kOutOfRange where A r² ≥ 0 or the inertia is not positive.
[[nodiscard]] inline Status lag_plant(const JointModel& joint, LagPlant& out) noexcept {
  models::SecondOrder<double> motion;
  if (const Status status = second_order(joint.muscle, joint.wheel_radius, joint.inertia, motion);
      !ok(status))
    return status;
  out = {.gain = joint.valve.gain * motion.gain,
         .lag = joint.valve.lag,
         .time_constant = motion.time_constant,
         .damping = motion.damping,
         .dead_time = joint.valve.dead_time};
  return Status::kOk;
}

/// The other way round, the inertia being known: what a lag tells of the muscle pair (C is not seen, K_C counts as 1).
[[nodiscard]] inline JointModel joint_model(const LagPlant& plant, double wheel_radius,
                                            double inertia) noexcept {
  const double stiffness = inertia / (plant.time_constant * plant.time_constant);
  JointModel joint{.wheel_radius = wheel_radius, .inertia = inertia};
  joint.muscle = {.A = -stiffness / (wheel_radius * wheel_radius),
                  .B = plant.gain * stiffness / wheel_radius,
                  .C = 0,
                  .D = 2 * plant.damping * plant.time_constant * stiffness};
  joint.valve = {.gain = 1, .lag = plant.lag, .dead_time = plant.dead_time};
  return joint;
}

}  // namespace isac::tune
