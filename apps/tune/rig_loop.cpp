#include "tune/rig_loop.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <map>
#include <memory>
#include <thread>

#include "isac/card/card.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/runtime/experiment_loop.hpp"
#include "isac/runtime/log_writer.hpp"
#include "isac/runtime/signal_map.hpp"
#include "isac/runtime/stop_signals.hpp"

namespace isac::apps {
namespace {

constexpr double kRampSeconds = 1.5;  // vented to initial pressure: eight lags of the valve unit

/// One run from open card to vented valves.
class Run {
 public:
  Run(const RigRun& options, tune::Experiment& experiment)
      : options_(options),
        experiment_(experiment),
        virtual_(options.card.rfind("sim:", 0) == 0 || options.card.rfind("replay:", 0) == 0),
        rig_(card::open(options.card)),
        map_(options.rig, rig_.card->shape()),
        safety_(options.limits),
        period_ns_(std::llround(1e9 / options.rate)) {
    runtime::StopSignals::vent_on_death(rig_.card.get());
  }
  ~Run() { runtime::StopSignals::vent_on_death(nullptr); }
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  RigRunOutcome play() {
    if (!options_.log.empty()) open_log();
    try {
      {
        const runtime::VentGuard vent(*rig_.card);
        drive();
      }
      close_log();
    } catch (const Error& error) {
      const bool torn = writer_ && writer_->failed();
      if (torn) {
        set_log_aside();
      } else {
        close_log();
      }
      throw Error(error.kind(), error.code(), error.text() + kept(torn), error.place());
    }
    return outcome_;
  }

 private:
  void open_log() {
    const std::time_t now = std::time(nullptr);
    writer_ = std::make_unique<runtime::LogWriter>(
        options_.log,
        std::map<std::string, std::string>{
            {"experiment", "closed-loop"},
            {"started", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now))},
            {"rig", options_.rig.name.empty() ? "unnamed" : options_.rig.name},
            {"card", options_.card},
            {"rate", fmt::format("{:g} Hz", options_.rate)},
            {"tuning", options_.method},
            {"program", "isac-tune " ISAC_VERSION}},
        map_.shape(), false);
  }

  void close_log() {
    if (!writer_) return;
    outcome_.dropped = writer_->dropped();
    writer_->finish();
    writer_.reset();
  }

  /// A log that could not be written is no log of the run: it steps aside under another name.
  void set_log_aside() {
    writer_.reset();
    std::error_code ignored;
    std::filesystem::rename(options_.log, options_.log + ".incomplete", ignored);
  }

  [[nodiscard]] std::string kept(bool torn) const {
    std::string text = "; the valves are vented and the gains stay as they were";
    if (options_.log.empty()) return text;
    if (torn) return text + ", what was written is in " + options_.log + ".incomplete";
    return text + fmt::format(", the {} samples until then are in {}", outcome_.rows, options_.log);
  }

  [[noreturn]] void card_failed(Status status) const {
    throw Error(
        ErrorKind::kStopped, "card_failed",
        fmt::format("the card '{}' failed ({}); check its cable and power", options_.card, describe(status)));
  }

  /// Waits for the next tick and reads it.
  runtime::Physical tick() {
    if (runtime::StopSignals::requested().load())
      throw Error(ErrorKind::kAnswerIsNo, "stopped_by_person", "stopped by hand");
    if (options_.pace_real)
      std::this_thread::sleep_until(wall_first_ + std::chrono::nanoseconds(next_ns_ - first_ns_));
    Status status = rig_.card->wait_until(next_ns_);
    if (ok(status)) status = rig_.card->read(sample_);
    if (!ok(status)) card_failed(status);
    if (const std::int64_t behind = (sample_.time_ns - next_ns_) / period_ns_; behind > 0) {
      next_ns_ += behind * period_ns_;
      outcome_.late += static_cast<std::uint64_t>(behind);
    }
    const runtime::Physical now = map_.to_physical(sample_);
    if (!safety_.check(elapsed(), now))
      throw Error(ErrorKind::kStopped, "limit",
                  "stopped during the " + options_.method + ": " + describe(safety_.fault()));
    return now;
  }

  void write(const runtime::Physical& now, const series::Pressures& pressures) {
    const card::Command command = map_.to_command(pressures);
    if (const Status status = rig_.card->write(command); !ok(status)) card_failed(status);
    next_ns_ += period_ns_;
    if (!writer_ || !(elapsed() > last_time_)) return;
    last_time_ = elapsed();
    const runtime::LogRow row{last_time_, now, map_.commanded(command), sample_, command};
    const bool taken = virtual_ && !options_.pace_real ? writer_->push_waiting(row) : writer_->push(row);
    if (taken) ++outcome_.rows;
    if (writer_->failed()) writer_->finish();  // throws what went wrong
  }

  void drive() {
    if (rig_.person) rig_.person->ask({});
    if (const Status status = rig_.card->read(sample_); !ok(status)) card_failed(status);
    next_ns_ = first_ns_ = sample_.time_ns + period_ns_;
    wall_first_ = std::chrono::steady_clock::now();
    const double p0 = options_.rig.joint.initial_pressure, centre = experiment_.settings().centre;
    const auto ticks = static_cast<int>(std::ceil(kRampSeconds * options_.rate));
    for (int i = 1; i <= ticks; ++i) {
      const double share = static_cast<double>(i) / ticks;
      const runtime::Physical now = tick();
      write(now, {share * (p0 - centre), share * (p0 + centre)});
    }
    while (!experiment_.finished()) {
      const runtime::Physical now = tick();
      // What the valves are really told: codes are steps of 1.2 hPa, and a command is held to the limits.
      const double delta = experiment_.step(elapsed(), now.angle);
      write(now, {p0 - delta, p0 + delta});
    }
  }

  [[nodiscard]] double elapsed() const { return static_cast<double>(sample_.time_ns - first_ns_) * 1e-9; }

  const RigRun& options_;
  tune::Experiment& experiment_;
  bool virtual_;
  card::Opened rig_;
  runtime::SignalMap map_;
  runtime::SafetyMonitor safety_;
  std::int64_t period_ns_, next_ns_ = 0, first_ns_ = 0;
  std::chrono::steady_clock::time_point wall_first_;
  card::Sample sample_;
  std::unique_ptr<runtime::LogWriter> writer_;
  RigRunOutcome outcome_;
  double last_time_ = -1;
};

}  // namespace

RigRunOutcome run_on_rig(const RigRun& run, tune::Experiment& experiment) {
  runtime::check_limits(run.limits);
  return Run(run, experiment).play();
}

}  // namespace isac::apps
