/// @file
/// What the card's codes mean: linear calibration of the rig file, encoder counts unwrapped to an angle, pressures to codes.
///
///   physical = (code − offset) · gain        angle = (count − middle) · 2π / steps_per_turn
/// Signals known: F1, F2, p1, p2 (inputs), p1_cmd, p2_cmd (outputs), angle (an encoder; where the calibration has none,
/// enc0 with the rig file's [encoder] section).
///
/// Units: SI. Real time: to_physical and to_command allocate nothing, throw nothing, take constant time.
/// Threads: one at a time (the encoder's unwrapping has a memory).
/// Errors: the constructor throws isac::Error (bad input) that names the signal or the channel the card does not have.
/// Source: seed E.3 (calibration), E.1.4 and C.4 (cards), E.2.2 getEncoderData.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "isac/card/card.hpp"
#include "isac/record/rig.hpp"
#include "isac/series/excitation.hpp"

namespace isac::runtime {

/// One instant of the rig, SI.
struct Physical {
  double angle = 0;
  double p1 = 0, p2 = 0;
  double F1 = 0, F2 = 0;
};

class SignalMap {
 public:
  SignalMap(const record::Rig& rig, const card::Shape& shape);

  [[nodiscard]] Physical to_physical(const card::Sample& sample) noexcept;
  /// Codes for both valves, rounded and clamped to the outputs' range; all other outputs 0. NaN gives 0: vented.
  [[nodiscard]] card::Command to_command(const series::Pressures& pressures) const noexcept;
  /// Both valves' codes themselves, rounded and clamped likewise.
  [[nodiscard]] card::Command to_command_of_codes(const series::Pressures& codes) const noexcept;
  /// The pressures that a command's codes stand for.
  [[nodiscard]] series::Pressures commanded(const card::Command& command) const noexcept;

  /// What each sensor can show, for the sweep check.
  [[nodiscard]] const std::vector<series::SensorRange>& ranges() const noexcept { return ranges_; }
  [[nodiscard]] double encoder_step() const noexcept { return std::abs(radian_per_count_); }
  [[nodiscard]] const card::Shape& shape() const noexcept { return shape_; }

 private:
  struct Line {
    int channel = -1;
    double offset = 0, gain = 1;
  };
  [[nodiscard]] static double value(const Line& line, std::uint32_t code) noexcept {
    return (static_cast<double>(code) - line.offset) * line.gain;
  }
  [[nodiscard]] std::uint32_t clamped(double code) const noexcept;

  card::Shape shape_;
  Line p1_, p2_, F1_, F2_, p1_cmd_, p2_cmd_;
  std::size_t encoder_ = 0;
  double radian_per_count_;
  double middle_;  ///< count; a calibrated middle may lie between two
  std::int64_t position_ = 0;
  std::uint32_t last_count_ = 0;
  bool has_count_ = false;
  std::vector<series::SensorRange> ranges_;
};

}  // namespace isac::runtime
