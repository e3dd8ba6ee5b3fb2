/// @file
/// Steps cut out of recordings: where the command steps, which rows belong to the answer, which are spikes.
///
/// Internal to the room `estimate`. Units: SI. Threads: pure functions. Errors: none (the caller has checked lengths).
/// Source: seed 4.1; docs/derivations/pcu_fit.md.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "isac/estimate/pcu_fit.hpp"

namespace isac::estimate {

struct CommandStep {
  double time = 0;  ///< s, first row with the new command
  double from = 0, to = 0;
  double previous_time = 0;  ///< s, of the step before, or of the first row
  double next_time = 0;      ///< s, of the step behind, or past the last row
};

/// Steps of at least `min_step` in the command; a change spread over several rows (a ramp) is none.
[[nodiscard]] std::vector<CommandStep> find_command_steps(std::span<const double> time,
                                                          std::span<const double> command, double min_step);

/// Rows of one step's answer: time relative to the step, spikes and missing rows already left out.
struct StepData {
  std::vector<double> s;        ///< s behind the step
  std::vector<double> y;        ///< Pa, what is fitted: the reading less what an earlier step has left over
  std::vector<double> reading;  ///< Pa, as recorded
  double sample_time = 0;       ///< s, median
  double quantum = 0;           ///< Pa, smallest change between rows
  double noise = 0;             ///< Pa, standard deviation from second differences
  std::size_t spikes = 0;
};

/// Rows with begin ≤ time < end and a finite pressure. Spikes stand out from the median of seven rows by more than six
/// robust standard deviations; a monotone rise never does, however steep.
[[nodiscard]] StepData cut_step(const PcuRun& run, double step_time, double begin, double end,
                                bool leave_out_spikes);

/// An earlier step that has not died out: its pressure still to come at time t is −size e^(−(t − onset)/lag).
struct Tail {
  double size = 0;   ///< Pa
  double lag = 1;    ///< s
  double onset = 0;  ///< s, in the recording's time
};

/// Takes the tail off `y`. Exact where both steps have the same lag; else the error is the tail times the lags' difference.
void remove_tail(StepData& data, double step_time, const Tail& tail);

[[nodiscard]] double median_of(std::vector<double> values);

}  // namespace isac::estimate
