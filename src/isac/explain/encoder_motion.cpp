#include "isac/explain/encoder_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "isac/core/units.hpp"
#include "isac/explain/filters.hpp"

namespace isac::explain {
namespace {

constexpr double kWideKernel = 0.020;              // s, for velocities that the encoder resolves badly
constexpr double kQuietKernel = 0.015;             // s, for velocities that change slowly
constexpr double kQuietKernelOfSlowTurns = 0.030;  // s, where the steps are further apart than that
constexpr double kNoMoreThanSteps = 1.5, kNoMoreThanSmoothSteps = 10;  // times their power
constexpr double kQuietKernelOfAcceleration = 0.025;                   // s, beside a narrow one of 0.020 s
constexpr double kQuietKernelOfSwing = 0.050;  // s, which a resonance of up to 18 Hz does not hear

/// By the kernel, and by a wider one.
struct TwoWays {
  std::vector<double> narrow, slow;
};

std::vector<double> derivative_of(std::span<const double> x, double sigma, double interval, int order) {
  return order == 0 ? low_pass(x, sigma) : low_pass_derivative(x, sigma, interval, order);
}

/// 1 − α, α = σ²/σ_w².
double bend_of(double sigma, double wide_sigma) {
  return 1 - sigma * sigma / (wide_sigma * wide_sigma);
}

/// w = g_w′ ∗ φ, u = 1 − g_w∗: w + (1 − α) u w + ½ (1 − α)(2 − α) u² w, α = σ²/σ_w², the beginning of (1 − u)^(α−1) w, has the second and the
/// fourth moment of g: a smooth motion passes it as it passes g′. (With the second alone a hand's reversals left 8e-5 N m s of a velocity that
/// is remembered for 0.1 s, two sigma in every day.)
std::vector<double> by_wider_way(std::span<const double> raw_angle, double sigma, double wide_sigma,
                                 double interval, int order) {
  const std::vector<double> wide = derivative_of(raw_angle, wide_sigma, interval, order),
                            wider = low_pass(wide, wide_sigma), widest = low_pass(wider, wide_sigma);
  const double bend = bend_of(sigma, wide_sigma), second = 0.5 * bend * (1 + bend);
  std::vector<double> slow(wide.size());
  for (std::size_t k = 0; k < wide.size(); ++k)
    slow[k] = wide[k] + bend * (wide[k] - wider[k]) + second * (wide[k] - 2 * wider[k] + widest[k]);
  return slow;
}

TwoWays two_ways(std::span<const double> raw_angle, double sigma, double wide_sigma, double interval,
                 int order) {
  return {.narrow = derivative_of(raw_angle, sigma, interval, order),
          .slow = by_wider_way(raw_angle, sigma, wide_sigma, interval, order)};
}

std::vector<double> difference_of(const TwoWays& both) {
  std::vector<double> difference(both.slow.size());
  for (std::size_t k = 0; k < difference.size(); ++k) difference[k] = both.narrow[k] - both.slow[k];
  return difference;
}

/// 0 where the power of x is no more than `most` times what is expected, 1 where it is twice as much.
std::vector<double> share_beyond(const std::vector<double>& expected, std::vector<double> x,
                                 double wide_sigma, double most) {
  for (double& v : x) v *= v;
  std::vector<double> share = wide_low_pass(x, 2 * wide_sigma);
  for (std::size_t k = 0; k < share.size(); ++k)
    share[k] = std::clamp((share[k] / expected[k] - most) / most, 0.0, 1.0);
  return share;
}

/// Of what two accelerations differ by, beside the encoder's steps as white noise.
std::vector<double> share_beyond_steps(const TwoWays& both, double sigma, double wide_sigma, double interval,
                                       double angle_step) {
  double gain = 0;  // of white noise by the second derivative
  for (const double g : gaussian(std::max(sigma, 1.0), 2)) gain += g * g;
  const double expected = angle_step * angle_step / 12 * gain / std::pow(interval, 4);
  return share_beyond(std::vector<double>(both.slow.size(), expected), difference_of(both), wide_sigma,
                      kNoMoreThanSteps);
}

void mix(const std::vector<double>& share, const std::vector<double>& slow, std::vector<double>& narrow) {
  for (std::size_t k = 0; k < narrow.size(); ++k) narrow[k] = slow[k] + share[k] * (narrow[k] - slow[k]);
}

/// What a low-pass leaves of a frequency, rad/s.
using Passes = std::function<double(double)>;

Passes by_kernel(double seconds) {
  return [seconds](double turns) { return std::exp(-0.5 * turns * seconds * turns * seconds); };
}

/// By a wider kernel and its own bend (by_wider_way).
Passes by_wider(double seconds, double wide_seconds) {
  return [=](double turns) {
    const double g = by_kernel(wide_seconds)(turns), u = 1 - g, bend = bend_of(seconds, wide_seconds);
    return g * (1 + bend * u * (1 + 0.5 * (1 + bend) * u));
  };
}

/// What an encoder's steps make of a low-passed velocity, (rad/s)²: of white noise, and of the teeth of a saw, |φ̇|/step in a second, from a table by
/// speed. `seconds`: of a kernel that passes no less.
class OfSteps {
 public:
  OfSteps(const Passes& passes, double seconds, double angle_step, double interval) {
    const auto through = [&](double turns) {
      const double velocity = turns * passes(turns);
      return velocity * velocity;
    };
    for (int k = 0; k < kParts; ++k) white_ += through((k + 0.5) / kParts * kPi / interval);
    white_ *= angle_step * angle_step / 12 / kParts;
    const double fastest = kNothing / seconds;  // rad/s of a first harmonic
    per_speed_ = 2 * kPi / angle_step * kParts / fastest;
    for (int i = 0; i <= kParts; ++i) {
      const double turns = fastest * i / kParts;
      for (int k = 1; k <= kHarmonics && k * turns < fastest; ++k)
        teeth_[static_cast<std::size_t>(i)] += through(k * turns) / (k * k);
      teeth_[static_cast<std::size_t>(i)] *= 0.5 * angle_step * angle_step / (kPi * kPi);
    }
  }
  [[nodiscard]] double white() const noexcept { return white_; }
  [[nodiscard]] double teeth(double speed) const noexcept {
    const double at = std::abs(speed) * per_speed_;
    if (!(at < kParts)) return 0;
    const auto i = static_cast<std::size_t>(at);
    return teeth_[i] + (at - static_cast<double>(i)) * (teeth_[i + 1] - teeth_[i]);
  }
  [[nodiscard]] bool stand_out(double speed) const noexcept { return teeth(speed) > white_; }

 private:
  static constexpr int kParts = 500, kHarmonics = 12;  // a joint whose steps pass more of them stands still
  static constexpr double kNothing = 6;                // e^(−½ 6²) is

  double white_ = 0, per_speed_ = 0;
  std::array<double, kParts + 1> teeth_{};
};

/// Two low-passes of a velocity, what they leave of the encoder's steps, and of the steps in the smooth part of their difference.
struct StepsOfTwoWays {
  StepsOfTwoWays(const Passes& narrow, double seconds, const Passes& slow, double wide_seconds,
                 double angle_step, double interval)
      : of_narrow(narrow, seconds, angle_step, interval),
        smooth([&narrow, &slow, kernel = by_kernel(wide_seconds)](
                   double turns) { return (narrow(turns) - slow(turns)) * kernel(turns); },
               seconds, angle_step, interval) {}
  OfSteps of_narrow, smooth;
};

std::vector<double> expected_of(const OfSteps& steps, const std::vector<double>& speed, double wide_sigma) {
  std::vector<double> expected(speed.size());
  for (std::size_t k = 0; k < expected.size(); ++k)
    expected[k] = std::max(steps.white(), steps.teeth(speed[k]));
  return wide_low_pass(expected, 2 * wide_sigma);
}

/// The wider way where it loses nothing of the motion: where what the two differ by is no more than the steps make of the narrow one, and where what
/// is smooth of it, to which the steps give little, is no more than they give.
std::vector<double> share_of_narrow(const TwoWays& both, const StepsOfTwoWays& steps, double wide_sigma) {
  const std::vector<double> difference = difference_of(both);
  std::vector<double> share = share_beyond(expected_of(steps.of_narrow, both.slow, wide_sigma), difference,
                                           wide_sigma, kNoMoreThanSteps);
  const std::vector<double> of_motion =
      share_beyond(expected_of(steps.smooth, both.slow, wide_sigma), low_pass(difference, wide_sigma),
                   wide_sigma, kNoMoreThanSmoothSteps);
  for (std::size_t k = 0; k < share.size(); ++k) share[k] = std::max(share[k], of_motion[k]);
  return share;
}

/// How much of the time within a kernel the teeth stand out of the steps' white noise.
std::vector<double> teeth_stand_out(const OfSteps& steps, const std::vector<double>& speed, double sigma) {
  std::vector<double> out(speed.size());
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = steps.stand_out(speed[k]) ? 1.0 : 0.0;
  return wide_low_pass(out, sigma);
}

bool is_known(double angle_step) {
  return std::isfinite(angle_step) && angle_step > 0;
}

}  // namespace

std::vector<double> quiet_velocity(std::span<const double> raw_angle, double sigma, double interval,
                                   double angle_step) {
  constexpr double kPartOfReach = 0.25;  // of the wider kernel, among teeth: there it counts in full
  const double seconds = std::max(sigma, 1.0) * interval, wide = kQuietKernel / interval,
               wider = kQuietKernelOfSlowTurns / interval;
  if (!is_known(angle_step) || wide <= sigma) return low_pass_derivative(raw_angle, sigma, interval, 1);
  TwoWays both = two_ways(raw_angle, sigma, wide, interval, 1);
  const Passes narrow = by_kernel(seconds), quiet = by_wider(sigma * interval, kQuietKernel),
               quieter = by_wider(sigma * interval, kQuietKernelOfSlowTurns);
  mix(share_of_narrow(both, {narrow, seconds, quiet, kQuietKernel, angle_step, interval}, wide), both.slow,
      both.narrow);
  const StepsOfTwoWays left(quiet, kQuietKernel, quieter, kQuietKernelOfSlowTurns, angle_step, interval);
  if (std::none_of(both.slow.begin(), both.slow.end(), [&](double v) { return left.of_narrow.stand_out(v); }))
    return std::move(both.narrow);
  both.slow = by_wider_way(raw_angle, sigma, wider, interval, 1);
  const std::vector<double> among_teeth = teeth_stand_out(left.of_narrow, both.slow, wider);
  std::vector<double> share = share_of_narrow(both, left, wider);
  for (std::size_t k = 0; k < share.size(); ++k)
    share[k] = std::max(share[k], 1 - among_teeth[k] / kPartOfReach);
  mix(share, both.slow, both.narrow);
  return std::move(both.narrow);
}

std::vector<double> quiet_acceleration(std::span<const double> raw_angle, double sigma, double interval,
                                       double angle_step) {
  const double wide = kQuietKernelOfAcceleration / interval;
  if (!is_known(angle_step) || wide <= sigma) return low_pass_derivative(raw_angle, sigma, interval, 2);
  TwoWays both = two_ways(raw_angle, sigma, wide, interval, 2);
  mix(share_beyond_steps(both, sigma, wide, interval, angle_step), both.slow, both.narrow);
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
  const std::vector<double> share = share_beyond_steps(orders[2], sigma, wide, interval, angle_step);
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
