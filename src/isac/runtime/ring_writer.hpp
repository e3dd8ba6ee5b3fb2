/// @file
/// A thread that takes rows out of a ring and hands them to a consumer that may wait for a disk.
///
/// Real time: push() is wait-free and counts what it loses. push_waiting() is for virtual time only, where time stands still
/// meanwhile. Threads: construct and finish() on one thread, push on the loop's; the consumer runs on the thread inside.
/// Errors: what the consumer throws ends the thread; failed() tells the loop, finish() throws it again.
/// Example: `RingWriter<Row> writer([&](const Row& row) { log.append(row); }, 8192);`
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <thread>
#include <utility>

#include "isac/runtime/spsc_ring.hpp"

namespace isac::runtime {

template <class Row>
class RingWriter {
 public:
  RingWriter(std::function<void(const Row&)> consume, std::size_t ring_rows)
      : consume_(std::move(consume)), ring_(ring_rows), thread_([this] { drain(); }) {}
  ~RingWriter() { join(); }
  RingWriter(const RingWriter&) = delete;
  RingWriter& operator=(const RingWriter&) = delete;

  /// False when the ring is full: the row is lost and counted.
  bool push(const Row& row) noexcept {
    if (ring_.push(row)) return true;
    dropped_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  /// Waits for room instead of losing the row. False once the consumer has failed.
  bool push_waiting(const Row& row) noexcept {
    while (!ring_.push(row)) {
      if (failed()) return false;
      std::this_thread::sleep_for(kNap);
    }
    return true;
  }
  [[nodiscard]] bool failed() const noexcept { return failed_.load(std::memory_order_acquire); }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

  /// Hands over what is left and throws what went wrong.
  void finish() {
    join();
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  }

 private:
  static constexpr std::chrono::microseconds kNap{500};

  void join() {
    stop_.store(true, std::memory_order_release);
    if (thread_.joinable()) thread_.join();
  }
  void drain() noexcept {
    try {
      Row row;
      for (;;) {
        const bool last_round = stop_.load(std::memory_order_acquire);  // read before the ring is emptied
        while (ring_.pop(row)) consume_(row);
        if (last_round) return;
        std::this_thread::sleep_for(kNap);
      }
    } catch (...) {
      error_ = std::current_exception();
      failed_.store(true, std::memory_order_release);
    }
  }

  std::function<void(const Row&)> consume_;
  SpscRing<Row> ring_;
  std::atomic<bool> stop_{false}, failed_{false};
  std::atomic<std::uint64_t> dropped_{0};
  std::exception_ptr error_;
  std::thread thread_;  ///< last: starts when everything else stands
};

}  // namespace isac::runtime
