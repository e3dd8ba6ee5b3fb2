// The start of the step fit: the sum of squares over all dead times at once, for a given lag.
#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/estimate/step_fit.hpp"

namespace isac::estimate {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Candidate {
  StepParameters parameters{};
  double sse = kInfinity;
};

struct Prefix {
  std::vector<double> sum, square;  // over the rows before i
};

Prefix prefix_sums(const std::vector<double>& y) {
  Prefix p{std::vector<double>(y.size() + 1, 0.0), std::vector<double>(y.size() + 1, 0.0)};
  for (std::size_t i = 0; i < y.size(); ++i) {
    p.sum[i + 1] = p.sum[i] + y[i];
    p.square[i + 1] = p.square[i] + y[i] * y[i];
  }
  return p;
}

// Best L and levels for one T. Rows i ≥ m lie behind the onset; with e_i = exp(−(s_i − s_m)/T) the sums
// A = Σ e, AA = Σ e², AY = Σ e y follow from those of m + 1 by one decay factor.
// Onsets are tried within [earliest, latest].
Candidate best_for_lag(std::span<const double> s, std::span<const double> y, const Prefix& prefix, double lag,
                       double earliest, double latest, double weight) {
  Candidate best;
  const std::size_t n = s.size();
  const double total = prefix.sum[n], total_square = prefix.square[n];
  double a = 0, aa = 0, ay = 0;
  double last_interval = -1, decay = 0;
  for (std::size_t m = n; m-- > 1;) {
    if (m + 1 < n) {
      const double interval = s[m + 1] - s[m];
      if (interval != last_interval) {
        decay = std::exp(-interval / lag);
        last_interval = interval;
      }
      a *= decay;
      aa *= decay * decay;
      ay *= decay;
    }
    a += 1;
    aa += 1;
    ay += y[m];
    if (n - m < 3 || s[m - 1] > latest) continue;
    if (s[m] < earliest) break;
    const double behind = static_cast<double>(n - m), before = static_cast<double>(m);
    const double sy = total - prefix.sum[m];
    const double before_mean = prefix.sum[m] / before;

    // Free: mean before; a line in (1, e) behind. Valid where the two meet between the rows m − 1 and m.
    const double det = behind * aa - a * a;
    if (det > 1e-12 * behind * aa) {
      const double c = (behind * ay - a * sy) / det;
      const double level = (sy - c * a) / behind;
      const double ratio = (before_mean - level) / c;
      if (ratio > 0 && c != 0) {
        const double onset = s[m] - lag * std::log(ratio);
        if (onset <= s[m] && onset >= std::max(s[m - 1], earliest)) {
          const double sse = (total_square - before * before_mean * before_mean) - level * sy - c * ay;
          if (sse < best.sse) best = {{before_mean, level - before_mean, lag, onset}, sse};
        }
      }
    }
    // Kink: onset exactly at row m. Regressors 1 (all rows) and g = 1 − e (rows behind).
    const double g = behind - a, gg = behind - 2 * a + aa, gy = sy - ay;
    const double all = static_cast<double>(n);
    const double det_kink = all * gg - g * g;
    if (det_kink > 1e-12 * all * gg) {
      const double gain = (all * gy - g * total) / det_kink;
      const double low = (total - gain * g) / all;
      const double sse = total_square - low * total - gain * gy;
      if (sse < best.sse) best = {{low, gain, lag, s[m]}, sse};
    }
  }
  best.sse *= weight;
  return best;
}

}  // namespace

std::pair<StepParameters, double> search_step(const StepData& data, double earliest) {
  const std::size_t n = data.y.size();
  if (n < 6) return {{}, kInfinity};
  // Centred values: the sums of squares are differences of large numbers otherwise.
  double centre = 0;
  for (double v : data.y) centre += v;
  centre /= static_cast<double>(n);
  std::vector<double> y(n);
  std::transform(data.y.begin(), data.y.end(), y.begin(), [&](double v) { return v - centre; });

  // Coarse: block means, at most 4000 of them.
  const std::size_t block = (n + 3999) / 4000;
  std::vector<double> sc, yc;
  for (std::size_t i = 0; i + block <= n; i += block) {
    double ms = 0, my = 0;
    for (std::size_t k = i; k < i + block; ++k) {
      ms += data.s[k];
      my += y[k];
    }
    sc.push_back(ms / static_cast<double>(block));
    yc.push_back(my / static_cast<double>(block));
  }
  const Prefix coarse = prefix_sums(yc);
  const double span = data.s.back() - data.s.front();
  const double shortest = 0.3 * std::max(data.sample_time, span / static_cast<double>(n));
  const double longest = 3 * span;
  constexpr int kGrid = 48;
  const double ratio = std::pow(longest / shortest, 1.0 / (kGrid - 1));
  double best_lag = shortest, best_sse = kInfinity, best_onset = 0;
  double lag = shortest;
  for (int k = 0; k < kGrid; ++k, lag *= ratio) {
    const Candidate c = best_for_lag(sc, yc, coarse, lag, earliest, kInfinity, static_cast<double>(block));
    if (c.sse < best_sse) {
      best_sse = c.sse;
      best_lag = lag;
      best_onset = c.parameters[3];
    }
  }

  // Fine: golden section in ln T over the neighbouring grid points, all rows.
  // The onset moves by less than a lag while T moves by one grid point.
  const Prefix fine = prefix_sums(y);
  const double margin = 2 * best_lag + 3 * static_cast<double>(block) * data.sample_time;
  const double from = std::max(earliest, best_onset - margin), to = best_onset + margin;
  const auto at = [&](double log_lag) {
    return best_for_lag(data.s, y, fine, std::exp(log_lag), from, to, 1.0);
  };
  const double golden = 0.5 * (std::sqrt(5.0) - 1);
  double low = std::log(best_lag / ratio), high = std::log(best_lag * ratio);
  double x1 = high - golden * (high - low), x2 = low + golden * (high - low);
  Candidate c1 = at(x1), c2 = at(x2);
  for (int k = 0; k < 16; ++k) {
    if (c1.sse < c2.sse) {
      high = x2;
      x2 = x1;
      c2 = c1;
      x1 = high - golden * (high - low);
      c1 = at(x1);
    } else {
      low = x1;
      x1 = x2;
      c1 = c2;
      x2 = low + golden * (high - low);
      c2 = at(x2);
    }
  }
  Candidate best = c1.sse < c2.sse ? c1 : c2;
  best.parameters[0] += centre;
  return {best.parameters, best.sse};
}

}  // namespace isac::estimate
