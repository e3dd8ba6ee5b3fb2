#include "isac/estimate/step_data.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace isac::estimate {

double median_of(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<CommandStep> find_command_steps(std::span<const double> time, std::span<const double> command,
                                            double min_step) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < command.size(); ++i)
    if (std::isfinite(command[i]) && std::isfinite(time[i])) rows.push_back(i);
  std::vector<CommandStep> steps;
  if (rows.size() < 2) return steps;

  // A step stands alone: the rows just before and just behind it hold still within half the smallest step.
  const auto change = [&](std::size_t k) { return command[rows[k]] - command[rows[k - 1]]; };
  for (std::size_t k = 1; k < rows.size(); ++k) {
    if (std::abs(change(k)) < min_step) continue;
    const bool quiet_before = k < 2 || std::abs(change(k - 1)) < 0.5 * min_step;
    const bool quiet_behind = k + 1 >= rows.size() || std::abs(change(k + 1)) < 0.5 * min_step;
    if (!quiet_before || !quiet_behind) continue;
    steps.push_back({.time = time[rows[k]], .from = command[rows[k - 1]], .to = command[rows[k]]});
  }
  for (std::size_t k = 0; k < steps.size(); ++k) {
    steps[k].previous_time = k > 0 ? steps[k - 1].time : time[rows.front()];
    steps[k].next_time = k + 1 < steps.size()
                             ? steps[k + 1].time
                             : std::nextafter(time[rows.back()], std::numeric_limits<double>::infinity());
  }
  return steps;
}

namespace {

constexpr std::size_t kHalf = 3;         // the spike filter looks at 2·3 + 1 rows
constexpr double kSpikeThreshold = 6.0;  // robust standard deviations
constexpr double kMadToSigma = 1.4826;   // of a normal distribution

double median_of_seven(std::array<double, 7> v, std::size_t n) {
  std::sort(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(n));
  return v[n / 2];
}

void remove_spikes(StepData& data) {
  const std::size_t n = data.y.size();
  if (n < 2 * kHalf + 1) return;
  std::vector<double> apart(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t low = std::min(i < kHalf ? 0 : i - kHalf, n - (2 * kHalf + 1));
    std::array<double, 7> window{};
    std::copy_n(data.y.begin() + static_cast<std::ptrdiff_t>(low), 2 * kHalf + 1, window.begin());
    apart[i] = data.y[i] - median_of_seven(window, 2 * kHalf + 1);
  }
  std::vector<double> magnitude(n);
  std::transform(apart.begin(), apart.end(), magnitude.begin(), [](double a) { return std::abs(a); });
  // A reading that rests between two quanta has a vanishing median deviation: the quantum is the least scale.
  const double scale = std::max({kMadToSigma * median_of(magnitude), data.noise, data.quantum});
  if (!(scale > 0)) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < n; ++i) {
    // The first and last rows have no symmetric window; a ramp would stand out there without being a spike.
    const bool inside = i >= kHalf && i + kHalf < n;
    if (inside && std::abs(apart[i]) > kSpikeThreshold * scale) continue;
    data.s[kept] = data.s[i];
    data.y[kept] = data.y[i];
    ++kept;
  }
  data.spikes = n - kept;
  data.s.resize(kept);
  data.y.resize(kept);
}

}  // namespace

StepData cut_step(const PcuRun& run, double step_time, double begin, double end, bool leave_out_spikes) {
  StepData data;
  for (std::size_t i = 0; i < run.time.size(); ++i) {
    if (!(run.time[i] >= begin && run.time[i] < end) || !std::isfinite(run.pressure[i])) continue;
    data.s.push_back(run.time[i] - step_time);
    data.y.push_back(run.pressure[i]);
  }
  const std::size_t n = data.y.size();
  if (n < 4) return data;

  std::vector<double> intervals, second;
  intervals.reserve(n);
  second.reserve(n);
  data.quantum = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < n; ++i) {
    intervals.push_back(data.s[i] - data.s[i - 1]);
    const double change = std::abs(data.y[i] - data.y[i - 1]);
    if (change > 0) data.quantum = std::min(data.quantum, change);
    if (i + 1 < n) second.push_back(std::abs(data.y[i + 1] - 2 * data.y[i] + data.y[i - 1]));
  }
  if (!std::isfinite(data.quantum)) data.quantum = 0;
  data.sample_time = median_of(std::move(intervals));
  // The second difference of white noise has variance 6 σ².
  data.noise = kMadToSigma * median_of(std::move(second)) / std::sqrt(6.0);
  if (leave_out_spikes) remove_spikes(data);
  data.reading = data.y;
  return data;
}

void remove_tail(StepData& data, double step_time, const Tail& tail) {
  constexpr double kDiedOut = 40;  // lags: e⁻⁴⁰ is below the rounding of a pressure
  if (data.s.empty() || step_time + data.s.front() - tail.onset > kDiedOut * tail.lag) return;
  for (std::size_t i = 0; i < data.y.size(); ++i)
    data.y[i] += tail.size * std::exp(-(step_time + data.s[i] - tail.onset) / tail.lag);
}

}  // namespace isac::estimate
