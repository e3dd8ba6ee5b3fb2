#include "isac/estimate/muscle_points.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/estimate/step_data.hpp"

namespace isac::estimate {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void check_columns(const MuscleRun& run) {
  const std::size_t n = run.pressure.size();
  const auto fits = [n](const std::vector<double>& v, bool optional) {
    return v.size() == n || (optional && v.empty());
  };
  if (fits(run.force, false) && fits(run.contraction, false) && fits(run.time, true) &&
      fits(run.contraction_rate, true) && fits(run.filling, true))
    return;
  throw Error(ErrorKind::kUsage, "columns_differ",
              fmt::format("{}: pressure has {} rows, force {}, contraction {}; expected equal lengths",
                          run.name, n, run.force.size(), run.contraction.size()));
}

std::vector<double> rates_of(const MuscleRun& run) {
  const std::size_t n = run.pressure.size();
  if (run.contraction_rate.size() == n) return run.contraction_rate;
  std::vector<double> rate(n, 0.0);
  if (run.time.size() != n) return rate;
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double span = run.time[i + 1] - run.time[i - 1];
    if (span > 0) rate[i] = (run.contraction[i + 1] - run.contraction[i - 1]) / span;
  }
  return rate;
}

// Filling while the pressure climbs: the sign of its change over a hundredth of the record.
std::vector<bool> branches_of(const MuscleRun& run) {
  const std::size_t n = run.pressure.size();
  std::vector<bool> filling(n, true);
  const std::size_t reach = std::max<std::size_t>(1, n / 100);
  for (std::size_t i = 0; i < n; ++i) {
    if (run.filling.size() == n) {
      filling[i] = run.filling[i] > 0;
    } else {
      const std::size_t a = i < reach ? 0 : i - reach, b = std::min(n - 1, i + reach);
      filling[i] = run.pressure[b] >= run.pressure[a];
    }
  }
  return filling;
}

// Median reading while the muscle is as good as empty: rows in the lowest hundredth of the pressure range.
double unloaded_reading(const MuscleRun& run) {
  double low = kInfinity, high = -kInfinity;
  for (double p : run.pressure)
    if (std::isfinite(p)) low = std::min(low, p), high = std::max(high, p);
  std::vector<double> force;
  for (std::size_t i = 0; i < run.pressure.size(); ++i)
    if (run.pressure[i] <= low + 0.01 * (high - low) && std::isfinite(run.force[i]))
      force.push_back(run.force[i]);
  const double zero = median_of(std::move(force));
  return std::isfinite(zero) ? zero : 0.0;
}

}  // namespace

double find_force_floor(std::span<const MuscleRun> a, std::span<const MuscleRun> b) {
  double least = kInfinity;
  std::size_t rows = 0, resting = 0;
  for (const auto runs : {a, b})
    for (const MuscleRun& run : runs)
      for (double f : run.force)
        if (std::isfinite(f)) least = std::min(least, f), ++rows;
  for (const auto runs : {a, b})
    for (const MuscleRun& run : runs)
      resting += static_cast<std::size_t>(std::count(run.force.begin(), run.force.end(), least));
  constexpr std::size_t kLeastRows = 50;
  return resting >= std::max(kLeastRows, rows / 500) ? least : -kInfinity;
}

double find_end_length(std::span<const MuscleRun> a, std::span<const MuscleRun> b,
                       const MuscleFitOptions& options) {
  if (std::isfinite(options.end_length)) return options.end_length;
  std::vector<MuscleLength> muscles = options.known_muscles;
  for (const auto runs : {a, b})
    for (const MuscleRun& run : runs) {
      if (!(run.rest_length > 0) || !std::isfinite(run.full_contraction)) continue;
      const bool known = std::any_of(muscles.begin(), muscles.end(), [&](const MuscleLength& m) {
        return std::abs(m.rest_length - run.rest_length) < 1e-6 &&
               std::abs(m.full_contraction - run.full_contraction) < 1e-3;
      });
      if (!known) muscles.push_back({run.rest_length, run.full_contraction});
    }
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const MuscleLength& m : muscles) {
    const double inverse = 1 / m.rest_length;
    n += 1, x += inverse, y += m.full_contraction, xx += inverse * inverse,
        xy += inverse * m.full_contraction;
  }
  const double det = n * xx - x * x;
  return det > 1e-9 * n * xx ? -(n * xy - x * y) / det : 0.0;
}

PreparedRun prepare_run(const MuscleRun& run, double end_length, double floor,
                        const MuscleFitOptions& options, int first_group) {
  check_columns(run);
  PreparedRun out;
  out.run = &run;
  out.floor = std::isfinite(run.force_floor) ? run.force_floor : floor;
  if (options.zero == ZeroHandling::kRecorded)
    out.zero = std::isfinite(run.force_zero) ? run.force_zero : unloaded_reading(run);
  const double shift = run.rest_length > 0 ? end_length / run.rest_length : 0.0;
  const std::vector<double> rate = rates_of(run);
  const std::vector<bool> filling = branches_of(run);

  double low = kInfinity, high = -kInfinity, fastest = 0;
  for (std::size_t i = 0; i < run.pressure.size(); ++i) {
    if (!std::isfinite(run.pressure[i]) || !std::isfinite(run.force[i]) || !std::isfinite(run.contraction[i]))
      continue;
    MusclePoint row{.pressure = run.pressure[i] - run.pressure_zero,
                    .contraction = run.contraction[i] + shift,
                    .rate = rate[i],
                    .force = run.force[i],
                    .weight = 1,
                    .censored = run.force[i] <= out.floor,
                    .group = first_group + (filling[i] ? 0 : 1)};
    low = std::min(low, row.pressure);
    high = std::max(high, row.pressure);
    fastest = std::max(fastest, std::abs(row.rate));
    out.rows.push_back(row);
  }
  out.moves = fastest > 1e-3;  // a thousandth of the length per second: below it no damping shows

  // Bins over pressure; readings at the stop apart from the others, so that a mean never mixes the two. A bin's points carry
  // their share of its rows: every bin weighs one, however long the record dwelt there. Moving runs bin by contraction too.
  const int bins = std::max(4, options.bins);
  const double width = high > low ? (high - low) / bins : 1.0;
  double contraction_low = kInfinity, contraction_high = -kInfinity;
  for (const MusclePoint& r : out.rows) {
    contraction_low = std::min(contraction_low, r.contraction);
    contraction_high = std::max(contraction_high, r.contraction);
  }
  const bool moving = contraction_high - contraction_low > 1e-4;
  const int layers = moving ? bins : 1;
  const double layer_height = moving ? (contraction_high - contraction_low) / layers : 1.0;
  std::vector<MusclePoint> sums(static_cast<std::size_t>(bins) * static_cast<std::size_t>(layers) * 4);
  for (MusclePoint& s : sums) s.weight = 0;
  for (const MusclePoint& r : out.rows) {
    const int k = std::min(bins - 1, static_cast<int>((r.pressure - low) / width));
    const int layer =
        moving ? std::min(layers - 1, static_cast<int>((r.contraction - contraction_low) / layer_height)) : 0;
    const int slot = ((layer * bins + k) * 2 + (r.group - first_group)) * 2 + (r.censored ? 1 : 0);
    MusclePoint& s = sums[static_cast<std::size_t>(slot)];
    s.pressure += r.pressure;
    s.contraction += r.contraction;
    s.rate += r.rate;
    s.force += r.force;
    s.weight += 1;
    s.censored = r.censored;
    s.group = r.group;
  }
  for (std::size_t i = 0; i < sums.size(); i += 2) {
    const double total = sums[i].weight + sums[i + 1].weight;
    for (std::size_t k = i; k < i + 2; ++k) {
      MusclePoint s = sums[k];
      if (!(s.weight > 0)) continue;
      s.pressure /= s.weight;
      s.contraction /= s.weight;
      s.rate /= s.weight;
      s.force /= s.weight;
      s.weight /= total;
      out.points.push_back(s);
    }
  }
  return out;
}

HysteresisWidth hysteresis_width(const PreparedRun& run, int bins) {
  HysteresisWidth out;
  out.run = run.run->name;
  double low = kInfinity, high = -kInfinity;
  for (const MusclePoint& p : run.rows) low = std::min(low, p.pressure), high = std::max(high, p.pressure);
  const double width = (high - low) / bins;
  if (!(width > 0)) return out;
  struct Sum {
    double force = 0, rows = 0;
  };
  std::vector<Sum> branch[2] = {std::vector<Sum>(static_cast<std::size_t>(bins)),
                                std::vector<Sum>(static_cast<std::size_t>(bins))};
  for (const MusclePoint& p : run.rows) {
    Sum& s =
        branch[p.group % 2]
              [static_cast<std::size_t>(std::min(bins - 1, static_cast<int>((p.pressure - low) / width)))];
    s.force += p.force;
    s.rows += 1;
  }
  constexpr double kEnough =
      5;  // rows: where the pressure rushes through a bin, one row says more of the valve than of the muscle
  double sum = 0, count = 0, worst = -1;
  for (int k = 0; k < bins; ++k) {
    const Sum &fill = branch[0][static_cast<std::size_t>(k)], &vent = branch[1][static_cast<std::size_t>(k)];
    if (fill.rows < kEnough || vent.rows < kEnough) continue;
    const double apart = vent.force / vent.rows - fill.force / fill.rows;
    sum += apart;
    count += 1;
    if (std::abs(apart) > worst) {
      worst = std::abs(apart);
      out.worst = apart;
      out.at_pressure = low + (k + 0.5) * width;
    }
  }
  if (count > 0) out.mean = sum / count;
  return out;
}

}  // namespace isac::estimate
