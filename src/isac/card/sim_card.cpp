#include "isac/card/sim_card.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "isac/core/error.hpp"

namespace isac::card {

namespace {

constexpr std::int64_t kSampleTimeNs = 1000;
constexpr std::int64_t kVentGrainNs = 10'000'000;  // a vent from another thread acts within this
constexpr std::size_t kValves = 2;

double seconds(std::int64_t ns) noexcept {
  return static_cast<double>(ns) * 1e-9;
}
std::int64_t nanoseconds(double s) noexcept {
  return std::llround(s * 1e9);
}

}  // namespace

SimCard::SimCard(std::shared_ptr<simulate::Rig> rig)
    : rig_(std::move(rig)), random_(rig_->config().seed, simulate::Random::kTiming) {}

SimCard::~SimCard() {
  static_cast<void>(rig_->command({0, 0}));
}

Shape SimCard::shape() const noexcept {
  return {.encoders = 1,
          .inputs = kInputs,
          .outputs = static_cast<int>(kValves),
          .encoder_modulus = simulate::Sensors::kEncoderModulus,
          .input_max_code = simulate::Sensors::kMaxCode,
          .output_max_code = simulate::Rig::kMaxValveCode};
}

std::int64_t SimCard::lateness(std::int64_t period_ns) noexcept {
  const simulate::TimingConfig& timing = rig_->config().timing;
  std::int64_t late = 0;
  if (timing.jitter) {
    late += nanoseconds(random_.exponential(timing.mean_delay));
    if (random_.uniform() < timing.tail_chance) late += nanoseconds(random_.uniform(0, timing.tail_delay));
  }
  if (timing.drop_chance > 0 && random_.uniform() < timing.drop_chance) late += period_ns;
  return late;
}

Status SimCard::advance(std::int64_t time_ns) noexcept {
  while (now_ns_ < time_ns) {
    if (const Status status = apply_vent(); !ok(status)) return status;
    now_ns_ = std::min(time_ns, now_ns_ + kVentGrainNs);
    if (const Status status = rig_->advance_to(seconds(now_ns_)); !ok(status)) return status;
  }
  return apply_vent();
}

Status SimCard::wait_until(std::int64_t time_ns) noexcept {
  const std::int64_t period = std::max<std::int64_t>(0, time_ns - last_target_ns_);
  last_target_ns_ = std::max(last_target_ns_, time_ns);
  if (time_ns <= now_ns_) return apply_vent();
  return advance(time_ns + lateness(period));
}

Status SimCard::read(Sample& sample) noexcept {
  if (const Status status = apply_vent(); !ok(status)) return status;
  if (const Status status = rig_->advance_to(seconds(now_ns_)); !ok(status)) return status;
  std::int64_t stamp = now_ns_;
  if (rig_->config().timing.jitter)
    stamp += nanoseconds(random_.exponential(rig_->config().timing.stamp_noise));
  stamp = std::max(stamp, last_stamp_ns_ + 1);
  last_stamp_ns_ = stamp;
  const simulate::Codes codes = rig_->read();
  sample = Sample{};
  sample.time_ns = stamp;
  sample.encoder[0] = codes.encoder;
  std::copy(codes.input.begin(), codes.input.end(), sample.input.begin());
  now_ns_ += kSampleTimeNs;
  return Status::kOk;
}

Status SimCard::write(const Command& command) noexcept {
  if (const Status status = apply_vent(); !ok(status)) return status;
  for (std::size_t i = 0; i < kValves; ++i) {
    if (command.output[i] > simulate::Rig::kMaxValveCode) return Status::kOutOfRange;
  }
  if (const Status status = rig_->advance_to(seconds(now_ns_)); !ok(status)) return status;
  if (const Status status = rig_->command({command.output[0], command.output[1]}); !ok(status)) return status;
  std::copy_n(command.output.begin(), kValves, outputs_.output.begin());
  return Status::kOk;
}

Status SimCard::vent() noexcept {
  vent_asked_.store(true, std::memory_order_release);
  return Status::kOk;
}

Status SimCard::apply_vent() noexcept {
  if (!vent_asked_.exchange(false, std::memory_order_acq_rel)) return Status::kOk;
  outputs_ = Command{};
  return rig_->command({0, 0});
}

Status SimCard::outputs(Command& command) const noexcept {
  command = vent_asked_.load(std::memory_order_acquire) ? Command{} : outputs_;
  return Status::kOk;
}

void SimPerson::ask(const Task& task) {
  using Kind = Task::Kind;
  const bool sensible = std::isfinite(task.amplitude_rad) && task.amplitude_rad >= 0 &&
                        std::isfinite(task.speed_rad_s) && std::isfinite(task.angle_rad) &&
                        std::isfinite(task.load_newton) && std::isfinite(task.pressure_pascal) &&
                        (task.kind != Kind::kSweepByHand || task.speed_rad_s > 0);
  if (!sensible) {
    throw Error(ErrorKind::kUsage, "task_impossible",
                "a person cannot do this: angles, loads and pressures must be finite numbers, and a sweep "
                "needs a speed "
                "above 0 and an amplitude not below 0.");
  }
  const bool at_the_rig =
      task.kind != Kind::kRemoveLoad && task.kind != Kind::kHangWeight && task.kind != Kind::kConnectSupply;
  if (at_the_rig) {
    rig_->sensors().hang_weight({});
    rig_->sensors().connect_supply({});
  }
  switch (task.kind) {
    case Kind::kRest:
    case Kind::kRelease:
      rig_->release();
      break;
    case Kind::kSweepByHand:
      rig_->sweep({.amplitude = task.amplitude_rad,
                   .middle = task.middle_rad,
                   .speed = task.speed_rad_s,
                   .vary_speed = task.vary_speed});
      break;
    case Kind::kClamp:
      rig_->hold(task.angle_rad, true);
      break;
    case Kind::kPose:
      rig_->hold(task.angle_rad, false);
      break;
    case Kind::kRemoveLoad:
      rig_->sensors().hang_weight(0.0);
      break;
    case Kind::kHangWeight:
      rig_->sensors().hang_weight(task.load_newton);
      break;
    case Kind::kConnectSupply:
      rig_->sensors().connect_supply(task.pressure_pascal);
      break;
  }
}

Opened open_sim(std::shared_ptr<simulate::Rig> rig) {
  auto card = std::make_unique<SimCard>(rig);
  return {.card = std::move(card), .person = std::make_unique<SimPerson>(std::move(rig))};
}

}  // namespace isac::card
