/// @file
/// Real-time set-up of this process and thread, as far as the system permits it, and what was permitted in plain words.
///
///   memory   mlockall(current and future); the stack is touched once, the heap is kept from giving memory back
///   thread   SCHED_FIFO at a priority; a thread that may not have it goes on at the ordinary one
/// Without SCHED_FIFO the wake-ups of an ordinary process come late under load (docs/how-to/run.md has the figures).
///
/// Units: µs where said. Real time: these are start-up calls. Threads: lock_memory once per process, fifo per thread.
/// Errors: none thrown; RealTime says what is missing and why. Source: sched(7), mlockall(2).
/// Example: `const RealTime rt = prepare_real_time(80); if (!rt.complete()) say(rt.words());`
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

namespace isac::runtime {

struct RealTime {
  bool fifo = false, locked = false;
  int fifo_error = 0, lock_error = 0;  ///< errno
  int priority = 0;
  [[nodiscard]] bool complete() const noexcept { return fifo && locked; }
  /// "FIFO 80, memory locked", or what is missing, why, and the mend.
  [[nodiscard]] std::string words() const;
};

/// Stacks of threads started from now on: what is locked is filled, and must be given back before a dead process closes its
/// files, which is how a supervisor learns of the death. Call before starting threads.
void keep_stacks_small() noexcept;

/// For the calling thread and its process; allocates nothing.
[[nodiscard]] RealTime prepare_real_time(int priority) noexcept;

/// How late a thread wakes up that sleeps until fixed times.
struct Jitter {
  std::vector<double> late;  ///< µs, sorted
  std::int64_t missed = 0;   ///< wake-ups later than one period
  std::int64_t skipped = 0;  ///< periods left out because of them
  /// At a share of all wake-ups, 0 … 1; NaN where nothing was measured.
  [[nodiscard]] double quantile(double share) const noexcept;
};

/// Sleeps `seconds · rate` times on the calling thread; `stop` ends it early.
[[nodiscard]] Jitter measure_jitter(double seconds, double rate, const std::atomic<bool>& stop);

}  // namespace isac::runtime
