#include "isac/runtime/pose_session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "isac/card/card.hpp"
#include "isac/core/error.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/runtime/experiment_loop.hpp"
#include "isac/runtime/stop_signals.hpp"

namespace isac::runtime {
namespace {

namespace fs = std::filesystem;

constexpr double kStepsPerTurn = 8000;                    // seed C.4
constexpr double kFullPressure = 5.0 * kPascalPerKgfCm2;  // at the highest valve code
constexpr double kDegree = kPi / 180;
constexpr double kStartUp = 2;           // s, from vented to the mean pressure
constexpr double kLag = 0.17;            // s, T_C of the valve units (seed 4.2)
constexpr double kCorrection = 0.8;      // s; more than 4 T_C, so that the correction does not overshoot
constexpr double kTravelSpeed = 0.5;     // rad/s, at most, between poses
constexpr double kShortestTravel = 1.5;  // s
constexpr double kArrive = 2;            // s, to correct before the last stretch
constexpr double kLastStretch = 2;       // s
constexpr double kLongestCreep = 6;      // s, forwards until the pose is reached
constexpr double kReached = 0.25 * kDegree;
constexpr double kLeastCreep = 0.15 * kDegree;  // a joint that is there goes on as if this were left
constexpr double kSettle = 9 * kLag;            // the valves are there to 1e-4, the arm to its own damping
constexpr double kAverage = 0.5;                // s
constexpr double kRestDrift = 0.1 * kDegree;
constexpr double kSpareAngle = 3 * kDegree;  // to a limit, for what a start of the last stretch overshoots
constexpr double kBeside = 0.3 * kDegree;    // of the plan: some steps of an encoder
constexpr double kAtLimit = 0.999;           // of Δp: half a code of the valves
constexpr double kGoldenRatio = 0.6180339887498949;
constexpr int kSpeedTicks = 4;  // over which a speed is taken: one step of the encoder is a jump

class Holder {
 public:
  Holder(const PoseSessionOptions& options, const std::atomic<bool>& stop)
      : options_(options),
        stop_(stop),
        joints_(static_cast<std::size_t>(options.arm.joints)),
        rig_(card::open(options.card)),
        period_ns_(std::llround(1e9 / options.rate)) {
    const card::Shape shape = rig_.card->shape();
    if (shape.encoders < options.arm.joints || shape.outputs < 2 * options.arm.joints) {
      throw Error(ErrorKind::kUsage, "card_too_small",
                  fmt::format("the card '{}' has {} encoders and {} outputs; this arm needs {} and {}",
                              options.card, shape.encoders, shape.outputs, joints_, 2 * joints_));
    }
    modulus_ = shape.encoder_modulus;
    max_code_ = shape.output_max_code;
    StopSignals::vent_on_death(rig_.card.get());
  }
  ~Holder() {
    static_cast<void>(rig_.card->vent());
    StopSignals::vent_on_death(nullptr);
  }
  Holder(const Holder&) = delete;
  Holder& operator=(const Holder&) = delete;

  void start_up() {
    card::Sample sample;
    require(rig_.card->read(sample));
    start_ns_ = next_ns_ = sample.time_ns;
    take(sample);
    wanted_ = phi_;
    const double end = time_ + kStartUp;
    while (running() && time_ < end) {
      pressure_ = options_.mean_pressure * std::min(1.0, 1 - (end - time_) / kStartUp);
      tick(true);
    }
    pressure_ = options_.mean_pressure;
  }

  /// False when the stop was asked for on the way.
  bool hold(const ArmAngles& target, int side, HeldPose& out) {
    ArmAngles start = target;
    for (std::size_t j = 0; j < joints_; ++j) start[j] -= side * options_.side;
    double far = 0;
    for (std::size_t j = 0; j < joints_; ++j) far = std::max(far, std::abs(start[j] - wanted_[j]));
    const double peak = kPi / 2;  // of a cosine move's speed over its mean
    move(start, std::max(kShortestTravel, peak * far / kTravelSpeed), true);
    wait(kArrive, [this] { correct(0); });
    move(target, kLastStretch, false);
    const double end = time_ + kLongestCreep;
    while (running() && time_ < end && !reached(side)) tick_with([this, side] { correct(side); });
    wait(kSettle, [] {});
    return average(target, side, out);
  }

  [[nodiscard]] double time() const { return time_; }

 private:
  [[nodiscard]] bool running() const { return !stop_.load(); }

  /// A move at the cosine's speed; `corrected`: the correction goes on meanwhile.
  void move(const ArmAngles& to, double seconds, bool corrected) {
    const ArmAngles from = wanted_;
    const double begin = time_;
    while (running() && time_ < begin + seconds) {
      const double share = 0.5 - 0.5 * std::cos(kPi * std::min(1.0, (time_ - begin) / seconds));
      for (std::size_t j = 0; j < joints_; ++j) wanted_[j] = from[j] + share * (to[j] - from[j]);
      tick(corrected);
    }
    wanted_ = to;
  }

  template <class Act>
  void wait(double seconds, Act act) {
    const double end = time_ + seconds;
    while (running() && time_ < end) tick_with(act);
  }

  template <class Act>
  void tick_with(Act act) {
    act();
    tick(false);
  }

  [[nodiscard]] bool reached(int side) const {
    for (std::size_t j = 0; j < joints_; ++j)
      if (side * (wanted_[j] - phi_[j]) > kReached && std::abs(delta_[j]) < options_.delta_pressure_limit)
        return false;
    return true;
  }

  /// ċ = (φ_wanted − φ) k/(B r)/T. `side` ≠ 0: towards that side only, and no joint stops before all do: one that stands would bear
  /// with its friction what its neighbours' motion changes of gravity.
  void correct(int side) {
    for (std::size_t j = 0; j < joints_; ++j) {
      const record::ArmActuator& a = options_.arm.actuators[j];
      double gap = wanted_[j] - phi_[j];
      if (side != 0) gap = side * std::max(side * gap, kLeastCreep);
      const double step =
          gap * -a.A * a.wheel_radius / a.B / kCorrection * static_cast<double>(period_ns_) * 1e-9;
      const bool full = std::abs(delta_[j]) >= options_.delta_pressure_limit && step * delta_[j] > 0;
      if (!full) correction_[j] += step;
    }
  }

  void tick(bool corrected) {
    if (corrected) correct(0);
    const models::JointVector<double, 6> gravity = models::multiply_transposed<double, 6>(
        options_.arm.coupling, models::gravity_torque(options_.arm.chain, theta_of(wanted_)));
    card::Command command;
    for (std::size_t j = 0; j < joints_; ++j) {
      const record::ArmActuator& a = options_.arm.actuators[j];
      const double r = a.wheel_radius;
      const double limit = std::min(options_.delta_pressure_limit, pressure_);
      const double wanted = (-a.A * r * r * wanted_[j] - gravity[j]) / (a.B * r) + correction_[j];
      const double delta = std::clamp(wanted, -limit, limit);
      const std::uint32_t low = code(pressure_ - delta), high = code(pressure_ + delta);
      command.output[2 * j] = low;
      command.output[2 * j + 1] = high;
      delta_[j] = (pascal(high) - pascal(low)) / 2;  // what the codes say
    }
    require(rig_.card->write(command));
    next_ns_ += period_ns_;
    require(rig_.card->wait_until(next_ns_));
    card::Sample sample;
    require(rig_.card->read(sample));
    take(sample);
    check();
  }

  /// Means over kAverage with the commands standing still.
  bool average(const ArmAngles& target, int side, HeldPose& out) {
    ArmAngles low = phi_, high = phi_, sum{};
    double count = 0;
    const double end = time_ + kAverage;
    while (running() && time_ < end) {
      tick(false);
      for (std::size_t j = 0; j < joints_; ++j) {
        low[j] = std::min(low[j], phi_[j]);
        high[j] = std::max(high[j], phi_[j]);
        sum[j] += phi_[j];
      }
      count += 1;
    }
    if (!running()) return false;
    out.approach = side;
    out.delta_pressure = delta_;
    for (std::size_t j = 0; j < joints_; ++j) {
      out.phi[j] = sum[j] / count;
      if (std::abs(delta_[j]) >= kAtLimit * options_.delta_pressure_limit)
        out.saturated = static_cast<int>(j);
      out.drift = std::max(out.drift, high[j] - low[j]);
      if (std::abs(out.phi[j] - target[j]) <= out.distance) continue;
      out.distance = std::abs(out.phi[j] - target[j]);
      out.farthest = static_cast<int>(j);
    }
    out.at_rest = out.drift <= kRestDrift;
    return true;
  }

  [[nodiscard]] ArmAngles theta_of(const ArmAngles& phi) const {
    ArmAngles theta = models::multiply<double, 6>(options_.arm.coupling, phi);
    for (std::size_t j = 0; j < theta.size(); ++j) theta[j] += options_.arm.middle[j];
    return theta;
  }

  /// An encoder that reads n stands somewhere from n to n + 1 steps.
  void take(const card::Sample& sample) {
    time_ = static_cast<double>(sample.time_ns - start_ns_) * 1e-9;
    for (std::size_t j = 0; j < joints_; ++j) {
      const auto half = static_cast<std::int64_t>(modulus_ / 2);
      auto count = static_cast<std::int64_t>(sample.encoder[j]);
      if (count >= half) count -= static_cast<std::int64_t>(modulus_);
      phi_[j] = (static_cast<double>(count) + 0.5) * 2 * kPi / kStepsPerTurn;
    }
  }

  void check() {
    ++ticks_;
    const bool look = ticks_ % kSpeedTicks == 0;
    for (std::size_t j = 0; j < joints_; ++j) {
      const double low = options_.arm.limits.lower[j], high = options_.arm.limits.upper[j];
      if (phi_[j] < low || phi_[j] > high) {
        throw Error(
            ErrorKind::kStopped, "limit",
            fmt::format("joint {} stands at {:.1f} deg, outside {:.1f} to {:.1f} deg; the valves are vented",
                        j + 1, phi_[j] / kDegree, low / kDegree, high / kDegree));
      }
      const double speed =
          std::abs(phi_[j] - before_[j]) / (kSpeedTicks * static_cast<double>(period_ns_) * 1e-9);
      if (look && ticks_ > kSpeedTicks && speed > options_.speed_limit) {
        throw Error(
            ErrorKind::kStopped, "limit",
            fmt::format("joint {} turned with {:.2f} rad/s, more than {:.2f} rad/s; the valves are vented",
                        j + 1, speed, options_.speed_limit));
      }
    }
    if (look) before_ = phi_;
  }

  void require(Status status) const {
    if (ok(status)) return;
    throw Error(ErrorKind::kStopped, "card_failed",
                fmt::format("the card '{}' failed ({}); the valves are vented; check its cable and power",
                            options_.card, isac::describe(status)));
  }

  [[nodiscard]] std::uint32_t code(double pressure) const {
    const double share = std::clamp(pressure / kFullPressure, 0.0, 1.0);
    return static_cast<std::uint32_t>(std::lround(share * max_code_));
  }
  [[nodiscard]] double pascal(std::uint32_t c) const {
    return static_cast<double>(c) * kFullPressure / max_code_;
  }

  const PoseSessionOptions& options_;
  const std::atomic<bool>& stop_;
  std::size_t joints_;
  card::Opened rig_;
  std::int64_t period_ns_, start_ns_ = 0, next_ns_ = 0;
  std::uint32_t modulus_ = 0, max_code_ = 0;
  double time_ = 0, pressure_ = 0;
  long ticks_ = 0;
  ArmAngles phi_{}, before_{}, wanted_{}, correction_{}, delta_{};
};

void check_options(const PoseSessionOptions& options) {
  const record::ArmFile& arm = options.arm;
  bool known = static_cast<int>(arm.actuators.size()) == arm.joints;
  for (const record::ArmActuator& a : arm.actuators)
    known = known && a.A < 0 && a.B > 0 && a.wheel_radius > 0;
  if (!known) {
    throw Error(ErrorKind::kBadInput, "actuators_unknown",
                "an arm is held by its muscles: the arm file needs an [[actuator]] with A below 0, B and "
                "chain_wheel_diameter for every joint");
  }
  if (options.theta.empty())
    throw Error(ErrorKind::kBadInput, "no_poses",
                "there is no pose to hold; plan some with isac-identify masses --design");
  if (!(options.rate >= 20 && options.rate <= 2000))
    throw Error(ErrorKind::kUsage, "rate_nonsense",
                fmt::format("poses are held at 20 to 2000 Hz, not at {:g} Hz", options.rate));
  if (!(options.side > 0 && options.side < 0.5))
    throw Error(ErrorKind::kUsage, "side_nonsense",
                "the last stretch must be above 0 and below 0.5 rad (28 deg)");
}

/// φ of the planned poses, moved inwards where they could not be approached from both sides.
std::vector<ArmAngles> targets_of(const PoseSessionOptions& options, PoseObserver& observer) {
  const record::ArmFile& arm = options.arm;
  models::Coupling<double, 6> inverse;
  static_cast<void>(models::inverse_coupling<double, 6>(
      arm.coupling, inverse));  // arm files with a singular one are refused
  std::vector<ArmAngles> targets;
  for (std::size_t i = 0; i < options.theta.size(); ++i) {
    ArmAngles theta = options.theta[i];
    for (std::size_t j = 0; j < theta.size(); ++j) theta[j] -= arm.middle[j];
    ArmAngles phi = models::multiply<double, 6>(inverse, theta);
    for (std::size_t j = 0; j < static_cast<std::size_t>(arm.joints); ++j) {
      const double spare = options.side + kSpareAngle;
      const double low = arm.limits.lower[j] + spare, high = arm.limits.upper[j] - spare;
      if (!std::isfinite(phi[j]) || low > high) {
        throw Error(
            ErrorKind::kBadInput, "pose_impossible",
            fmt::format("pose {} cannot be held: joint {} has no finite angle with {:.0f} deg to its limits",
                        i + 1, j + 1, spare / kDegree));
      }
      const double inside = std::clamp(phi[j], low, high);
      if (std::abs(inside - phi[j]) > kDegree)
        observer.note(fmt::format(
            "pose {}: joint {} goes to {:.1f} instead of {:.1f} deg, so that it can be approached "
            "from both sides inside its limits",
            i + 1, j + 1, inside / kDegree, phi[j] / kDegree));
      phi[j] = inside;
    }
    targets.push_back(phi);
  }
  return targets;
}

/// The pose a little beside the plan, another place for every row: poses that repeat must not read the same step of an encoder.
ArmAngles beside(const ArmAngles& target, std::size_t row, std::size_t joints) {
  ArmAngles out = target;
  for (std::size_t j = 0; j < joints; ++j) {
    const double turn = kGoldenRatio * static_cast<double>(row * joints + j + 1);
    out[j] += kBeside * (2 * (turn - std::floor(turn)) - 1);
  }
  return out;
}

std::unique_ptr<record::AppendLog> open_log(const PoseSessionOptions& options) {
  if (fs::exists(options.file)) {
    if (!options.overwrite)
      throw Error(ErrorKind::kBadInput, "file_exists",
                  "the recording exists already; name another folder with -o, or replace it with --overwrite",
                  {options.file.string(), 0, 0});
    fs::path backup = options.file;
    fs::rename(options.file, backup += ".bak");
  }
  std::vector<record::LogColumn> columns = {{"time", "s", 3}, {"pose", "1", 0}, {"approach", "1", 0}};
  for (const auto& [family, unit] : {std::pair{"phi", "deg"}, std::pair{"dp", "kg/cm2"}})
    for (int j = 1; j <= options.arm.joints; ++j) columns.push_back({family + std::to_string(j), unit, 6});
  std::map<std::string, std::string> metadata = {
      {"experiment", "pose"},
      {"angle_resolution", fmt::format("{:g} deg", 360 / kStepsPerTurn)},
      {"card", options.card},
      {"initial_pressure", fmt::format("{:g} kg/cm2", options.mean_pressure / kPascalPerKgfCm2)},
      {"program", "isac-log " ISAC_VERSION},
  };
  if (!options.arm.name.empty()) metadata["arm"] = options.arm.name;
  return std::make_unique<record::AppendLog>(options.file, columns, metadata);
}

}  // namespace

PoseSessionResult hold_poses(const PoseSessionOptions& options, PoseObserver& observer,
                             const std::atomic<bool>& stop) {
  check_options(options);
  const std::vector<ArmAngles> targets = targets_of(options, observer);
  Holder holder(options, stop);
  const auto log = open_log(options);
  const auto joints = static_cast<std::size_t>(options.arm.joints);
  PoseSessionResult result;
  try {
    holder.start_up();
    for (std::size_t i = 0; i < targets.size(); ++i) {
      std::vector<std::vector<double>> rows;
      bool usable = true;
      for (const int side : {1, -1}) {
        HeldPose held{.pose = static_cast<long>(i) + 1};
        const ArmAngles target = beside(targets[i], result.rows.size(), joints);
        if (stop.load() || !holder.hold(target, side, held)) return result;
        rows.push_back({holder.time(), static_cast<double>(held.pose), static_cast<double>(side)});
        for (std::size_t j = 0; j < joints; ++j) rows.back().push_back(held.phi[j] / kDegree);
        for (std::size_t j = 0; j < joints; ++j)
          rows.back().push_back(held.delta_pressure[j] / kPascalPerKgfCm2);
        usable = usable && held.saturated < 0;
        result.rows.push_back(held);
        observer.held(held, result.rows.size(), 2 * targets.size());
      }
      for (const std::vector<double>& row : rows)
        if (usable) log->append(row);
    }
  } catch (const Error& error) {
    throw Error(
        error.kind(), error.code(),
        error.text() + fmt::format("; {} rows until then are in {}", log->rows(), options.file.string()));
  }
  log->close();
  result.complete = true;
  return result;
}

}  // namespace isac::runtime
