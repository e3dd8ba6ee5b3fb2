#include "isac/tune/assess.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/control/stability.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/simulate/random.hpp"

namespace isac::tune {
namespace {

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      static_cast<std::ptrdiff_t>(std::floor(share * static_cast<double>(values.size() - 1) + 0.5));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

StepFigures step_of(const JointModel& model, const JointModel& joint, const Gains& gains,
                    const ClosedLoopOptions& options) {
  return step_figures(run_step(model, joint, gains, options), kStepHeight);
}

Gains scaled(Gains gains, double factor) {
  for (double* k : {&gains.position.proportional, &gains.position.integral, &gains.position.derivative})
    *k *= factor;
  return gains;
}

/// Do 95 % of the draws keep the overshoot, and 95 % the modulus margin?
bool within(std::span<const JointModel> draws, const JointModel& model, const Gains& gains,
            const Limits& limits, const ClosedLoopOptions& options) {
  std::vector<double> modulus, overshoot;
  for (const JointModel& joint : draws) {
    const Margins m = margins(control_loop(joint, gains, options.sampling, model));
    modulus.push_back(m.stable ? m.modulus : 0.0);
  }
  if (quantile(std::move(modulus), 0.05) < limits.modulus) return false;
  for (const JointModel& joint : draws) {
    const StepFigures s = step_of(model, joint, gains, options);
    overshoot.push_back(s.bounded ? s.overshoot : 10.0);
  }
  return quantile(std::move(overshoot), 0.95) <= limits.overshoot;
}

}  // namespace

RelativeCovariance independent(const std::array<double, kDrawnParameters>& relative_errors) {
  RelativeCovariance covariance{};
  for (std::size_t i = 0; i < kDrawnParameters; ++i)
    covariance[i * kDrawnParameters + i] = relative_errors[i] * relative_errors[i];
  return covariance;
}

std::vector<JointModel> draw_joints(const JointModel& model, const RelativeCovariance& covariance, int count,
                                    std::uint64_t seed) {
  using Matrix = Eigen::Matrix<double, kDrawnParameters, kDrawnParameters, Eigen::RowMajor>;
  const estimate::SymmetricEigen eigen =
      estimate::symmetric_eigen(Eigen::Map<const Matrix>(covariance.data()));
  const Matrix root = eigen.vectors * eigen.values.cwiseMax(0.0).cwiseSqrt().asDiagonal();
  simulate::Random random(seed, 1);
  std::vector<JointModel> joints;
  while (static_cast<int>(joints.size()) < count) {
    Eigen::Matrix<double, kDrawnParameters, 1> normal;
    for (int i = 0; i < kDrawnParameters; ++i) normal[i] = random.normal();
    const Eigen::Matrix<double, kDrawnParameters, 1> factor = (root * normal).array() + 1.0;
    if (!(factor.minCoeff() > 0.05)) continue;  // no joint: a sign would turn
    JointModel j = model;
    j.muscle.A *= factor[kDrawA];
    j.muscle.B *= factor[kDrawB];
    j.muscle.C *= factor[kDrawC];
    j.muscle.D *= factor[kDrawD];
    j.inertia *= factor[kDrawInertia];
    j.valve.gain *= factor[kDrawValveGain];
    j.valve.lag *= factor[kDrawLag];
    j.valve.dead_time *= factor[kDrawDeadTime];
    joints.push_back(j);
  }
  return joints;
}

Assessment assess(const JointModel& model, std::span<const JointModel> draws, const Gains& gains,
                  const Limits& limits, const ClosedLoopOptions& options) {
  Assessment a;
  a.draws = static_cast<int>(draws.size());
  a.margins = margins(control_loop(model, gains, options.sampling));
  a.modulus = a.margins.stable ? a.margins.modulus : 0;
  if (gains.structure == control::Structure::kModelBased) {
    const control::CascadeLoop<double> loop{model.muscle, model.wheel_radius, model.inertia,
                                            model.valve,  gains.position,     gains.torque};
    a.inner_use = control::inner_loop_use(loop, options.sampling.interval);
  }
  const auto step = [&](const JointModel& joint) { return step_of(model, joint, gains, options); };
  const auto track = [&](const JointModel& joint) {
    return tracking_figures(run_trajectory(model, joint, gains, options));
  };
  const StepFigures nominal = step(model);
  a.overshoot = nominal.overshoot;
  a.rise = nominal.rise;
  a.settling = nominal.settling;
  a.itae = nominal.itae;
  std::vector<double> tracking, overshoot, effort, modulus;
  int stable = 0, good = 0;
  for (const JointModel& joint : draws) {
    const Margins m = margins(control_loop(joint, gains, options.sampling, model));
    const StepFigures s = step(joint);
    const TrackingFigures t = track(joint);
    const bool holds = m.stable && s.bounded && t.bounded && a.inner_use < 1;
    stable += holds ? 1 : 0;
    good += holds && s.overshoot <= limits.overshoot && m.modulus >= limits.modulus ? 1 : 0;
    modulus.push_back(m.stable ? m.modulus : 0.0);
    overshoot.push_back(s.bounded ? s.overshoot : 10.0);
    if (t.bounded) tracking.push_back(t.rms), effort.push_back(t.effort);
  }
  if (draws.empty()) {
    const TrackingFigures t = track(model);
    if (t.bounded) tracking.push_back(t.rms), effort.push_back(t.effort);
    overshoot.push_back(nominal.overshoot);
    modulus.push_back(a.modulus);
  } else {
    a.stable_share = stable / static_cast<double>(draws.size());
    a.good_share = good / static_cast<double>(draws.size());
  }
  a.tracking = tracking.empty() ? std::numeric_limits<double>::infinity() : mean(tracking);
  a.tracking_p95 = tracking.empty() ? a.tracking : quantile(tracking, 0.95);
  a.effort = mean(effort);
  a.overshoot_p95 = quantile(overshoot, 0.95);
  a.modulus_p05 = quantile(modulus, 0.05);
  return a;
}

std::string refusal(const Assessment& a, const Limits& limits) {
  if (!a.margins.stable) return "the loop would be unstable on the identified joint itself";
  if (a.inner_use >= 1) return "the sampled torque loop would swing from tick to tick";
  if (a.stable_share < limits.share)
    return fmt::format(
        "only {:.1f} % of the joints that the parameters allow would be stable ({:.0f} % asked for)",
        100 * a.stable_share, 100 * limits.share);
  if (a.good_share < limits.share)
    return fmt::format(
        "only {:.1f} % of the joints that the parameters allow would hold the limits: overshoot of {:.0f} % "
        "(the worst twentieth reaches "
        "{:.1f} %), modulus margin of {:.2f} (the worst twentieth {:.2f})",
        100 * a.good_share, 100 * limits.overshoot, 100 * a.overshoot_p95, limits.modulus, a.modulus_p05);
  return {};
}

std::optional<Gains> brought_to_limits(std::span<const JointModel> draws, const JointModel& model,
                                       const Gains& gains, const Limits& limits,
                                       const ClosedLoopOptions& options) {
  // Neither margin nor overshoot need be monotone in the gain (a cascade may want enough of it): from above, in steps of a tenth.
  constexpr double kStep = 1.1;
  const auto holds = [&](double factor) {
    return within(draws, model, scaled(gains, factor), limits, options);
  };
  double factor = 10;
  while (factor > 0.05 && !holds(factor)) factor /= kStep;
  if (!(factor > 0.05)) return {};
  double low = factor, high = factor * kStep;
  for (int i = 0; i < 4; ++i) {
    const double middle = std::sqrt(low * high);
    (holds(middle) ? low : high) = middle;
  }
  return scaled(gains, low);
}

}  // namespace isac::tune
