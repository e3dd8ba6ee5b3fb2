#include "isac/series/statistics.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>

namespace isac::series {
namespace {

constexpr double kNoValue = std::numeric_limits<double>::quiet_NaN();

std::vector<double> finite(std::span<const double> x) {
  std::vector<double> out;
  out.reserve(x.size());
  for (const double v : x)
    if (std::isfinite(v)) out.push_back(v);
  return out;
}

double quantile_in_place(std::vector<double>& x, double probability) {
  if (x.empty()) return kNoValue;
  const double place = probability * static_cast<double>(x.size() - 1);
  const auto low = static_cast<std::size_t>(place);
  std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(low), x.end());
  const double a = x[low];
  if (low + 1 >= x.size()) return a;
  const double b = *std::min_element(x.begin() + static_cast<std::ptrdiff_t>(low) + 1, x.end());
  return a + (place - static_cast<double>(low)) * (b - a);
}

double joint_mean(std::span<const std::vector<double>> pieces, std::size_t& count) {
  double sum = 0;
  count = 0;
  for (const auto& piece : pieces)
    for (const double v : piece) {
      sum += v;
      ++count;
    }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

double autocovariance_sum(std::span<const std::vector<double>> pieces, double mean, std::size_t lag) {
  double sum = 0;
  for (const auto& piece : pieces)
    for (std::size_t i = lag; i < piece.size(); ++i) sum += (piece[i] - mean) * (piece[i - lag] - mean);
  return sum;
}

constexpr std::size_t kLags =
    8;  // that are summed at once: one sum's additions wait for each other, those of eight do not

/// sums[j]: as autocovariance_sum of lag + j, to the last bit.
void autocovariance_sums(std::span<const std::vector<double>> pieces, double mean, std::size_t lag,
                         double (&sums)[kLags]) {
  std::fill(std::begin(sums), std::end(sums), 0.0);
  for (const auto& piece : pieces) {
    const std::size_t n = piece.size(), together = std::min(n, lag + kLags - 1);
    for (std::size_t j = 0; j < kLags; ++j)
      for (std::size_t i = lag + j; i < together; ++i)
        sums[j] += (piece[i] - mean) * (piece[i - lag - j] - mean);
    for (std::size_t i = together; i < n; ++i) {
      const double here = piece[i] - mean;
      const double* before = piece.data() + (i - lag);
      for (std::size_t j = 0; j < kLags; ++j) sums[j] += here * (*(before - j) - mean);
    }
  }
}

}  // namespace

double median(std::span<const double> x) {
  return quantile(x, 0.5);
}

double quantile(std::span<const double> x, double probability) {
  std::vector<double> copy = finite(x);
  return quantile_in_place(copy, probability);
}

double robust_deviation(std::span<const double> x, bool about_zero) {
  std::vector<double> copy = finite(x);
  const double middle = about_zero ? 0.0 : quantile_in_place(copy, 0.5);
  for (double& v : copy) v = std::abs(v - middle);
  return 1.482602218505602 * quantile_in_place(copy, 0.5);
}

double student_t_limit(double confidence, double degrees_of_freedom) {
  if (!(degrees_of_freedom > 0)) return kNoValue;
  return boost::math::quantile(boost::math::students_t(degrees_of_freedom), 0.5 + 0.5 * confidence);
}

double student_t_two_sided(double t, double degrees_of_freedom) {
  if (!(degrees_of_freedom > 0) || !std::isfinite(t)) return kNoValue;
  return 2.0 *
         boost::math::cdf(boost::math::complement(boost::math::students_t(degrees_of_freedom), std::abs(t)));
}

double normal_two_sided_limit(double probability) {
  if (!(probability > 0 && probability <= 1)) return kNoValue;
  return boost::math::quantile(boost::math::complement(boost::math::normal(), 0.5 * probability));
}

double chi_square_upper(double statistic, double degrees_of_freedom) {
  if (!(degrees_of_freedom > 0) || !(statistic >= 0)) return kNoValue;
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(degrees_of_freedom), statistic));
}

double correlation_time(std::span<const std::vector<double>> pieces) {
  std::size_t count = 0, longest = 0;
  const double mean = joint_mean(pieces, count);
  for (const auto& piece : pieces) longest = std::max(longest, piece.size());
  const double variance = autocovariance_sum(pieces, mean, 0);
  if (!(variance > 0)) return 0.5;
  double tau = 0.5;
  double sums[kLags];
  for (std::size_t lag = 1; lag < longest / 2; ++lag) {
    if ((lag - 1) % kLags == 0) autocovariance_sums(pieces, mean, lag, sums);
    tau += sums[(lag - 1) % kLags] / variance;
    if (static_cast<double>(lag) >= 5.0 * std::max(tau, 0.5)) break;
  }
  return std::max(tau, 0.5);
}

LjungBox ljung_box(std::span<const std::vector<double>> pieces, int lags) {
  LjungBox out;
  std::size_t count = 0;
  const double mean = joint_mean(pieces, count);
  const double variance = autocovariance_sum(pieces, mean, 0);
  const auto n = static_cast<double>(count);
  out.lags = lags;
  if (!(variance > 0)) return out;
  for (int lag = 1; lag <= lags && n - lag > 1; ++lag) {
    const double rho = autocovariance_sum(pieces, mean, static_cast<std::size_t>(lag)) / variance;
    out.statistic += n * (n + 2) * rho * rho / (n - lag);
  }
  out.p_value = chi_square_upper(out.statistic, lags);
  return out;
}

}  // namespace isac::series
