#include "isac/runtime/experiment_loop.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <thread>

namespace isac::runtime {
namespace {

constexpr double kRampSeconds = 1.5;    // vented to initial pressure: eight lags of the valve unit
constexpr double kSettleSeconds = 1.0;  // six lags
constexpr double kLetGoSeconds = 0.5;   // four periods of the testbed's joint (T_J 0.032 s, damping 0.26)
constexpr double kPatienceSeconds = 60.0;

card::Task to_task(const series::Ask& ask) noexcept {
  card::Task task;
  switch (ask.kind) {
    case series::Ask::Kind::kRest:
      task.kind = card::Task::Kind::kRest;
      break;
    case series::Ask::Kind::kSweepByHand:
      task.kind = card::Task::Kind::kSweepByHand;
      break;
    case series::Ask::Kind::kClamp:
      task.kind = card::Task::Kind::kClamp;
      break;
    case series::Ask::Kind::kRelease:
      task.kind = card::Task::Kind::kRelease;
      break;
    case series::Ask::Kind::kPose:
      task.kind = card::Task::Kind::kPose;
      break;
    case series::Ask::Kind::kRemoveLoad:
      task.kind = card::Task::Kind::kRemoveLoad;
      break;
    case series::Ask::Kind::kHangWeight:
      task.kind = card::Task::Kind::kHangWeight;
      break;
    case series::Ask::Kind::kConnectSupply:
      task.kind = card::Task::Kind::kConnectSupply;
      break;
  }
  task.load_newton = ask.load;
  task.pressure_pascal = ask.pressure;
  task.amplitude_rad = ask.amplitude;
  task.speed_rad_s = ask.speed;
  task.vary_speed = ask.vary_speed;
  task.angle_rad = ask.angle;
  task.middle_rad = ask.middle;
  return task;
}

}  // namespace

ExperimentLoop::ExperimentLoop(card::Opened& rig, SignalMap& map, const series::Program& program,
                               const LoopOptions& options, RecordingLive& live,
                               const std::atomic<bool>& stop) noexcept
    : rig_(rig),
      map_(map),
      program_(program),
      options_(options),
      live_(live),
      stop_(stop),
      safety_(options.limits),
      period_ns_(std::llround(1e9 / options.rate)) {}

bool ExperimentLoop::end(LoopResult::End why) noexcept {
  result_.end = why;
  return false;
}

bool ExperimentLoop::start_clock() noexcept {
  card::Sample sample;
  result_.status = rig_.card->read(sample);
  if (!ok(result_.status)) {
    return end(result_.status == Status::kEndOfData ? LoopResult::End::kCardEnded : LoopResult::End::kCard);
  }
  next_ns_ = first_ns_ = sample.time_ns + period_ns_;
  wall_first_ = std::chrono::steady_clock::now();
  return true;
}

void ExperimentLoop::wait_for_wall_clock() const noexcept {
  std::this_thread::sleep_until(wall_first_ + std::chrono::nanoseconds(next_ns_ - first_ns_));
}

bool ExperimentLoop::tick(Tick& tick) noexcept {
  if (stop_.load(std::memory_order_relaxed)) return end(LoopResult::End::kStopRequested);
  if (options_.pace_real) wait_for_wall_clock();
  result_.status = rig_.card->wait_until(next_ns_);
  if (ok(result_.status)) result_.status = rig_.card->read(tick.sample);
  if (!ok(result_.status)) {
    return end(result_.status == Status::kEndOfData ? LoopResult::End::kCardEnded : LoopResult::End::kCard);
  }
  if (const std::int64_t behind = (tick.sample.time_ns - next_ns_) / period_ns_; behind > 0) {
    next_ns_ += behind * period_ns_;
    result_.late += static_cast<std::uint64_t>(behind);
  }
  tick.physical = map_.to_physical(tick.sample);
  const double since_began = static_cast<double>(tick.sample.time_ns - result_.began_ns) * 1e-9;
  if (!safety_.check(since_began, tick.physical)) {
    result_.fault = safety_.fault();
    return end(LoopResult::End::kLimit);
  }
  live_.angle.store(tick.physical.angle, std::memory_order_relaxed);
  live_.delta_pressure.store(0.5 * (tick.physical.p2 - tick.physical.p1), std::memory_order_relaxed);
  return true;
}

bool ExperimentLoop::write(const series::Pressures& pressures, LogRow* row) noexcept {
  const card::Command command =
      program_.in_codes ? map_.to_command_of_codes(pressures) : map_.to_command(pressures);
  result_.status = rig_.card->write(command);
  if (!ok(result_.status)) return end(LoopResult::End::kCard);
  if (row != nullptr) {
    row->command = command;
    row->commanded = map_.commanded(command);
  }
  return true;
}

void ExperimentLoop::ask(std::size_t stage) noexcept {
  live_.stage.store(static_cast<int>(stage), std::memory_order_release);
  ask_person(program_.stages[stage].ask);
}

void ExperimentLoop::ask_person(const series::Ask& ask) noexcept {
  if (!rig_.person) return;
  try {
    rig_.person->ask(to_task(ask));
  } catch (...) {  // a simulated person that runs out of memory: treated as one who does not come
    result_.end = LoopResult::End::kPersonLate;
  }
}

bool ExperimentLoop::ramp_pressures() noexcept {
  const series::Pressures target = program_.lead.empty() ? program_.at(0.0) : program_.lead_at(0.0);
  const auto ticks = static_cast<int>(std::ceil(kRampSeconds * options_.rate));
  Tick now;
  for (int i = 1; i <= ticks; ++i) {
    if (!tick(now)) return false;
    const double share = static_cast<double>(i) / ticks;
    if (!write({share * target.p1, share * target.p2}, nullptr)) return false;
    next_ns_ += period_ns_;
  }
  return true;
}

bool ExperimentLoop::play_lead() noexcept {
  if (program_.lead.empty()) return true;
  const double ticks = program_.lead.back().time * options_.rate;
  Tick now;
  for (double i = 1.0; i <= ticks; i += 1.0) {
    if (!tick(now) || !write(program_.lead_at(i / options_.rate), nullptr)) return false;
    next_ns_ += period_ns_;
  }
  return tick(now) && write(program_.at(0.0), nullptr);
}

bool ExperimentLoop::hold(double seconds) noexcept {
  Tick now;
  for (double left = seconds * options_.rate; left > 0.0; left -= 1.0) {
    if (!tick(now)) return false;
    next_ns_ += period_ns_;
  }
  return true;
}

bool ExperimentLoop::wait_until_ready() noexcept {
  if (!rig_.person) return true;
  Tick now;
  for (double left = kPatienceSeconds * options_.rate; left > 0.0; left -= 1.0) {
    if (rig_.person->ready()) return true;
    if (!tick(now)) return false;
    next_ns_ += period_ns_;
  }
  return end(LoopResult::End::kPersonLate);
}

LoopResult ExperimentLoop::lead_in() noexcept {
  if (!start_clock()) return result_;
  result_.began_ns = first_ns_;
  if (!options_.lead_in) {
    ask(0);
    return result_;
  }
  // A clamp is closed before the pressures rise; a hand takes hold of a joint that has found its place.
  const series::Ask::Kind kind = program_.stages.front().ask.kind;
  const bool ask_last = kind == series::Ask::Kind::kRest || kind == series::Ask::Kind::kSweepByHand ||
                        kind == series::Ask::Kind::kPose;
  if (!ask_last) {
    ask(0);
    if (!wait_until_ready()) return result_;
  }
  if (!ramp_pressures() || !play_lead() || !hold(kSettleSeconds)) return result_;
  if (ask_last) {
    ask(0);
    if (!wait_until_ready() || !hold(0.2)) return result_;
  }
  return result_;
}

LoopResult ExperimentLoop::record(LogWriter& writer) noexcept {
  if (!start_clock()) return result_;
  result_.began_ns = first_ns_;
  live_.recording.store(true, std::memory_order_release);
  safety_ = SafetyMonitor(options_.limits);  // times of a fault count from here
  const auto last_ns =
      first_ns_ + static_cast<std::int64_t>(std::llround(program_.duration * 1e9)) - period_ns_ / 2;
  std::size_t stage = 0;
  std::int64_t last_sample_ns = first_ns_ - period_ns_;
  double peak = 0.0, low = INFINITY, high = -INFINITY;
  Tick now;
  while (next_ns_ < last_ns) {
    if (!tick(now)) break;
    const double time = static_cast<double>(next_ns_ - first_ns_) * 1e-9;
    while (stage + 1 < program_.stages.size() && time >= program_.stages[stage + 1].start) ask(++stage);
    LogRow row;
    if (!write(program_.at(time), &row)) break;
    next_ns_ += period_ns_;
    if (now.sample.time_ns <= last_sample_ns) continue;  // a clock that stands still is no new sample
    last_sample_ns = now.sample.time_ns;
    row.time = static_cast<double>(now.sample.time_ns - first_ns_) * 1e-9;
    row.physical = now.physical;
    row.sample = now.sample;
    const bool taken = options_.virtual_time ? writer.push_waiting(row) : writer.push(row);
    if (taken) ++result_.rows;
    if (writer.failed()) {
      end(LoopResult::End::kWriter);
      break;
    }
    peak = std::max(peak, std::abs(safety_.speed()));
    low = std::min({low, now.physical.F1, now.physical.F2});
    high = std::max({high, now.physical.F1, now.physical.F2});
    live_.elapsed.store(row.time, std::memory_order_relaxed);
    live_.peak_speed.store(peak, std::memory_order_relaxed);
    live_.force_low.store(low, std::memory_order_relaxed);
    live_.force_high.store(high, std::memory_order_relaxed);
    live_.rows.store(result_.rows, std::memory_order_relaxed);
  }
  live_.recording.store(false, std::memory_order_release);
  let_go();
  return result_;
}

// A bar that is let go while the muscles still hold it comes to rest; one that is let go when they are vented falls.
void ExperimentLoop::let_go() noexcept {
  const series::Ask::Kind kind = program_.stages.front().ask.kind;
  const bool in_hand = kind == series::Ask::Kind::kSweepByHand || kind == series::Ask::Kind::kPose;
  if (!rig_.person || !in_hand || !options_.lead_in || result_.end != LoopResult::End::kDone) return;
  ask_person({});
  hold(kLetGoSeconds);
}

}  // namespace isac::runtime
