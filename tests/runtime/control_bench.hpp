/// @file
/// A control loop on the fake card, in virtual time: one call, one cycle.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <vector>

#include "fake_rig.hpp"
#include "isac/runtime/control_loop.hpp"
#include "isac/runtime/control_setup.hpp"
#include "isac/runtime/directors.hpp"

namespace isac::test {

inline constexpr std::int64_t kPeriodNs = 500'000;  // 2 kHz

/// The fake card with a clock that can run while a read is under way, and failures as told.
class ControlCard : public FakeCard {
 public:
  Status read(card::Sample& sample) noexcept override {
    const Status status = FakeCard::read(sample);
    if (!ok(status)) return status;
    sample.time_ns = std::max(sample.time_ns, last_stamp + 1);
    last_stamp = sample.time_ns;
    if (change) change(sample);
    clock = std::max(clock, now_ns) + read_takes_ns;
    return status;
  }
  Status write(const card::Command& command) noexcept override {
    if (fail_write) return Status::kDeviceError;
    return FakeCard::write(command);
  }
  Status vent() noexcept override {
    if (vented_at_ns < 0 && !closed()) vented_at_ns = now_ns;
    return FakeCard::vent();
  }
  [[nodiscard]] std::int64_t clock_ns() const noexcept override { return clock; }
  [[nodiscard]] bool closed() const noexcept { return written.output == card::Command{}.output; }

  std::function<void(card::Sample&)> change;
  std::int64_t read_takes_ns = 0, clock = 0, last_stamp = -1, vented_at_ns = -1;
  bool fail_write = false;
};

/// Wants what the test says.
class TestDirector final : public runtime::Director {
 public:
  bool at(const runtime::Moment& now, runtime::Wanted& out) noexcept override {
    if (arms) wanted.arm = now.plausible || now.phase != runtime::Phase::kChecking;
    out = wanted;
    return !over;
  }
  runtime::Wanted wanted{.mode = control::Mode::kPosition, .joint = {}};
  bool arms = true;  ///< once the samples are plausible
  bool over = false;
};

class Bench {
 public:
  explicit Bench(const std::function<void(runtime::ControlSettings&)>& change = {}, bool heartbeat = false) {
    card.has_heartbeat = heartbeat;
    settings = runtime::testbed_control_settings(rig, {});
    settings.run_up = 0.01;
    if (change) change(settings);
    loop = std::make_unique<runtime::ControlLoop>(card, runtime::wire_joints(rig, card.shape(), 1), settings);
    EXPECT_EQ(loop->configure(), Status::kOk);
  }
  void cycles(int count) {
    for (int k = 0; k < count; ++k) static_cast<void>(loop->cycle(director, &live, nullptr));
  }
  /// Armed, pressures up, controller at work.
  void run_in() {
    cycles(200);
    ASSERT_EQ(loop->row().phase, runtime::Phase::kControl);
    ASSERT_FALSE(card.closed());
  }
  [[nodiscard]] control::RunState state() const { return loop->machine().state(); }
  [[nodiscard]] const control::Finding& cause() const { return loop->machine().cause(); }
  /// Counts of the testbed's encoder for an angle.
  static long counts(double radian) { return std::lround(radian * 8000 / (2 * kPi)); }

  record::Rig rig;
  runtime::ControlSettings settings;
  ControlCard card;
  TestDirector director;
  runtime::Live live;
  std::unique_ptr<runtime::ControlLoop> loop;
};

}  // namespace isac::test
