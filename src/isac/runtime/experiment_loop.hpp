/// @file
/// The periodic loop of a recording: wait, read, convert, check, command, hand to the writer.
///
///   lead_in()  asks the person, brings the pressures up from vented, plays the program's lead, waits until the person has taken the task up
///   record()   plays the program and pushes a row per sample into the writer's ring
/// Time is the card's own; a loop that comes late skips whole periods (never a burst to catch up) and counts them.
///
/// Units: SI, card time in ns. Real time: record() allocates nothing, takes no lock and writes no file; what a simulated
/// person does when asked is outside this promise. Threads: one thread runs a loop; `RecordingLive` and `stop` are for others.
/// Errors: how the loop ended is in LoopResult; lead_in() and record() throw nothing. The caller vents (VentGuard).
/// Source: seed 3.2 to 3.4, D.2.2 (start-up), E.2.2.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

#include "isac/card/card.hpp"
#include "isac/runtime/log_writer.hpp"
#include "isac/runtime/safety.hpp"
#include "isac/series/excitation.hpp"

namespace isac::runtime {

struct LoopOptions {
  double rate = 500;  ///< Hz
  Limits limits;
  bool virtual_time =
      false;               ///< time stands still while the writer catches up: wait rather than lose samples
  bool pace_real = false;  ///< let card time run no faster than the wall clock
  bool lead_in = true;     ///< false for a replayed recording, which has its own beginning
};

/// What the loop shows of itself while it runs.
struct RecordingLive {
  std::atomic<bool> recording{false};
  std::atomic<int> stage{-1};                       ///< whose prompt is due; −1: none yet
  std::atomic<double> elapsed{0};                   ///< s since the recording began
  std::atomic<double> angle{0};                     ///< rad
  std::atomic<double> peak_speed{0};                ///< rad/s, so far
  std::atomic<double> delta_pressure{0};            ///< Pa
  std::atomic<double> force_low{0}, force_high{0};  ///< N, so far
  std::atomic<std::uint64_t> rows{0};
};

struct LoopResult {
  enum class End {
    kDone,           ///< the program has been played to its end
    kStopRequested,  ///< a person or another process asked for the end
    kLimit,          ///< `fault` says which
    kCard,           ///< `status` says what the card answered
    kCardEnded,      ///< a replayed recording has nothing more
    kWriter,         ///< the log cannot be written; LogWriter::finish() says why
    kPersonLate,     ///< the task was not taken up in time
  } end = End::kDone;
  Fault fault;
  Status status = Status::kOk;
  std::uint64_t rows = 0, late = 0;
  std::int64_t began_ns = 0;  ///< card time of the first sample
};

class ExperimentLoop {
 public:
  ExperimentLoop(card::Opened& rig, SignalMap& map, const series::Program& program,
                 const LoopOptions& options, RecordingLive& live, const std::atomic<bool>& stop) noexcept;

  [[nodiscard]] LoopResult lead_in() noexcept;
  [[nodiscard]] LoopResult record(LogWriter& writer) noexcept;

 private:
  struct Tick {
    card::Sample sample;
    Physical physical;
  };
  bool start_clock() noexcept;
  bool tick(Tick& tick) noexcept;  ///< false: result_ says why the loop ends
  bool write(const series::Pressures& pressures, LogRow* row) noexcept;
  bool ramp_pressures() noexcept;
  bool play_lead() noexcept;
  bool wait_until_ready() noexcept;
  bool hold(double seconds) noexcept;
  void ask(std::size_t stage) noexcept;  ///< and shows its prompt
  void ask_person(const series::Ask& ask) noexcept;
  void let_go() noexcept;
  void wait_for_wall_clock() const noexcept;
  bool end(LoopResult::End why) noexcept;

  card::Opened& rig_;
  SignalMap& map_;
  const series::Program& program_;
  LoopOptions options_;
  RecordingLive& live_;
  const std::atomic<bool>& stop_;
  SafetyMonitor safety_;
  std::int64_t period_ns_;
  std::int64_t next_ns_ = 0, first_ns_ = 0;
  std::chrono::steady_clock::time_point wall_first_;
  LoopResult result_;
};

/// Vents when it goes out of scope, whichever way that is.
class VentGuard {
 public:
  explicit VentGuard(card::Card& card) noexcept : card_(card) {}
  ~VentGuard() { static_cast<void>(card_.vent()); }
  VentGuard(const VentGuard&) = delete;
  VentGuard& operator=(const VentGuard&) = delete;

 private:
  card::Card& card_;
};

}  // namespace isac::runtime
