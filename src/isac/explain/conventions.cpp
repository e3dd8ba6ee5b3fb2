// How a recorder counts, and what of a reading that takes up: part of the search (search_run.hpp).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "isac/explain/search_run.hpp"

namespace isac::explain {
namespace {

constexpr double kConvention = 0.12;  // relative, of the encoder's half step
// Of a sample, or half of one: a dead time is fitted within 0.3 %, and within its own error where it is small.
constexpr double kConventionOfTime = 0.01, kErrorsOfTime = 2, kMostOfTime = 0.06;
constexpr double kToldApart = 16;  // units of noise, four sigma: offsets that were not there closed 13
constexpr double kOwnError =
    0.02;  // of the units that an effect closed: what its equation's own error may ask an offset for
constexpr double kHardlySkewed = 0.1, kHalfASample = 0.03, kBeyondHalf = 0.55;  // of a sample

/// Were it right, it would lead the best by half of what lies between them, give or take one sigma.
bool may_be_right(const Comparison& behind) {
  constexpr double kOneInAHundred = 2.33;
  return behind.separation < kTwinLimit || behind.t + 0.5 * behind.separation < kOneInAHundred;
}

}  // namespace

bool Search::is_convention(const Step& step) {
  const auto near = [](double share, double convention, double within) {
    return std::abs(share - convention) < within * convention;
  };
  for (const Trial& t : step.trials) {
    if (!t.in_set || !may_be_right(t.behind)) continue;
    const std::string id = ranking_.id_of(t);
    const double step_angle = data_.rig.angle_step, interval = data_.runs.front().interval;
    // Once: what lies beyond a tolerance that is there already is an effect, however near.
    if (std::any_of(library_.tolerances.begin(), library_.tolerances.end(),
                    [&](const Hypothesis& h) { return h.id() == id && h.upper[0] > 0; }))
      continue;
    std::string what;
    if (id == "encoder_offset" && near(std::abs(t.values[0]) / step_angle, 0.5, kConvention)) {
      tolerate(library_, data_, id, -0.5 * step_angle, 0.5 * step_angle);
      what = fmt::format("{:.3g} rad, half a step", t.values[0]);
    } else if (const double within =
                   std::min(kConventionOfTime + kErrorsOfTime / std::sqrt(std::max(1.0, units_closed(t))),
                            kMostOfTime);
               id == "dead_time" &&
               (near(t.values[0] / interval, 0.5, within) || near(t.values[0] / interval, 1, within))) {
      tolerate(library_, data_, id, -interval, interval);
      what =
          fmt::format("{:.3g} s, {} sample", t.values[0], t.values[0] < 0.75 * interval ? "half a" : "one");
    } else {
      continue;
    }
    const std::string sentence = "of " + what + ", " + kLeftToTheRecorder;
    found_.notes.push_back({id, sentence});
    say(id + ": " + sentence);
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    move_to(found_.baseline);
    return true;
  }
  return false;
}

bool Search::begins_anew_beside_half_a_step(const Step& step) {
  if (found_.added.empty() || !step.gate.significant || half_a_step_is_free() ||
      !data_.baseline.terms.empty() || library_.tolerances.size() + 1 > library_.tolerances.capacity())
    return false;
  for (const int added : found_.added) {
    const std::string& id = library_.hypotheses[static_cast<std::size_t>(added)].id();
    if (id == "encoder_offset" || nests(id, "torque_offset")) return false;
  }
  const double half = 0.5 * data_.rig.angle_step;
  const auto offset = std::find_if(step.trials.begin(), step.trials.end(), [&](const Trial& t) {
    return t.in_set && ranking_.id_of(t) == "encoder_offset";
  });
  if (offset == step.trials.end() || !(std::abs(std::abs(offset->values[0]) - half) < kConvention * half))
    return false;
  tolerate(library_, data_, "encoder_offset", -half, half);
  const std::string sentence =
      fmt::format("of {:.3g} rad, half a step, {}", offset->values[0], kLeftToTheRecorder);
  say("encoder_offset: " + sentence);
  found_.steps.clear();
  found_.added.clear();
  found_.notes.clear();
  found_.notes.push_back({"encoder_offset", sentence});
  first_size_ = largest_size_ = largest_units_ = 0;
  responses_.forget();
  found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
  move_to(found_.baseline);
  return true;
}

void Search::doubt_the_clock() {
  auto& tolerances = library_.tolerances;
  const auto skew = std::find_if(tolerances.begin(), tolerances.end(),
                                 [](const Hypothesis& h) { return h.id() == "time_skew"; });
  if (skew == tolerances.end()) return;
  const std::ptrdiff_t at = skew - tolerances.begin();
  const double interval = data_.runs.front().interval,
               shift =
                   std::abs(found_.baseline.model.effects[static_cast<std::size_t>(at)].values[0]) / interval;
  const bool at_bound = shift > 0.499;
  if (shift < kHardlySkewed || (!at_bound && shift > 0.5 - kHalfASample)) return;
  const Hypothesis tolerance = *skew;
  const Found without_effect = found_;
  const double blocks = data_.block_seconds;
  tolerances.erase(skew);
  responses_.forget();
  found_.steps.clear();
  found_.baseline = fit_baseline(predictor_, tolerances, found_.weights);
  move_to(found_.baseline);
  forward();
  // At its bound it may be any skew from half a sample on: how large it is, the effect's own fit says, to a twentieth.
  const bool told =
      std::any_of(found_.model.model.effects.begin() + static_cast<std::ptrdiff_t>(found_.model.tolerances),
                  found_.model.model.effects.end(), [&](const Active& a) {
                    return a.hypothesis->effect == tolerance.effect &&
                           (!at_bound || std::abs(a.values[0]) > kBeyondHalf * interval);
                  });
  const auto likelihood = [&](const Found& f) {
    return log_likelihood(data_, f.weights, unfiltered(data_, f.weights, f.model.residual));
  };
  // Or another effect leaves so much less than the skew did that it was the skew that stood for it.
  const bool nearer = !told && found_.adequate && !found_.added.empty() &&
                      2 * (likelihood(found_) - likelihood(without_effect)) > kLargeForSure;
  if (told || nearer) return;
  tolerances.insert(tolerances.begin() + at, tolerance);
  found_ = without_effect;
  responses_.forget();
  cut_blocks(data_, blocks);
  move_to(found_.model);
}

double Search::offset_within_a_step(const Step& step) const {
  if (found_.added.empty()) return 0;
  // What was added may hold an offset of its own, and stand for some of the reading's or against it until that is free: it may look twice as large.
  const bool shared = std::any_of(found_.added.begin(), found_.added.end(), [&](int added) {
    return nests(library_.hypotheses[static_cast<std::size_t>(added)].id(), "torque_offset");
  });
  const double most = (shared ? 1.0 : 0.5) * data_.rig.angle_step;
  for (const Trial& t : step.trials)
    if (t.in_set && ranking_.id_of(t) == "encoder_offset" && std::abs(t.values[0]) < most)
      return t.values[0] / data_.rig.angle_step;
  return 0;
}

void Search::keep_what_holds_an_offset() {
  for (Step& s : found_.steps) {
    if (s.trials.empty()) continue;
    const std::string first = ranking_.id_of(s.trials.front());
    for (Trial& t : s.trials)
      if (nests(ranking_.id_of(t), first) && nests(ranking_.id_of(t), "torque_offset")) t.in_set = true;
    Ranking::weigh(s.trials);
  }
}

bool Search::half_a_step_is_free() const {
  return std::any_of(library_.tolerances.begin(), library_.tolerances.end(),
                     [](const Hypothesis& h) { return h.id() == "encoder_offset" && h.upper[0] > 0; });
}

bool Search::leave_half_a_step(bool asked_for) {
  if (found_.added.empty() || !std::isfinite(data_.rig.angle_step) || !data_.baseline.terms.empty())
    return false;
  std::vector<Active> effects(
      found_.model.model.effects.begin() + static_cast<std::ptrdiff_t>(found_.model.tolerances),
      found_.model.model.effects.end());
  const bool an_offset = std::any_of(effects.begin(), effects.end(), [](const Active& a) {
    const std::string id = a.hypothesis->id();
    return id == "encoder_offset" || id == "torque_offset";
  });
  if (an_offset || half_a_step_is_free() || library_.tolerances.size() + 1 > library_.tolerances.capacity())
    return false;
  const double half = 0.5 * data_.rig.angle_step, without = found_.model.loss;
  const auto within = [&](double low, double high) {
    tolerate(library_, data_, "encoder_offset", low, high);
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    return refit(predictor_, found_.baseline, effects, found_.weights, 8);
  };
  Fit fit = within(-half, half);
  const double unit = compare(data_, fit.residual, fit.residual, 0, noise_density(data_, fit.residual)).unit;
  // A name that holds an offset of its own may ask for this one with its equation's error.
  double least = kToldApart;  // units of noise
  for (std::size_t i = 0; i < std::min(found_.added.size(), found_.steps.size()); ++i)
    if (nests(library_.hypotheses[static_cast<std::size_t>(found_.added[i])].id(), "torque_offset"))
      least = std::max({least, kLargeForSure, kOwnError * found_.steps[i].units});
  const double told = (without - fit.loss) / unit;
  if (!asked_for) {
    // Within the step any reading is as likely before the runs are asked: their mean with that, or the middle where they hardly tell.
    double reading = 0;
    for (std::size_t i = 0; i < fit.tolerances; ++i)
      if (told >= least && fit.model.effects[i].hypothesis->id() == "encoder_offset") {
        const double value = fit.model.effects[i].values[0], before = half * half / 3;
        reading = value * before / (before + value * value / told);
      }
    fit = within(reading, reading);
    untold_half_step_ = half;
  }
  move_to(fit);
  return true;
}

}  // namespace isac::explain
