/// @file
/// The last cycles before the end, always kept: a ring of rows in memory that outlives the process that writes it.
///
/// The ring lies in memory that a supervisor shares (supervisor.hpp), so that the rows before a SIGKILL are still there; they
/// are written to a file by whoever is not in a hurry, after the run. The row that was being copied when its writer died is
/// left out.
/// Units: rows as in cycle_row.hpp. Real time: push() copies one row, constant time, no heap. Threads: one pushes; rows() may
/// be called by another process or thread once the pusher has stopped. Errors: none.
/// Source: libfranka keeps the last 50 cycles with every exception. Example: `FlightRecorder flight(memory, 4000);`
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

#include "isac/runtime/cycle_row.hpp"

namespace isac::runtime {

class FlightRecorder {
 public:
  struct Head {
    std::atomic<std::uint64_t> written{0};
  };
  [[nodiscard]] static constexpr std::size_t bytes(std::size_t capacity) noexcept {
    return kRowsAt + capacity * sizeof(CycleRow);
  }
  /// `memory` of bytes(capacity), aligned for any type; its pages are touched here.
  FlightRecorder(void* memory, std::size_t capacity) noexcept
      : head_(new (memory) Head), rows_(static_cast<std::byte*>(memory) + kRowsAt), capacity_(capacity) {
    for (std::size_t i = 0; i < capacity; ++i) new (rows_ + i * sizeof(CycleRow)) CycleRow;
  }

  void push(const CycleRow& row) noexcept {
    const std::uint64_t written = head_->written.load(std::memory_order_relaxed);
    *slot(written) = row;
    head_->written.store(written + 1, std::memory_order_release);
  }

  /// Oldest first; at most capacity − 1, because the oldest slot may be half overwritten.
  [[nodiscard]] std::vector<CycleRow> rows() const {
    const std::uint64_t written = head_->written.load(std::memory_order_acquire);
    const std::uint64_t kept = written < capacity_ ? written : capacity_ - 1;
    std::vector<CycleRow> out;
    out.reserve(kept);
    for (std::uint64_t k = written - kept; k < written; ++k) out.push_back(*slot(k));
    return out;
  }

 private:
  static constexpr std::size_t kRowsAt = 64;
  [[nodiscard]] CycleRow* slot(std::uint64_t k) const noexcept {
    return std::launder(reinterpret_cast<CycleRow*>(rows_ + (k % capacity_) * sizeof(CycleRow)));
  }

  Head* head_;
  std::byte* rows_;
  std::size_t capacity_;
};

}  // namespace isac::runtime
