/// @file
/// The beat that a loop leaves in shared memory for whoever watches it.
///
/// Units: none. Real time: lock-free stores. Threads: the loop beats, others read. Errors: none. Source: decision 0111.
#pragma once

#include <atomic>
#include <cstdint>

namespace isac::runtime {

/// What parent and child share; lies in SharedMemory.
struct Heartbeat {
  enum class Stage : int {
    kStarting,  ///< opening cards and files: may take its time
    kRunning,   ///< beats
    kLeft       ///< the loop has ended and vented; files are being closed
  };
  std::atomic<std::uint64_t> beat{0};
  std::atomic<int> stage{static_cast<int>(Stage::kStarting)};
  std::atomic<bool> stop{false};  ///< the parent asks the child to stop
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

}  // namespace isac::runtime
