#include "isac/explain/filters.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "isac/core/units.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr double kWideKernel = 0.020;                 // s, for velocities that the encoder resolves badly
constexpr double kQuietKernel = 0.015;                // s, for velocities that change slowly
constexpr double kQuietKernelOfAcceleration = 0.025;  // s, beside a narrow one of 0.020 s
constexpr double kQuietKernelOfSwing = 0.050;         // s, which a resonance of up to 18 Hz does not hear

}  // namespace

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

namespace {

/// By the kernel, and by a wider one.
struct TwoWays {
  std::vector<double> narrow, slow;
};

std::vector<double> derivative_of(std::span<const double> x, double sigma, double interval, int order) {
  return order == 0 ? low_pass(x, sigma) : low_pass_derivative(x, sigma, interval, order);
}

/// w = g_w′ ∗ φ, u = 1 − g_w∗: w + (1 − α) u w + ½ (1 − α)(2 − α) u² w, α = σ²/σ_w², the beginning of (1 − u)^(α−1) w, has the second and the
/// fourth moment of g: a smooth motion passes it as it passes g′. (With the second alone a hand's reversals left 8e-5 N m s of a velocity that
/// is remembered for 0.1 s, two sigma in every day.)
TwoWays two_ways(std::span<const double> raw_angle, double sigma, double wide_sigma, double interval,
                 int order) {
  TwoWays both{.narrow = derivative_of(raw_angle, sigma, interval, order), .slow = {}};
  const std::vector<double> wide = derivative_of(raw_angle, wide_sigma, interval, order),
                            wider = low_pass(wide, wide_sigma), widest = low_pass(wider, wide_sigma);
  const double bend = 1 - sigma * sigma / (wide_sigma * wide_sigma), second = 0.5 * bend * (1 + bend);
  both.slow.resize(wide.size());
  for (std::size_t k = 0; k < wide.size(); ++k)
    both.slow[k] = wide[k] + bend * (wide[k] - wider[k]) + second * (wide[k] - 2 * wider[k] + widest[k]);
  return both;
}

/// 0 where what the two ways differ by is no more than the encoder's steps make of it, 1 where it is twice as much.
std::vector<double> share_beyond_steps(const TwoWays& both, double sigma, double wide_sigma, double interval,
                                       double angle_step, int order) {
  std::vector<double> difference(both.slow.size());
  for (std::size_t k = 0; k < difference.size(); ++k)
    difference[k] = (both.narrow[k] - both.slow[k]) * (both.narrow[k] - both.slow[k]);
  std::vector<double> share = wide_low_pass(difference, 2 * wide_sigma);
  double gain = 0;  // of white noise by the derivative
  for (const double g : gaussian(std::max(sigma, 1.0), order)) gain += g * g;
  const double expected = angle_step * angle_step / 12 * gain / std::pow(interval, 2 * order);
  for (double& s : share) s = std::clamp((s / expected - 1.5) / 1.5, 0.0, 1.0);
  return share;
}

void mix(const std::vector<double>& share, const std::vector<double>& slow, std::vector<double>& narrow) {
  for (std::size_t k = 0; k < narrow.size(); ++k) narrow[k] = slow[k] + share[k] * (narrow[k] - slow[k]);
}

/// The derivative of an encoder's reading by a wider kernel, where what it differs by from the narrow one's is no more than the steps make.
std::vector<double> quiet_derivative(std::span<const double> raw_angle, double sigma, double wide_sigma,
                                     double interval, double angle_step, int order) {
  if (!(std::isfinite(angle_step) && angle_step > 0) || wide_sigma <= sigma)
    return derivative_of(raw_angle, sigma, interval, order);
  TwoWays both = two_ways(raw_angle, sigma, wide_sigma, interval, order);
  mix(share_beyond_steps(both, sigma, wide_sigma, interval, angle_step, order), both.slow, both.narrow);
  return std::move(both.narrow);
}

}  // namespace

std::vector<double> quiet_velocity(std::span<const double> raw_angle, double sigma, double interval,
                                   double angle_step) {
  return quiet_derivative(raw_angle, sigma, kQuietKernel / interval, interval, angle_step, 1);
}

std::vector<double> quiet_acceleration(std::span<const double> raw_angle, double sigma, double interval,
                                       double angle_step) {
  return quiet_derivative(raw_angle, sigma, kQuietKernelOfAcceleration / interval, interval, angle_step, 2);
}

std::vector<unsigned char> beats_with_clock(std::span<const double> velocity, double interval,
                                            double angle_step) {
  constexpr double kSmooth = 0.05;                    // s
  constexpr double kPassesKernel = 40, kWhile = 0.1;  // Hz, s
  std::vector<unsigned char> beats(velocity.size(), 0);
  if (!(std::isfinite(angle_step) && angle_step > 0) || velocity.size() < 2) return beats;
  const std::vector<double> smooth = wide_low_pass(velocity, kSmooth / interval);
  for (std::size_t k = 0; k < beats.size(); ++k) {
    const double steps = smooth[k] * interval / angle_step;  // for each sample
    const double nearest = 0.5 * std::round(2 * steps);
    if (nearest == 0 || std::abs(steps - nearest) >= kPassesKernel * interval) continue;
    const std::size_t a = k - std::min<std::size_t>(k, 1), b = std::min(k + 1, beats.size() - 1);
    const double acceleration = (smooth[b] - smooth[a]) / (static_cast<double>(b - a) * interval);
    beats[k] = std::abs(acceleration) * kWhile < kPassesKernel * angle_step ? 1 : 0;
  }
  return beats;
}

namespace {

/// The parabola through x[from, to) by least squares, at sample k: its value and its slope per sample.
std::pair<double, double> parabola(std::span<const double> x, std::size_t from, std::size_t to,
                                   std::size_t k) {
  const double half = 0.5 * static_cast<double>(to - from), here = static_cast<double>(k);
  double m[5] = {}, y[3] = {};
  for (std::size_t i = from; i < to; ++i) {
    const double u = (static_cast<double>(i) - here) / half, v = x[i] - x[k];
    double power = 1;
    for (int p = 0; p < 5; ++p, power *= u) {
      m[p] += power;
      if (p < 3) y[p] += power * v;
    }
  }
  const double c0 = m[2] * m[4] - m[3] * m[3], c1 = m[2] * m[3] - m[1] * m[4], c2 = m[1] * m[3] - m[2] * m[2];
  const double det = m[0] * c0 + m[1] * c1 + m[2] * c2;
  const double value = (y[0] * c0 + y[1] * c1 + y[2] * c2) / det;
  const double slope =
      (y[0] * c1 + y[1] * (m[0] * m[4] - m[2] * m[2]) + y[2] * (m[1] * m[2] - m[0] * m[3])) / det;
  return {x[k] + value, slope / half};
}

}  // namespace

void hush_beats(std::span<const double> raw_angle, double interval, double angle_step,
                std::vector<double>& angle, std::vector<double>& velocity) {
  constexpr double kHalfWidth = 0.3, kBlend = 0.02;  // s
  const std::vector<unsigned char> beats = beats_with_clock(velocity, interval, angle_step);
  const auto width = static_cast<std::size_t>(kHalfWidth / interval);
  for (std::size_t begin = 0; begin < beats.size();) {
    if (beats[begin] == 0) {
      ++begin;
      continue;
    }
    std::size_t end = begin;
    while (end < beats.size() && beats[end] != 0) ++end;
    for (std::size_t k = begin; k < end && end - begin > width; ++k) {
      const auto [value, slope] =
          parabola(raw_angle, k - std::min(k - begin, width), std::min(end, k + width + 1), k);
      const double inside = static_cast<double>(std::min(k - begin, end - 1 - k) + 1) * interval;
      const double share = std::min(1.0, inside / kBlend);
      angle[k] += share * (value - angle[k]);
      velocity[k] += share * (slope / interval - velocity[k]);
    }
    begin = end;
  }
}

namespace {

/// What is let go covers in twice the time four times the way, what moves already twice.
bool begins_at_rest(std::span<const double> raw_angle, double interval, double angle_step) {
  constexpr double kClear = 8, kLate = 0.05, kOfRest = 3;  // steps, s, times the way
  const double step = std::isfinite(angle_step) ? angle_step : 0.0;
  const auto last = std::min((raw_angle.size() - 1) / 2, static_cast<std::size_t>(kLate / interval));
  for (std::size_t k = 1; k <= last; ++k) {
    const double way = std::abs(raw_angle[2 * k] - raw_angle[0]);
    if (way > kClear * step) return way >= kOfRest * std::abs(raw_angle[k] - raw_angle[0]);
  }
  return true;
}

}  // namespace

Motion quiet_motion(std::span<const double> raw_angle, double sigma, double interval, double angle_step) {
  if (raw_angle.empty()) return {};
  const double wide = kQuietKernelOfSwing / interval;
  const bool from_rest = begins_at_rest(raw_angle, interval, angle_step);
  const auto lead = static_cast<std::size_t>(std::ceil(kKernelReach * std::max(wide, sigma)));
  std::vector<double> angle(lead, raw_angle.front());
  angle.insert(angle.end(), raw_angle.begin(), raw_angle.end());
  if (!(std::isfinite(angle_step) && angle_step > 0) || wide <= sigma)
    return {derivative_of(angle, sigma, interval, 0), derivative_of(angle, sigma, interval, 1),
            derivative_of(angle, sigma, interval, 2), lead, from_rest};
  TwoWays orders[3];
  for (int order = 0; order < 3; ++order) orders[order] = two_ways(angle, sigma, wide, interval, order);
  const std::vector<double> share = share_beyond_steps(orders[2], sigma, wide, interval, angle_step, 2);
  for (TwoWays& both : orders) mix(share, both.slow, both.narrow);
  return {std::move(orders[0].narrow), std::move(orders[1].narrow), std::move(orders[2].narrow), lead,
          from_rest};
}

std::vector<double> dry_velocity(std::span<const double> raw_angle, std::span<const double> velocity,
                                 double interval, double angle_step) {
  const std::vector<double> wide = low_pass_derivative(raw_angle, kWideKernel / interval, interval, 1);
  const double still = std::isfinite(angle_step) && angle_step > 0 ? angle_step / kSlowestStep : 0.0;
  // A wide kernel sees a turn that is not even on both sides too early or too late, by σ²/2 times its bend: where the joint turns quickly,
  // the kernel's own second smoothing tells how much. (Where it creeps, that would double the noise.)
  const std::vector<double> wider = low_pass(wide, kWideKernel / interval);
  const auto reach = static_cast<std::size_t>(std::max(1.0, 0.5 * kWideKernel / interval));
  std::vector<double> out(velocity.size());
  for (std::size_t k = 0; k < out.size(); ++k) {
    const std::size_t a = k - std::min(k, reach), b = std::min(out.size() - 1, k + reach);
    const double change = std::abs(wide[b] - wide[a]) * kWideKernel / (static_cast<double>(b - a) * interval);
    const double quick = still > 0 ? std::clamp(change / still - 1, 0.0, 1.0) : 1.0;
    const double slow = wide[k] + quick * (wide[k] - wider[k]);
    const double share =
        still > 0 ? std::clamp((std::abs(wide[k]) - 2 * still) / (4 * still), 0.0, 1.0) : 1.0;
    const double w = share * velocity[k] + (1 - share) * slow;
    out[k] = std::abs(w) > still ? w : 0.0;
  }
  return out;
}

}  // namespace isac::explain
