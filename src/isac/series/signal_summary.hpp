/// @file
/// What a recording holds, signal by signal, and what a person should know before fitting it.
///
/// Units: SI as in the recording. Threads: pure function. Errors: none; an empty recording gives an empty summary.
/// Example: `for (const auto& s : series::summarise(recording).signals) …`
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"
#include "isac/series/recording.hpp"

namespace isac::series {

struct SignalSummary {
  std::string name, unit;
  std::size_t missing = 0;
  double min = std::numeric_limits<double>::quiet_NaN();
  double max = std::numeric_limits<double>::quiet_NaN();
  double mean = std::numeric_limits<double>::quiet_NaN();
  double std = std::numeric_limits<double>::quiet_NaN();
};

struct RecordingSummary {
  double seconds = std::numeric_limits<double>::quiet_NaN();
  double rate = std::numeric_limits<double>::quiet_NaN();         ///< Hz, from the median time step
  double largest_gap = std::numeric_limits<double>::quiet_NaN();  ///< s, largest time step
  std::vector<SignalSummary> signals;                             ///< all columns but time
  Warnings remarks;  ///< "signal_constant", "samples_missing", "time_gap", "signal_at_stop"
};

[[nodiscard]] RecordingSummary summarise(const Recording& recording);

}  // namespace isac::series
