#include "isac/runtime/control_loop.hpp"

#include <algorithm>
#include <cmath>

namespace isac::runtime {
namespace {

using control::FaultCode;
using control::Finding;

[[nodiscard]] double or_zero(double value) noexcept {
  return std::isnan(value) ? 0.0 : value;
}

}  // namespace

ControlLoop::ControlLoop(card::Card& card, const JointWiring& wiring,
                         const ControlSettings& settings) noexcept
    : card_(card),
      wiring_(wiring),
      settings_(settings),
      period_ns_(settings.fault.period),
      machine_(settings.fault) {
  controller_.compensate = settings.compensate;
  controller_.chain = settings.chain;
  controller_.coupling = settings.coupling;
  controller_.inertia = settings.inertia;
  for (auto& watch : input_watch_)
    watch = control::InputWatch(wiring.shape.input_max_code, settings.samples_at_end);
  for (int k = 0; k < wiring.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const JointLines& lines = wiring.joint[i];
    joint_watch_[i] = control::JointWatch<double>(settings.watch[i], k);
    control::EncoderWatchSettings<double> encoder = settings.encoder[i];
    encoder.modulus = wiring.shape.encoder_modulus;
    encoder.counts_per_radian = 1.0 / std::abs(lines.radian_per_count);
    encoder_watch_[i] = control::EncoderWatch<double>(encoder, k);
    velocity_[i] = control::VelocityEstimate<double>(settings.velocity_filter);
    controller_.feed_forward[i] = settings.feed_forward[i];
    for (const CodeLine* line : {&lines.F1, &lines.F2, &lines.p1, &lines.p2}) {
      if (!line->wired()) continue;
      const bool zero_is_an_end =
          line == &lines.F1 || line == &lines.F2;  // gauge pressure of a vented muscle is code 0
      input_used_[line->index()] = true;
      input_watch_[line->index()] =
          control::InputWatch(wiring.shape.input_max_code, settings.samples_at_end, zero_is_an_end);
    }
  }
}

Status ControlLoop::configure() noexcept {
  for (int k = 0; k < wiring_.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    failed_ = k;
    const bool measured = settings_.joint[i].structure == control::Structure::kCascade;
    if (measured && !wiring_.joint[i].measures_force()) return Status::kNotPermitted;
    if (const Status status = controller_.joints[i].configure(settings_.joint[i]); !ok(status)) return status;
  }
  failed_ = -1;
  return Status::kOk;
}

Status ControlLoop::sample(double& dt) noexcept {
  Status status = has_sample_ ? card_.wait_until(next_ns_) : Status::kOk;
  if (ok(status)) status = card_.read(row_.sample);
  if (!ok(status)) return status;
  const std::int64_t now = row_.sample.time_ns;
  if (!has_sample_) {
    first_ns_ = last_ns_ = now;
    next_ns_ = now;
    dt = 1e-9 * static_cast<double>(period_ns_);
  } else {
    dt = 1e-9 * static_cast<double>(now - last_ns_);
    end_.longest_late_ns = std::max(end_.longest_late_ns, now - next_ns_);
    last_ns_ = now;
  }
  if (const std::int64_t behind = (now - next_ns_) / period_ns_; behind > 0) next_ns_ += behind * period_ns_;
  next_ns_ += period_ns_;
  row_.time_ns = now - first_ns_;
  return Status::kOk;
}

void ControlLoop::measure(double dt) noexcept {
  for (int k = 0; k < wiring_.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const JointLines& lines = wiring_.joint[i];
    JointCycle& joint = row_.joint[i];
    if (!has_sample_) {
      const double modulus = static_cast<double>(wiring_.shape.encoder_modulus);
      double from_middle =
          static_cast<double>(row_.sample.encoder[static_cast<std::size_t>(lines.encoder)]) - lines.middle;
      if (from_middle > 0.5 * modulus) from_middle -= modulus;
      if (from_middle < -0.5 * modulus) from_middle += modulus;
      first_count_[i] = from_middle;
    }
    joint.angle =
        (first_count_[i] + static_cast<double>(encoder_watch_[i].position())) * lines.radian_per_count;
    static_cast<void>(
        velocity_[i].step(joint.angle, dt, joint.velocity));  // a dt that is no time is a stale sample
    joint.p1 = lines.p1.value(row_.sample.input);
    joint.p2 = lines.p2.value(row_.sample.input);
    joint.F1 = lines.F1.value(row_.sample.input);
    joint.F2 = lines.F2.value(row_.sample.input);
  }
}

Finding ControlLoop::watch(double dt) noexcept {
  Finding first;
  const auto keep = [&first](const Finding& found) noexcept {
    if (!first.found()) first = found;
  };
  for (int c = 0; c < wiring_.shape.inputs; ++c) {
    const auto i = static_cast<std::size_t>(c);
    if (input_used_[i]) keep(input_watch_[i].check(row_.sample.input[i], true, c));
  }
  for (int k = 0; k < wiring_.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const JointLines& lines = wiring_.joint[i];
    const JointCycle& joint = row_.joint[i];  // what was commanded is still that of the cycle before
    const bool measured = lines.measures_pressure();
    const double p1 = measured ? lines.p1.value(row_.sample.input) : joint.p1_cmd;
    const double p2 = measured ? lines.p2.value(row_.sample.input) : joint.p2_cmd;
    keep(encoder_watch_[i].check(row_.sample.encoder[static_cast<std::size_t>(lines.encoder)],
                                 0.5 * (p2 - p1), dt, row_.warnings));
  }
  measure(dt);
  for (int k = 0; k < wiring_.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const JointLines& lines = wiring_.joint[i];
    const JointCycle& joint = row_.joint[i];
    const bool measured = lines.measures_pressure();
    const double radius = settings_.joint[i].wheel_radius;
    keep(joint_watch_[i].check(
        {.pressure_1 = measured ? joint.p1 : joint.p1_cmd,
         .pressure_2 = measured ? joint.p2 : joint.p2_cmd,
         .angle = joint.angle,
         .speed = joint.velocity,
         .force_1 = or_zero(joint.F1),
         .force_2 = or_zero(joint.F2),
         .torque = lines.measures_force() ? (joint.F2 - joint.F1) * radius : joint.torque,
         .desired_angle = joint.aim.angle,
         .follows = in_control_ && wanted_.mode == control::Mode::kPosition},
        dt, row_.warnings));
  }
  return first;
}

void ControlLoop::judge(const Finding& found, bool answered) noexcept {
  const std::int64_t stamp = answered ? row_.sample.time_ns : last_ns_ + period_ns_;
  const std::int64_t clock = card_.clock_ns();
  const control::RunState before = machine_.state();
  machine_.begin({.now = std::max(clock, stamp),
                  .sampled = stamp,
                  .arm = wanted_.arm,
                  .acknowledge = wanted_.acknowledge,
                  .finding = found});
  if (machine_.late()) row_.warnings |= control::kTickLate;
  good_cycles_ = found.found() || machine_.arm_refused() ? 0 : good_cycles_ + 1;
  bad_cycles_ = good_cycles_ > settings_.fault.plausible_ticks ? 0 : bad_cycles_ + 1;
  if (found.found()) end_.cause = found;
  if (before != control::RunState::kArmed && machine_.state() == control::RunState::kArmed)
    armed_ns_ = last_ns_;
}

void ControlLoop::act(double dt) noexcept {
  const double armed_for = 1e-9 * static_cast<double>(last_ns_ - armed_ns_);
  if (!in_control_ && armed_for < settings_.run_up) {
    row_.phase = Phase::kRunUp;
    const double share = armed_for / settings_.run_up;
    for (int k = 0; k < wiring_.joints; ++k) {
      const auto i = static_cast<std::size_t>(k);
      row_.joint[i].p1_cmd = row_.joint[i].p2_cmd = share * settings_.joint[i].mean_pressure;
    }
    return;
  }
  if (!in_control_) {
    in_control_ = true;
    control_ns_ = last_ns_;
  }
  row_.phase = Phase::kControl;
  control(dt);
}

void ControlLoop::control(double dt) noexcept {
  Controller::PerJoint<control::JointMeasurement<double>> now{};
  Controller::PerJoint<control::ArmReference<double>> reference{};
  Controller::PerJoint<control::JointCommand<double>> command{};
  for (int k = 0; k < wiring_.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const JointCycle& joint = row_.joint[i];
    now[i] = {.angle = joint.angle,
              .velocity = joint.velocity,
              .torque = or_zero(joint.F2 - joint.F1) * settings_.joint[i].wheel_radius};
    reference[i] = {.angle = joint.aim.angle,
                    .velocity = joint.aim.velocity,
                    .acceleration = joint.aim.acceleration,
                    .torque = joint.aim.torque};
    if (!ok(controller_.joints[i].set_mode(wanted_.mode)))
      machine_.report({.code = FaultCode::kCommandNotFinite, .joint = static_cast<std::int8_t>(k)});
  }
  int failed = -1;
  if (!ok(controller_.step(now, reference, dt, command, failed)))
    machine_.report({.code = FaultCode::kCommandNotFinite, .joint = static_cast<std::int8_t>(failed)});
  for (int k = 0; k < wiring_.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    JointCycle& joint = row_.joint[i];
    joint.p1_cmd = command[i].pressure.muscle_1;
    joint.p2_cmd = command[i].pressure.muscle_2;
    joint.torque = command[i].torque;
    joint.asked_torque = command[i].wanted_torque;
    joint.limited = command[i].limited;
  }
}

void ControlLoop::write_out() noexcept {
  card::Command command;
  for (int k = 0; k < wiring_.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const JointLines& lines = wiring_.joint[i];
    const std::uint32_t top = wiring_.shape.output_max_code;
    command.output[lines.valve_1.index()] = lines.valve_1.code(row_.joint[i].p1_cmd, top);
    command.output[lines.valve_2.index()] = lines.valve_2.code(row_.joint[i].p2_cmd, top);
  }
  end_.status = card_.write(command);
  if (!ok(end_.status)) machine_.report({.code = FaultCode::kReadFailed});
  row_.command = command;
}

void ControlLoop::close_valves() noexcept {
  static_cast<void>(
      card_.vent());  // what a card answers to a vent changes nothing: the next cycle asks again
  for (JointCycle& joint : row_.joint) {
    joint.p1_cmd = joint.p2_cmd = joint.torque = joint.asked_torque = 0.0;
    joint.limited = 0;
  }
  for (auto& joint : controller_.joints) static_cast<void>(joint.set_mode(control::Mode::kVented));
  row_.command = {};
  row_.phase = machine_.state() == control::RunState::kFaulted ? Phase::kVented : Phase::kChecking;
  in_control_ = false;
}

void ControlLoop::beat() noexcept {
  if (!wiring_.shape.heartbeat) return;
  const bool alive = row_.answered && machine_.state() != control::RunState::kFaulted;
  beat_ = alive && !beat_;
  if (ok(card_.beat(beat_)) || !alive) return;
  machine_.report(
      {.code = FaultCode::kReadFailed});  // whoever guards the supply must not be left without a sign
  close_valves();
}

void ControlLoop::show(Live* live) const noexcept {
  if (live == nullptr) return;
  live->time_ns.store(row_.time_ns, std::memory_order_relaxed);
  live->phase.store(static_cast<int>(row_.phase), std::memory_order_relaxed);
  live->late.store(machine_.late_ticks(), std::memory_order_relaxed);
  live->skipped.store(machine_.skipped_periods(), std::memory_order_relaxed);
  for (int k = 0; k < wiring_.joints; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const JointCycle& joint = row_.joint[i];
    live->angle[i].store(joint.angle, std::memory_order_relaxed);
    live->aim[i].store(joint.aim.angle, std::memory_order_relaxed);
    live->delta_pressure[i].store(0.5 * (joint.p2_cmd - joint.p1_cmd), std::memory_order_relaxed);
  }
  live->heart.beat.fetch_add(1, std::memory_order_release);
}

bool ControlLoop::cycle(Director& director, Live* live, CycleSink* sink) noexcept {
  row_.warnings = 0;
  double dt = 0;
  end_.status = sample(dt);
  if (end_.status == Status::kEndOfData) {
    end_.why = LoopEnd::Why::kCardEnded;
    close_valves();
    return false;
  }
  const bool answered = ok(end_.status);
  row_.answered = answered;
  if (!answered) {
    next_ns_ += period_ns_;
    row_.time_ns = std::max(card_.clock_ns(), last_ns_ + period_ns_) - first_ns_;
  }
  const Finding found = answered ? watch(dt) : Finding{.code = FaultCode::kReadFailed};
  has_sample_ = has_sample_ || answered;

  Moment moment{.cycle = row_.cycle,
                .time_ns = row_.time_ns,
                .control_time = in_control_ ? 1e-9 * static_cast<double>(last_ns_ - control_ns_) : 0.0,
                .phase = row_.phase,
                .plausible = good_cycles_ > settings_.fault.plausible_ticks};
  for (std::size_t i = 0; i < row_.joint.size(); ++i) moment.angle[i] = row_.joint[i].angle;
  const bool more = director.at(moment, wanted_);
  row_.arm = wanted_.arm;
  row_.mode = wanted_.mode;
  for (std::size_t i = 0; i < row_.joint.size(); ++i) row_.joint[i].aim = wanted_.joint[i];

  judge(found, answered);
  if (more && !machine_.vents()) act(dt);
  if (more && !machine_.vents()) write_out();
  if (!more || machine_.vents()) close_valves();
  beat();
  row_.state = machine_.state();
  row_.finding = machine_.state() == control::RunState::kFaulted ? machine_.cause() : found;
  ++end_.cycles;
  show(live);
  const bool taken = sink == nullptr || sink->take(row_);
  ++row_.cycle;
  if (!taken) end_.why = LoopEnd::Why::kSink;
  return more && taken;
}

LoopEnd ControlLoop::run(Director& director, const std::atomic<bool>& stop, Live* live,
                         CycleSink* sink) noexcept {
  using Why = LoopEnd::Why;
  const double patience_cycles = kPatience * 1e9 / static_cast<double>(period_ns_);
  for (;;) {
    if (stop.load(std::memory_order_relaxed)) {
      end_.why = Why::kStopped;
      break;
    }
    if (!cycle(director, live, sink)) break;
    if (machine_.state() == control::RunState::kFaulted) {
      end_.why = Why::kFault;
      end_.cause = machine_.cause();
      break;
    }
    const bool dead = !ok(end_.status);
    if (dead || static_cast<double>(bad_cycles_) > patience_cycles) {
      end_.why = dead ? Why::kFault : Why::kImplausible;
      break;
    }
  }
  close_valves();
  if (wiring_.shape.heartbeat) static_cast<void>(card_.beat(false));
  end_.late = machine_.late_ticks();
  end_.skipped = machine_.skipped_periods();
  end_.ended_ns = row_.time_ns;
  return end_;
}

}  // namespace isac::runtime
