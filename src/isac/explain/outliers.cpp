#include "isac/explain/outliers.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "isac/explain/filters.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr double kAlpha = 0.001;
constexpr double kFarOut =
    8;  // standard deviations of the white noise: beside what is alone so far out nothing tells its tail
constexpr double kLeastOut = 6.5;   // of them: 5.3 deviations of a difference, 1e-7 of normal noise
constexpr double kLessBent = 0.96;  // than the quantiles say: they have errors, and a tail may become fatter
constexpr double kMostBent = 1.6;   // exponent of a tail, 2 for normal noise far out
constexpr double kManyOrHigh = 0.25;      // of the white noise: what spikes hold for sure
constexpr std::size_t kManyForSure = 25;  // where a thousandth of one is expected
constexpr double kOfThoseThere = 0.04;  // of so many: what the tail may hold of them at kLeastOut and farther
constexpr double kOfThoseNearer = 0.2;  // and nearer, where it is better known
constexpr double kNearer = 5.5;         // standard deviations of the white noise
constexpr double kFarther = 1.15;       // from one limit to the next,
constexpr double kNotBeyond = 13;       // standard deviations, the last such limit
constexpr double kThin =
    1;  // exponent, Laplace's: noise with a fatter tail has one that no two quantiles tell
constexpr double kAlike = 0.5;  // of the height: how far the neighbours may be apart, or off theirs
// Of the neighbours one, two and three samples away, on either side: what any cubic passes, at the least variance, 3/2 with the sample's.
constexpr double kOfNeighbour[] = {3.0 / 7, 3.0 / 14, -1.0 / 7};
constexpr std::size_t kNeighboursEachSide = std::size(kOfNeighbour);

double difference(const std::vector<double>& x, std::size_t k) {
  double d = x[k];
  for (std::size_t j = 1; j <= kNeighboursEachSide; ++j) d -= kOfNeighbour[j - 1] * (x[k - j] + x[k + j]);
  return d;
}

/// Does sample k, d off its neighbours, stand alone? They are near each other but for the slope about them, and, both together, near theirs:
/// a corner that a model rounds is a peak of several samples.
bool alone(const std::vector<double>& x, std::size_t k, double d) {
  const double most = kAlike * std::abs(d);
  if (!(std::abs(x[k + 1] - x[k - 1] - (x[k + 3] - x[k - 3]) / 3) < most)) return false;
  return std::abs(0.5 * (x[k - 1] + x[k + 1] - x[k - 2] - x[k + 2])) < most;
}

/// ln(1/S) = (x/a)^k through two quantiles.
struct Tail {
  double from = 0, at = 1, exponent = 1;  ///< ln(1/S) at the farther quantile, that quantile, k
  Tail(double share_near, double near, double share_far, double far) : from(-std::log(share_far)), at(far) {
    const double k = std::log(from / -std::log(share_near)) / std::log(far / near);
    exponent = kLessBent * std::clamp(k, 0.5, kMostBent);
  }
  [[nodiscard]] double share(double x) const { return std::exp(-from * std::pow(x / at, exponent)); }
  /// What one of n passes with the probability p.
  [[nodiscard]] double end(double n, double p) const {
    return at * std::pow(std::log(n / p) / from, 1 / exponent);
  }
};

Outliers outliers_of(std::span<const double> heights, double limit, std::size_t samples) {
  Outliers out;
  out.limit = limit;
  out.samples = samples;
  out.count = heights.size();
  if (heights.empty()) return out;
  double squares = 0;
  for (const double d : heights) squares += d * d;
  out.height = series::median(heights);
  out.rms = std::sqrt(squares / static_cast<double>(samples));
  return out;
}

}  // namespace

Outliers count_outliers(Readings readings, double limit) {
  std::vector<double> heights;
  std::size_t samples = 0;
  for (const std::vector<double>* x : readings)
    for (std::size_t k = kNeighboursEachSide; k + kNeighboursEachSide < x->size(); ++k) {
      const double d = difference(*x, k);
      if (!std::isfinite(d)) continue;
      ++samples;
      if (std::abs(d) > limit && alone(*x, k, d)) heights.push_back(std::abs(d));
    }
  return outliers_of(heights, limit, samples);
}

Outliers find_outliers(Readings readings, double quantum) {
  const double white = white_noise(readings);
  // The tail of the noise: without the neighbours of what stands alone far out, whose differences are up to 0.43 of its. (One spike in 140
  // samples makes six such, four in a hundred.) Itself stays in: of a real amplifier's samples a hundredth is such, and without them its tail
  // looked thin.
  std::vector<double> size, heights;
  std::size_t samples = 0;
  const double nearest = std::max(kNearer * white, 3 * quantum);
  for (const std::vector<double>* x : readings) {
    std::vector<double> off(x->size(), std::numeric_limits<double>::quiet_NaN());
    std::vector<char> beside(x->size(), 0);
    for (std::size_t k = kNeighboursEachSide; k + kNeighboursEachSide < x->size(); ++k) {
      off[k] = std::abs(difference(*x, k));
      if (!std::isfinite(off[k])) continue;
      ++samples;
      if (off[k] <= nearest || !alone(*x, k, off[k])) continue;
      heights.push_back(off[k]);
      if (off[k] > kFarOut * white)
        for (std::size_t j = 1; j <= kNeighboursEachSide; ++j) beside[k - j] = beside[k + j] = 1;
    }
    for (std::size_t k = 0; k < off.size(); ++k)
      if (std::isfinite(off[k]) && beside[k] == 0) size.push_back(off[k]);
  }
  std::sort(heights.begin(), heights.end());
  const auto beyond = [&](double limit) {
    const auto first = std::upper_bound(heights.begin(), heights.end(), limit);
    Outliers out = outliers_of(std::span(first, heights.end()), limit, samples);
    out.among_noise = out.count > 0 && out.height < kFarOut * white;
    return out;
  };
  if (size.size() < 1000) return {};
  const double n = static_cast<double>(size.size());
  const double q90 = series::quantile(size, 0.90), q98 = series::quantile(size, 0.98);
  if (!(q98 > q90 && q90 > 0)) return {};
  const Tail tail(0.1, q90, 0.02, q98);
  // Many beyond where the tail holds hardly any need not each be beyond its end.
  for (double limit = std::max(tail.exponent >= kThin ? nearest : kLeastOut * white, 3 * quantum);
       limit < kNotBeyond * white; limit *= kFarther) {
    const Outliers many = beyond(limit);
    if (many.count < kManyForSure) break;
    const double expected = n * tail.share(limit);
    const double most = limit < kLeastOut * white ? kOfThoseNearer : kOfThoseThere;
    if (expected <= most * static_cast<double>(many.count)) return many;
  }
  const Outliers lone = beyond(std::max({tail.end(n, kAlpha), kLeastOut * white, 3 * quantum}));
  if (lone.rms >= kManyOrHigh * white || lone.count >= kManyForSure) return lone;
  // A few that are hardly beyond it may be a tail that bends the other way: then an exponential's end is asked for.
  const double b = std::max((q98 - q90) / std::log(5.0), q98 / std::log(50.0));
  const double end = q98 + b * std::log(0.02 * n / kAlpha);
  return beyond(std::max({end, kFarOut * white, 3 * quantum}));
}

}  // namespace isac::explain
