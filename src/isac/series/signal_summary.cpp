#include "isac/series/signal_summary.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace isac::series {
namespace {

std::string text_of(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.4g", value);
  return buffer;
}

SignalSummary summarise(const Column& column) {
  SignalSummary summary{.name = column.name, .unit = column.unit};
  double sum = 0;
  std::size_t count = 0;
  for (const double value : column.values) {
    if (!std::isfinite(value)) continue;
    summary.min = count == 0 ? value : std::min(summary.min, value);
    summary.max = count == 0 ? value : std::max(summary.max, value);
    sum += value;
    ++count;
  }
  summary.missing = column.values.size() - count;
  if (count == 0) return summary;
  summary.mean = sum / static_cast<double>(count);
  double squares = 0;  // second pass: no cancellation for a small ripple on a large offset
  for (const double value : column.values) {
    if (std::isfinite(value)) squares += (value - summary.mean) * (value - summary.mean);
  }
  summary.std = count > 1 ? std::sqrt(squares / static_cast<double>(count - 1)) : 0.0;
  return summary;
}

/// Share of samples that sit exactly at `value`: a sensor at its stop repeats one number.
double share_at(const Column& column, double value) {
  const auto same = std::count(column.values.begin(), column.values.end(), value);
  return static_cast<double>(same) / static_cast<double>(column.values.size());
}

/// Share of neighbours that are equal, away from `low` and `high`. A noisy sensor seldom repeats a reading; an encoder at rest
/// and a held command do, and they stand at their extremes without any stop.
double share_repeated(const Column& column, double low, double high) {
  std::size_t pairs = 0, equal = 0;
  for (std::size_t i = 1; i < column.values.size(); ++i) {
    const double value = column.values[i];
    if (!std::isfinite(value) || value == low || value == high) continue;
    ++pairs;
    equal += value == column.values[i - 1] ? 1 : 0;
  }
  return pairs == 0 ? 1.0 : static_cast<double>(equal) / static_cast<double>(pairs);
}

void remark_on_signal(const Column& column, const SignalSummary& summary, bool meant_to_rest,
                      Warnings& remarks) {
  if (summary.missing == column.values.size()) {
    remarks.push_back({"signal_empty", column.name + " holds no number at all."});
    return;
  }
  if (summary.missing > 0) {
    const double percent =
        100.0 * static_cast<double>(summary.missing) / static_cast<double>(column.values.size());
    remarks.push_back({"samples_missing", column.name + ": " + std::to_string(summary.missing) +
                                              " samples (" + text_of(percent) + " %) are missing."});
  }
  if (summary.min == summary.max) {
    if (column.values.size() > 1 && !meant_to_rest) {
      remarks.push_back({"signal_constant", column.name + " never changes (" + text_of(summary.min) + " " +
                                                summary.unit + ")."});
    }
    return;
  }
  constexpr double kNoisy =
      0.3;  // of the neighbours equal at the most: 12-bit readings of a moving signal stay below a tenth
  if (column.values.size() < 200 || share_repeated(column, summary.min, summary.max) > kNoisy) return;
  for (const double extreme : {summary.min, summary.max}) {
    const double share = share_at(column, extreme);
    if (share > 0.02) {
      remarks.push_back({"signal_at_stop", column.name + " stands at " + text_of(extreme) + " " +
                                               summary.unit + " in " + text_of(100 * share) +
                                               " % of the samples: a stop of the sensor, or saturation?"});
    }
  }
}

}  // namespace

RecordingSummary summarise(const Recording& recording) {
  RecordingSummary summary;
  for (const Column& column : recording.columns) {
    if (column.name == "time") continue;
    summary.signals.push_back(summarise(column));
    const bool is_command = column.name.size() > 4 && column.name.ends_with("_cmd");
    const std::string experiment = recording.meta("experiment");
    const bool clamped =
        column.name == "angle" && (experiment == "constant-angle" || experiment == "pcu-step");
    remark_on_signal(column, summary.signals.back(), is_command || clamped, summary.remarks);
  }
  const Column* time = recording.find("time");
  if (time == nullptr || time->values.size() < 2) return summary;
  std::vector<double> steps(time->values.size() - 1);
  for (std::size_t i = 0; i + 1 < time->values.size(); ++i) steps[i] = time->values[i + 1] - time->values[i];
  summary.seconds = time->values.back() - time->values.front();
  summary.largest_gap = *std::max_element(steps.begin(), steps.end());
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  const double median = *middle;
  summary.rate = 1.0 / median;
  const auto gaps =
      std::count_if(steps.begin(), steps.end(), [median](double step) { return step > 1.5 * median; });
  if (gaps > 0) {
    summary.remarks.push_back({"time_gap", std::to_string(gaps) +
                                               " time steps are longer than 1.5 median steps of " +
                                               text_of(1000 * median) + " ms; the longest is " +
                                               text_of(1000 * summary.largest_gap) + " ms."});
  }
  return summary;
}

}  // namespace isac::series
