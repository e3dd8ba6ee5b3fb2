#include "isac/tune/linear_step.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
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

/// From one row to the next, and what is read: x_k+1 = Φ x_k + Γ_old u_k−whole−1 + Γ_new u_k−whole, φ_k = read · x_k.
struct StepRow {
  Eigen::Matrix3d phi;
  State old_gain, new_gain, read;
  std::ptrdiff_t whole;  ///< rows of dead time
};
StepRow row_of(const LagPlant& plant, double interval) {
  const Matrix4 system = system_of(plant);
  const double behind = plant.dead_time / interval, whole = std::floor(behind);
  const double part = (behind - whole) * interval;  // the older command still acts this long
  const Step first = step_of(system, part), second = step_of(system, interval - part);
  const double w = 1 / plant.time_constant, bend = plant.bend;
  return {.phi = second.phi * first.phi,
          .old_gain = second.phi * first.gamma,
          .new_gain = second.gamma,
          .read = State(bend * w * w, 1 - bend * w * w, -2 * bend * plant.damping * w),  // φ + q φ̈
          .whole = static_cast<std::ptrdiff_t>(whole)};
}

/// At a dead time of 0 a derivative's step goes below it: the command is then asked for ahead, and held after its last row.
struct Delayed {
  std::span<const double> command;
  std::ptrdiff_t whole;
  double operator()(std::ptrdiff_t k) const {
    const auto last = static_cast<std::ptrdiff_t>(command.size()) - 1;
    return command[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k - whole, 0, last))] - command[0];
  }
};

/// Derivatives of a unit step's answer at a state, without the bend; `fourth` behind the step.
struct Derivatives {
  double first, second, third, fourth;
};
Derivatives derivatives_of(const LagPlant& p, const State& x) {
  const double w = 1 / p.time_constant;
  const double first = x[2], pressure_1 = (p.gain - x[0]) / p.lag, pressure_2 = -pressure_1 / p.lag;
  const double second = w * w * (x[0] - x[1]) - 2 * p.damping * w * first;
  const double third = w * w * (pressure_1 - first) - 2 * p.damping * w * second;
  return {first, second, third, w * w * (pressure_2 - second) - 2 * p.damping * w * third};
}

/// Steepest point of a unit step's answer, found on the exact solution.
models::StepShape<double> tangent_of(const LagPlant& plant) {
  const Matrix4 system = system_of(plant);
  const auto at = [&system, &plant](double t) { return derivatives_of(plant, step_of(system, t).gamma); };
  // The speed rises first and has its greatest value at its first maximum: later swings of a stable plant are smaller.
  const double fastest = std::min({plant.time_constant, plant.lag > 0 ? plant.lag : plant.time_constant});
  const double h = 0.05 * fastest;
  const Step one = step_of(system, h);
  State x = State::Zero();
  double t = 0, last = -std::numeric_limits<double>::infinity();
  bool rising = false;  // a bend lets the speed begin with a jump
  for (int i = 0; i < 200000; ++i, t += h) {
    x = (one.phi * x + one.gamma).eval();
    const Derivatives d = derivatives_of(plant, x);
    const double now = d.first + plant.bend * d.third;
    if (rising && !(now > last)) break;
    rising = now > last && i > 0;
    last = now;
  }
  double low = std::max(0.0, t - h), high = t + h;
  for (int i = 0; i < 60; ++i) {  // the speed stops growing at the steepest point
    const double middle = 0.5 * (low + high);
    const Derivatives d = at(middle);
    (d.second + plant.bend * d.fourth > 0 ? low : high) = middle;
  }
  const State steepest = step_of(system, 0.5 * (low + high)).gamma;
  const Derivatives d = derivatives_of(plant, steepest);
  const double height = steepest[1] + plant.bend * d.second, slope = d.first + plant.bend * d.third;
  return {.latency = plant.dead_time + 0.5 * (low + high) - height / slope, .adjustment = plant.gain / slope};
}

}  // namespace

void simulate_into(const LagPlant& plant, double interval, std::span<const double> command,
                   std::vector<double>& angle) {
  const StepRow row = row_of(plant, interval);
  const Delayed delayed{command, row.whole};
  State x = State::Zero();
  angle.resize(command.size());
  for (std::size_t k = 0; k < command.size(); ++k) {
    angle[k] = row.read.dot(x);
    const auto now = static_cast<std::ptrdiff_t>(k);
    x = (row.phi * x + row.old_gain * delayed(now - 1) + row.new_gain * delayed(now)).eval();
  }
}

void simulate_means_into(const LagPlant& plant, double interval, std::span<const double> command,
                         std::size_t rows, std::vector<double>& mean) {
  const StepRow row = row_of(plant, interval);
  const auto n = static_cast<Eigen::Index>(rows), blocks = static_cast<Eigen::Index>(command.size() / rows);
  // Of x at a block's first row and the commands from one row before it: the sum of φ over the block, and x behind it.
  Eigen::Matrix<double, 4, 3> from_state = Eigen::Matrix<double, 4, 3>::Zero();
  from_state.bottomRows<3>().setIdentity();
  Eigen::Matrix<double, 4, Eigen::Dynamic> from_command(4, n + 1);
  from_command.setZero();
  for (Eigen::Index i = 0; i < n; ++i) {
    from_state.row(0) += row.read.transpose() * from_state.bottomRows<3>();
    from_command.row(0) += row.read.transpose() * from_command.bottomRows<3>();
    from_state.bottomRows<3>() = (row.phi * from_state.bottomRows<3>()).eval();
    from_command.bottomRows<3>() = (row.phi * from_command.bottomRows<3>()).eval();
    from_command.col(i).tail<3>() += row.old_gain;
    from_command.col(i + 1).tail<3>() += row.new_gain;
  }
  thread_local std::vector<double> held;
  held.resize(static_cast<std::size_t>(blocks * n + 1));
  const Delayed delayed{command, row.whole};
  for (std::size_t k = 0; k < held.size(); ++k) held[k] = delayed(static_cast<std::ptrdiff_t>(k) - 1);
  const Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>> windows(held.data(), n + 1, blocks,
                                                                           Eigen::OuterStride<>(n));
  thread_local Eigen::Matrix<double, 4, Eigen::Dynamic> forced;
  forced.noalias() = from_command * windows;
  mean.resize(static_cast<std::size_t>(blocks));
  State x = State::Zero();
  for (Eigen::Index b = 0; b < blocks; ++b) {
    const Eigen::Vector4d next = from_state * x + forced.col(b);
    mean[static_cast<std::size_t>(b)] = next[0] / static_cast<double>(n);
    x = next.tail<3>();
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
