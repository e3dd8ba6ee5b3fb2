#include "isac/explain/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "isac/explain/gate.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/search_run.hpp"
#include "isac/explain/slip_moment.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kContenders = 16;  // of each screen
constexpr double kConvention = 0.12;     // relative, of the encoder's half step
// Of a sample, or half of one: a dead time is fitted within 0.3 %, and within its own error where it is small.
constexpr double kConventionOfTime = 0.01, kErrorsOfTime = 2, kMostOfTime = 0.06;
constexpr double kToldApart = 16;  // units of noise, four sigma: offsets that were not there closed 13
constexpr double kOwnError =
    0.02;  // of the units that an effect closed: what its equation's own error may ask an offset for
constexpr double kHardlySkewed = 0.1, kHalfASample = 0.03, kBeyond = 0.55;  // of a sample
constexpr double kMostByTolerance =
    2;  // of what stands beyond it: less beyond than within is the tolerance's own error
constexpr double kLittle = 0.05;  // of the units that an effect closed: a doubt of its name, and no more
constexpr double kHardlyAnything =
    0.01;  // of the units of noise that an effect closed: its equation and the noise's model are no truer

/// Were it right, it would lead the best by half of what lies between them, give or take one sigma.
bool may_be_right(const Comparison& behind) {
  constexpr double kOneInAHundred = 2.33;
  return behind.separation < kTwinLimit || behind.t + 0.5 * behind.separation < kOneInAHundred;
}

}  // namespace

Found Search::run() {
  found_.floors = floors_of(data_);
  found_.another_pair = look_.another_pair;
  first_weights();
  found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
  reweight(data_, found_.baseline, found_.weights);
  found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
  choose_blocks(found_.baseline.residual);
  say(fmt::format("baseline fitted to {} rows of {} runs", data_.rows.size(), data_.runs.size()));
  place_slip(library_, data_, found_.baseline.residual);
  move_to(found_.baseline);
  take_first_colour();
  if (!found_.wants_torque_of_free_runs) forward();
  if (found_.adequate && found_.added.empty() && !found_.steps.empty()) doubt_the_clock();
  if (found_.wants_torque_of_free_runs || found_.worth_another_look) return std::move(found_);
  if (found_.added.size() > 1) swap_and_drop();
  if (found_.adequate && !found_.added.empty()) hold_against_others();
  look_at_remainder();
  look_at_moments_beside();
  if (found_.adequate) leave_half_a_step(false);
  if (!found_.added.empty()) found_.model = polished(predictor_, std::move(found_.model), found_.weights);
  leave_a_limit_to_its_simple_case();
  if (untold_half_step_ > 0)  // it stayed in the middle, and the intervals know how far it may be off
    tolerate(library_, data_, "encoder_offset", -untold_half_step_, untold_half_step_);
  look_at_limits();
  add_slow_part(noise_of_what_is_left(), found_.floors);
  return std::move(found_);
}

void Search::hold_against_others() {
  const Around baseline = around(predictor_, found_.baseline, found_.weights);
  hold_against_functions(baseline);
  if (found_.adequate) hold_against_a_step(baseline);
  if (found_.adequate) hold_against_any_valve();
  if (found_.adequate) hold_against_itself(baseline);
}

void Search::take_first_colour() {
  if (!look_.colour_beside_best || look_.found.empty()) {
    take_colour(place_.residual);
    return;
  }
  colour_beside_best_ = true;
  std::vector<Active> effects;
  for (const auto& [hypothesis, values] : look_.found)
    effects.push_back({&library_.hypotheses[static_cast<std::size_t>(hypothesis)], values});
  take_colour(refit(predictor_, found_.baseline, effects, found_.weights, 6).residual);
}

bool Search::touches_pressures() const {
  return std::any_of(found_.added.begin(), found_.added.end(), [&](int h) {
    return (library_.hypotheses[static_cast<std::size_t>(h)].chains & kPressureChains) != 0;
  });
}

void Search::first_weights() {
  for (int c = 0; c < kChains; ++c) found_.weights.sigma[c] = 1e-9;
  for (int c : {0, 3})
    found_.weights.sigma[c] = std::isfinite(found_.floors.white[c]) && found_.floors.white[c] > 0
                                  ? 0.4 * found_.floors.white[c]
                                  : 1e-3;
  found_.weights.sigma[1] = found_.weights.sigma[2] = 150.0;  // Pa
}

std::set<std::string> Search::contenders() const {
  std::set<std::string> ids;
  for (const Step& step : found_.steps) {
    for (const Trial& t : step.trials) ids.insert(ranking_.id_of(t));
    for (std::size_t i = 0; i < std::min(kContenders, step.screen.candidates.size()); ++i)
      ids.insert(library_.hypotheses[static_cast<std::size_t>(step.screen.candidates[i].hypothesis)].id());
  }
  return ids;
}

void Search::report(const std::vector<Trial>& trials) {
  for (const Trial& t : trials) {
    const Trial& best = trials.front();
    // The simpler case of it that stands in its place.
    const auto simple = std::find_if(trials.begin(), trials.end(), [&](const Trial& other) {
      return other.in_set && nests(ranking_.id_of(t), ranking_.id_of(other));
    });
    const std::string sentence =
        &t == &best ? fmt::format("fits best; closes {:.0f} units of noise, {:.2f} of the floor",
                                  units_closed(t), t.material)
        : t.in_set
            ? fmt::format("cannot be told from {} ({:.1f} sigma behind, {:.1f} sigma of data between them)",
                          ranking_.id_of(best), told_behind(t.behind), t.behind.separation)
        : simple != trials.end() && cannot_rule_out(t.behind)
            ? fmt::format("what it has beyond {} is not needed ({:.1f} sigma behind {})",
                          ranking_.id_of(*simple), told_behind(t.behind), ranking_.id_of(best))
        : !ranking_.share_readings(t, best)
            ? fmt::format("closes another reading than {}: no rival of it", ranking_.id_of(best))
            : fmt::format("ruled out: {:.1f} sigma behind {}", told_behind(t.behind), ranking_.id_of(best));
    found_.notes.push_back({ranking_.id_of(t), sentence});
    say(ranking_.id_of(t) + ": " + sentence);
  }
}

void Search::forward() {
  first_size_ = largest_size_ = largest_units_ = 0;
  left_elsewhere_ = false;
  take_settled();
  for (;;) {
    const bool narrow = !look_.contenders.empty();
    if (narrow) asked_for_ = look_.contenders;
    Step step = step_here();
    asked_for_.reset();
    if (found_.wants_torque_of_free_runs) return;
    if (narrow && !is_open(step)) {
      narrow_ = std::move(step.screen);
      step = step_here();
      narrow_.reset();
    }
    if (found_.steps.empty()) {
      found_.gate = step.gate;
      // Of what stood near the top once, the largest is larger by chance than of all that were looked for then.
      if (narrow) found_.gate.p_value = std::max(step.gate.p_value, look_.gate.p_value);
    }
    const bool open = is_open(step);
    say(open ? fmt::format("{} is missing: p = {:.2g}, {:.2f} of the noise floor, most like {} ({} blocks "
                           "of {:.1f} s)",
                           found_.added.empty() ? "something" : "something more", step.gate.p_value,
                           step.gate.size, step.gate.what, data_.blocks, data_.block_seconds)
             : fmt::format("nothing {} is left: p = {:.2g}, {:.2f} of the noise floor",
                           step.gate.significant ? "material" : "significant", step.gate.p_value,
                           step.gate.size));
    report(step.trials);
    found_.adequate = !open;
    if (!open && no_zero_wanders_beside_it()) continue;
    if (open && found_.added.empty() && is_convention(step)) continue;
    if (open && found_.added.empty() && a_wandering_zero_was_hidden_by(step)) {
      if (found_.wants_torque_of_free_runs) return;
      continue;
    }
    if (const double offset = open ? offset_within_a_step(step) : 0.0;
        offset != 0 && leave_half_a_step(true)) {
      found_.doubts.push_back(
          fmt::format("Beside it the encoder would have to be {:.2f} of its step off, which is {:.2f} of the "
                      "noise floor: that may be a part of the effect.",
                      std::abs(offset), step.gate.size));
      say(found_.doubts.back());
      keep_what_holds_an_offset();
      continue;
    }
    if (open && found_.added.size() == 1 && another_leaves_nothing(step)) return;
    bool take = open && !step.trials.empty() && static_cast<int>(found_.added.size()) < options_.most_effects;
    if (take) {
      const double size = step.trials.front().material;
      take = size >= options_.material;
      if (take && !found_.added.empty())
        take = is_clear_enough(whole_size(step.trials.front()), chains_of(step.trials.front())) ||
               closes_all_that_is_left(step);
      if (take && found_.added.empty()) first_size_ = size;
      if (take) {
        largest_size_ = std::max(largest_size_, size);
        largest_units_ = std::max(largest_units_, units_closed(step.trials.front()));
      }
    }
    if (open && !take && found_.added.size() == 1 &&
        (a_rival_goes_better_with(step) || another_pair_closes_more(step)))
      continue;
    if (open && !take && !found_.added.empty() && !leave_elsewhere(step)) leave_a_little(step);
    found_.steps.push_back(std::move(step));
    if (take) {
      const Trial& best = found_.steps.back().trials.front();
      found_.added.push_back(best.hypothesis);
      move_to(refit(predictor_, found_.model, {active_of(best)}, found_.weights, 6));
    }
    // A valve's effect was added, and it is not all that is missing, or made the torque look as if a zero wandered.
    if (look_.provisional && touches_pressures() &&
        (found_.added.size() > 1 || (!take && (open || a_zero_wanders(found_.weights))))) {
      found_.worth_another_look = true;
      found_.settled = settled_steps();
      found_.colour_beside_best = colour_beside_best_;
      found_.contenders = contenders();
      return;
    }
    if (!take) return;
  }
}

std::vector<Step> Search::settled_steps() const {
  // Not where a tolerance depended on what was found: the other look comes to it in its own order.
  const bool tolerated =
      std::any_of(library_.tolerances.begin(), library_.tolerances.end(), [](const Hypothesis& h) {
        return (h.id() == "dead_time" || h.id() == "encoder_offset") && h.upper[0] > 0;
      });
  std::vector<Step> settled;
  if (tolerated) return settled;
  const auto enters_forces = [&](const Trial& t) { return (chains_of(t) & kForceChains) != 0; };
  for (std::size_t i = 0; i < found_.added.size(); ++i) {
    const std::vector<Trial>& trials = found_.steps[i].trials;
    // A pressure sensor's error enters both: beside it nothing is settled.
    if (std::any_of(trials.begin(), trials.end(),
                    [&](const Trial& t) { return t.in_set && enters_forces(t); }))
      break;
    settled.push_back(found_.steps[i]);
    std::erase_if(settled.back().trials, enters_forces);
  }
  return settled;
}

void Search::take_settled() {
  if (look_.settled.empty()) return;
  found_.gate = look_.gate;
  found_.notes = look_.notes;
  std::vector<Active> effects;
  for (const Step& step : look_.settled) {
    const Trial& best = step.trials.front();
    if (effects.empty()) first_size_ = best.material;
    largest_size_ = std::max(largest_size_, best.material);
    largest_units_ = std::max(largest_units_, step.units);
    found_.added.push_back(best.hypothesis);
    effects.push_back(active_of(best));
  }
  found_.steps = look_.settled;
  // What was tried changed nothing in the rows of forces and motion, whose noise is another now.
  for (Step& step : found_.steps)
    for (Trial& t : step.trials) {
      for (std::size_t i = 0; i < data_.rows.size(); ++i)
        if ((bit(data_.rows[i].chain) & kForceChains) != 0)
          t.residual[static_cast<Eigen::Index>(i)] = place_.residual[static_cast<Eigen::Index>(i)];
      t.loss = t.residual.squaredNorm();
    }
  move_to(refit(predictor_, found_.baseline, effects, found_.weights, 6));
}

bool Search::leave_elsewhere(const Step& step) {
  if (leaves_over_in(bit(step.gate.chain)) || step.gate.size >= kSecondOfFloor) return false;
  found_.adequate = left_elsewhere_ = true;
  found_.doubts.push_back(fmt::format(
      "Something more is missing in other readings, {:.2f} of the noise floor of the {} (p = {:.1g}), "
      "and too little to be named.",
      step.gate.size, label_of(data_, step.gate.chain).signal, step.gate.p_value));
  say(found_.doubts.back());
  return true;
}

void Search::leave_a_little(const Step& step) {
  if (step.units >= std::min(kLargeForSure, kLittle * largest_units_) ||
      step.gate.size >= kSecondOfFirst * first_size_)
    return;
  found_.adequate = true;
  found_.doubts.push_back(
      fmt::format("Beside it a little more is missing, {:.2f} of the noise floor of the {} (p = {:.1g}): its "
                  "equation is not all, or another is nearer.",
                  step.gate.size, label_of(data_, step.gate.chain).signal, step.gate.p_value));
  say(found_.doubts.back());
}

bool Search::is_open(const Step& step) const {
  if (!step.gate.significant || !step.gate.material) return false;
  if (found_.added.empty() || is_worth_a_second_name(step)) return true;
  return step.gate.size >= small_in(step.gate.chain) &&
         (!leaves_over_in(bit(step.gate.chain)) || step.units >= kHardlyAnything * largest_units_);
}

bool Search::leaves_over_in(unsigned chains) const {
  return std::any_of(found_.added.begin(), found_.added.end(), [&](int h) {
    return (together_with(library_.hypotheses[static_cast<std::size_t>(h)].chains) & together_with(chains)) !=
           0;
  });
}

double Search::whole_size(const Trial& t) const {
  for (std::size_t i = 0; i < found_.model.tolerances; ++i) {
    const Active& tolerance = found_.model.model.effects[i];
    const double within = tolerance.values[0];
    if (tolerance.hypothesis->effect != active_of(t).hypothesis->effect || within == 0) continue;
    const Fit fit = refit(predictor_, found_.model, {active_of(t)}, found_.weights, 6);
    const double whole = fit.model.effects.back().values[0];
    return whole / within > 1 ? t.material * std::min(whole / (whole - within), kMostByTolerance)
                              : t.material;
  }
  return t.material;
}

bool Search::is_worth_a_second_name(const Step& step) const {
  return !step.trials.empty() &&
         is_clear_enough(whole_size(step.trials.front()), chains_of(step.trials.front())) &&
         units_closed(step.trials.front()) > kLargeForSure;
}

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
    if (id == "encoder_offset" && near(std::abs(t.values[0]) / step_angle, 0.5, kConvention)) {
      tolerate(library_, data_, id, -0.5 * step_angle, 0.5 * step_angle);
    } else if (const double within =
                   std::min(kConventionOfTime + kErrorsOfTime / std::sqrt(std::max(1.0, units_closed(t))),
                            kMostOfTime);
               id == "dead_time" &&
               (near(t.values[0] / interval, 0.5, within) || near(t.values[0] / interval, 1, within))) {
      tolerate(library_, data_, id, -interval, interval);
    } else {
      continue;
    }
    const std::string sentence =
        fmt::format("of {:.3g} it is how the recorder counts, and is left to that", t.values[0]);
    found_.notes.push_back({id, sentence});
    say(id + ": " + sentence);
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    move_to(found_.baseline);
    return true;
  }
  return false;
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
                           (!at_bound || std::abs(a.values[0]) > kBeyond * interval);
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
  for (const Trial& t : step.trials)
    if (t.in_set && ranking_.id_of(t) == "encoder_offset" &&
        std::abs(t.values[0]) < 0.5 * data_.rig.angle_step)
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
  const bool there =
      std::any_of(library_.tolerances.begin(), library_.tolerances.end(),
                  [](const Hypothesis& h) { return h.id() == "encoder_offset" && h.upper[0] > 0; });
  if (an_offset || there || library_.tolerances.size() + 1 > library_.tolerances.capacity()) return false;
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

Found search(const Predictor& predictor, Library& library, Prepared& data, const ExplainOptions& options,
             const Look& look) {
  return Search(predictor, library, data, options, look).run();
}

}  // namespace isac::explain
