#include "isac/tune/procedure.hpp"

#include <algorithm>
#include <cmath>

#include "isac/tune/rules.hpp"

namespace isac::tune {
namespace {

constexpr double kInnerUse = 0.4;
constexpr double kOvershoot = 0.10;
constexpr double kOvershootOfP = 0.05;  // half is left to the I part
constexpr double kMostIntegral = 2;     // 1/s, K_I/K_P of the position loop: the greatest of the seed's (5.3)

double overshoot_of(const JointModel& joint, const Gains& gains, const ClosedLoopOptions& options) {
  const StepFigures f = step_figures(run_step(joint, joint, gains, options), kStepHeight);
  return f.bounded ? f.overshoot : 10.0;
}

/// The greatest gain in [low, high] with at most `limit` of overshoot, which grows with it.
double largest(double low, double high, double limit, const std::function<double(double)>& overshoot) {
  if (overshoot(high) <= limit) return high;
  for (int i = 0; i < 14; ++i) {
    const double middle = 0.5 * (low + high);
    (overshoot(middle) > limit ? high : low) = middle;
  }
  return low;
}

/// Greatest share by which the modelled torque overshoots a step of the torque asked for: z² − z (1 − a − b) − a.
double torque_overshoot(double a, double b) {
  double u = 0, integral = 0, most = 0;
  for (int k = 0; k < 400; ++k) {
    const double e = 1 - u;  // u: torque per torque asked for
    integral += b * e;
    u = a * e + integral;
    most = std::max(most, u - 1);
  }
  return most;
}

}  // namespace

control::PidGains<double> inner_gains(const JointModel& joint, const Sampling& sampling) noexcept {
  const double gain = joint.muscle.B * joint.wheel_radius, h = sampling.interval;
  // a + b/2 = use and (1 + a) h/b = outer interval: b = (1 + a)/outer_every.
  const double n = sampling.outer_every;
  double a = (kInnerUse - 0.5 / n) / (1 + 0.5 / n), b = (1 + a) / n;
  while (b > 1e-3 && torque_overshoot(a, b) > kOvershoot) b *= 0.9;
  return {.proportional = a / gain, .integral = b / (gain * h)};
}

std::optional<Gains> tune_by_procedure(const JointModel& joint, const ClosedLoopOptions& options,
                                       const control::PidGains<double>* keep_inner) {
  Gains gains;
  gains.torque = keep_inner != nullptr ? *keep_inner : inner_gains(joint, options.sampling);
  const std::optional<Ultimate> critical = ultimate(outer_loop(joint, gains, options.sampling));
  if (!critical) return {};
  const auto with = [&](double p, double i) {
    Gains g = gains;
    g.position = {.proportional = p, .integral = i};
    return g;
  };
  const double p = largest(0.0, 0.5 * critical->gain, kOvershootOfP,
                           [&](double k) { return overshoot_of(joint, with(k, 0), options); });
  const double i = largest(0.0, kMostIntegral * p, kOvershoot,
                           [&](double k) { return overshoot_of(joint, with(p, k), options); });
  return with(p, i);
}

std::optional<Gains> tune_outer_by_ziegler_nichols(const JointModel& joint,
                                                   const control::PidGains<double>& inner,
                                                   const Sampling& sampling) {
  Gains gains;
  gains.torque = inner;
  const std::optional<Ultimate> critical = ultimate(outer_loop(joint, gains, sampling));
  if (!critical) return {};
  gains.position = ziegler_nichols(*critical, Form::kPi);
  return gains;
}

}  // namespace isac::tune
