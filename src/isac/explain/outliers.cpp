#include "isac/explain/outliers.hpp"

#include <algorithm>
#include <cmath>

#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr double kAlpha = 0.001;
constexpr double kFarOut =
    8;  // standard deviations of the white noise: alone so far out is no part of its tail
constexpr double kLeastOut = 6.5;   // of them: 5.3 deviations of a difference, 1e-7 of normal noise
constexpr double kLessBent = 0.96;  // than the quantiles say: they have errors, and a tail may become fatter
constexpr double kMostBent = 1.6;   // exponent of a tail, 2 for normal noise far out
constexpr double kManyOrHigh = 0.25;      // of the white noise: what spikes hold for sure
constexpr std::size_t kManyForSure = 25;  // where a thousandth of one is expected
constexpr double kOfThoseThere = 0.04;    // of so many: what the tail may hold of them
constexpr double kAlike = 0.5;            // of the height: how far the neighbours may be apart, or off theirs

double difference(const std::vector<double>& x, std::size_t k) {
  return x[k] - 0.5 * (x[k - 1] + x[k + 1]);
}

/// Does sample k, d off its neighbours, stand alone? They are near each other and, both together, near theirs: a corner that a model rounds is
/// a peak of several samples.
bool alone(const std::vector<double>& x, std::size_t k, double d) {
  const double most = kAlike * std::abs(d);
  if (!(std::abs(x[k + 1] - x[k - 1]) < most)) return false;
  return k < 2 || k + 2 >= x.size() || !(std::abs(0.5 * (x[k - 1] + x[k + 1] - x[k - 2] - x[k + 2])) >= most);
}

}  // namespace

Outliers count_outliers(std::span<const Series> runs, double limit) {
  Outliers out;
  out.limit = limit;
  std::vector<double> heights;
  double squares = 0;
  for (const Series& run : runs)
    for (std::size_t k = 1; k + 1 < run.value.size(); ++k) {
      const double d = difference(run.value, k);
      if (!std::isfinite(d)) continue;
      ++out.samples;
      if (std::abs(d) <= limit || !alone(run.value, k, d)) continue;
      heights.push_back(std::abs(d));
      squares += d * d;
    }
  out.count = heights.size();
  if (out.count > 0) {
    out.height = series::median(heights);
    out.rms = std::sqrt(squares / static_cast<double>(out.samples));
  }
  return out;
}

Outliers find_outliers(std::span<const Series> runs, double quantum) {
  std::vector<const std::vector<double>*> values;
  for (const Series& run : runs) values.push_back(&run.value);
  const double white = white_noise(values);
  // The tail of the noise: without what stands alone far out, and without both neighbours, whose differences are half as large. (One
  // spike in 140 samples makes three in a hundred differences, and the quantiles that the tail is read off.)
  std::vector<double> size;
  for (const Series& run : runs) {
    std::vector<char> beside(run.value.size(), 0);
    for (std::size_t k = 1; k + 1 < run.value.size(); ++k)
      if (const double d = difference(run.value, k); std::abs(d) > kFarOut * white && alone(run.value, k, d))
        beside[k - 1] = beside[k] = beside[k + 1] = 1;
    for (std::size_t k = 1; k + 1 < run.value.size(); ++k)
      if (const double d = difference(run.value, k); std::isfinite(d) && beside[k] == 0)
        size.push_back(std::abs(d));
  }
  if (size.size() < 1000) return {};
  const double q90 = series::quantile(size, 0.90), q98 = series::quantile(size, 0.98);
  // ln(1/S) = (x/a)^k through S = 0.1 and 0.02, to the x that one of all passes with the probability α.
  const double k =
      std::clamp(std::log(std::log(50.0) / std::log(10.0)) / std::log(q98 / q90), 0.5, kMostBent);
  const double tail = q98 * std::pow(std::log(static_cast<double>(size.size()) / kAlpha) / std::log(50.0),
                                     1 / (kLessBent * k));
  // Many beyond where the tail holds hardly any need not each be beyond its end.
  const double least = std::max(kLeastOut * white, 3 * quantum);
  const double expected =
      static_cast<double>(size.size()) * std::pow(0.02, std::pow(least / q98, kLessBent * k));
  const Outliers many = count_outliers(runs, least);
  if (many.count >= kManyForSure && expected <= kOfThoseThere * static_cast<double>(many.count)) return many;
  const Outliers lone = count_outliers(runs, std::max({tail, kLeastOut * white, 3 * quantum}));
  if (lone.rms >= kManyOrHigh * white || lone.count >= kManyForSure) return lone;
  // A few that are hardly beyond it may be a tail that bends the other way: then an exponential's end is asked for.
  const double b = std::max((q98 - q90) / std::log(5.0), q98 / std::log(50.0));
  const double end = q98 + b * std::log(0.02 * static_cast<double>(size.size()) / kAlpha);
  return count_outliers(runs, std::max({end, kFarOut * white, 3 * quantum}));
}

}  // namespace isac::explain
