/// @file
/// What the files of the prediction share; for this room only.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "isac/explain/filters.hpp"
#include "isac/explain/predict.hpp"
#include "isac/models/effect_hooks.hpp"

namespace isac::explain {

[[nodiscard]] inline double time_of(const Hypothesis& h, const PreparedRun& run, std::size_t k) {
  return run.time[k] + (h.clock == Clock::kDay ? run.day_offset : 0.0);
}

[[nodiscard]] inline bool is_null(const Active& a) {
  return null_values(*a.hypothesis, a.values) == a.values;
}

/// (growth(s) − 1)/s: the growth for an input that rises evenly over the step; where s is small, by its series, Σ s^k/(k + 2)!, to 1e-11.
[[nodiscard]] inline double growth_of_ramp(double s) {
  constexpr double kSmall = 0.4;
  if (std::abs(s) >= kSmall) return ((std::expm1(s) / s) - 1) / s;
  double sum = 1;
  for (const double share : {1.0 / 10, 1.0 / 9, 1.0 / 8, 1.0 / 7, 1.0 / 6, 1.0 / 5, 1.0 / 4, 1.0 / 3})
    sum = 1 + s * share * sum;
  return 0.5 * sum;
}
/// (e^s − 1)/s; of the small s of a fine step by its first terms, to 1e-11 as well, which do not wait for one another so long.
[[nodiscard]] inline double growth(double s) {
  constexpr double kFine = 0.02;
  if (std::abs(s) < kFine) {
    const double s2 = s * s;
    return (1 + s * 0.5) + s2 * ((1.0 / 6 + s * (1.0 / 24)) + s2 * (1.0 / 120));
  }
  return 1 + s * growth_of_ramp(s);
}

/// What a linear effect makes of the pressures' readings, y_i = c_i + s_i p_i, by its values at two points; offsets and gains are all such.
struct PressureReading {
  double constant[2], slope[2];

  explicit PressureReading(const Active& a) {
    const auto read = [&](double pressure) {
      models::Readings<double> y;
      y.pressure[0] = y.pressure[1] = pressure;
      models::effect_reading(a.hypothesis->effect, a.values.data(), 0.0, static_cast<const double*>(nullptr),
                             y);
      return y;
    };
    constexpr double kFar = 1e6;  // Pa
    const models::Readings<double> none = read(0), far = read(kFar);
    for (int i = 0; i < 2; ++i) {
      constant[i] = none.pressure[i];
      slope[i] = (far.pressure[i] - none.pressure[i]) / kFar;
    }
  }
};

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

/// How the joint moved: as measured, or as it was before sensors changed it.
struct Predictor::Motions {
  const std::vector<double>*angle = nullptr, *velocity = nullptr, *acceleration = nullptr, *dry = nullptr,
        *slow_acceleration = nullptr;
  const Motion* swing = nullptr;  ///< of a free joint; nullptr: angle, velocity and acceleration
  std::vector<double> own_angle, own_velocity, own_acceleration, own_dry, own_slow_acceleration;
  Motion own_swing;
};

/// What enters the equations: that, and the pressures.
struct Predictor::Inputs {
  std::shared_ptr<const Motions> motions;
  const std::vector<double>*angle = nullptr, *velocity = nullptr, *acceleration = nullptr, *dry = nullptr,
        *slow_acceleration = nullptr;
  const Motion* swing = nullptr;
  const std::vector<double>* pressure[2] = {nullptr, nullptr};
  std::vector<double> own_pressure[2];
  double first_pressure[2] = {0, 0};  ///< as the sensors' model has it, before what the muscles make force of
  std::uint64_t identity = 0;         ///< of these inputs among all
  std::vector<double> columns;        ///< row-major: rows of the torque chain × terms
  mutable std::vector<double>
      terms;  ///< row-major: samples × terms, each with 1 for its parameter; empty until asked for
};

/// What an effect adds to the rows of one run and chain, by each of its amplitudes: low-passed, with 1 for that one and 0 for the others.
struct Predictor::Columns {
  std::vector<std::size_t> amplitudes;  ///< which of its parameters they are
  std::vector<double> rows;             ///< row-major: rows × amplitudes
};

/// g ∗ x at one sample.
class Kernel {
 public:
  explicit Kernel(double sigma) : weights_(gaussian(std::max(sigma, 0.3), 0)) {}
  double operator()(const std::vector<double>& x, std::size_t k) const { return centred_sum(weights_, x, k); }

 private:
  std::vector<double> weights_;
};

/// Effects are driven by signals that one Gaussian has passed; rows of the motion have passed a wider one: σ² add up.
[[nodiscard]] inline double left_to_smooth(const Smoothing& smoothing) {
  return std::sqrt(std::max(0.0, smoothing.motion * smoothing.motion - smoothing.torque * smoothing.torque));
}

}  // namespace isac::explain
