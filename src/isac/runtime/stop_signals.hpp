/// @file
/// Signals become a clean stop: SIGINT, SIGTERM and SIGHUP raise a flag that the loop reads; signals that end the process
/// (SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL) vent the card first and then take their usual course.
///
/// SIGPIPE and SIGXFSZ are ignored, so that a closed terminal or a full quota is an error of a write and not a death
/// with open valves. SIGKILL cannot be caught: then the card's own watchdog or a supervisor process must vent.
/// Real time: the flag is lock-free. Threads: one object at a time, made on the main thread. Errors: none.
#pragma once

#include <array>
#include <atomic>
#include <csignal>

#include "isac/card/card.hpp"

namespace isac::runtime {

class StopSignals {
 public:
  StopSignals();
  ~StopSignals();  ///< the former handlers come back
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  [[nodiscard]] static const std::atomic<bool>& requested() noexcept;
  /// The card to vent when the process dies; null for none.
  static void vent_on_death(card::Card* card) noexcept;

 private:
  static constexpr std::array<int, 10> kSignals = {SIGINT, SIGTERM, SIGHUP, SIGSEGV, SIGABRT,
                                                   SIGBUS, SIGFPE,  SIGILL, SIGPIPE, SIGXFSZ};
  std::array<struct sigaction, kSignals.size()> former_{};
};

}  // namespace isac::runtime
