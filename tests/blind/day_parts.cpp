#include "day_parts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace blind {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

}  // namespace

Reference multisine(Random& random, double slowest, double fastest, int count) {
  std::vector<std::array<double, 3>> parts;
  double sum = 0.0;
  for (int i = 0; i < count; ++i) {
    const double f = slowest * std::pow(fastest / slowest, (i + random.uniform(0.1, 0.9)) / count);
    const double size = random.uniform(0.6, 1.0);
    parts.push_back({kTwoPi * f, random.uniform(0.0, kTwoPi), size});
    sum += size;
  }
  return [parts, sum](double t) {
    double x = 0.0;
    for (const auto& [omega, phase, size] : parts) x += size * std::sin(omega * t + phase);
    return 1.5 * x / sum;
  };
}

Reference levels(const std::vector<double>& values, double hold) {
  return [values, hold](double t) {
    const auto i = static_cast<std::size_t>(std::max(0.0, t / hold));
    return values[std::min(i, values.size() - 1)];
  };
}

Reference triangle(Random& random, double speed_low, double speed_high, double seconds) {
  std::vector<std::array<double, 2>> corners = {{0.0, 0.0}};
  double side = random.sign();
  while (corners.back()[0] < seconds + 5.0) {
    const double target = side * random.uniform(0.85, 1.0);
    const double speed = random.log_uniform(speed_low, speed_high) * random.uniform(0.9, 1.1);
    corners.push_back({corners.back()[0] + std::abs(target - corners.back()[1]) / speed, target});
    side = -side;
  }
  return [corners](double t) {
    const auto next = std::upper_bound(corners.begin(), corners.end(), t,
                                       [](double time, const auto& corner) { return time < corner[0]; });
    if (next == corners.end()) return corners.back()[1];
    if (next == corners.begin()) return corners.front()[1];
    const auto& [t0, x0] = *(next - 1);
    return x0 + ((*next)[1] - x0) * (t - t0) / ((*next)[0] - t0);
  };
}

void follow(RunPlan& run, const Reference& reference, double offset, double amplitude, int rows) {
  constexpr double kBandwidth = 35.0, kStep = kRowTime / 4;
  double x = offset + amplitude * reference(0.0), y = x, z = x;
  for (int k = 0; k < rows; ++k) {
    run.hand.push_back(z);
    run.hand_velocity.push_back(kBandwidth * (y - z));
    for (int i = 0; i < 4; ++i) {
      // Exact for an input that is held: three equal lags.
      const double u = offset + amplitude * reference(k * kRowTime + (i + 0.5) * kStep);
      const double h = kBandwidth * kStep, decay = std::exp(-h);
      const double ex = x - u, ey = y - u, ez = z - u;
      x = u + decay * ex;
      y = u + decay * (ey + h * ex);
      z = u + decay * (ez + h * ey + 0.5 * h * h * ex);
    }
  }
}

double reach(const Rig& rig, double delta, double mean) {
  const double largest = 0.9 * 2.0 * rig.r * (rig.pull_zero + rig.pull_gain * mean);
  const double stiffness = -rig.A * rig.r * rig.r;
  return std::min(1.1, (largest - rig.B * rig.r * std::abs(delta) - 1.5) / stiffness);
}

void command(RunPlan& run, double delta, double mean) {
  run.command_1.push_back(std::clamp(mean - delta, 0.0, 5.0));
  run.command_2.push_back(std::clamp(mean + delta, 0.0, 5.0));
}

void command_each(RunPlan& run, const Reference& first, const Reference& second, int rows) {
  for (int k = 0; k < rows; ++k) {
    run.command_1.push_back(first(k * kRowTime));
    run.command_2.push_back(second(k * kRowTime));
  }
}

}  // namespace blind
