#include "isac/tune/linear_step.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

namespace isac::tune {
namespace {

using Matrix4 = Eigen::Matrix4d;
using State = Eigen::Vector3d;

/// x = (pressure times gain, angle, speed) and the command as a fourth state that stands still.
Matrix4 system_of(const LagPlant& p) {
  Matrix4 a = Matrix4::Zero();
  const double w = 1 / p.time_constant;
  a(0, 0) = -1 / p.lag;
  a(0, 3) = p.gain / p.lag;
  a(1, 2) = 1;
  a(2, 0) = w * w;
  a(2, 1) = -w * w;
  a(2, 2) = -2 * p.damping * w;
  return a;
}

struct Step {
  Eigen::Matrix3d phi;
  State gamma;
};
Step step_of(const Matrix4& system, double time) {
  const Matrix4 e = (system * time).exp();
  return {e.topLeftCorner<3, 3>(), e.topRightCorner<3, 1>()};
}

/// Steepest point of a unit step's answer, found on the exact solution.
models::StepShape<double> tangent_of(const LagPlant& plant) {
  const Matrix4 system = system_of(plant);
  const auto at = [&system](double t) -> State { return step_of(system, t).gamma; };
  // The speed rises first and has its greatest value at its first maximum: later swings of a stable plant are smaller.
  const double fastest = std::min({plant.time_constant, plant.lag > 0 ? plant.lag : plant.time_constant});
  const double h = 0.05 * fastest;
  const Step one = step_of(system, h);
  State x = State::Zero();
  double t = 0, last = 0;
  for (int i = 0; i < 200000; ++i, t += h) {
    x = (one.phi * x + one.gamma).eval();
    if (!(x[2] > last)) break;
    last = x[2];
  }
  double low = std::max(0.0, t - h), high = t + h;
  for (int i = 0; i < 60; ++i) {  // ÿ changes its sign at the steepest point
    const double middle = 0.5 * (low + high);
    const State m = at(middle);
    const double w = 1 / plant.time_constant;
    (w * w * (m[0] - m[1]) - 2 * plant.damping * w * m[2] > 0 ? low : high) = middle;
  }
  const State steepest = at(0.5 * (low + high));
  return {.latency = plant.dead_time + 0.5 * (low + high) - steepest[1] / steepest[2],
          .adjustment = plant.gain / steepest[2]};
}

}  // namespace

void simulate_into(const LagPlant& plant, double interval, std::span<const double> command,
                   std::vector<double>& angle) {
  const Matrix4 system = system_of(plant);
  const double behind = plant.dead_time / interval;
  const auto whole = static_cast<std::ptrdiff_t>(std::floor(behind));
  const double part =
      (behind - static_cast<double>(whole)) * interval;  // the older command still acts this long
  const Step first = step_of(system, part), second = step_of(system, interval - part);
  const Eigen::Matrix3d phi = second.phi * first.phi;
  const State old_gain = second.phi * first.gamma, new_gain = second.gamma;
  // At a dead time of 0 a derivative's step goes below it: the command is then asked for ahead, and held after its last row.
  const auto last = static_cast<std::ptrdiff_t>(command.size()) - 1;
  const auto delayed = [&](std::ptrdiff_t k) {
    return command[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, last))] - command[0];
  };
  State x = State::Zero();
  angle.resize(command.size());
  for (std::size_t k = 0; k < command.size(); ++k) {
    angle[k] = x[1];
    const auto now = static_cast<std::ptrdiff_t>(k) - whole;
    x = (phi * x + old_gain * delayed(now - 1) + new_gain * delayed(now)).eval();
  }
}

std::vector<double> simulate(const LagPlant& plant, double interval, std::span<const double> command) {
  std::vector<double> angle;
  simulate_into(plant, interval, command, angle);
  return angle;
}

models::StepShape<double> step_shape(const LagPlant& plant) {
  return tangent_of(plant);
}

models::StepShape<double> joint_step_shape(const LagPlant& plant) {
  const models::SecondOrder<double> motion{plant.time_constant, plant.damping, 1.0};
  models::StepShape<double> shape;
  if (ok(models::step_shape(motion, shape))) return shape;
  // Overdamped, lags T1 > T2: ẏ = (e^(−t/T1) − e^(−t/T2))/(T1 − T2) is greatest at t = ln(T1/T2) T1 T2/(T1 − T2).
  const double root = std::sqrt(std::max(1e-12, plant.damping * plant.damping - 1.0));
  const double slow = plant.time_constant * (plant.damping + root),
               quick = 1 / slow * plant.time_constant * plant.time_constant;
  const double split = slow - quick, t = std::log(slow / quick) * slow * quick / split;
  const double slope = (std::exp(-t / slow) - std::exp(-t / quick)) / split;
  const double height = 1 - (slow * std::exp(-t / slow) - quick * std::exp(-t / quick)) / split;
  return {.latency = t - height / slope, .adjustment = 1 / slope};
}

}  // namespace isac::tune
