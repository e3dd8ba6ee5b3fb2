#include "isac/explain/outliers.hpp"

#include <algorithm>
#include <cmath>

#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr double kAlpha = 0.001;
constexpr double kAlike = 0.5;  // of the height: how far the neighbours may be apart

/// d of every sample that has both neighbours; NaN elsewhere.
template <class Take>
void for_each_difference(std::span<const Series> runs, Take&& take) {
  for (const Series& run : runs)
    for (std::size_t k = 1; k + 1 < run.value.size(); ++k) {
      const double before = run.value[k - 1], here = run.value[k], after = run.value[k + 1];
      const double d = here - 0.5 * (before + after);
      if (std::isfinite(d)) take(d, before, after);
    }
}

bool alone(double d, double before, double after) {
  return std::abs(after - before) < kAlike * std::abs(d);
}

}  // namespace

Outliers count_outliers(std::span<const Series> runs, double limit) {
  Outliers out;
  out.limit = limit;
  std::vector<double> heights;
  double squares = 0;
  for_each_difference(runs, [&](double d, double before, double after) {
    ++out.samples;
    if (std::abs(d) <= limit || !alone(d, before, after)) return;
    heights.push_back(std::abs(d));
    squares += d * d;
  });
  out.count = heights.size();
  if (out.count > 0) {
    out.height = series::median(heights);
    out.rms = std::sqrt(squares / static_cast<double>(out.samples));
  }
  return out;
}

Outliers find_outliers(std::span<const Series> runs, double quantum) {
  std::vector<double> size;
  for_each_difference(runs, [&](double d, double, double) { size.push_back(std::abs(d)); });
  if (size.size() < 1000) return {};
  std::vector<const std::vector<double>*> values;
  for (const Series& run : runs) values.push_back(&run.value);
  const double q90 = series::quantile(size, 0.90), q98 = series::quantile(size, 0.98);
  const double b = std::max((q98 - q90) / std::log(5.0), q98 / std::log(50.0));
  const double tail = q98 + b * std::log(0.02 * static_cast<double>(size.size()) / kAlpha);
  return count_outliers(runs, std::max({tail, 8 * white_noise(values), 3 * quantum}));
}

}  // namespace isac::explain
