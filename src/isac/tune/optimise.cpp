#include "isac/tune/optimise.hpp"

#include <nlopt.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/control/stability.hpp"

namespace isac::tune {
namespace {

constexpr double kMostInnerUse = 0.5;  // of the sampled torque loop's border
constexpr double kMostRest =
    0.05;  // of a step, missing after two seconds: gains that never arrive track as well as others
constexpr double kUnstable = 1e3;

/// What is searched for, as logarithms: of a PID its gains; of a cascade the same, but of the position loop's K_I/K_P what it has
/// beyond `least`, so that no gain can be found below it.
std::vector<double*> members(Gains& g) {
  if (g.structure == control::Structure::kPid)
    return {&g.position.proportional, &g.position.integral, &g.position.derivative};
  return {&g.position.proportional, &g.position.integral, &g.torque.proportional, &g.torque.integral};
}

class Search {
 public:
  Search(const JointModel& model, std::span<const JointModel> joints, const Gains& form,
         const OptimiseOptions& options)
      : model_(model), joints_(joints), form_(form), options_(options) {}

  [[nodiscard]] Gains gains_of(const double* x) const {
    Gains g = form_;
    std::size_t i = 0;
    for (double* gain : members(g)) *gain = std::exp(x[i++]);
    if (g.structure != control::Structure::kPid)
      g.position.integral = g.position.proportional * (g.position.integral + options_.least_integral);
    return g;
  }

  double cost(const double* x) {
    if (options_.stop && options_.stop()) {
      stopped_ = true;
      return kUnstable;
    }
    ++evaluations_;
    const Gains g = gains_of(x);
    double penalty = 0, sum = 0;
    if (g.structure == control::Structure::kModelBased) {
      const control::CascadeLoop<double> loop{model_.muscle, model_.wheel_radius, model_.inertia,
                                              model_.valve,  g.position,          g.torque};
      penalty +=
          std::max(0.0, control::inner_loop_use(loop, options_.loop.sampling.interval) - kMostInnerUse);
      if (penalty > 0.2) return kUnstable * (1 + penalty);
    }
    // Margins first: they cost a hundredth of a simulation, and an unstable loop needs none.
    for (const JointModel& joint : joints_) {
      const Margins m = margins(control_loop(joint, g, options_.loop.sampling, model_));
      if (!m.stable) return kUnstable * (2 - m.modulus);
      penalty += std::max(0.0, options_.limits.modulus * (1 + options_.spare) - m.modulus);
    }
    for (const JointModel& joint : joints_) {
      const StepFigures s = step_figures(run_step(model_, joint, g, options_.loop), kStepHeight);
      const TrackingFigures t = tracking_figures(run_trajectory(model_, joint, g, options_.loop));
      if (!s.bounded || !t.bounded) return kUnstable;
      penalty += std::max(0.0, s.overshoot - options_.limits.overshoot * (1 - options_.spare));
      penalty += std::max(0.0, s.rest - kMostRest);
      sum += t.rms + options_.itae_weight * s.itae + options_.effort_weight * t.effort;
    }
    const double n = static_cast<double>(joints_.size());
    const double value =
        sum / n + penalty;  // rad, and shares counted as rad: a percent too much weighs 10 mrad
    const bool holds = penalty <= 0;
    if ((holds && !best_holds_) || (holds == best_holds_ && value < best_)) {
      best_ = value;
      best_holds_ = holds;
      best_x_.assign(x, x + static_cast<std::ptrdiff_t>(count()));
    }
    return value;
  }

  void run(std::vector<double> x, int evaluations) {
    nlopt_opt search = nlopt_create(NLOPT_LN_SBPLX, static_cast<unsigned>(count()));
    nlopt_set_min_objective(
        search,
        [](unsigned, const double* at, double*, void* self) { return static_cast<Search*>(self)->cost(at); },
        this);
    std::vector<double> low = x, high = x;
    for (std::size_t i = 0; i < x.size(); ++i) low[i] -= std::log(100.0), high[i] += std::log(100.0);
    nlopt_set_lower_bounds(search, low.data());
    nlopt_set_upper_bounds(search, high.data());
    nlopt_set_initial_step1(search, 0.4);
    nlopt_set_maxeval(search, evaluations);
    nlopt_set_ftol_rel(search, 1e-4);
    nlopt_set_xtol_rel(search, 1e-4);
    double value = 0;
    static_cast<void>(nlopt_optimize(search, x.data(), &value));  // any way it ends, the best is kept
    nlopt_destroy(search);
  }

  [[nodiscard]] std::size_t count() const {
    Gains g = form_;
    return members(g).size();
  }
  [[nodiscard]] const std::vector<double>& best_x() const { return best_x_; }
  [[nodiscard]] double best() const { return best_; }
  [[nodiscard]] bool holds() const { return best_holds_; }
  [[nodiscard]] int evaluations() const { return evaluations_; }

 private:
  const JointModel& model_;
  std::span<const JointModel> joints_;
  Gains form_;
  const OptimiseOptions& options_;
  std::vector<double> best_x_;
  double best_ = std::numeric_limits<double>::infinity();
  bool best_holds_ = false, stopped_ = false;
  int evaluations_ = 0;
};

/// A gain that is zero begins at a hundredth of its loop's proportional one (per second, seconds).
std::vector<double> logarithms(Gains gains, double least_integral) {
  std::vector<double> x;
  for (control::PidGains<double>* loop : {&gains.position, &gains.torque})
    for (double* k : {&loop->integral, &loop->derivative})
      if (!(*k > 0)) *k = 0.01 * loop->proportional;
  if (gains.structure != control::Structure::kPid)
    gains.position.integral =
        std::max(0.01, gains.position.integral / gains.position.proportional - least_integral);
  for (const double* gain : members(gains)) x.push_back(std::log(*gain));
  return x;
}

struct Judged {
  double good_share = 0;
  std::size_t overshooting = 0, fragile = 0;  ///< the draws at the quantiles
};

Judged judge(const JointModel& model, std::span<const JointModel> draws, const Gains& gains,
             const OptimiseOptions& options) {
  std::vector<std::pair<double, std::size_t>> overshoot, modulus;
  int good = 0;
  for (std::size_t i = 0; i < draws.size(); ++i) {
    const Margins m = margins(control_loop(draws[i], gains, options.loop.sampling, model));
    const StepFigures s = step_figures(run_step(model, draws[i], gains, options.loop), kStepHeight);
    overshoot.emplace_back(s.bounded ? s.overshoot : 10.0, i);
    modulus.emplace_back(m.stable ? m.modulus : 0.0, i);
    good +=
        overshoot.back().first <= options.limits.overshoot && modulus.back().first >= options.limits.modulus
            ? 1
            : 0;
  }
  std::sort(overshoot.begin(), overshoot.end());
  std::sort(modulus.begin(), modulus.end());
  const double last = static_cast<double>(draws.size() - 1);
  return {.good_share = good / (last + 1),
          .overshooting = overshoot[static_cast<std::size_t>(0.97 * last)].second,
          .fragile = modulus[static_cast<std::size_t>(0.03 * last)].second};
}

}  // namespace

Optimised optimise(const JointModel& model, std::span<const JointModel> draws,
                   const std::vector<Gains>& starts, const OptimiseOptions& options) {
  Optimised out;
  if (starts.empty()) return out;
  out.gains = starts.front();
  const JointModel nominal[] = {model};
  Search first(model, nominal, starts.front(), options);
  for (const Gains& start : starts)
    first.run(logarithms(start, options.least_integral), options.nominal_evaluations);
  out.evaluations = first.evaluations();
  if (first.best_x().empty()) return out;
  out.gains = first.gains_of(first.best_x().data());
  out.objective = first.best();
  out.found = first.holds();
  if (draws.empty()) return out;
  std::vector<JointModel> critical = {model};
  for (int round = 0; round <= options.rounds; ++round) {
    const Judged judged = judge(model, draws, out.gains, options);
    out.good_share = judged.good_share;
    out.found = judged.good_share >= options.limits.share;
    if (judged.good_share >= std::min(1.0, options.limits.share + options.share_spare) && round > 0) break;
    if (round == options.rounds || (options.stop && options.stop())) break;
    critical.push_back(draws[judged.overshooting]);
    if (judged.fragile != judged.overshooting) critical.push_back(draws[judged.fragile]);
    Search search(model, critical, starts.front(), options);
    search.run(logarithms(out.gains, options.least_integral), options.round_evaluations);
    out.evaluations += search.evaluations();
    if (search.best_x().empty()) break;
    out.gains = search.gains_of(search.best_x().data());
    out.objective = search.best();
  }
  return out;
}

}  // namespace isac::tune
