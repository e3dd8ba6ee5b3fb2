/// @file
/// Small statistics that every estimate needs: order statistics, tail probabilities, correlation in time.
///
/// Robust spread: 1.4826 median|x − median x| equals the standard deviation of normal data. Correlation time:
/// τ = Δt (1/2 + Σ ρ_k), the sum up to the first lag beyond 5 τ (Sokal's window), so that n samples are worth
/// n Δt/(2τ). NaN entries are skipped by median, quantile and robust_deviation. Threads: pure functions.
/// Errors: empty input gives NaN. Source: Huber and Ronchetti 2009; Ljung and Box 1978; Sokal 1997.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace isac::series {

[[nodiscard]] double median(std::span<const double> x);
[[nodiscard]] double quantile(std::span<const double> x, double probability);
/// 1.4826 median |x − median x|; `about_zero` leaves the inner median out.
[[nodiscard]] double robust_deviation(std::span<const double> x, bool about_zero = false);

/// Student's t: the point that |t| exceeds with probability 1 − `confidence`.
[[nodiscard]] double student_t_limit(double confidence, double degrees_of_freedom);
[[nodiscard]] double student_t_two_sided(double t, double degrees_of_freedom);
/// Standard normal: the point that |z| exceeds with this probability.
[[nodiscard]] double normal_two_sided_limit(double probability);
[[nodiscard]] double chi_square_upper(double statistic, double degrees_of_freedom);

/// Correlation time in samples of the spacing given, at least 1/2 (white). Means of the pieces are taken out
/// jointly.
[[nodiscard]] double correlation_time(std::span<const std::vector<double>> pieces);

struct LjungBox {
  double statistic = 0;
  int lags = 0;
  double p_value = 1;
};
/// Portmanteau test that the pieces, joined without crossing their borders, are white.
[[nodiscard]] LjungBox ljung_box(std::span<const std::vector<double>> pieces, int lags);

}  // namespace isac::series
