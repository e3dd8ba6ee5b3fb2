/// @file
/// Runs of a free joint made by another integrator (Dormand-Prince, adaptive) than the fit's.
#pragma once

#include <array>
#include <boost/numeric/odeint.hpp>
#include <cmath>
#include <random>

#include "isac/estimate/motion_fit.hpp"

namespace isac::estimate {

inline constexpr double kKgf = 98066.5;

struct Truth {
  MotionVector p{0.0085, -23450, 174.2 / kKgf, 0.0026, 0.14, 0.05, 0.17};
  double radius = 0.019, gravity = 0, friction_speed = 0.05;
};

/// Smooth command without a period: a sum of five sines up to ±1.5 kg/cm².
inline double command_at(double t, unsigned seed) {
  double u = 0;
  for (int i = 0; i < 5; ++i) u += 0.3 * kKgf * std::sin((1.1 + 2.3 * i) * t + 1.7 * i + seed);
  return u;
}

/// A run by an adaptive Dormand-Prince integrator of another library: another method, another step, the command continuous.
inline MotionRun make_run(const Truth& truth, unsigned seed, double seconds, double rate, double noise,
                          double correlation = 0) {
  using StateVector = std::array<double, 3>;
  namespace ode = boost::numeric::odeint;
  const MotionVector& p = truth.p;
  const auto rhs = [&](const StateVector& x, StateVector& d, double t) {
    const double r = truth.radius;
    d[0] = x[1];
    d[1] = (p[kA] * r * r * x[0] + p[kB] * r * x[2] - p[kC] * x[1] * x[1] * x[1] - p[kD] * x[1] -
            p[kFriction] * std::tanh(x[1] / truth.friction_speed) - truth.gravity * std::sin(x[0])) /
           p[kInertia];
    d[2] = (command_at(t, seed) - x[2]) / p[kLag];
  };
  StateVector x{0.05, -0.2, command_at(0, seed)};
  auto stepper = ode::make_controlled(1e-10, 1e-10, ode::runge_kutta_dopri5<StateVector>());
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss;
  MotionRun run;
  run.name = "made";
  double ar = noise * gauss(random);
  const long rows = std::lround(seconds * rate);
  for (long k = 0; k < rows; ++k) {
    const double t = static_cast<double>(k) / rate;
    if (k > 0) ode::integrate_adaptive(stepper, rhs, x, t - 1 / rate, t, 1e-4);
    ar = correlation * ar + std::sqrt(1 - correlation * correlation) * noise * gauss(random);
    run.time.push_back(t);
    run.command.push_back(command_at(t, seed));
    run.angle.push_back(x[0] + ar);
  }
  return run;
}

inline MotionOptions options_for(const Truth& truth) {
  MotionOptions options;
  options.command_linear = true;  // the command above is smooth between its samples
  options.wheel_radius = truth.radius;
  options.gravity_torque = truth.gravity;
  options.friction_speed = truth.friction_speed;
  options.start[kInertia] = truth.p[kInertia];
  options.fixed[kInertia] = true;
  return options;
}

}  // namespace isac::estimate
