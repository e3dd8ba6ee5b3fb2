/// @file
/// A card and a person of a few lines for tests of the loop: pressures follow at once, angles and faults as told.
#pragma once

#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "isac/card/calibration.hpp"
#include "isac/card/card.hpp"
#include "isac/core/units.hpp"

namespace isac::test {

class FakeCard : public card::Card {
 public:
  [[nodiscard]] card::Shape shape() const noexcept override {
    return {.encoders = 1, .inputs = 8, .outputs = 2, .heartbeat = has_heartbeat};
  }

  Status wait_until(std::int64_t time_ns) noexcept override {
    if (on_wait) on_wait(*this);
    now_ns = std::max(now_ns, time_ns);
    ++waits;
    return Status::kOk;
  }

  Status read(card::Sample& sample) noexcept override {
    if (fail_after >= 0 && waits >= fail_after) return failure;
    sample = {};
    sample.time_ns = now_ns + stall_ns;
    now_ns += stall_ns;
    stall_ns = 0;
    sample.encoder[0] = static_cast<std::uint32_t>(encoder) & 0xFFFFFFu;  // 24 bit, wraps below zero
    sample.input[channel(F1)] = force_1;
    sample.input[channel(F2)] = force_2;
    // What the valves are told is what the sensors see, by the calibration of the testbed.
    for (const auto& [out, in] : {std::pair{&p1_cmd, &p1}, std::pair{&p2_cmd, &p2}}) {
      const double pressure = (written.output[channel(*out)] - out->offset) * out->gain;
      sample.input[channel(*in)] = static_cast<std::uint32_t>(std::lround(pressure / in->gain + in->offset));
    }
    return Status::kOk;
  }

  Status write(const card::Command& command) noexcept override {
    written = command;
    ++writes;
    return Status::kOk;
  }

  Status beat(bool level) noexcept override {
    if (!has_heartbeat || fail_beat) return Status::kDeviceError;
    if (level != beat_level) last_beat_ns = now_ns;
    beats += level != beat_level ? 1 : 0;
    beat_level = level;
    return Status::kOk;
  }

  Status vent() noexcept override {
    written = {};
    ++vents;
    return Status::kOk;
  }

  Status outputs(card::Command& command) const noexcept override {
    command = written;
    return Status::kOk;
  }

  static record::RigChannel calibrated(const char* signal) {
    for (const record::RigChannel& channel : card::default_calibration()) {
      if (channel.signal == signal) return channel;
    }
    return {};
  }
  static std::size_t channel(const record::RigChannel& line) noexcept {
    return static_cast<std::size_t>(line.channel[2] - '0');
  }
  /// The code at which a force sensor of the testbed shows `newton`.
  static std::uint32_t force_code(double newton) {
    const record::RigChannel line = calibrated("F1");
    return static_cast<std::uint32_t>(std::lround(newton / line.gain + line.offset));
  }

  record::RigChannel p1 = calibrated("p1"), p2 = calibrated("p2"), p1_cmd = calibrated("p1_cmd"),
                     p2_cmd = calibrated("p2_cmd"), F1 = calibrated("F1"), F2 = calibrated("F2");
  std::function<void(FakeCard&)> on_wait;  ///< before each tick
  std::int64_t now_ns = 0, stall_ns = 0;
  long encoder = 0;
  std::uint32_t force_1 = force_code(90), force_2 = force_code(90);
  card::Command written;
  bool has_heartbeat = false, fail_beat = false, beat_level = false;
  int beats = 0;
  std::int64_t last_beat_ns = -1;
  int waits = 0, writes = 0, vents = 0, fail_after = -1;
  Status failure = Status::kDeviceError;
};

class FakePerson : public card::Person {
 public:
  void ask(const card::Task& task) override { tasks.push_back(task.kind); }
  std::vector<card::Task::Kind> tasks;
};

}  // namespace isac::test
