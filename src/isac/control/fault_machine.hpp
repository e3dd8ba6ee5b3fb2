/// @file
/// The fault state machine of the live loop: pure, with time handed in; the same code on every back end.
///
///   disarmed ──arm edge, after `plausible_ticks` good ticks──► armed ──any finding──► faulted (latched)
///      ▲  ▲                                                      │                        │
///      │  └───────────────────── disarm ─────────────────────────┘                        │
///      └────────────── edge of `acknowledge` on a tick without a finding ─────────────────┘
///
///   1   starts disarmed; `arm` held from the start, or through a fault, is no edge; a refused edge is spent
///   4   late ticks: missed = ⌊(t − t_last)/period + ½⌋ − 1 periods are skipped, never caught up; a leaky counter goes +1 on
///       a late tick and −1 on one in time, and faults at `overrun_limit`
///   6   a command that is not finite is reported as a finding: fault, never clamped
///   13  the first cause is kept until the operator's acknowledge; later findings are counted
///   18  a sample that is not newer than the last, or older than `stale_after`: fault
/// Everything but "armed" vents. A finding while disarmed spoils the plausibility count, and latches nothing.
///
/// Use, each tick: `begin(inputs)`, then `report(finding)` for what the step itself finds, then act on `vents()`.
/// Units: ns. Real time: constant time, no heap, no lock, noexcept. Threads: one.
/// Errors: none; the status of an arm edge is in `arm_refused()`. Source: decision 0090; LinuxCNC estop_latch, PX4 failsafe.
/// Example: tests/control/fault_machine_test.cpp.
#pragma once

#include <cstdint>

#include "isac/control/fault.hpp"

namespace isac::control {

enum class RunState : std::uint8_t { kDisarmed, kArmed, kFaulted };

struct FaultSettings {
  std::int64_t period = 500'000;         ///< ns
  std::int64_t stale_after = 5'000'000;  ///< ns, age of a sample
  int plausible_ticks = 100;             ///< good ticks in a row before arming
  int overrun_limit = 20;                ///< of the leaky counter
};

struct TickInputs {
  std::int64_t now = 0;      ///< ns, the loop's clock
  std::int64_t sampled = 0;  ///< ns, when the sample was taken, same clock
  bool arm = false;          ///< level; an edge arms
  bool disarm = false;       ///< level; wins over arm
  bool acknowledge = false;  ///< level; an edge lets a latched fault go
  Finding finding{};         ///< the first thing the watches found in this sample
};

class FaultMachine {
 public:
  explicit constexpr FaultMachine(const FaultSettings& settings = {}) noexcept : settings_(settings) {}

  constexpr RunState begin(const TickInputs& in) noexcept {
    const bool arm_edge = in.arm && !last_arm_, acknowledge_edge = in.acknowledge && !last_acknowledge_;
    last_arm_ = in.arm;
    last_acknowledge_ = in.acknowledge;
    arm_refused_ = false;

    const Finding timing = check_time(in);
    const Finding& found = in.finding.found() ? in.finding : timing;
    if (state_ == RunState::kFaulted) {
      if (found.found()) {
        ++later_;
      } else if (acknowledge_edge) {
        state_ = RunState::kDisarmed;
        cause_ = Finding{};
        plausible_ = leaky_ = later_ = 0;
        reported_ = true;
      }
    } else if (found.found()) {
      report(found);
    }
    if (state_ == RunState::kArmed && in.disarm) state_ = RunState::kDisarmed;
    if (state_ == RunState::kDisarmed) {
      if (arm_edge && !in.disarm && !found.found() && plausible_ >= settings_.plausible_ticks) {
        state_ = RunState::kArmed;
        leaky_ = 0;
      } else if (!found.found() && plausible_ < settings_.plausible_ticks) {
        ++plausible_;
      }
    }
    arm_refused_ = arm_edge && state_ != RunState::kArmed;
    return state_;
  }

  /// A finding after begin(), e.g. of the controller's step; latches when armed.
  constexpr void report(const Finding& finding) noexcept {
    if (!finding.found()) return;
    plausible_ = 0;
    if (state_ == RunState::kFaulted) ++later_;
    if (state_ != RunState::kArmed) return;
    state_ = RunState::kFaulted;
    cause_ = finding;
    reported_ = false;
  }

  [[nodiscard]] constexpr RunState state() const noexcept { return state_; }
  [[nodiscard]] constexpr bool vents() const noexcept { return state_ != RunState::kArmed; }
  [[nodiscard]] constexpr const Finding& cause() const noexcept {
    return cause_;
  }  ///< first cause, while faulted
  /// True once per fault: the time to tell the person.
  [[nodiscard]] constexpr bool take_report() noexcept {
    const bool news = state_ == RunState::kFaulted && !reported_;
    reported_ = true;
    return news;
  }
  [[nodiscard]] constexpr int later_findings() const noexcept { return later_; }
  [[nodiscard]] constexpr bool arm_refused() const noexcept {
    return arm_refused_;
  }                                                                     ///< an edge of this tick
  [[nodiscard]] constexpr bool late() const noexcept { return late_; }  ///< this tick
  [[nodiscard]] constexpr std::int64_t late_ticks() const noexcept { return late_ticks_; }
  [[nodiscard]] constexpr std::int64_t skipped_periods() const noexcept { return skipped_; }

 private:
  constexpr Finding check_time(const TickInputs& in) noexcept {
    late_ = false;
    Finding found;
    if (has_last_) {
      if (in.now <= last_now_ || in.sampled <= last_sampled_) {
        found = {.code = FaultCode::kStaleSample, .value = seconds(in.sampled - last_sampled_), .limit = 0};
      }
      const std::int64_t gap = in.now > last_now_ ? in.now - last_now_ : 0;
      const std::int64_t missed = (gap + settings_.period / 2) / settings_.period - 1;
      late_ = missed > 0;
      if (late_) {
        ++late_ticks_;
        skipped_ += missed;
        if (leaky_ < settings_.overrun_limit) ++leaky_;
      } else if (leaky_ > 0) {
        --leaky_;
      }
      if (leaky_ >= settings_.overrun_limit && !found.found() && state_ == RunState::kArmed) {
        found = {.code = FaultCode::kOverrun,
                 .value = static_cast<float>(leaky_),
                 .limit = static_cast<float>(settings_.overrun_limit)};
      }
    }
    if (!found.found() && in.now - in.sampled > settings_.stale_after) {
      found = {.code = FaultCode::kStaleSample,
               .value = seconds(in.now - in.sampled),
               .limit = seconds(settings_.stale_after)};
    }
    has_last_ = true;
    last_now_ = in.now;
    last_sampled_ = in.sampled;
    return found;
  }
  [[nodiscard]] static constexpr float seconds(std::int64_t ns) noexcept {
    return 1e-9f * static_cast<float>(ns);
  }

  FaultSettings settings_;
  RunState state_ = RunState::kDisarmed;
  Finding cause_;
  std::int64_t last_now_ = 0, last_sampled_ = 0, late_ticks_ = 0, skipped_ = 0;
  int plausible_ = 0, leaky_ = 0, later_ = 0;
  bool has_last_ = false, last_arm_ = true, last_acknowledge_ = true;  // held from the start is no edge
  bool late_ = false, reported_ = true, arm_refused_ = false;
};

}  // namespace isac::control
