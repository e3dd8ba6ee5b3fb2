/// @file
/// What the files of the prediction share; for this room only.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "isac/explain/predict.hpp"
#include "isac/models/effect_hooks.hpp"

namespace isac::explain {

[[nodiscard]] inline double time_of(const Hypothesis& h, const PreparedRun& run, std::size_t k) {
  return run.time[k] + (h.clock == Clock::kDay ? run.day_offset : 0.0);
}

[[nodiscard]] inline bool is_null(const Active& a) {
  return null_values(*a.hypothesis, a.values) == a.values;
}

/// (e^s − 1)/s; where s is small, by its series to 1e-9.
[[nodiscard]] inline double growth(double s) {
  return std::abs(s) < 0.03 ? 1 + s * (0.5 + s * (1.0 / 6 + s * (1.0 / 24 + s / 120))) : std::expm1(s) / s;
}
/// (growth(s) − 1)/s: the same for an input that rises evenly over the step.
[[nodiscard]] inline double growth_of_ramp(double s) {
  return std::abs(s) < 0.03 ? 0.5 + s * (1.0 / 6 + s * (1.0 / 24 + s / 120)) : (growth(s) - 1) / s;
}

/// Of the baseline, what effects that bend it need: A, B, C, D.
struct BaselineOfPoint {
  double stiffness = 0, pressure_gain = 0, cubic_damping = 0, damping = 0;
};

[[nodiscard]] inline models::JointPoint<double> point_at(const RigFacts& rig, const BaselineOfPoint& base,
                                                         const std::vector<double>& angle,
                                                         const std::vector<double>& velocity,
                                                         const std::vector<double>& acceleration,
                                                         const std::vector<double>* const (&pressure)[2],
                                                         double time, std::size_t k) {
  models::JointPoint<double> x;
  x.angle = angle[k];
  x.velocity = velocity[k];
  x.acceleration = acceleration[k];
  if (pressure[0] != nullptr && !pressure[0]->empty()) {
    const double p1 = (*pressure[0])[k], p2 = (*pressure[1])[k];
    x.delta_pressure = 0.5 * (p2 - p1);
    x.mean_pressure = 0.5 * (p1 + p2);
  }
  x.time = time;
  x.wheel_radius = std::isfinite(rig.wheel_radius) ? rig.wheel_radius : 1.0;
  x.reference_pressure = rig.initial_pressure;
  x.stiffness = base.stiffness;
  x.pressure_gain = base.pressure_gain;
  x.cubic_damping = base.cubic_damping;
  x.damping = base.damping;
  return x;
}

/// What enters the equations: the measured signals, or what they were before sensors changed them.
struct Predictor::Inputs {
  const std::vector<double>*angle = nullptr, *velocity = nullptr, *acceleration = nullptr, *dry = nullptr,
        *slow_acceleration = nullptr;
  const std::vector<double>* pressure[2] = {nullptr, nullptr};
  std::vector<double> own_angle, own_velocity, own_acceleration, own_dry, own_slow_acceleration,
      own_pressure[2];
  std::vector<double> columns;  ///< row-major: rows of the torque chain × terms
};

}  // namespace isac::explain
