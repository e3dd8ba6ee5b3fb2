#include <algorithm>
#include <cmath>

#include "score.hpp"

namespace blind {
namespace {

/// The coarsest step 1/N, 100 ≤ N ≤ 10000, of which all values are multiples; zero where there is none. A coarser grid would
/// be read into a few values that happen to be round, above all into ones.
double step_of(const std::vector<double>& p) {
  for (int n = 100; n <= 10000; ++n)
    if (std::all_of(p.begin(), p.end(), [&](double x) { return std::abs(x * n - std::round(x * n)) < 1e-7; }))
      return 1.0 / n;
  return 0.0;
}

}  // namespace

PDistance p_distance(std::vector<double> p) {
  PDistance far;
  if (p.empty()) return far;
  std::sort(p.begin(), p.end());
  const double step = step_of(p), n = static_cast<double>(p.size());
  for (std::size_t i = 0; i < p.size();) {
    const double value = p[i];
    // Just below a value the uniform law has come as far as the grid's step before it.
    far.large = std::max(far.large, value - step - static_cast<double>(i) / n);
    while (i < p.size() && p[i] == value) ++i;
    far.small = std::max(far.small, static_cast<double>(i) / n - value);
  }
  // Kolmogorov's, either side: Stephens' approximation to all n.
  far.limit = 1.358 / (std::sqrt(n) + 0.12 + 0.11 / std::sqrt(n));
  return far;
}

}  // namespace blind
