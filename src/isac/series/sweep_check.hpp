/// @file
/// The verdict on a fresh sweep, while the person still stands at the rig: keep it, or repeat it and why.
///
/// A pure function of a recording and of what was asked for. Every remark is one plain sentence with the
/// number found, the number that would do, and what to do about it; a remark either asks for the sweep again
/// (`repeat`) or only informs. Checked: length, time gaps and lost samples, missing and frozen signals,
/// a calibration's level that rests, saturation of force, pressure and converter, jumps of the encoder, pressure held or followed, range of
/// angle and of speed in both directions, steps that settled.
///
/// Speed here is a central difference of the angle over `SweepExpectation::speed_window` on either side: good
/// enough to say whether a sweep covered its range, not meant for identification. Units: SI. Threads: pure.
/// Cost: O(rows log rows). Errors: throws isac::Error (bad input) only when a needed column is missing.
/// Source: seed 3.2 (sweeps), 3.5 (range of validity), E.1 (ranges of the sensors).
/// Example: `const auto verdict = isac::series::check_sweep(recording, program.expected);`
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "isac/series/recording.hpp"

namespace isac::series {

/// What a sensor can show at most and at least, SI; a sample within half a `step` of either end is saturated.
struct SensorRange {
  std::string column;  ///< "F1", "p2", …
  double low = 0, high = 0;
  double step = 0;  ///< one code of the converter
};

/// A signal that must rest at its level through a calibration's recording.
struct HeldSignal {
  std::string column;    ///< "F1", "p2", "angle"
  double tolerance = 0;  ///< SI: between both halves' means; twice that for the scatter of 50 ms means
};

/// What was asked for. NaN or an empty list means "not asked, don't check".
struct SweepExpectation {
  std::string experiment;                                           ///< `# experiment:` of docs/formats.md
  double duration = std::numeric_limits<double>::quiet_NaN();       ///< s
  double sample_period = std::numeric_limits<double>::quiet_NaN();  ///< s
  double amplitude = std::numeric_limits<
      double>::quiet_NaN();  ///< rad, of the person's sweep either side of where the bar rests
  double speed = std::numeric_limits<double>::quiet_NaN();  ///< rad/s, peak asked of the person
  bool all_speeds = false;                                  ///< the bundle: every speed up to `speed`
  bool slow = false;                                        ///< quasi-static: much faster is wrong too
  double held_delta_pressure = std::numeric_limits<double>::quiet_NaN();  ///< Pa, constant through the sweep
  bool clamped = false;                                                   ///< the angle must not move
  bool stepped = false;  ///< p1_cmd, p2_cmd hold steps that must settle
  double moved_by_muscles =
      std::numeric_limits<double>::quiet_NaN();  ///< rad, angle range that free motion must reach
  std::vector<double> poses;                     ///< rad, angles to hold still
  std::uint64_t dropped = 0;                     ///< samples the logger lost
  std::uint64_t late = 0;                        ///< periods the loop skipped
  double encoder_step = std::numeric_limits<double>::quiet_NaN();  ///< rad per count
  double highest_speed =
      std::numeric_limits<double>::quiet_NaN();  ///< rad/s, faster than any joint: an encoder jump
  double force_capacity = std::numeric_limits<double>::quiet_NaN();  ///< N, of the force sensors
  double speed_window = 0.02;                                        ///< s, either side
  std::vector<HeldSignal> held;  ///< a calibration's level: only this, length, gaps and range are checked
  std::vector<SensorRange> ranges;
};

struct SweepRemark {
  std::string code;  ///< stable for programs: "speed_too_low", "encoder_jumped"
  std::string text;  ///< one plain sentence with the mend
  bool repeat = true;
};

/// What the sweep covered, SI; NaN where the recording has no such signal.
struct SweepFacts {
  double duration = 0;
  std::uint64_t rows = 0;
  double angle_low = std::numeric_limits<double>::quiet_NaN();
  double angle_high = std::numeric_limits<double>::quiet_NaN();
  double speed_forward = std::numeric_limits<double>::quiet_NaN();   ///< 99th percentile of the speed
  double speed_backward = std::numeric_limits<double>::quiet_NaN();  ///< 1st percentile, negated
  double delta_pressure_low = std::numeric_limits<double>::quiet_NaN();
  double delta_pressure_high = std::numeric_limits<double>::quiet_NaN();
  double force_low = std::numeric_limits<double>::quiet_NaN();
  double force_high = std::numeric_limits<double>::quiet_NaN();
  struct Level {
    std::string column;
    double mean = 0, scatter = 0;  ///< SI, of all samples
  };
  std::vector<Level> levels;  ///< of a calibration: what the signals showed, by the calibration before it
};

struct SweepVerdict {
  std::vector<SweepRemark> remarks;
  SweepFacts facts;
  [[nodiscard]] bool keep() const noexcept;
};

[[nodiscard]] SweepVerdict check_sweep(const Recording& recording, const SweepExpectation& expected);

}  // namespace isac::series
