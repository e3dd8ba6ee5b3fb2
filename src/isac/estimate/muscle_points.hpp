/// @file
/// Recordings of a muscle condensed to mean points over pressure, branch by branch, with zero and stop settled.
///
/// Internal to the room `estimate`. Units: SI. Threads: pure functions. Errors: usage error for columns of unequal length.
/// Source: docs/derivations/muscle_fit.md.
#pragma once

#include <vector>

#include "isac/estimate/muscle_fit.hpp"

namespace isac::estimate {

struct MusclePoint {
  double pressure = 0;     ///< Pa, less its zero
  double contraction = 0;  ///< with the end correction
  double rate = 0;         ///< 1/s
  double force = 0;        ///< N, reading (zero not taken off)
  double weight = 1;       ///< share of the bin's rows
  bool censored = false;   ///< the reading stands at the stop
  int group = 0;           ///< run and branch
};

struct PreparedRun {
  const MuscleRun* run = nullptr;
  double zero = 0;   ///< N, known zero (0 where it is fitted)
  double floor = 0;  ///< N, −inf without a stop
  std::vector<MusclePoint> points;
  std::vector<MusclePoint> rows;  ///< every usable row, for scores
  bool moves = false;             ///< the contraction rate is excited
};

/// Lower stop of the force readings that many rows rest on, or −inf.
[[nodiscard]] double find_force_floor(std::span<const MuscleRun> a, std::span<const MuscleRun> b);

/// δ of the end correction by least squares of full contraction over 1/l0; 0 where fewer than two lengths are known.
[[nodiscard]] double find_end_length(std::span<const MuscleRun> a, std::span<const MuscleRun> b,
                                     const MuscleFitOptions& options);

[[nodiscard]] PreparedRun prepare_run(const MuscleRun& run, double end_length, double floor,
                                      const MuscleFitOptions& options, int first_group);

[[nodiscard]] HysteresisWidth hysteresis_width(const PreparedRun& run, int bins);

}  // namespace isac::estimate
