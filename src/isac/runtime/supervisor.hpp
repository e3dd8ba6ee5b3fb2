/// @file
/// A process that watches the loop's process and closes the valves when it dies, aborts or hangs.
///
/// The valves keep what they were last told when a process ends, and no handler runs after SIGKILL. So the parent holds a
/// handle of its own to the valves and the child runs the loop:
///   death  the child's end of a pipe closes: vent
///   hang   the beat in shared memory stands still for `beat_limit` while the loop runs: vent, SIGKILL, vent again (a child
///          that wakes up between the first vent and its death may have written once more)
///   the parent's own death  the child gets SIGTERM (PR_SET_PDEATHSIG), stops cleanly and vents
/// A read that stalls in the kernel holds the card's lock: with sensors and valves on one card the vent comes after the stall
/// (up to 1 s), on two cards at once (docs/faults.md).
///
/// BeatWatch is the decision alone: pure, time handed in. Units: ns. Real time: the parent polls every `poll` and runs above
/// the loop's priority where permitted. Threads: call supervise() before the program has started any.
/// Errors: supervise() throws isac::Error (stopped) when no process can be started. Source: decision 0111.
/// Example: tests/runtime/supervisor_test.cpp.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "isac/card/card.hpp"
#include "isac/runtime/heartbeat.hpp"

namespace isac::runtime {

struct BeatLimits {
  std::int64_t beat = 10'000'000;          ///< ns without a beat while running
  std::int64_t starting = 60'000'000'000;  ///< ns to open cards and files
  std::int64_t leaving = 60'000'000'000;   ///< ns to close files
};

/// Pure: is the child still to be trusted?
class BeatWatch {
 public:
  enum class Verdict { kTrusted, kHung };
  explicit constexpr BeatWatch(const BeatLimits& limits) noexcept : limits_(limits) {}

  constexpr Verdict check(std::int64_t now, std::uint64_t beat, Heartbeat::Stage stage) noexcept {
    if (!started_ || beat != last_beat_ || stage != last_stage_) {
      started_ = true;
      last_beat_ = beat;
      last_stage_ = stage;
      since_ = now;
    }
    const std::int64_t limit = stage == Heartbeat::Stage::kRunning    ? limits_.beat
                               : stage == Heartbeat::Stage::kStarting ? limits_.starting
                                                                      : limits_.leaving;
    return now - since_ > limit ? Verdict::kHung : Verdict::kTrusted;
  }
  /// When the beat was last seen to move.
  [[nodiscard]] constexpr std::int64_t since() const noexcept { return since_; }

 private:
  BeatLimits limits_;
  std::uint64_t last_beat_ = 0;
  Heartbeat::Stage last_stage_ = Heartbeat::Stage::kStarting;
  std::int64_t since_ = 0;
  bool started_ = false;
};

/// Memory that parent and child both see; zeroed, locked where permitted.
class SharedMemory {
 public:
  /// Throws isac::Error (stopped) when the system has none left.
  explicit SharedMemory(std::size_t bytes);
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;
  [[nodiscard]] void* data() const noexcept { return data_; }

 private:
  void* data_ = nullptr;
  std::size_t bytes_;
};

struct SupervisorOptions {
  BeatLimits limits;
  std::chrono::microseconds poll{1000};
  int priority = 0;  ///< of SCHED_FIFO, 0: ordinary
};

struct SupervisorEnd {
  enum class Why { kLeft, kDied, kHung } why = Why::kLeft;
  int exit_code = -1;  ///< of the child; −1 where a signal ended it
  int signal = 0;
  std::int64_t silent_ns = 0;  ///< from the last beat that was seen to the vent; 0 where it left by itself
  Status vent = Status::kOk;   ///< what the parent's own handle answered
};

/// Runs `child` in a process of its own, and watches it from this one. `child` returns its exit code; it must tell
/// `heart` when it runs and when it has left. `stop` is passed on.
[[nodiscard]] SupervisorEnd supervise(card::Card& valves, Heartbeat& heart, const std::atomic<bool>& stop,
                                      const SupervisorOptions& options, const std::function<int()>& child);

}  // namespace isac::runtime
