/// @file
/// Calibration of the rig's channels (seed E.3 and Calibration_x0): pressure and force sensors, valves,
/// encoder middle.
///
///   reading = offset + gain · reference          sensors: e.g. counts at 0 and 5 kg/cm², at 0 and 149.1 N
///   pressure = offset + gain · code              valves: codes 0 … 4095; CalPressure is the pressure at 4095
///   middle  = mean of the encoder's rest positions over repeated approaches with both muscles stiff
///   rest    = middle + shift · Δp ± half the sides' difference, where approaches at several Δp were recorded
///
/// Any number of levels ≥ 2: weighted least squares, weights from the scatter of 50 ms averages at each level
/// (seed E.2), so that noise correlated over less than 50 ms does not make the errors too small. With ≥ 3
/// distinct levels the departure from the line is tested and its size in the reference's unit is said.
/// docs/derivations/calibration.md.
///
/// Units: SI for references (Pa, N), raw counts or volts for readings; `Estimated::unit` says which.
/// Threads: pure functions of their arguments. Errors: throws isac::Error (answer is no): "too_few_levels",
/// "levels_equal", "channel_dead", "channel_saturated", "too_few_approaches", "valve_never_moves", each with
/// what to do. Source: seed E.3.1 to E.3.3, E.2.2, D.2.2. Example: `calibrate_sensor(levels, {.name = "F1",
/// .reference_unit = "N"})`.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"

namespace isac::estimate {

/// Readings of one channel while the reference is held at one level.
struct CalibrationLevel {
  double reference = 0;         ///< in the reference's unit (Pa, N, or the valve's code)
  double reference_error = 0;   ///< standard error of the reference itself, same unit
  std::vector<double> time;     ///< s; empty: `sample_time` of the options is taken
  std::vector<double> reading;  ///< counts, V … (Pa for a valve); NaN where missing
};

struct CalibrationOptions {
  std::string name = "channel";  ///< for messages: "p1", "F2"
  std::string reference_unit = "Pa";
  std::string reading_unit = "count";
  double reading_low = 0;         ///< lower stop of the reading
  double reading_high = 4095;     ///< upper stop of the reading
  double resolution = 1;          ///< reading units: a reading that rests says no more than this
  double average_seconds = 0.05;  ///< length of the averages (seed: 50 ms)
  double sample_time = 0.002;     ///< s, where levels carry no time
  double smallest_change = 8;     ///< reading units: a channel that moves less over all levels is dead
};

struct CalibrationLevelResult {
  double reference = 0;
  double mean = 0;       ///< of the reading
  double std_error = 0;  ///< of the mean, from the averages' scatter
  double residual = 0;   ///< mean less line, reading units
  std::size_t samples = 0;
  std::size_t averages = 0;  ///< 50 ms averages
};

enum class Linearity { kLinear, kCurved, kNotTestable };

struct ChannelCalibration {
  std::string name;
  Estimated offset;                 ///< reading at reference 0 (CalP1Offset, CalF1Offset)
  Estimated gain;                   ///< reading per reference unit
  Estimated sensitivity;            ///< its inverse: reference units per reading unit
  double full_scale_reference = 0;  ///< largest |reference|, e.g. 5 kg/cm² in Pa, 149.1 N
  Estimated full_scale;             ///< reading there less the offset (CalP1Max, CalF1Max)
  double covariance = 0;            ///< of offset and gain
  Linearity linearity = Linearity::kNotTestable;
  double nonlinearity = 0;  ///< largest |residual| over the full-scale reading
  double p_value = 1;       ///< of "it is a line"
  std::string sentence;     ///< the verdict in words
  std::vector<CalibrationLevelResult> levels;
  Warnings warnings;

  /// Reference that belongs to a reading, and the standard error of it that the calibration contributes.
  [[nodiscard]] double to_reference(double reading) const noexcept;
  [[nodiscard]] double reference_error(double reading) const noexcept;
};

/// Pressure sensor or force sensor.
[[nodiscard]] ChannelCalibration calibrate_sensor(std::span<const CalibrationLevel> levels,
                                                  const CalibrationOptions& options = {});

struct ValveCalibration {
  ChannelCalibration line;  ///< pressure over code: offset in Pa, gain in Pa per count
  Estimated cal_pressure;   ///< CalPressure: pressure at code 4095, Pa
  Estimated zero_pressure;  ///< pressure at code 0, Pa; the seed's program has no offset, the zero trimmer
                            ///< must be set
};

/// Levels' `reference` is the code 0 … 4095, `reading` the settled pressure in Pa from a calibrated sensor.
[[nodiscard]] ValveCalibration calibrate_valve(std::span<const CalibrationLevel> levels,
                                               const CalibrationOptions& options);
/// Defaults for valves: unit "count" to "Pa", no stops, dead below 0.05 kg/cm².
[[nodiscard]] CalibrationOptions valve_calibration_options(const std::string& name);

/// One approach: the encoder while both muscles are stiff and the joint has come to rest.
struct MiddleApproach {
  std::vector<double> counts;
  int from_side =
      0;  ///< +1, −1: the side the joint came from, 0 unknown; play or hysteresis shows as a difference
  double delta_pressure = std::numeric_limits<double>::quiet_NaN();  ///< Pa, measured while it rests
};

struct MiddleCalibration {
  Estimated middle;  ///< EncMiddlePosition, count; standard error from the scatter between approaches
  Estimated side_difference;  ///< count, positive side less negative side; refused when one side is missing
  /// count/Pa, of the rest position with Δp; refused without four approaches over 0.05 kg/cm²
  Estimated shift{};
  std::vector<double> approaches;  ///< mean of each less shift · Δp, count
  Warnings warnings;
};

[[nodiscard]] MiddleCalibration calibrate_middle(std::span<const MiddleApproach> approaches,
                                                 const std::string& name = "encoder");

/// Means over windows of `seconds`, the last one only if at least half full; NaN samples are skipped (seed
/// E.2.2).
[[nodiscard]] std::vector<double> window_means(std::span<const double> time, std::span<const double> values,
                                               double seconds);

}  // namespace isac::estimate
