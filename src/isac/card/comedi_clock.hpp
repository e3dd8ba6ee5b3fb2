/// @file
/// The time that a Comedi card lives in; a test may bring its own.
///
/// Units: ns since the clock was made. Real time: both calls allocate nothing; the system's reads CLOCK_MONOTONIC and sleeps to an
/// absolute time, so that lateness does not add up. Threads: now_ns() from any, sleep_until() from the one that drives.
/// Errors: none; a sleep that a signal ends goes on. Example: `open_comedi(table, std::make_unique<MyClock>())`.
#pragma once

#include <cstdint>
#include <memory>

namespace isac::card {

class ComediClock {
 public:
  virtual ~ComediClock() = default;
  [[nodiscard]] virtual std::int64_t now_ns() const noexcept = 0;
  virtual void sleep_until(std::int64_t time_ns) noexcept = 0;
};

[[nodiscard]] std::unique_ptr<ComediClock> system_clock();

}  // namespace isac::card
