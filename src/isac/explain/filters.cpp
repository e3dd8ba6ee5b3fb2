#include "isac/explain/filters.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/units.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {

std::vector<double> gaussian(double sigma, int order) {
  const int reach = std::max(1, static_cast<int>(std::ceil(kKernelReach * sigma)));
  std::vector<double> g(static_cast<std::size_t>(2 * reach + 1));
  double sum = 0;
  for (int k = -reach; k <= reach; ++k)
    sum += g[static_cast<std::size_t>(k + reach)] = std::exp(-0.5 * k * k / (sigma * sigma));
  for (double& v : g) v /= sum;
  if (order == 0) return g;
  // Derivatives that are exact on the polynomials they must be exact on, whatever the truncation.
  std::vector<double> d(g.size());
  double moment = 0, second = 0;
  for (int k = -reach; k <= reach; ++k) {
    const double v = g[static_cast<std::size_t>(k + reach)];
    second += k * k * v;
  }
  for (int k = -reach; k <= reach; ++k) {
    const auto i = static_cast<std::size_t>(k + reach);
    if (order == 1) {
      d[i] = g[i] * k;
      moment += d[i] * k;
    } else {
      d[i] = g[i] * (k * k - second);
      moment += d[i] * 0.5 * k * k;
    }
  }
  for (double& v : d) v /= moment;
  return d;
}

// Four sums at once where the processor can: the same ones, without a fused multiplication, whose digits would be others.
#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__SANITIZE_ADDRESS__)
[[gnu::target_clones("avx", "default")]]
#endif
double
centred_sum(std::span<const double> g, std::span<const double> x, std::size_t at) {
  const auto reach = static_cast<std::ptrdiff_t>(g.size() / 2);
  const auto n = static_cast<std::ptrdiff_t>(x.size()), i = static_cast<std::ptrdiff_t>(at);
  double sum = 0;
  if (i >= reach && i + reach < n) {
    const double* p = x.data() + (i - reach);
    // Four sums that do not wait for one another; always the same ones, so the digits are the same everywhere.
    double part[4] = {0, 0, 0, 0};
    std::size_t k = 0;
    for (; k + 4 <= g.size(); k += 4)
      for (std::size_t j = 0; j < 4; ++j) part[j] += g[k + j] * p[k + j];
    for (; k < g.size(); ++k) sum += g[k] * p[k];
    return sum + ((part[0] + part[1]) + (part[2] + part[3]));
  }
  for (std::ptrdiff_t k = -reach; k <= reach; ++k)
    sum += g[static_cast<std::size_t>(k + reach)] *
           x[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i + k, 0, n - 1))];
  return sum;
}

std::vector<double> low_pass(std::span<const double> x, double sigma, std::size_t first, std::size_t stride) {
  const std::vector<double> g = gaussian(std::max(sigma, 0.3), 0);
  std::vector<double> out;
  out.reserve(x.size() / stride + 1);
  for (std::size_t i = first; i < x.size(); i += stride) out.push_back(centred_sum(g, x, i));
  return out;
}

std::vector<double> wide_low_pass(std::span<const double> x, double sigma) {
  const auto n = static_cast<std::ptrdiff_t>(x.size());
  const auto half = std::max<std::ptrdiff_t>(1, std::lround((std::sqrt(4 * sigma * sigma + 1) - 1) / 2));
  std::vector<double> now(x.begin(), x.end()), next(x.size());
  for (int pass = 0; pass < 3; ++pass) {
    const auto at = [&](std::ptrdiff_t k) {
      return now[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, n - 1))];
    };
    double sum = 0;
    for (std::ptrdiff_t k = -half; k <= half; ++k) sum += at(k);
    for (std::ptrdiff_t k = 0; k < n; ++k) {
      next[static_cast<std::size_t>(k)] = sum / static_cast<double>(2 * half + 1);
      sum += at(k + half + 1) - at(k - half);
    }
    std::swap(now, next);
  }
  return now;
}

std::vector<double> quieten(std::span<const double> raw, std::span<const double> narrow, double sigma,
                            double wide_sigma, double white) {
  const std::vector<double> wide = wide_low_pass(raw, wide_sigma);
  std::vector<double> difference(raw.size());
  for (std::size_t k = 0; k < raw.size(); ++k) difference[k] = (narrow[k] - wide[k]) * (narrow[k] - wide[k]);
  const std::vector<double> power = wide_low_pass(difference, 2 * wide_sigma);
  // White noise of variance s² has s²/(2 √π σ) of it left after a Gaussian of σ samples.
  const double expected = white * white / (2 * std::sqrt(kPi) * sigma);
  std::vector<double> out(raw.size());
  for (std::size_t k = 0; k < raw.size(); ++k) {
    const double share = expected > 0 ? std::clamp((power[k] / expected - 1.5) / 1.5, 0.0, 1.0) : 1.0;
    out[k] = wide[k] + share * (narrow[k] - wide[k]);
  }
  return out;
}

double white_noise(std::span<const std::vector<double>* const> signals) {
  std::vector<double> d;
  for (const std::vector<double>* x : signals)
    for (std::size_t k = 2; k + 2 < x->size(); k += 3) {
      const double v = (*x)[k - 2] - 4 * (*x)[k - 1] + 6 * (*x)[k] - 4 * (*x)[k + 1] + (*x)[k + 2];
      if (std::isfinite(v)) d.push_back(v);
    }
  double squares = 0;
  for (const double v : d) squares += v * v;
  // A quantised signal at rest has a median of nothing: never below a quarter of the plain deviation.
  const double plain = d.empty() ? 0 : std::sqrt(squares / static_cast<double>(d.size()));
  return std::max(series::robust_deviation(d, true), 0.25 * plain) / std::sqrt(70.0);
}

std::vector<double> low_pass_derivative(std::span<const double> x, double sigma, double interval, int order) {
  const std::vector<double> g = gaussian(std::max(sigma, 1.0), order);
  const double scale = order == 1 ? 1 / interval : 1 / (interval * interval);
  std::vector<double> out(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) out[i] = scale * centred_sum(g, x, i);
  return out;
}

}  // namespace isac::explain
