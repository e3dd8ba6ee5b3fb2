#include "isac/explain/ranking.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>

#include "isac/explain/generic_fit.hpp"
#include "isac/explain/slip_moment.hpp"

namespace isac::explain {
namespace {

// Sigma that a general case must lead a simpler one by to stand first, and to stand beside it. If the general one is true and s sigma of
// data lie between the two, it leads by s/2: with less than three they are twins.
constexpr double kNestedLimit = 1.5, kNestedDoubt = 0.75;
constexpr double kHardlyMore = 1.25;  // of the friction in motion: at rest it is nearly the same
constexpr double kErrAlike = 0.1;     // of the larger: two sensors err by the same
constexpr double kCoincidence = 3;    // sigma: as seldom do two sensors err by the same
constexpr double kOneInAHundred = 2.33;
constexpr double kLimitReach =
    8;  // sigma: what a limit case leads its simple case by is how roughly it is reached

}  // namespace

bool Ranking::is_dry(const Trial& t) const {
  const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
  return h.dry && h.info().state_count == 0;
}

int Ranking::parameters_of(const Trial& t) const {
  const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
  // Between two runs there is one moment, within a run the best of many.
  const bool within =
      is_slip(h) && std::any_of(data_.runs.begin(), data_.runs.end(), [&](const PreparedRun& run) {
        return !run.time.empty() && t.values[1] > run.day_offset &&
               t.values[1] < run.day_offset + run.time.back();
      });
  return h.parameters() + (within ? kChoosingOne : 0);
}
std::string Ranking::id_of(const Trial& t) const {
  return library_.hypotheses[static_cast<std::size_t>(t.hypothesis)].id();
}

bool Ranking::share_readings(const Trial& a, const Trial& b) const {
  const auto chains = [&](const Trial& t) {
    return together_with(library_.hypotheses[static_cast<std::size_t>(t.hypothesis)].chains);
  };
  return (chains(a) & chains(b)) != 0;
}

bool Ranking::is_limit_case(int hypothesis, const Values& values) const {
  const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(hypothesis)];
  if (std::string_view(h.info().id) == "stribeck_friction" && values[1] < kHardlyMore * values[0])
    return true;
  for (int i = 0; i < h.info().parameter_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto& parameter = h.info().parameters[i];
    if (!h.free[k] || std::isfinite(parameter.null_value)) continue;
    // The loss is flat there: a tenth is near enough.
    const double low = h.lower[k] + 0.1 * std::abs(h.lower[k]),
                 high = h.upper[k] - 0.1 * std::abs(h.upper[k]);
    if (values[k] <= low || values[k] >= high) return true;
    if (h.dry && std::string_view(parameter.unit) == "rad" && values[k] < 3 * data_.rig.angle_step)
      return true;
  }
  return false;
}

std::size_t Ranking::simple_case_of_limit(const std::vector<Trial>& trials, const Values& values) const {
  if (trials.empty() || !is_limit_case(trials.front().hypothesis, values)) return 0;
  for (std::size_t i = 1; i < trials.size(); ++i)
    if (nests(id_of(trials.front()), id_of(trials[i])) && trials[i].behind.t < kLimitReach) return i;
  return 0;
}

bool Ranking::err_alike(const Trial& t) const {
  const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
  if (h.info().where != models::Subsystem::kSensor || h.info().parameter_count != 2 || !h.amplitude[0] ||
      !h.amplitude[1] || !h.free[0] || !h.free[1])
    return false;
  const double a = t.values[0] - h.info().parameters[0].null_value,
               b = t.values[1] - h.info().parameters[1].null_value;
  return std::abs(a - b) < kErrAlike * std::max(std::abs(a), std::abs(b));
}

bool Ranking::is_one_cause_of_both(const Trial& t, const Trial& both) const {
  if (!err_alike(both)) return false;
  const std::string sensors = id_of(both), cause = id_of(t);
  return sensors == "force_gain_error" ? cause == "inertia_error" || cause == "encoder_gain"
                                       : sensors == "pressure_offset" && cause == "pressure_gain_error";
}

/// Nothing forbids it, and of two that the data cannot tell apart the other is told first: what was added to a joint is seldom less than nothing.
bool Ranking::is_against_its_name(const Trial& t) const {
  return id_of(t) == "inertia_error" && t.values[0] < 0;
}

/// An inertia is estimated, the steps of a turn are counted: of the two, which are one equation, a joint that is heavier than was said is told first.
bool Ranking::is_likelier_cause(const Trial& t, const Trial& than) const {
  return id_of(t) == "inertia_error" && t.values[0] > 0 && id_of(than) == "encoder_gain";
}

/// Both sensors' zeros off by the same are what a valve zero is, and as likely: no general case that happens to fit.
bool Ranking::are_two_causes_of_one(const Trial& general, const Trial& simple) const {
  return id_of(general) == "pressure_offset" && id_of(simple) == "pressure_gain_error" &&
         compare(data_, simple.residual, general.residual, 0, noise_density(data_, simple.residual))
                 .separation < kTwinLimit;
}

bool goes_with_pressure(const Hypothesis& friction, const Values& values) {
  constexpr double kGoesWithIt = 0.5;  // the power
  return std::string_view(friction.info().id) == "pressure_dependent_friction" && values[1] > kGoesWithIt;
}

bool Ranking::are_two_frictions(const Trial& by_pressure, const Trial& plain) const {
  return goes_with_pressure(library_.hypotheses[static_cast<std::size_t>(by_pressure.hypothesis)],
                            by_pressure.values) &&
         id_of(plain) == "coulomb_friction";
}

/// At one pressure they are the same; a run at another pressure tells.
bool Ranking::is_another_at_this_pressure(const Trial& general, const Trial& simple) const {
  return are_two_frictions(general, simple) &&
         compare(data_, simple.residual, general.residual, 0, noise_density(data_, simple.residual))
                 .separation < kTwinLimit;
}

void Ranking::rank(std::vector<Trial>& trials, const Eigen::VectorXd& before) const {
  if (trials.empty()) return;
  const auto least = std::min_element(trials.begin(), trials.end(),
                                      [](const Trial& a, const Trial& b) { return a.loss < b.loss; });
  const double unit = compare(data_, least->residual, before, 0, noise_density(data_, least->residual)).unit;
  const auto penalised = [&](const Trial& t) { return t.loss + 2 * unit * parameters_of(t); };
  std::stable_sort(trials.begin(), trials.end(),
                   [&](const Trial& a, const Trial& b) { return penalised(a) < penalised(b); });
  // The best reading of an effect speaks for it.
  std::set<std::string> seen;
  std::erase_if(trials, [&](const Trial& t) { return !seen.insert(id_of(t)).second; });
  mark(trials);
  // Parsimony: a simpler case that is not ruled out stands for the general one.
  std::size_t changes = 0;  // two that each stand for the other must not take turns for ever
  for (bool changed = true; changed && changes < trials.size();) {
    changed = false;
    for (std::size_t i = 1; i < trials.size(); ++i) {
      const double apart = trials[i].behind.separation,
                   closed = (before.squaredNorm() - trials[0].loss) / trials[i].behind.unit,
                   hardly_any = id_of(trials[i]) == "inertia_error" ||
                                        (is_dry(trials[i]) && !are_two_frictions(trials[0], trials[i]))
                                    ? kHardlyAny * closed
                                    : 0;
      const bool twins = apart < kTwinLimit;
      const bool simpler =
          nests(id_of(trials[0]), id_of(trials[i])) &&
          (trials[i].behind.t < kNestedLimit || twins ||
           (apart * apart < hardly_any && trials[i].behind.t < kLimitReach) ||
           (trials[i].behind.t < kLimitReach && is_limit_case(trials[0].hypothesis, trials[0].values)));
      const int more = parameters_of(trials[i]) - parameters_of(trials[0]);
      const bool likelier =
          twins &&
          (more < 0 || (more == 0 && ((is_against_its_name(trials[0]) && !is_against_its_name(trials[i])) ||
                                      is_likelier_cause(trials[i], trials[0]))));
      const bool one_cause = trials[i].behind.t < kCoincidence && is_one_cause_of_both(trials[i], trials[0]);
      if (!simpler && !likelier && !one_cause) continue;
      std::rotate(trials.begin(), trials.begin() + static_cast<std::ptrdiff_t>(i),
                  trials.begin() + static_cast<std::ptrdiff_t>(i) + 1);
      mark(trials);
      changed = true;
      ++changes;
      break;
    }
  }
  for (Trial& t : trials)
    if (&t != &trials.front() && t.in_set)
      for (const Trial& simple : trials)
        // (An offset and a gain of a force are as many numbers: neither is the simpler one.)
        if (simple.in_set && nests(id_of(t), id_of(simple)) && !are_two_causes_of_one(t, simple) &&
            !is_another_at_this_pressure(t, simple) &&
            ((parameters_of(t) > parameters_of(simple) && t.behind.t > -kNestedDoubt) ||
             is_limit_case(t.hypothesis, t.values)))
          t.in_set = false;
  weigh(trials);
}

void Ranking::widen(std::vector<Trial>& trials) const {
  const auto is_case_of_another = [&](const Trial& t) {
    return std::any_of(trials.begin(), trials.end(), [&](const Trial& other) {
      return other.in_set && (nests(id_of(t), id_of(other)) || nests(id_of(other), id_of(t)));
    });
  };
  for (Trial& t : trials)
    // (What is nearer and not in the set was taken out of it for a reason.)
    if (!t.in_set && t.behind.t >= kSetLimit && t.behind.t < kOneInAHundred &&
        share_readings(t, trials.front()) && !is_case_of_another(t))
      t.in_set = true;
  weigh(trials);
}

void Ranking::mark(std::vector<Trial>& trials) const {
  const Trial& best = trials.front();
  const NoiseDensity noise = noise_density(data_, best.residual);
  for (Trial& t : trials) {
    t.behind = compare(data_, best.residual, t.residual, parameters_of(t) - parameters_of(best), noise);
    t.in_set = &t == &best || (cannot_rule_out(t.behind) && share_readings(t, best));
  }
}

void Ranking::weigh(std::vector<Trial>& trials) {
  double sum = 0;
  for (Trial& t : trials) {
    // Twins are equally likely: what lies between them is less than the data can tell. Others as often as noise would put the
    // truth so far behind.
    const double behind = t.behind.separation < kTwinLimit ? 0.0 : std::max(0.0, t.behind.t);
    t.weight = t.in_set ? std::exp(-0.5 * behind * behind) : 0.0;
    if (&t == &trials.front()) t.weight *= kFirst;
    sum += t.weight;
  }
  for (Trial& t : trials) t.weight *= kSurest / sum;
}

}  // namespace isac::explain
