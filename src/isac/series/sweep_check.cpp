#include "isac/series/sweep_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "isac/core/units.hpp"
#include "isac/series/sweep_check_detail.hpp"

namespace isac::series {
namespace detail {

void Sweep::remark(std::string code, std::string text, bool repeat) {
  verdict.remarks.push_back({std::move(code), std::move(text), repeat});
}

double quantile(std::vector<double> values, double share) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto place = static_cast<std::ptrdiff_t>(std::lround(share * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

double mean(std::span<const double> values) noexcept {
  double sum = 0.0;
  std::size_t count = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value;
    ++count;
  }
  return count == 0 ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(count);
}

std::string number(const char* format, double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

std::string in_kgf(double pascal) {
  return number("%.3g", pascal / kPascalPerKgfCm2) + " kg/cm2";
}
std::string in_degrees(double rad) {
  return number("%.0f", rad * 180.0 / kPi);
}

}  // namespace detail

namespace {

using detail::in_kgf;
using detail::number;
using detail::Sweep;

std::span<const double> column_or_empty(const Recording& recording, std::string_view name) {
  const Column* found = recording.find(name);
  return found ? std::span<const double>(found->values) : std::span<const double>();
}

/// Central difference over `window` on either side; NaN at the ends and beside missing samples.
std::vector<double> speed_of(std::span<const double> time, std::span<const double> angle, double period,
                             double window) {
  const std::size_t n = time.size();
  const auto half = static_cast<std::size_t>(std::max(1.0, std::round(window / period)));
  std::vector<double> speed(n, std::numeric_limits<double>::quiet_NaN());
  if (angle.size() != n) return speed;
  for (std::size_t i = half; i + half < n; ++i) {
    speed[i] = (angle[i + half] - angle[i - half]) / (time[i + half] - time[i - half]);
  }
  return speed;
}

void check_length(Sweep& sweep) {
  const double lasted = sweep.verdict.facts.duration;
  // 2 %: one sample at either end, and the tick on which a person's Ctrl-C falls.
  if (lasted < 0.98 * sweep.expected.duration) {
    sweep.remark("stopped_early", "the recording lasts " + number("%.1f", lasted) + " s of the " +
                                      number("%.1f", sweep.expected.duration) +
                                      " s asked for; repeat it to the end, or ask for a shorter one");
  }
}

void check_gaps(Sweep& sweep) {
  double longest = 0.0, missing = 0.0, at = 0.0;
  for (std::size_t i = 1; i < sweep.time.size(); ++i) {
    const double gap = sweep.time[i] - sweep.time[i - 1];
    if (gap < 1.5 * sweep.period) continue;
    missing += std::round(gap / sweep.period) - 1.0;
    if (gap > longest) {
      longest = gap;
      at = sweep.time[i - 1];
    }
  }
  const double rows = static_cast<double>(sweep.time.size());
  const auto dropped = static_cast<double>(sweep.expected.dropped);
  if (dropped > 0.0) {
    const bool many = dropped > 1e-3 * rows;
    sweep.remark("samples_dropped",
                 number("%.0f", dropped) + " of " + number("%.0f", rows + dropped) +
                     " samples were lost because the disk could not keep up; " +
                     (many ? "log to a local disk, or at a lower --rate, and repeat" : "too few to matter"),
                 many);
  }
  if (missing > 0.0) {
    // Five periods: a differentiator of that reach can still bridge the gap.
    const bool bad = longest > 5.5 * sweep.period || missing > 5e-3 * rows;
    sweep.remark(
        "time_gaps",
        number("%.0f", missing) + " samples are missing in gaps, the longest of " +
            number("%.0f", longest * 1e3) + " ms at " + number("%.2f", at) + " s; " +
            (bad ? "end other programs, or use a lower --rate, and repeat" : "short enough to go on with"),
        bad);
  }
}

void check_present(Sweep& sweep) {
  std::vector<std::string> needed = {"angle"};
  const bool moves = !sweep.expected.poses.empty() || std::isfinite(sweep.expected.amplitude) ||
                     std::isfinite(sweep.expected.moved_by_muscles);
  for (const char* name : {"F1", "F2", "p1", "p2"}) {
    if (sweep.recording.find(name)) needed.emplace_back(name);
  }
  for (const std::string& name : needed) {
    const std::vector<double>& values = sweep.recording.column(name).values;
    const auto missing = static_cast<double>(
        std::count_if(values.begin(), values.end(), [](double value) { return !std::isfinite(value); }));
    if (missing > 0.01 * static_cast<double>(values.size())) {
      sweep.remark("signal_missing",
                   name + " is missing in " +
                       number("%.1f", 100.0 * missing / static_cast<double>(values.size())) +
                       " % of the samples; check its cable and repeat");
      continue;
    }
    const bool must_change = name == "angle"  ? moves
                             : name[0] == 'F' ? (moves || sweep.expected.stepped)
                                              : sweep.expected.stepped;
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    if (must_change && *low == *high) {
      sweep.remark("signal_frozen", name + " shows " + number("%.6g", *low) +
                                        " in every sample; check its cable and power, and repeat");
    }
  }
}

void check_saturation(Sweep& sweep) {
  constexpr int kTolerated = 2;  // a lone spike is the fit's business (robust loss), not a saturated sensor
  const bool valve_run = sweep.expected.experiment == "pcu-step";  // looks at pressures only
  for (const char* name : {"F1", "F2", "p1", "p2"}) {
    const Column* column = sweep.recording.find(name);
    if (!column) continue;
    const bool force = name[0] == 'F';
    double low = -std::numeric_limits<double>::infinity(), high = -low;
    for (const SensorRange& range : sweep.expected.ranges) {
      if (range.column != name) continue;
      low = range.low + 0.5 * range.step;
      high = range.high - 0.5 * range.step;
    }
    if (force && std::isfinite(sweep.expected.force_capacity))
      high = std::min(high, sweep.expected.force_capacity);
    int top = 0, bottom = 0;
    double first_top = 0.0, first_bottom = 0.0;
    for (std::size_t i = 0; i < column->values.size(); ++i) {
      if (column->values[i] >= high && top++ == 0) first_top = sweep.time[i];
      if (column->values[i] <= low && bottom++ == 0) first_bottom = sweep.time[i];
    }
    const auto shown = [&](double value) { return force ? number("%.1f", value) + " N" : in_kgf(value); };
    const std::string whose(name);
    if (top > kTolerated) {
      const std::string found = whose + " stood at the top of its range (" + shown(high) + ") in " +
                                std::to_string(top) + " samples, first at " + number("%.2f", first_top) +
                                " s; ";
      if (!force) {
        sweep.remark("pressure_saturated", found + "use lower pressures, and repeat");
      } else if (valve_run) {
        sweep.remark("force_saturated",
                     found + "the valve steps do not need it, but lower --heights spare the sensor", false);
      } else {
        sweep.remark("force_saturated",
                     found + "move less far or use a smaller pressure difference, and repeat");
      }
    }
    if (bottom > kTolerated && force && !valve_run) {
      sweep.remark("muscle_slack",
                   whose + " stood at the bottom of its range (" + shown(low) + ") in " +
                       std::to_string(bottom) + " samples, first at " + number("%.2f", first_bottom) +
                       " s: the muscle went slack or the sensor lost its zero; move less far, or mount "
                       "the muscles with more pre-tension, and repeat");
    }
  }
}

void gather_facts(Sweep& sweep) {
  SweepFacts& facts = sweep.verdict.facts;
  facts.rows = sweep.time.size();
  facts.duration = sweep.time.back() - sweep.time.front() + sweep.period;
  const auto extremes = [](std::span<const double> values, double& low, double& high) {
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      low = std::isnan(low) ? value : std::min(low, value);
      high = std::isnan(high) ? value : std::max(high, value);
    }
  };
  extremes(sweep.angle, facts.angle_low, facts.angle_high);
  for (const char* name : {"F1", "F2"})
    extremes(column_or_empty(sweep.recording, name), facts.force_low, facts.force_high);
  for (std::size_t i = 0; i < sweep.p1.size() && i < sweep.p2.size(); ++i) {
    const double half_difference = 0.5 * (sweep.p2[i] - sweep.p1[i]);
    extremes({&half_difference, 1}, facts.delta_pressure_low, facts.delta_pressure_high);
  }
  facts.speed_forward = detail::quantile(sweep.speed, 0.99);
  facts.speed_backward = -detail::quantile(sweep.speed, 0.01);
}

}  // namespace

bool SweepVerdict::keep() const noexcept {
  return std::none_of(remarks.begin(), remarks.end(),
                      [](const SweepRemark& remark) { return remark.repeat; });
}

SweepVerdict check_sweep(const Recording& recording, const SweepExpectation& expected) {
  Sweep sweep{.recording = recording,
              .expected = expected,
              .time = recording.column("time").values,
              .angle = recording.column("angle").values,
              .p1 = column_or_empty(recording, "p1"),
              .p2 = column_or_empty(recording, "p2"),
              .speed = {},
              .period = expected.sample_period,
              .verdict = {}};
  if (sweep.time.size() < 10) {
    sweep.verdict.facts.rows = sweep.time.size();
    sweep.remark("too_short",
                 "the recording has only " + std::to_string(sweep.time.size()) + " samples; repeat it");
    return sweep.verdict;
  }
  if (!(sweep.period > 0.0)) {
    sweep.period = (sweep.time.back() - sweep.time.front()) / static_cast<double>(sweep.time.size() - 1);
  }
  sweep.speed = speed_of(sweep.time, sweep.angle, sweep.period, expected.speed_window);
  gather_facts(sweep);
  check_length(sweep);
  check_gaps(sweep);
  check_present(sweep);
  if (!expected.held.empty()) {
    detail::check_level(sweep);
    return sweep.verdict;
  }
  check_saturation(sweep);
  detail::check_motion(sweep);
  detail::check_pressure(sweep);
  return sweep.verdict;
}

}  // namespace isac::series
