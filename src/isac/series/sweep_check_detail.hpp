/// @file
/// Shared by the parts of the sweep check: the recording's columns, its numbers, and the sentences'
/// parts. Not for others.
///
/// Units: SI. Threads: pure. Errors: none of its own.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "isac/series/sweep_check.hpp"

namespace isac::series::detail {

/// One recording under examination, and the verdict that grows.
struct Sweep {
  const Recording& recording;
  const SweepExpectation& expected;
  std::span<const double> time, angle, p1, p2;  ///< empty where the recording has none
  std::vector<double> speed;                    ///< rad/s, NaN where it cannot be told
  double period = 0;                            ///< s between samples
  SweepVerdict verdict;

  void remark(std::string code, std::string text, bool repeat = true);
};

/// The finite values' quantile (0 … 1); NaN of nothing.
[[nodiscard]] double quantile(std::vector<double> values, double share);
[[nodiscard]] double mean(std::span<const double> values) noexcept;  ///< of the finite ones; NaN of nothing
[[nodiscard]] std::string number(const char* format, double value);
[[nodiscard]] std::string in_kgf(double pascal);   ///< "1.5 kg/cm2"
[[nodiscard]] std::string in_degrees(double rad);  ///< "57"

void check_motion(Sweep& sweep);    ///< encoder, angle range, speeds, clamp, poses
void check_level(Sweep& sweep);     ///< a calibration's level: at rest, inside the sensor's range
void check_pressure(Sweep& sweep);  ///< held levels, steps that settle

}  // namespace isac::series::detail
