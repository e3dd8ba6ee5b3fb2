#include "isac/estimate/calibrate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/estimate/step_noise.hpp"

namespace isac::estimate {
namespace {

constexpr double kSaturatedShare = 0.01;  // of a level's samples at a stop
constexpr double kCurvedSize =
    1e-3;  // of full scale: a smaller bend is significant at most, not worth a verdict
constexpr double kSignificant = 0.01;

[[noreturn]] void refuse(const char* code, std::string text) {
  throw Error(ErrorKind::kAnswerIsNo, code, std::move(text));
}

Estimated estimate(const char* name, std::string unit, double value, double error, double dof) {
  Estimated e;
  e.name = name;
  e.unit = std::move(unit);
  e.value = value;
  e.std_error = error;
  const double half = student_95(dof) * error;
  e.ci_low = value - half;
  e.ci_high = value + half;
  return e;
}

struct Moments {
  double mean = 0, variance = 0, count = 0;
};

Moments moments(const std::vector<double>& values) {
  Moments m;
  for (double v : values) m.mean += v, m.count += 1;
  m.mean /= std::max(1.0, m.count);
  for (double v : values) m.variance += (v - m.mean) * (v - m.mean);
  m.variance /= std::max(1.0, m.count - 1);
  return m;
}

CalibrationLevelResult reduce(const CalibrationLevel& level, const CalibrationOptions& options) {
  if (!level.time.empty() && level.time.size() != level.reading.size())
    throw Error(ErrorKind::kUsage, "columns_differ",
                fmt::format("{}: a level has {} times and {} readings; expected equal lengths", options.name,
                            level.time.size(), level.reading.size()));
  std::vector<double> time = level.time;
  if (time.empty())
    for (std::size_t i = 0; i < level.reading.size(); ++i)
      time.push_back(static_cast<double>(i) * options.sample_time);
  std::vector<double> samples;
  for (double r : level.reading)
    if (std::isfinite(r)) samples.push_back(r);
  CalibrationLevelResult out;
  out.reference = level.reference;
  out.samples = samples.size();
  if (samples.empty())
    refuse("no_usable_data", fmt::format("{}: no reading at all at reference {:.6g} {}", options.name,
                                         level.reference, options.reference_unit));
  const auto at_stop = static_cast<double>(std::count_if(samples.begin(), samples.end(), [&](double r) {
    return r <= options.reading_low || r >= options.reading_high;
  }));
  if (at_stop > kSaturatedShare * static_cast<double>(samples.size()))
    refuse("channel_saturated", fmt::format("{}: {:.0f} % of the readings at reference {:.6g} {} stand at a "
                                            "stop ({:.6g} or {:.6g} {}): choose a "
                                            "smaller gain or range, or move the zero, and calibrate again",
                                            options.name, 100 * at_stop / static_cast<double>(samples.size()),
                                            level.reference, options.reference_unit, options.reading_low,
                                            options.reading_high, options.reading_unit));
  const Moments all = moments(samples);
  const std::vector<double> means = window_means(time, level.reading, options.average_seconds);
  const Moments averaged = moments(means);
  out.averages = means.size();
  out.mean = all.mean;
  double variance =
      averaged.count >= 2 ? averaged.variance / averaged.count : all.variance / std::max(1.0, all.count);
  // Without half a quantum of noise to dither it, the mean is no better than the quantum.
  if (std::sqrt(all.variance) < 0.5 * options.resolution)
    variance += options.resolution * options.resolution / 12;
  out.std_error = std::sqrt(variance);
  return out;
}

struct Line {
  double offset = 0, gain = 0, var_offset = 0, var_gain = 0, covariance = 0, chi_square = 0;
};

Line weighted_line(const std::vector<CalibrationLevelResult>& levels, std::span<const CalibrationLevel> given,
                   double least) {
  Line line;
  // The error of the reference enters through the gain (effective variance): three rounds settle it.
  for (int round = 0; round < 3; ++round) {
    double w = 0, x = 0, y = 0, xx = 0, xy = 0;
    std::vector<double> weight;
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const double error =
          std::hypot(std::max(levels[i].std_error, least), line.gain * given[i].reference_error);
      weight.push_back(1 / (error * error));
      w += weight[i];
      x += weight[i] * levels[i].reference;
      y += weight[i] * levels[i].mean;
    }
    const double mx = x / w, my = y / w;
    for (std::size_t i = 0; i < levels.size(); ++i) {
      const double dx = levels[i].reference - mx;
      xx += weight[i] * dx * dx;
      xy += weight[i] * dx * (levels[i].mean - my);
    }
    line.gain = xy / xx;
    line.offset = my - line.gain * mx;
    line.var_gain = 1 / xx;
    line.var_offset = 1 / w + mx * mx / xx;
    line.covariance = -mx / xx;
    line.chi_square = 0;
    for (std::size_t i = 0; i < levels.size(); ++i)
      line.chi_square +=
          weight[i] * std::pow(levels[i].mean - line.offset - line.gain * levels[i].reference, 2);
  }
  return line;
}

}  // namespace

std::vector<double> window_means(std::span<const double> time, std::span<const double> values,
                                 double seconds) {
  std::vector<double> out;
  const std::size_t n = std::min(time.size(), values.size());
  std::size_t i = 0;
  while (i < n) {
    const double begin = time[i], end = begin + seconds * (1 - 1e-9);
    double sum = 0, count = 0, last = begin;
    for (; i < n && time[i] < end; ++i) {
      last = time[i];
      if (!std::isfinite(values[i])) continue;
      sum += values[i];
      count += 1;
    }
    if (count > 0 && (i < n || last - begin >= 0.5 * seconds)) out.push_back(sum / count);
  }
  return out;
}

double ChannelCalibration::to_reference(double reading) const noexcept {
  return (reading - offset.value) / gain.value;
}

double ChannelCalibration::reference_error(double reading) const noexcept {
  const double x = to_reference(reading);
  const double variance =
      offset.std_error * offset.std_error + x * x * gain.std_error * gain.std_error + 2 * x * covariance;
  return std::sqrt(std::max(0.0, variance)) / std::abs(gain.value);
}

ChannelCalibration calibrate_sensor(std::span<const CalibrationLevel> levels,
                                    const CalibrationOptions& options) {
  const std::string& name = options.name;
  if (levels.size() < 2)
    refuse("too_few_levels", fmt::format("{}: {} reference level given; offset and gain need two or more",
                                         name, levels.size()));
  const auto [least, most] = std::minmax_element(
      levels.begin(), levels.end(), [](const auto& a, const auto& b) { return a.reference < b.reference; });
  const double span = most->reference - least->reference;
  double full = 0;
  for (const CalibrationLevel& l : levels) full = std::max(full, std::abs(l.reference));
  if (!(span > 1e-6 * full))
    refuse("levels_equal",
           fmt::format("{}: all levels have the reference {:.6g} {}: apply another one, best the full scale",
                       name, least->reference, options.reference_unit));

  ChannelCalibration out;
  out.name = name;
  out.full_scale_reference = full;
  double low = 1e300, high = -1e300, dof = 0;
  for (const CalibrationLevel& l : levels) {
    out.levels.push_back(reduce(l, options));
    low = std::min(low, out.levels.back().mean);
    high = std::max(high, out.levels.back().mean);
    dof += std::max(1.0, static_cast<double>(out.levels.back().averages) - 1);
  }
  if (!(high - low >= options.smallest_change))
    refuse("channel_dead", fmt::format("{}: the reading moves by {:.3g} {} only while the reference goes "
                                       "from {:.6g} to {:.6g} {}: look at plug, "
                                       "supply and amplifier",
                                       name, high - low, options.reading_unit, least->reference,
                                       most->reference, options.reference_unit));

  const Line line = weighted_line(out.levels, levels, 1e-9 * (high - low));
  double worst = 0;
  for (CalibrationLevelResult& l : out.levels) {
    l.residual = l.mean - line.offset - line.gain * l.reference;
    worst = std::max(worst, std::abs(l.residual));
  }
  out.nonlinearity = worst / std::abs(line.gain * span);
  std::vector<double> distinct;
  for (const CalibrationLevel& l : levels) distinct.push_back(l.reference);
  std::sort(distinct.begin(), distinct.end());
  const auto different =
      std::unique(distinct.begin(), distinct.end(), [&](double a, double b) { return b - a < 1e-6 * span; });
  const double free = static_cast<double>(levels.size()) - 2;
  double inflation = 1, quantile_dof = dof;
  if (different - distinct.begin() >= 3) {
    out.p_value =
        boost::math::cdf(boost::math::complement(boost::math::fisher_f(free, dof), line.chi_square / free));
    const bool curved = out.p_value < kSignificant && out.nonlinearity > kCurvedSize;
    out.linearity = curved ? Linearity::kCurved : Linearity::kLinear;
    if (out.p_value < kSignificant) {  // the line's own scatter is the honest error then
      inflation = std::sqrt(std::max(1.0, line.chi_square / free));
      quantile_dof = free;
    }
    out.sentence =
        curved ? fmt::format(
                     "not a line: readings leave it by up to {:.2g} % of the span; use it between the levels "
                     "measured only, or look for the cause",
                     100 * out.nonlinearity)
               : fmt::format("a line: readings leave it by {:.2g} % of the span at most",
                             100 * out.nonlinearity);
    if (curved) out.warnings.push_back({"not_linear", name + ": " + out.sentence});
  } else {
    out.sentence = "two levels make a line but cannot test it: measure a third one between them";
  }
  const std::string per = options.reading_unit + "/" + options.reference_unit;
  const double error_offset = inflation * std::sqrt(line.var_offset),
               error_gain = inflation * std::sqrt(line.var_gain);
  out.covariance = inflation * inflation * line.covariance;
  out.offset = estimate("offset", options.reading_unit, line.offset, error_offset, quantile_dof);
  out.gain = estimate("gain", per, line.gain, error_gain, quantile_dof);
  out.sensitivity = estimate("sensitivity", options.reference_unit + "/" + options.reading_unit,
                             1 / line.gain, error_gain / (line.gain * line.gain), quantile_dof);
  out.full_scale =
      estimate("full_scale", options.reading_unit, line.gain * full, error_gain * full, quantile_dof);
  return out;
}

CalibrationOptions valve_calibration_options(const std::string& name) {
  CalibrationOptions o;
  o.name = name;
  o.reference_unit = "count";
  o.reading_unit = "Pa";
  o.reading_low = -std::numeric_limits<double>::infinity();
  o.reading_high = std::numeric_limits<double>::infinity();
  o.resolution = 0;
  o.smallest_change = 0.05 * kPascalPerKgfCm2;
  return o;
}

ValveCalibration calibrate_valve(std::span<const CalibrationLevel> levels,
                                 const CalibrationOptions& options) {
  constexpr double kHighestCode = 4095;
  constexpr double kTrim = 0.1 * kPascalPerKgfCm2;  // the unit's own precision: 1 % of 5 kg/cm2, twice
  ValveCalibration out;
  try {
    out.line = calibrate_sensor(levels, options);
  } catch (const Error& e) {
    if (e.code() != "channel_dead") throw;
    refuse("valve_never_moves",
           fmt::format("{}: the pressure hardly changes over all codes: look at the air supply, the valve's "
                       "power and the output channel",
                       options.name));
  }
  const ChannelCalibration& line = out.line;
  const double variance = std::pow(line.offset.std_error, 2) +
                          std::pow(kHighestCode * line.gain.std_error, 2) +
                          2 * kHighestCode * line.covariance;
  const double quantile = (line.offset.ci_high - line.offset.value) / std::max(line.offset.std_error, 1e-300);
  out.zero_pressure = line.offset;
  out.zero_pressure.name = "zero_pressure";
  out.cal_pressure = line.offset;
  out.cal_pressure.name = "CalPressure";
  out.cal_pressure.value = line.offset.value + kHighestCode * line.gain.value;
  out.cal_pressure.std_error = std::sqrt(std::max(0.0, variance));
  out.cal_pressure.ci_low = out.cal_pressure.value - quantile * out.cal_pressure.std_error;
  out.cal_pressure.ci_high = out.cal_pressure.value + quantile * out.cal_pressure.std_error;
  if (std::abs(out.zero_pressure.value) > kTrim)
    out.line.warnings.push_back(
        {"zero_trimmer", fmt::format("{}: code 0 gives {:.3g} kg/cm2: set the valve's zero trimmer",
                                     options.name, out.zero_pressure.value / kPascalPerKgfCm2)});
  if (std::abs(out.cal_pressure.value - 5 * kPascalPerKgfCm2) > kTrim)
    out.line.warnings.push_back(
        {"span_trimmer", fmt::format("{}: code 4095 gives {:.3g} kg/cm2 instead of 5: set the valve's "
                                     "span trimmer, or keep this CalPressure",
                                     options.name, out.cal_pressure.value / kPascalPerKgfCm2)});
  return out;
}

}  // namespace isac::estimate
