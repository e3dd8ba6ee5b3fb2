#include "isac/tune/closed_loop.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "isac/control/joint_controller.hpp"
#include "isac/control/velocity_estimate.hpp"

namespace isac::tune {
namespace {

constexpr double kTrajectoryMoves = 1.6;  // s, then the sine
constexpr double kFarAway = 4;            // rad: nothing that is stable goes there

/// The joint that moves: two valve units behind a tube, muscles, inertia.
class Joint {
 public:
  Joint(const JointModel& model, double interval)
      : model_(model),
        interval_(interval),
        decay_(model.valve.lag > 0 ? std::exp(-interval / model.valve.lag) : 0.0),
        pressure_{model.mean_pressure, model.mean_pressure} {
    const double behind = model.valve.dead_time / interval;
    whole_ = static_cast<std::size_t>(behind);
    share_ = behind - static_cast<double>(whole_);
    tube_.assign(whole_ + 2, {model.mean_pressure, model.mean_pressure});
  }

  void step(double p1, double p2, double load) {
    load_ = load;
    tube_[at_] = {p1, p2};
    const std::size_t n = tube_.size();
    const auto& now = tube_[(at_ + n - whole_) % n];
    const auto& before = tube_[(at_ + n - whole_ - 1) % n];
    at_ = (at_ + 1) % n;
    const std::array<double, 2> from = pressure_;
    for (std::size_t i = 0; i < 2; ++i) {
      // The older command still acts for a share of the tick; its mean is what counts over so short a time.
      const double target = model_.valve.gain * (share_ * before[i] + (1 - share_) * now[i]);
      pressure_[i] = std::max(0.0, target + (pressure_[i] - target) * decay_);
    }
    const double a = 0.5 * (from[1] - from[0]), c = 0.5 * (pressure_[1] - pressure_[0]), b = 0.5 * (a + c),
                 h = interval_;
    const double k1 = pull(angle_, speed_, a);
    const double k2 = pull(angle_ + h / 2 * speed_, speed_ + h / 2 * k1, b);
    const double k3 = pull(angle_ + h / 2 * (speed_ + h / 2 * k1), speed_ + h / 2 * k2, b);
    const double k4 = pull(angle_ + h * (speed_ + h / 2 * k2), speed_ + h * k3, c);
    angle_ += h * (speed_ + h / 6 * (k1 + k2 + k3));
    speed_ += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  }

  [[nodiscard]] double angle() const { return angle_; }
  [[nodiscard]] double torque() const {
    return models::joint_torque(model_.muscle, model_.wheel_radius, angle_,
                                0.5 * (pressure_[1] - pressure_[0]), speed_);
  }

 private:
  [[nodiscard]] double pull(double angle, double speed, double delta_pressure) const {
    return (models::joint_torque(model_.muscle, model_.wheel_radius, angle, delta_pressure, speed) - load_) /
           model_.inertia;
  }
  const JointModel& model_;
  double interval_, decay_, load_ = 0, share_ = 0, angle_ = 0, speed_ = 0;
  std::size_t whole_ = 0, at_ = 0;
  std::array<double, 2> pressure_;
  std::vector<std::array<double, 2>> tube_;
};

double smooth_move(double share) noexcept {
  const double s = std::clamp(share, 0.0, 1.0);
  return s * s * s * (10 + s * (-15 + 6 * s));  // least jerk
}

}  // namespace

control::JointSettings<double> settings_of(const JointModel& model, const Gains& gains,
                                           const Sampling& sampling) {
  control::JointSettings<double> s;
  s.structure = gains.structure;
  s.muscle = model.muscle;
  s.wheel_radius = model.wheel_radius;
  s.mean_pressure = model.mean_pressure;
  s.inertia = model.inertia;
  s.valve = model.valve;
  s.position = gains.position;
  s.torque = gains.torque;
  s.derivative_filter = sampling.derivative_filter;
  s.outer_every = sampling.outer_every;
  s.model_pressure = gains.model_pressure;
  s.limits = model.limits;
  return s;
}

Trace run_closed_loop(const JointModel& model, const JointModel& joint, const Gains& gains,
                      const std::function<double(double)>& reference, double duration,
                      const ClosedLoopOptions& options) {
  Trace trace;
  const double h = options.sampling.interval;
  const auto ticks = static_cast<std::size_t>(duration / h);
  for (auto* column : {&trace.time, &trace.reference, &trace.angle, &trace.delta_pressure})
    column->reserve(ticks);
  control::JointController<double> controller;
  control::VelocityEstimate<double> speed(options.sampling.velocity_filter);
  Joint moving(joint, h);
  trace.bounded = ok(controller.configure(settings_of(model, gains, options.sampling))) &&
                  ok(controller.set_mode(control::Mode::kPosition));
  for (std::size_t k = 0; k < ticks && trace.bounded; ++k) {
    const double t = static_cast<double>(k) * h, angle = moving.angle();
    const double seen =
        options.encoder_step > 0 ? options.encoder_step * std::round(angle / options.encoder_step) : angle;
    double velocity = 0;
    control::JointCommand<double> command;
    trace.bounded =
        std::abs(angle) < kFarAway && ok(speed.step(seen, h, velocity)) &&
        ok(controller.step({seen, velocity, moving.torque()}, {.angle = reference(t)}, h, command));
    if (!trace.bounded) break;
    trace.time.push_back(t);
    trace.reference.push_back(reference(t));
    trace.angle.push_back(angle);
    trace.delta_pressure.push_back(command.delta_pressure);
    moving.step(command.pressure.muscle_1, command.pressure.muscle_2,
                options.load != 0 && t >= options.load_from ? options.load : 0.0);
  }
  return trace;
}

StepFigures step_figures(const Trace& trace, double height) {
  StepFigures f;
  f.bounded = trace.bounded;
  for (std::size_t k = 0; k < trace.time.size(); ++k) {
    const double t = trace.time[k], y = trace.angle[k] / height;
    f.overshoot = std::max(f.overshoot, y - 1);
    if (y >= 0.9) f.rise = std::min(f.rise, t);
    if (std::abs(y - 1) > 0.05) f.settling = t;
    f.rest = std::abs(y - 1);
    if (k > 0) f.itae += t * std::abs(height - trace.angle[k]) * (t - trace.time[k - 1]);
  }
  return f;
}

TrackingFigures tracking_figures(const Trace& trace) {
  TrackingFigures f;
  f.bounded = trace.bounded;
  if (trace.time.size() < 2) return f;
  double squares = 0, changes = 0;
  for (std::size_t k = 0; k < trace.time.size(); ++k) {
    const double e = trace.reference[k] - trace.angle[k];
    squares += e * e;
    f.worst = std::max(f.worst, std::abs(e));
    if (k > 0) changes += std::pow(trace.delta_pressure[k] - trace.delta_pressure[k - 1], 2);
  }
  const double h = trace.time[1] - trace.time[0], n = static_cast<double>(trace.time.size());
  f.rms = std::sqrt(squares / n);
  f.effort = std::sqrt(changes / n) / h;
  return f;
}

Trace run_trajectory(const JointModel& model, const JointModel& joint, const Gains& gains,
                     const ClosedLoopOptions& options) {
  ClosedLoopOptions loaded = options;
  loaded.load = kTrajectoryLoad;
  loaded.load_from = kTrajectoryMoves;
  return run_closed_loop(model, joint, gains, trajectory, kTrajectoryDuration, loaded);
}

Trace run_step(const JointModel& model, const JointModel& joint, const Gains& gains,
               const ClosedLoopOptions& options) {
  return run_closed_loop(
      model, joint, gains, [](double) { return kStepHeight; }, kStepDuration, options);
}

double trajectory(double time) noexcept {
  if (time < kTrajectoryMoves)
    return 0.4 * (smooth_move((time - 0.1) / 0.6) - smooth_move((time - 0.8) / 0.6));
  return 0.15 * std::sin(2 * (time - kTrajectoryMoves));
}

}  // namespace isac::tune
