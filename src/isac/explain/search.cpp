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
constexpr double kMostByTolerance =
    2;  // of what stands beyond it: less beyond than within is the tolerance's own error
constexpr double kLittle = 0.05;  // of the units that an effect closed: a doubt of its name, and no more
constexpr double kHardlyAnything =
    0.005;  // of the units of noise that an effect closed: its equation and the noise's model are no truer

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
  if (data_.untold() > 0)
    say(fmt::format(
        "{:.1f} s of slow turns, in which the encoder does not tell a direction, are left out of the torque",
        data_.untold()));
  place_slip(library_, data_, found_.baseline.residual);
  move_to(found_.baseline);
  take_first_colour();
  if (!found_.wants_torque_of_free_runs) forward();
  if (found_.adequate && found_.added.empty() && !found_.steps.empty()) doubt_the_clock();
  const bool little = take_what_is_little();
  if (found_.wants_torque_of_free_runs || found_.worth_another_look) return std::move(found_);
  if (!little && found_.added.size() > 1) swap_and_drop();
  if (!little && found_.adequate && !found_.added.empty()) hold_against_others();
  look_at_remainder();
  look_at_moments_beside();
  if (found_.adequate) leave_half_a_step(false);
  if (!found_.added.empty()) found_.model = polished(predictor_, std::move(found_.model), found_.weights);
  leave_a_limit_to_its_simple_case();
  for (std::size_t i = 0; i < found_.added.size(); ++i) ranking_.widen(found_.steps[i].trials);
  if (untold_half_step_ > 0)  // it stayed in the middle, and the intervals know how far it may be off
    tolerate(library_, data_, "encoder_offset", -untold_half_step_, untold_half_step_);
  look_at_limits();
  add_slow_part(noise_of_what_is_left(), found_.floors);
  return std::move(found_);
}

bool Search::take_what_is_little() {
  if (!found_.adequate || !found_.added.empty() || found_.steps.empty() || found_.wants_torque_of_free_runs ||
      !is_beyond_doubt(found_.steps.back()))
    return false;
  const Found nothing = found_;
  little_counts_ = true;
  found_.steps.clear();
  forward();
  if (found_.wants_torque_of_free_runs || found_.worth_another_look) return true;
  if (found_.added.size() > 1) swap_and_drop();
  if (found_.adequate && !found_.added.empty()) hold_against_others();
  if (found_.adequate && !found_.added.empty()) return true;
  say("What is too small to matter has no name that stands: it is left.");
  found_ = nothing;
  little_counts_ = false;
  found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
  move_to(found_.baseline);
  return false;
}

void Search::hold_against_others() {
  const Around baseline = around(predictor_, found_.baseline, found_.weights);
  hold_against_functions(baseline);
  if (found_.adequate) hold_against_a_step(baseline);
  if (found_.adequate) hold_against_a_drift(baseline);
  if (found_.adequate) hold_against_any_valve();
  if (found_.adequate) hold_against_its_simple_case();
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
    found_.blurred = is_blur_of_slow_turns(step);
    if (found_.blurred)
      say(fmt::format("It is {:.1g} of what was found: where the joint turns slowly nobody can tell.",
                      units_closed(step.trials.front()) / largest_units_));
    if (no_zero_wanders_beside_it() || (!open && slow_noise_hid_another(step))) {
      if (found_.wants_torque_of_free_runs) return;
      continue;
    }
    if (open && found_.added.empty() && is_convention(step)) continue;
    if (begins_anew_beside_half_a_step(step)) continue;
    if (open && found_.added.size() < 2 && a_wandering_zero_was_hidden_by(step)) {
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
      take = size >= least_material(step);
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
  if (!step.gate.significant || !step.gate.material || is_blur_of_slow_turns(step)) return false;
  if (found_.added.empty() || is_worth_a_second_name(step)) return true;
  return step.gate.size >= small_in(step.gate.chain) &&
         (!leaves_over_in(bit(step.gate.chain)) || step.units >= kHardlyAnything * largest_units_);
}

bool Search::is_blur_of_slow_turns(const Step& step) const {
  const bool dry = std::any_of(found_.added.begin(), found_.added.end(),
                               [&](int h) { return library_.hypotheses[static_cast<std::size_t>(h)].dry; });
  return dry && data_.untold() > 0 && !step.trials.empty() && leaves_over_in(bit(step.gate.chain)) &&
         units_closed(step.trials.front()) < kHardlyAnything * largest_units_;
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

Found search(const Predictor& predictor, Library& library, Prepared& data, const ExplainOptions& options,
             const Look& look) {
  return Search(predictor, library, data, options, look).run();
}

}  // namespace isac::explain
