#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/explain/gate.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/refine.hpp"
#include "isac/explain/search_run.hpp"
#include "isac/explain/slip_moment.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {

bool Search::another_leaves_nothing(const Step& step) {
  std::vector<Trial>& trials = found_.steps.front().trials;
  // What the first closes together with a second, a rival that leaves nothing closes alone, but for an equation's own error.
  constexpr double kOwnError = 0.05;  // of the units that the first closed
  double together = std::numeric_limits<double>::infinity();
  if (!step.trials.empty()) {
    const Trial& second = step.trials.front();
    const double unit =
        compare(data_, second.residual, place_.residual, 0, noise_density(data_, second.residual)).unit;
    const bool same_rows = ranking_.share_readings(second, trials.front());
    together = second.loss + unit * std::max(kLargeForSure, same_rows ? kOwnError * largest_units_ : 0.0);
  }
  const Fit kept = found_.model;
  const std::string first = ranking_.id_of(trials.front());
  const double blocks = data_.block_seconds;
  const std::size_t notes = found_.notes.size();
  int tried = 0;
  for (std::size_t i = 1; i < trials.size() && tried < 3; ++i) {
    if (!cannot_rule_out(trials[i].behind) && !nests(ranking_.id_of(trials[i]), first)) continue;
    if (!ranking_.share_readings(trials[i], trials.front())) continue;
    ++tried;
    // (Where that second name is the rival itself, the first may only take up what its equation leaves; of a slip, its moment is the second's.)
    const bool itself =
        !step.trials.empty() && ranking_.id_of(step.trials.front()) == ranking_.id_of(trials[i]);
    const bool moved = itself && is_slip(*active_of(step.trials.front()).hypothesis);
    const Active rival = active_of(moved ? step.trials.front() : trials[i]);
    found_.added.back() = moved ? step.trials.front().hypothesis : trials[i].hypothesis;
    move_to(refit(predictor_, found_.baseline, {rival}, found_.weights, 6));
    if (!itself && place_.residual.squaredNorm() > together) continue;
    const double large = kSmallRemainder * trials[i].material;
    asked_for_.emplace();  // functions without a name, which cost next to nothing, often say it already
    const Step nameless = screened_step();
    asked_for_.reset();
    if (is_open_at_least(nameless, large)) continue;
    Step rest = screened_step();
    if (is_open_at_least(rest, large)) continue;
    rest = refitted(std::move(rest));
    if (rest.gate.significant && rest.gate.material && rest.gate.size >= large) continue;
    say(fmt::format("{} leaves nothing, {} does: it takes its place", ranking_.id_of(trials[i]), first));
    if (moved) {
      trials[i].hypothesis = step.trials.front().hypothesis;
      trials[i].values = step.trials.front().values;
    }
    const Eigen::VectorXd left_by_first = trials.front().residual;
    put_first(i);
    if (moved) leave_out_twins_of(left_by_first);
    found_.steps.push_back(std::move(rest));
    found_.adequate = true;
    return true;
  }
  found_.added.back() = trials.front().hypothesis;
  found_.notes.resize(notes);  // what was tried beside a rival says nothing beside what stands first
  cut_blocks(data_, blocks);
  move_to(kept);
  return false;
}

void Search::leave_out_twins_of(const Eigen::VectorXd& residual) {
  std::vector<Trial>& trials = found_.steps.front().trials;
  const NoiseDensity noise = noise_density(data_, residual);
  for (Trial& t : trials)
    if (&t != &trials.front() && compare(data_, residual, t.residual, 0, noise).separation < kTwinLimit)
      t.in_set = false;
  Ranking::weigh(trials);
}

bool Search::closes_all_that_is_left(const Step& step) {
  constexpr double kUnits = 400, kOfLargest = 0.1;  // units of noise, and of what the largest effect closed
  constexpr double kSmallest = 0.2;                 // of the floor
  const Trial& second = step.trials.front();
  // Elsewhere the largest closed units of another reading's noise, which say nothing of this one's: a shifted pressure closes ten times more
  // of the pressures than of the torque.
  const double least = std::max(kUnits, kOfLargest * most_units_closed_in(together_with(chains_of(second))));
  if (second.material < kSmallest || units_closed(second) < least) return false;
  const Fit kept = found_.model;
  const double blocks = data_.block_seconds;
  const std::size_t notes = found_.notes.size();
  found_.added.push_back(second.hypothesis);
  move_to(refit(predictor_, found_.model, {active_of(second)}, found_.weights, 6));
  const Step rest = screened_step();
  const bool nothing = !rest.gate.significant;
  found_.added.pop_back();
  found_.notes.resize(notes);
  cut_blocks(data_, blocks);
  move_to(kept);
  // One cause that enters both readings, a pressure sensor's gain, looks like that too: unequal muscles with a leak.
  if (nothing && units_closed(second) < kOfLargest * largest_units_)
    found_.doubts.push_back(fmt::format(
        "{} is small beside what was found in other readings: one effect that enters both, and that the "
        "catalogue does not have, may look like that.",
        upper_first(active_of(second).hypothesis->info().term)));
  return nothing;
}

double Search::most_units_closed_in(unsigned chains) const {
  double most = 0;
  const Eigen::VectorXd* before = &found_.baseline.residual;
  for (std::size_t i = 0; i < found_.added.size(); ++i) {
    const Trial& t = found_.steps[i].trials.front();
    double closed = 0;
    for (std::size_t k = 0; k < data_.rows.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      if ((bit(data_.rows[k].chain) & chains) != 0)
        closed += (*before)[row] * (*before)[row] - t.residual[row] * t.residual[row];
    }
    most = std::max(most,
                    closed / compare(data_, t.residual, *before, 0, noise_density(data_, t.residual)).unit);
    before = &t.residual;
  }
  return most;
}

bool Search::a_rival_goes_better_with(const Step& step) {
  constexpr double kNearlyDid = 0.2;  // of the units that the first closed is left over beside it
  if (a_rival_was_tried_ || step.trials.empty()) return false;
  a_rival_was_tried_ = true;
  std::vector<Trial>& trials = found_.steps.front().trials;
  const Trial& second = step.trials.front();
  const std::string first = ranking_.id_of(trials.front());
  const double unit = step.screen.noise_unit;
  // The second effect was fitted beside the first: beside a rival it may be of another size, which only other starts lead to.
  const Hypothesis& other = library_.hypotheses[static_cast<std::size_t>(second.hypothesis)];
  std::vector<Values> starts = other.shapes;
  starts.push_back(second.values);
  const auto loss_of = [&](const Trial& t) {
    const Fit alone = with({t});
    const Around beside = around(predictor_, alone, found_.weights);
    std::vector<double> losses(starts.size());
    share_work(options_.threads, starts.size(),
               [&](std::size_t i) { losses[i] = refine(beside, other, starts[i]).loss; });
    return *std::min_element(losses.begin(), losses.end()) + 2 * unit * ranking_.parameters_of(t);
  };
  const double standing = loss_of(trials.front());
  double least = standing - kThreeSigma * unit;
  std::size_t best = 0, tried = 0;
  for (std::size_t i = 1; i < trials.size() && tried < 3; ++i) {
    // A general case led its simple one because something else was missing: beside that, the simple one need only do as well.
    const bool simpler = nests(first, ranking_.id_of(trials[i]));
    if ((!cannot_rule_out(trials[i].behind) && !simpler) ||
        !ranking_.share_readings(trials[i], trials.front()) ||
        ranking_.id_of(trials[i]) == ranking_.id_of(second))
      continue;
    ++tried;
    const double loss = loss_of(trials[i]);
    if (loss >= (simpler && best == 0 ? standing : least)) continue;
    least = std::min(least, loss);
    best = i;
  }
  if (best == 0) return false;
  say(fmt::format("{} goes better with {} than {} does: it takes its place", ranking_.id_of(trials[best]),
                  ranking_.id_of(second), first));
  found_.another_pair = found_.another_pair || step.units < kNearlyDid * largest_units_;
  put_first(best);
  found_.added.back() = trials.front().hypothesis;
  move_to(with({trials.front()}));
  return true;
}

bool Search::another_pair_closes_more(const Step& step) {
  if (a_pair_was_tried_ || step.trials.empty()) return false;
  a_pair_was_tried_ = true;
  constexpr std::size_t kRivals = 2;
  std::vector<Trial>& trials = found_.steps.front().trials;
  const Fit kept = found_.model;
  const double blocks = data_.block_seconds, unit = step.screen.noise_unit;
  const std::size_t notes = found_.notes.size();
  const std::string first = ranking_.id_of(trials.front());
  const auto penalised = [&](double loss, const Trial& a, const Trial& b) {
    return loss + 2 * unit * (ranking_.parameters_of(a) + ranking_.parameters_of(b));
  };
  double least =
      penalised(with({trials.front(), step.trials.front()}).loss, trials.front(), step.trials.front()) -
      kLargeForSure * unit;
  std::size_t best = 0, tried = 0;
  std::string second;
  for (std::size_t i = 1; i < trials.size() && tried < kRivals; ++i) {
    if (!ranking_.share_readings(trials[i], trials.front()) || trials[i].material < options_.material)
      continue;
    ++tried;
    found_.added.back() = trials[i].hypothesis;
    move_to(with({trials[i]}));
    asked_for_ = contenders();
    const Step next = step_here();
    asked_for_.reset();
    if (next.trials.empty() || next.trials.front().material < kSecondOfFloor) continue;
    const double loss = penalised(next.trials.front().loss, trials[i], next.trials.front());
    if (loss >= least) continue;
    least = loss;
    best = i;
    second = ranking_.id_of(next.trials.front());
  }
  found_.notes.resize(notes);
  if (best == 0) {
    found_.added.back() = trials.front().hypothesis;
    cut_blocks(data_, blocks);
    move_to(kept);
    return false;
  }
  say(fmt::format("{} and {} close more than {} does with any other: it takes its place",
                  ranking_.id_of(trials[best]), second, first));
  put_first(best);
  found_.added.back() = trials.front().hypothesis;
  found_.another_pair = true;
  move_to(with({trials.front()}));
  return true;
}

void Search::leave_a_limit_to_its_simple_case() {
  if (found_.added.size() != 1 || !found_.adequate) return;
  std::vector<Trial>& trials = found_.steps.front().trials;
  const std::size_t simple =
      ranking_.simple_case_of_limit(trials, found_.model.model.effects[found_.model.tolerances].values);
  if (simple == 0) return;
  say(fmt::format("{} went on to the end of its range: {} takes its place", ranking_.id_of(trials.front()),
                  ranking_.id_of(trials[simple])));
  put_first(simple);
  found_.added.front() = trials.front().hypothesis;
  found_.model = polished(predictor_, with({trials.front()}), found_.weights);
}

void Search::put_first(std::size_t i) {
  std::vector<Trial>& trials = found_.steps.front().trials;
  const std::string first = ranking_.id_of(trials.front());
  std::rotate(trials.begin(), trials.begin() + static_cast<std::ptrdiff_t>(i),
              trials.begin() + static_cast<std::ptrdiff_t>(i) + 1);
  ranking_.mark(trials);
  for (Trial& t : trials)
    if (ranking_.id_of(t) == first) t.in_set = false;
  Ranking::weigh(trials);
  first_size_ = largest_size_ = trials.front().material;
}

void Search::swap_and_drop() {
  asked_for_ = contenders();
  std::vector<Trial> chosen;
  for (std::size_t i = 0; i < found_.added.size(); ++i) chosen.push_back(found_.steps[i].trials.front());
  Step last = std::move(found_.steps.back());
  std::vector<Step> standing = std::move(found_.steps),
                    steps;  // one for each that is chosen, and what becomes of them
  standing.pop_back();
  bool changed = false;
  const double blocks = data_.block_seconds;
  const Fit whole = found_.model;
  for (std::size_t i = 0; i < chosen.size();) {
    if (!changed && i + 1 == chosen.size()) {  // beside all before it: so it was added
      steps.push_back(std::move(standing[i]));
      break;
    }
    std::vector<Trial> others = chosen;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    found_.added.clear();
    for (const Trial& t : others) found_.added.push_back(t.hypothesis);
    move_to(with(others));
    const double missed_by =
        (found_.model.loss - whole.loss) /
        compare(data_, whole.residual, found_.model.residual, 0, noise_density(data_, whole.residual)).unit;
    Step step = step_here();
    const bool shows = !step.trials.empty() && step.gate.significant;
    if (!shows && !changed && missed_by > kLargeForSure) {
      // Beside a wrong size of the others its response is small; the joint fit says what it is worth.
      steps.push_back(std::move(standing[i]));
      ++i;
      continue;
    }
    if (!shows) {
      say(fmt::format("{} is not missed when it is dropped", ranking_.id_of(chosen[i])));
      chosen = others;
      standing.erase(standing.begin() + static_cast<std::ptrdiff_t>(i));
      changed = true;
      continue;
    }
    if (ranking_.id_of(step.trials.front()) != ranking_.id_of(chosen[i])) {
      // Without it the others may have come to a wrong size, beside which another does better: both sets are refitted whole.
      std::vector<Trial> swapped = chosen;
      swapped[i] = step.trials.front();
      const double worse = (with(swapped).loss - with(chosen).loss) / step.screen.noise_unit;
      constexpr double kOwnError =
          0.1;  // of the units that the largest closed: a simpler name may leave it over
      if (worse > std::max(kLargeForSure, kOwnError * largest_units_)) {
        steps.push_back(std::move(standing[i]));
        ++i;
        continue;
      }
      say(fmt::format("{} does better in place of {}", ranking_.id_of(step.trials.front()),
                      ranking_.id_of(chosen[i])));
      const bool in_set = std::any_of(step.trials.begin(), step.trials.end(), [&](const Trial& t) {
        return t.in_set && t.hypothesis == chosen[i].hypothesis;
      });
      // Two pairs that do about as well, and one effect that the catalogue does not have may be like either.
      if (!in_set && worse > -kLargeForSure)
        found_.doubts.push_back(fmt::format(
            "{} in the place of {} leaves about as little: one effect that is neither may look like both.",
            upper_first(active_of(chosen[i]).hypothesis->info().term),
            active_of(step.trials.front()).hypothesis->info().term));
      changed = true;
    }
    chosen[i] = step.trials.front();
    step.screen = std::move(standing[i].screen);  // of everything that was looked for
    steps.push_back(std::move(step));
    ++i;
  }
  asked_for_.reset();
  found_.added.clear();
  for (const Trial& t : chosen) found_.added.push_back(t.hypothesis);
  move_to(with(chosen));
  if (changed) {
    last = step_here();
    first_size_ = steps.front().trials.front().material;
    largest_size_ = largest_units_ = 0;
    for (const Step& step : steps) {
      largest_size_ = std::max(largest_size_, step.trials.front().material);
      largest_units_ = std::max(largest_units_, step.units);
    }
    found_.adequate = !is_open(last);
  } else {
    cut_blocks(data_, blocks);
  }
  steps.push_back(std::move(last));
  found_.steps = std::move(steps);
}

}  // namespace isac::explain
