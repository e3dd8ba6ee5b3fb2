#include "isac/runtime/log_session.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <thread>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/runtime/stop_signals.hpp"

namespace isac::runtime {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::system_clock;

constexpr double kUncalibrated = 1.1;

std::string iso_time(Clock::time_point time) {
  const auto since = time.time_since_epoch();
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since);
  const auto milliseconds = std::chrono::duration_cast<std::chrono::milliseconds>(since - seconds).count();
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(Clock::to_time_t(Clock::time_point(seconds))),
                     milliseconds);
}

fs::path file_of(const SessionOptions& options, const series::Program& program) {
  const fs::path folder = program.heldout ? options.folder / "heldout" : options.folder;
  return folder / (program.name + ".csv");
}

[[noreturn]] void refuse_output(const char* code, std::string text, const fs::path& path) {
  throw Error(ErrorKind::kBadInput, code, std::move(text), {path.string(), 0, 0});
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder)) {
    refuse_output("output_folder",
                  "the output folder cannot be made (" + error.message() + "); name another with -o", folder);
  }
  if (::access(folder.c_str(), W_OK) != 0) {
    refuse_output("output_folder",
                  "the output folder cannot be written to; change its permissions or name another with -o",
                  folder);
  }
}

/// Everything about the output that can be refused before a valve opens; leaves folders, no files.
void prepare_output(const SessionOptions& options) {
  double bytes = 1e6;  // the rig file, metadata, and a margin
  for (const series::Program& program : options.programs) {
    const fs::path file = file_of(options, program);
    if (fs::exists(file) && !options.overwrite) {
      refuse_output(
          "file_exists",
          "the recording exists already; name another folder with -o, or replace it with --overwrite", file);
    }
    bytes += program.duration * options.rate * (options.raw ? 220.0 : 90.0);  // longest lines
  }
  const fs::path parent = [&] {  // of what exists, before anything is made
    fs::path path = fs::absolute(options.folder);
    while (!fs::exists(path) && path.has_relative_path()) path = path.parent_path();
    return path;
  }();
  std::error_code error;
  const fs::space_info space = fs::space(parent, error);
  if (!error && space.capacity > 0 && static_cast<double>(space.available) < bytes) {
    refuse_output(
        "disk_full",
        fmt::format(
            "the disk has {:.1f} MB left but the recordings need up to {:.1f} MB; make room, or name another "
            "folder with -o",
            static_cast<double>(space.available) / 1e6, bytes / 1e6),
        options.folder);
  }
  make_folder(options.folder);
  if (!options.dataset || options.rig_file.empty()) return;
  const fs::path copy = options.folder / "rig.toml";
  if (fs::exists(copy) && fs::equivalent(copy, options.rig_file, error)) return;
  if (fs::exists(copy) && !options.overwrite) {
    refuse_output(
        "file_exists",
        "the dataset has a rig file already; name another folder with -o, or replace it with --overwrite",
        copy);
  }
  fs::copy_file(options.rig_file, copy, fs::copy_options::overwrite_existing, error);
  if (error)
    refuse_output("output_folder", "the rig file cannot be copied into the dataset (" + error.message() + ")",
                  copy);
}

std::map<std::string, std::string> metadata_of(const SessionOptions& options, const series::Program& program,
                                               Clock::time_point began) {
  std::map<std::string, std::string> metadata = {
      {"experiment", program.experiment},
      {"started", iso_time(began)},
      {"rig", options.rig.name},
      {"card", options.card},
      {"rate", fmt::format("{:g} Hz", options.rate)},
      {"seed", std::to_string(options.seed)},
      {"duration", fmt::format("{:g} s", program.duration)},
      {"initial_pressure", fmt::format("{:g} kg/cm2", options.rig.joint.initial_pressure / kPascalPerKgfCm2)},
      {"program", "isac-log " ISAC_VERSION},
  };
  if (options.rig.name.empty()) metadata.erase("rig");
  if (!program.calibration.empty()) metadata["calibration"] = program.calibration;
  if (!program.sweep.empty()) metadata["sweep"] = program.sweep;
  if (std::isfinite(program.expected.held_delta_pressure)) {
    metadata["delta_pressure"] =
        fmt::format("{:g} kg/cm2", program.expected.held_delta_pressure / kPascalPerKgfCm2);
  }
  if (std::isfinite(program.expected.speed))
    metadata["asked_speed"] = fmt::format("{:g} rad/s", program.expected.speed);
  if (std::isfinite(program.expected.amplitude)) {
    metadata["asked_amplitude"] = fmt::format("{:g} rad", program.expected.amplitude);
  }
  return metadata;
}

/// The parts of a recording that live on the loop's thread.
struct Work {
  LoopResult loop;
  std::unique_ptr<LogWriter> writer;
  std::exception_ptr error;
  std::atomic<bool> done{false};
};

class Session {
 public:
  Session(const SessionOptions& options, SessionObserver& observer, const std::atomic<bool>& stop)
      : options_(options),
        observer_(observer),
        stop_(stop),
        virtual_(options.card.rfind("sim:", 0) == 0 || options.card.rfind("replay:", 0) == 0),
        rig_(card::open(options.card)),
        opened_at_(Clock::now()),
        map_(options.rig, rig_.card->shape()) {
    StopSignals::vent_on_death(rig_.card.get());
  }
  ~Session() { StopSignals::vent_on_death(nullptr); }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  std::vector<RecordingOutcome> run() {
    prepare_output(options_);
    std::vector<RecordingOutcome> outcomes;
    for (std::size_t i = 0; i < options_.programs.size() && !stop_.load(); ++i) {
      const series::Program& program = options_.programs[i];
      if (!observer_.about_to_record(program, i, options_.programs.size(),
                                     rig_.person == nullptr && !virtual_))
        break;
      if (std::optional<RecordingOutcome> outcome = record(program)) {
        observer_.judged(*outcome);
        outcomes.push_back(std::move(*outcome));
      }
    }
    return outcomes;
  }

 private:
  LoopOptions loop_options(const series::Program& program) const {
    LoopOptions loop;
    loop.rate = options_.rate;
    loop.limits = options_.limits;
    if (program.hand_moves) loop.limits.speed = options_.hand_speed_limit;
    if (!program.calibration.empty()) {
      // Sensors that are about to be calibrated are believed to a tenth, an encoder without its middle not at all.
      for (double* limit : {&loop.limits.pressure, &loop.limits.delta_pressure, &loop.limits.force})
        *limit *= kUncalibrated;
      loop.limits.angle = std::numeric_limits<double>::infinity();
    }
    loop.pace_real = options_.pace_real;
    loop.virtual_time = virtual_ && !options_.pace_real;
    loop.lead_in = options_.card.rfind("replay:", 0) != 0;
    return loop;
  }

  /// When the card's clock stood at `card_ns`: on hardware and in paced runs that is now, in virtual time it is later.
  Clock::time_point wall_time(std::int64_t card_ns) const {
    if (!virtual_ || options_.pace_real) return Clock::now();
    return opened_at_ + std::chrono::duration_cast<Clock::duration>(std::chrono::nanoseconds(card_ns));
  }

  void play(const series::Program& program, const fs::path& file, RecordingLive& live, Work& work) noexcept {
    const VentGuard vent(*rig_.card);
    try {
      ExperimentLoop loop(rig_, map_, program, loop_options(program), live, stop_);
      work.loop = loop.lead_in();
      if (work.loop.end != LoopResult::End::kDone) return;
      card::Sample now;
      const std::int64_t card_ns = ok(rig_.card->read(now)) ? now.time_ns : work.loop.began_ns;
      if (fs::exists(file)) {  // --overwrite: the old one steps aside only now that the new one begins
        fs::path backup = file;
        fs::rename(file, backup += ".bak");
      }
      work.writer = std::make_unique<LogWriter>(file, metadata_of(options_, program, wall_time(card_ns)),
                                                map_.shape(), options_.raw);
      work.loop = loop.record(*work.writer);
    } catch (...) {
      work.error = std::current_exception();
    }
  }

  void show_due_prompts(const series::Program& program, const RecordingLive& live, int& shown) const {
    const int due = live.stage.load(std::memory_order_acquire);
    while (shown < due) observer_.prompt(program.stages[static_cast<std::size_t>(++shown)].prompt);
  }

  std::optional<RecordingOutcome> record(const series::Program& program) {
    RecordingOutcome outcome;
    outcome.file = file_of(options_, program);
    outcome.program = program.name;
    make_folder(outcome.file.parent_path());
    RecordingLive live;
    Work work;
    std::thread loop([&] {
      play(program, outcome.file, live, work);
      work.done.store(true, std::memory_order_release);
    });
    int shown = -1;
    for (auto next_view = std::chrono::steady_clock::now(); !work.done.load(std::memory_order_acquire);) {
      show_due_prompts(program, live, shown);
      if (const auto now = std::chrono::steady_clock::now(); now >= next_view) {
        observer_.progress(program, live);
        next_view = now + std::chrono::milliseconds(50);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    loop.join();
    show_due_prompts(program, live, shown);
    if (work.loop.rows > 0) observer_.progress(program, live);
    outcome.loop = work.loop;
    finish_log(outcome, work);
    if (work.error) std::rethrow_exception(work.error);
    throw_if_stopped(outcome);
    if (outcome.loop.rows == 0) return std::nullopt;
    judge(outcome, program);
    return outcome;
  }

  /// Closes the log; one that could not be written is renamed, one without rows removed.
  void finish_log(RecordingOutcome& outcome, Work& work) const {
    if (!work.writer) return;
    std::error_code ignored;
    try {
      outcome.dropped = work.writer->dropped();
      work.writer->finish();
      if (outcome.loop.rows == 0) fs::remove(outcome.file, ignored);
    } catch (const Error& error) {
      fs::path aside = outcome.file;
      aside += ".incomplete";
      work.writer.reset();
      fs::rename(outcome.file, aside, ignored);
      throw Error(
          error.kind(), error.code(),
          error.text() + "; the valves are vented and what was written is in " + aside.filename().string(),
          error.place());
    }
  }

  void throw_if_stopped(const RecordingOutcome& outcome) const {
    const std::string kept =
        outcome.loop.rows == 0
            ? "; the valves are vented and nothing was recorded"
            : fmt::format("; the valves are vented and the {} samples until then are in {}",
                          outcome.loop.rows, outcome.file.string());
    const auto stopped = [&](const char* code, const std::string& why) {
      throw Error(ErrorKind::kStopped, code,
                  "stopped " + std::string(outcome.loop.rows == 0 ? "while getting ready for " : "during ") +
                      outcome.program + ": " + why + kept);
    };
    switch (outcome.loop.end) {
      case LoopResult::End::kDone:
      case LoopResult::End::kStopRequested:
      case LoopResult::End::kCardEnded:
      case LoopResult::End::kWriter:
        return;
      case LoopResult::End::kLimit:
        stopped("limit", describe(outcome.loop.fault));
        return;
      case LoopResult::End::kCard:
        stopped("card_failed", fmt::format("the card '{}' failed ({}); check its cable and power",
                                           options_.card, isac::describe(outcome.loop.status)));
        return;
      case LoopResult::End::kPersonLate:
        stopped("nobody_ready", "the task was not taken up within a minute");
        return;
    }
  }

  void judge(RecordingOutcome& outcome, const series::Program& program) const {
    series::SweepExpectation expected = program.expected;
    expected.sample_period = 1.0 / options_.rate;
    expected.dropped = outcome.dropped;
    expected.late = outcome.loop.late;
    expected.encoder_step = map_.encoder_step();
    expected.ranges = map_.ranges();
    expected.force_capacity = options_.rig.limits.force;
    outcome.verdict = series::check_sweep(
        record::read_recording(outcome.file, {.map = {}, .require_time = true, .hash = false}), expected);
  }

  const SessionOptions& options_;
  SessionObserver& observer_;
  const std::atomic<bool>& stop_;
  bool virtual_;
  card::Opened rig_;
  Clock::time_point opened_at_;
  SignalMap map_;
};

}  // namespace

std::vector<RecordingOutcome> run_session(const SessionOptions& options, SessionObserver& observer,
                                          const std::atomic<bool>& stop) {
  if (!(options.rate > 0.0) || options.rate > 1e5) {
    throw Error(ErrorKind::kUsage, "rate_nonsense",
                fmt::format("the sample rate must be a positive number of at most 100000 Hz, not {:g}",
                            options.rate));
  }
  check_limits(options.limits);
  Session session(options, observer, stop);
  return session.run();
}

}  // namespace isac::runtime
