#include "isac/explain/encoder_motion.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "isac/core/units.hpp"
#include "isac/explain/filters.hpp"

namespace isac::explain {
namespace {

constexpr double kWideKernel = 0.020;                 // s, for velocities that the encoder resolves badly
constexpr double kQuietKernel = 0.015;                // s, for velocities that change slowly
constexpr double kQuietKernelOfSlowTurns = 0.030;     // s, where the steps are further apart than that
constexpr double kQuietKernelOfAcceleration = 0.025;  // s, beside a narrow one of 0.020 s
constexpr double kQuietKernelOfSwing = 0.050;         // s, which a resonance of up to 18 Hz does not hear

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

/// 0 where what the two ways differ by is no more than is expected of the encoder's steps, 1 where it is twice as much.
std::vector<double> share_beyond(const std::vector<double>& expected, const TwoWays& both,
                                 double wide_sigma) {
  std::vector<double> difference(both.slow.size());
  for (std::size_t k = 0; k < difference.size(); ++k)
    difference[k] = (both.narrow[k] - both.slow[k]) * (both.narrow[k] - both.slow[k]);
  std::vector<double> share = wide_low_pass(difference, 2 * wide_sigma);
  for (std::size_t k = 0; k < share.size(); ++k)
    share[k] = std::clamp((share[k] / expected[k] - 1.5) / 1.5, 0.0, 1.0);
  return share;
}

/// The same, of steps as white noise.
std::vector<double> share_beyond_steps(const TwoWays& both, double sigma, double wide_sigma, double interval,
                                       double angle_step, int order) {
  double gain = 0;  // of white noise by the derivative
  for (const double g : gaussian(std::max(sigma, 1.0), order)) gain += g * g;
  const double expected = angle_step * angle_step / 12 * gain / std::pow(interval, 2 * order);
  return share_beyond(std::vector<double>(both.slow.size(), expected), both, wide_sigma);
}

void mix(const std::vector<double>& share, const std::vector<double>& slow, std::vector<double>& narrow) {
  for (std::size_t k = 0; k < narrow.size(); ++k) narrow[k] = slow[k] + share[k] * (narrow[k] - slow[k]);
}

/// What a low-pass leaves of a frequency, rad/s.
using Passes = std::function<double(double)>;

Passes by_kernel(double seconds) {
  return [seconds](double turns) { return std::exp(-0.5 * turns * seconds * turns * seconds); };
}

/// By a wider kernel and its own bend (two_ways).
Passes by_wider(double seconds, double wide_seconds) {
  return [=](double turns) {
    const double g = by_kernel(wide_seconds)(turns), u = 1 - g,
                 bend = 1 - seconds * seconds / (wide_seconds * wide_seconds);
    return g * (1 + bend * u * (1 + 0.5 * (1 + bend) * u));
  };
}

/// What an encoder's steps make of a low-passed velocity, (rad/s)²: of white noise, and of the teeth of a saw, |φ̇|/step in a second.
class OfSteps {
 public:
  OfSteps(Passes passes, double angle_step, double interval)
      : passes_(std::move(passes)), angle_step_(angle_step) {
    constexpr int kParts = 4000;
    for (int k = 0; k < kParts; ++k) white_ += through((k + 0.5) / kParts * kPi / interval);
    white_ *= angle_step * angle_step / 12 / kParts;
  }
  [[nodiscard]] double white() const noexcept { return white_; }
  [[nodiscard]] double teeth(double speed) const {
    const double turns = 2 * kPi * std::abs(speed) / angle_step_;
    double sum = 0;
    for (int k = 1; k <= kHarmonics; ++k) {
      const double harmonic = through(k * turns) / (k * k);
      sum += harmonic;
      if (harmonic <= 1e-6 * sum) break;
    }
    return 0.5 * angle_step_ * angle_step_ / (kPi * kPi) * sum;
  }

 private:
  static constexpr int kHarmonics = 12;  // a joint whose steps pass more of them stands still

  [[nodiscard]] double through(double turns) const {
    const double passes = turns * passes_(turns);
    return passes * passes;
  }
  Passes passes_;
  double angle_step_, white_ = 0;
};

/// The wider way where what the two differ by is no more than the steps make of the narrow one; `among_teeth`: only about where their teeth stand out.
void quieten_steps(TwoWays& both, const OfSteps& steps, double wide_sigma, bool among_teeth) {
  std::vector<double> expected(both.slow.size()), stand_out(both.slow.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    const double teeth = steps.teeth(both.slow[k]);
    expected[k] = std::max(steps.white(), teeth);
    stand_out[k] = teeth > steps.white() ? 1.0 : 0.0;
  }
  std::vector<double> share = share_beyond(wide_low_pass(expected, 2 * wide_sigma), both, wide_sigma);
  if (among_teeth) {
    constexpr double kPartOfReach = 0.25;  // of the time within the kernel
    stand_out = wide_low_pass(stand_out, wide_sigma);
    for (std::size_t k = 0; k < share.size(); ++k)
      share[k] = std::max(share[k], 1 - stand_out[k] / kPartOfReach);
  }
  mix(share, both.slow, both.narrow);
}

bool is_known(double angle_step) {
  return std::isfinite(angle_step) && angle_step > 0;
}

}  // namespace

std::vector<double> quiet_velocity(std::span<const double> raw_angle, double sigma, double interval,
                                   double angle_step) {
  const double seconds = sigma * interval, wide = kQuietKernel / interval,
               wider = kQuietKernelOfSlowTurns / interval;
  if (!is_known(angle_step) || wide <= sigma) return low_pass_derivative(raw_angle, sigma, interval, 1);
  TwoWays both = two_ways(raw_angle, sigma, wide, interval, 1);
  quieten_steps(both, OfSteps(by_kernel(seconds), angle_step, interval), wide, false);
  both.slow = two_ways(raw_angle, sigma, wider, interval, 1).slow;
  quieten_steps(both, OfSteps(by_wider(seconds, kQuietKernel), angle_step, interval), wider, true);
  return std::move(both.narrow);
}

std::vector<double> quiet_acceleration(std::span<const double> raw_angle, double sigma, double interval,
                                       double angle_step) {
  const double wide = kQuietKernelOfAcceleration / interval;
  if (!is_known(angle_step) || wide <= sigma) return low_pass_derivative(raw_angle, sigma, interval, 2);
  TwoWays both = two_ways(raw_angle, sigma, wide, interval, 2);
  mix(share_beyond_steps(both, sigma, wide, interval, angle_step, 2), both.slow, both.narrow);
  return std::move(both.narrow);
}

std::vector<unsigned char> beats_with_clock(std::span<const double> velocity, double interval,
                                            double angle_step) {
  constexpr double kSmooth = 0.05;                    // s
  constexpr double kPassesKernel = 40, kWhile = 0.1;  // Hz, s
  std::vector<unsigned char> beats(velocity.size(), 0);
  if (!is_known(angle_step) || velocity.size() < 2) return beats;
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
  if (!is_known(angle_step) || wide <= sigma)
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
  const double still = is_known(angle_step) ? angle_step / kSlowestStep : 0.0;
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
