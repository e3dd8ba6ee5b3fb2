// Recordings of a joint made without the product's simulator: analytic motion (sums of sines that share no period), pressures
// behind a lag, encoder steps, jittered stamps, white and coloured noise, spikes.
#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "isac/estimate/joint_fit.hpp"

namespace isac::test {

inline constexpr double kKgf = 98066.5;

struct Truth {
  double A = -23450, B = 174.2, C = 0.0026, D = 0.14;  // N/m, N cm2/kg, N m s3, N m s
  double radius = 0.019;
  [[nodiscard]] double torque(double angle, double dp, double v) const {
    return A * radius * radius * angle + B / kKgf * radius * dp - C * v * v * v - D * v;
  }
};

struct Sensors {
  double force = 0.3;              // N, white, each force
  double pressure = 0.004 * kKgf;  // Pa, white, each pressure
  double encoder_steps = 8000;     // 0: exact
  double in_step = 0;    // where in a step the angle is read: 0 cuts off as a counter does, 0.5 rounds
  double coloured = 0;   // N m, standard deviation of a first-order process in the torque
  double memory = 0.15;  // s, its time constant
  double jitter = 0.02;  // of the interval
  double spikes = 0;     // share of the rows with ±60 N in one force
};

struct Sweep {
  std::string experiment = "constant-pressure";
  double seconds = 60, rate = 250;
  double delta_pressure = 0;  // kg/cm2, constant part
  double pressure_swing = 0;  // kg/cm2, moving part (clamped runs)
  double angle = 0;           // rad, of clamped runs
  double reach = 1.05;        // rad, of moved runs
  double speed = 0.314;       // rad/s, of the fastest sine
  bool moved = true;
};

inline Sweep slow(double dp = 0) {
  return {.seconds = 60, .delta_pressure = dp, .speed = 0.314};
}
inline Sweep fast(double dp = 0) {
  return {.seconds = 40, .delta_pressure = dp, .speed = 6.28};
}
inline Sweep clamped(double angle) {
  return {
      .experiment = "constant-angle", .seconds = 40, .pressure_swing = 1.5, .angle = angle, .moved = false};
}

inline estimate::JointRun record(const Sweep& sweep, const Truth& truth, const Sensors& sensors,
                                 unsigned seed) {
  std::mt19937_64 random(seed * 7919ull + 17);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  constexpr double kTwoPi = 2 * std::numbers::pi;
  estimate::JointRun run;
  run.name = sweep.experiment + "-" + std::to_string(seed);
  run.experiment = sweep.experiment;
  // A hand: three sines near the wanted speed that beat against each other, and a tremor.
  const double w = sweep.speed / sweep.reach;
  const double amplitude[4] = {0.55 * sweep.reach, 0.28 * sweep.reach, 0.15 * sweep.reach, 3e-4};
  const double rate[4] = {w * 1.1, w * 0.79, w * 0.36, kTwoPi * 8.7};
  double phase[4], pressure_phase[2];
  for (double& p : phase) p = kTwoPi * uniform(random);
  for (double& p : pressure_phase) p = kTwoPi * uniform(random);
  const auto rows = static_cast<std::size_t>(sweep.seconds * sweep.rate);
  const double interval = 1.0 / sweep.rate;
  const double fade = std::exp(-interval / sensors.memory);
  double process = sensors.coloured * normal(random);
  for (std::size_t i = 0; i < rows; ++i) {
    const double t = (static_cast<double>(i) + sensors.jitter * (uniform(random) - 0.5)) * interval;
    double angle = sweep.angle, velocity = 0;
    if (sweep.moved) {
      angle = 0;
      for (int k = 0; k < 4; ++k) {
        angle += amplitude[k] * std::sin(rate[k] * t + phase[k]);
        velocity += amplitude[k] * rate[k] * std::cos(rate[k] * t + phase[k]);
      }
    }
    const double dp =
        kKgf * (sweep.delta_pressure + sweep.pressure_swing * (0.7 * std::sin(0.9 * t + pressure_phase[0]) +
                                                               0.3 * std::sin(2.3 * t + pressure_phase[1])));
    process = fade * process + sensors.coloured * std::sqrt(1 - fade * fade) * normal(random);
    double difference =
        truth.torque(angle, dp, velocity) / truth.radius + sensors.force * (normal(random) - normal(random));
    if (uniform(random) < sensors.spikes) difference += uniform(random) < 0.5 ? -60.0 : 60.0;
    const double step = sensors.encoder_steps > 0 ? kTwoPi / sensors.encoder_steps : 0.0;
    run.time.push_back(t);
    run.angle.push_back(step > 0 ? step * (std::floor(angle / step) + sensors.in_step) : angle);
    run.delta_pressure.push_back(dp + 0.5 * sensors.pressure * (normal(random) - normal(random)));
    run.mean_pressure.push_back(3.0 * kKgf + 0.5 * sensors.pressure * (normal(random) + normal(random)));
    run.output.push_back(truth.radius * difference + process);
  }
  return run;
}

/// Slow and fast sweeps at three pressures, one clamped run, a bundle of five minutes: chapter 3 of the seed.
inline std::vector<estimate::JointRun> chapter_three(const Truth& truth, const Sensors& sensors,
                                                     unsigned seed) {
  std::vector<estimate::JointRun> runs;
  for (const double dp : {-1.0, 0.0, 1.0})
    runs.push_back(record(slow(dp), truth, sensors, seed * 20 + static_cast<unsigned>(5 + dp)));
  for (const double dp : {-1.0, 0.0, 1.0})
    runs.push_back(record(fast(dp), truth, sensors, seed * 20 + static_cast<unsigned>(8 + dp)));
  runs.push_back(record(clamped(0.4), truth, sensors, seed * 20 + 11));
  Sweep bundle = fast();
  bundle.seconds = 300;
  runs.push_back(record(bundle, truth, sensors, seed * 20 + 12));
  return runs;
}

inline estimate::JointFitOptions options_for(const Truth& truth) {
  estimate::JointFitOptions options;
  options.wheel_radius = truth.radius;
  return options;
}

inline const Estimated& find(const std::vector<Estimated>& all, const std::string& name) {
  for (const Estimated& e : all)
    if (e.name == name) return e;
  throw std::out_of_range(name);
}

}  // namespace isac::test
