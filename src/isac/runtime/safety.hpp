/// @file
/// Safety limits while recording: a pure state machine that is fed every sample and says when the run must stop.
///
/// A limit is broken when it is exceeded without pause for `persistence`: one noisy sample stops nothing, a joint that runs
/// away stops within ten milliseconds. A value that is not finite stops at once. The first fault is kept (latched).
/// Speed is the angle's difference through a first-order filter of `kSpeedFilter`, which holds back encoder steps.
///
/// Units: SI. Real time: constant time, no heap, noexcept. Threads: one at a time.
/// Errors: check_limits throws isac::Error (usage) for a limit that is not a positive number; describe() allocates.
/// Source: seed 3.5 (range of validity), E.1.1 (capacity of the force sensors).
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>

#include "isac/runtime/signal_map.hpp"

namespace isac::runtime {

struct Limits {
  double pressure = 0;         ///< Pa, of either muscle
  double delta_pressure = 0;   ///< Pa, |Δp|
  double angle = 0;            ///< rad
  double speed = 0;            ///< rad/s
  double force = 0;            ///< N, of either sensor
  double persistence = 0.010;  ///< s
};

struct Fault {
  enum class Kind : std::uint8_t {
    kNone,
    kNotFinite,
    kPressure,
    kDeltaPressure,
    kAngle,
    kSpeed,
    kForce
  } kind = Kind::kNone;
  double value = 0, limit = 0;
  double time = 0;  ///< s, on the clock that check() was given
};

class SafetyMonitor {
 public:
  static constexpr double kSpeedFilter = 0.010;  ///< s

  explicit SafetyMonitor(const Limits& limits) noexcept : limits_(limits) {}
  /// True while the run may go on.
  bool check(double time, const Physical& now) noexcept;
  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }
  [[nodiscard]] double speed() const noexcept { return speed_; }

 private:
  static constexpr std::size_t kChecks = 5;
  Limits limits_;
  Fault fault_;
  std::array<double, kChecks> since_{kNever, kNever, kNever, kNever, kNever};
  double last_time_ = 0, last_angle_ = 0, speed_ = 0;
  bool has_last_ = false;
  static constexpr double kNever = std::numeric_limits<double>::infinity();
};

void check_limits(const Limits& limits);

/// One sentence: what was exceeded, by how much, when, and what to do.
[[nodiscard]] std::string describe(const Fault& fault);

}  // namespace isac::runtime
