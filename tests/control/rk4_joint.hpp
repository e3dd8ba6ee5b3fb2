/// @file
/// A joint of the testbed for closed-loop tests, written down anew from the seed's equations (no code of the models), and
/// integrated by the classical Runge-Kutta method: p behind a dead time and a lag, muscle pair, inertia, load.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <deque>
#include <functional>

namespace isac::test {

struct Rk4Joint {
  double A = -23450, B = 174.2 / 98066.5, C = 0.0026, D = 0.14, r = 0.019, J = 0.0085;
  double valve_gain = 1, lag = 0.17;
  int dead_steps = 0;                           ///< of the control period
  double coulomb = 0;                           ///< N m, tanh-smoothed over 1 mrad/s
  bool clamped = false;                         ///< φ held
  double external = 0;                          ///< N m
  std::function<double(double)> load_of_angle;  ///< N m over φ, e.g. gravity

  double p1 = 0, p2 = 0, angle = 0, velocity = 0;  ///< Pa, rad, rad/s
  std::deque<std::array<double, 2>> tube;

  void rest_at(double mean_pressure) { p1 = p2 = mean_pressure; }
  [[nodiscard]] double torque() const { return torque_of({p1, p2, angle, velocity}); }

  /// One control period with these commands; dt of 0.5 ms is cut into `parts` steps of RK4.
  void step(double u1, double u2, double dt, int parts = 2) {
    tube.push_back({u1, u2});
    std::array<double, 2> u = tube.front();
    if (static_cast<int>(tube.size()) > dead_steps) tube.pop_front();
    const double h = dt / parts;
    for (int n = 0; n < parts; ++n) {
      const State x = {p1, p2, angle, velocity};
      const State k1 = rate(x, u), k2 = rate(move(x, k1, h / 2), u);
      const State k3 = rate(move(x, k2, h / 2), u), k4 = rate(move(x, k3, h), u);
      State y = x;
      for (std::size_t i = 0; i < 4; ++i) y[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
      p1 = y[0], p2 = y[1], angle = y[2], velocity = y[3];
    }
  }

 private:
  using State = std::array<double, 4>;
  [[nodiscard]] double torque_of(const State& x) const {
    const double dp = (x[1] - x[0]) / 2, w = x[3];
    return A * r * r * x[2] + B * r * dp - C * w * w * w - D * w;
  }
  [[nodiscard]] State rate(const State& x, const std::array<double, 2>& u) const {
    double total = torque_of(x) + external - coulomb * std::tanh(x[3] / 1e-3);
    if (load_of_angle) total += load_of_angle(x[2]);
    return {(valve_gain * u[0] - x[0]) / lag, (valve_gain * u[1] - x[1]) / lag, clamped ? 0 : x[3],
            clamped ? 0 : total / J};
  }
  static State move(State x, const State& k, double h) {
    for (std::size_t i = 0; i < 4; ++i) x[i] += h * k[i];
    return x;
  }
};

}  // namespace isac::test
