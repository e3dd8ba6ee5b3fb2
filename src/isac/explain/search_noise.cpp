// What a search takes for noise: its colour, read off once more beside what had passed for it or hidden it.
#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <vector>

#include "isac/explain/gate.hpp"
#include "isac/explain/search_run.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kColours = 6;  // effects beside which the noise's colour is read off

}  // namespace

void Search::take_colour(const Eigen::VectorXd& left_over) {
  take_colours(data_, left_over, cleaned(), found_.weights);
  if (!look_.settled.empty()) {  // the pressures' own has been read off already
    for (const Chain c : {Chain::kPressure1, Chain::kPressure2})
      found_.weights.colour[static_cast<int>(c)] = look_.weights.colour[static_cast<int>(c)];
    found_.weights.take(data_);
  }
  found_.wants_torque_of_free_runs = look_.provisional &&
                                     found_.weights.colour[static_cast<int>(Chain::kTorque)].wander > 0 &&
                                     can_add_torque_of_free_runs(data_);
  responses_.forget();
  found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
  move_to(found_.baseline);
}

bool Search::no_zero_wanders_beside_it() {
  if (found_.added.empty() || zero_was_stopped_ || !found_.hid_the_zero.empty() || look_.colour_beside_best ||
      !look_.settled.empty() || !a_zero_wanders(found_.weights))
    return false;
  const Eigen::VectorXd rows = unfiltered(data_, found_.weights, found_.model.residual);
  Weights weights = found_.weights;
  take_colours(data_, rows, cleaned(), weights);
  if (a_zero_wanders(weights)) return false;
  say("beside it the force sensors' zero does not wander: once more with one that stands still");
  zero_was_stopped_ = true;
  begin_anew_with_noise_of(rows);
  return true;
}

bool Search::slow_noise_hid_another(const Step& step) {
  const Screen& s = step.screen;
  if (colour_beside_best_ || found_.added.empty() || !look_.settled.empty() || step.gate.significant ||
      s.candidates.empty())
    return false;
  const Screened& most = s.candidates.front();
  if (is_significant(most, s) || most.gain < kLargeForSure * s.noise_unit) return false;
  const Trial hidden = refit_one(most);
  if (hidden.material < options_.material || units_closed(hidden) < kLargeForSure || is_implausible(hidden))
    return false;
  say(fmt::format(
      "{} would close {:.0f} units of noise in too few blocks to tell: once more beside the noise "
      "that it leaves",
      ranking_.id_of(hidden), units_closed(hidden)));
  begin_anew_with_noise_of(unfiltered(data_, found_.weights, hidden.residual));
  return true;
}

void Search::begin_anew_with_noise_of(const Eigen::VectorXd& rows) {
  colour_beside_best_ = true;
  found_.added.clear();
  found_.steps.clear();
  found_.doubts.clear();  // of what was added
  first_size_ = largest_size_ = largest_units_ = 0;
  take_colour(rows);
}

bool Search::a_wandering_zero_was_hidden_by(const Step& step) {
  if (colour_beside_best_ || step.trials.empty() || a_zero_wanders(found_.weights)) return false;
  const Eigen::VectorXd rows = unfiltered(data_, found_.weights, step.trials.front().residual);
  Weights weights = found_.weights;
  take_colours(data_, rows, cleaned(), weights);
  if (!a_zero_wanders(weights)) return false;
  say((found_.added.empty() ? "" : ranking_.id_of(found_.steps.back().trials.front()) + " and ") +
      ranking_.id_of(step.trials.front()) +
      " had hidden that the force sensors' zero wanders: once more beside what they leave");
  found_.hid_the_zero = {{step.trials.front().hypothesis, step.trials.front().values}};
  for (std::size_t i = 0; i < found_.added.size(); ++i)
    found_.hid_the_zero.emplace_back(found_.added[i],
                                     found_.model.model.effects[found_.model.tolerances + i].values);
  begin_anew_with_noise_of(rows);
  return true;
}

Weights Search::noise_of_what_is_left() const {
  Weights left = found_.weights;
  if (!found_.adequate) return left;
  const Eigen::VectorXd plain = unfiltered(data_, found_.weights, found_.model.residual);
  for (int c = 0; c < kChains; ++c)
    if (data_.has(static_cast<Chain>(c))) left.colour[c] = colour_of(data_, plain, static_cast<Chain>(c));
  return left;
}

Eigen::VectorXd Search::least_noise_beside(const Screen& s) const {
  std::vector<Screened> large;
  std::set<std::string> seen;
  for (const Screened& c : s.candidates)
    if (c.gain > kLargeForSure * s.noise_unit && large.size() < kColours &&
        seen.insert(library_.hypotheses[static_cast<std::size_t>(c.hypothesis)].id()).second)
      large.push_back(c);
  const std::vector<Trial> trials = refit_all(large);
  if (trials.empty()) return {};
  std::vector<Eigen::VectorXd> rows(trials.size());
  std::vector<double> likelihood(trials.size());
  (void)beside_functions(trials.front().residual);  // they are made once, and not by two threads
  share_work(options_.threads, trials.size(), [&](std::size_t i) {
    rows[i] = unfiltered(data_, found_.weights, trials[i].residual);
    Weights weights = found_.weights;
    take_colours(data_, rows[i], cleaned(), weights);
    likelihood[i] = log_likelihood(data_, weights, rows[i]);
  });
  return rows[static_cast<std::size_t>(std::max_element(likelihood.begin(), likelihood.end()) -
                                       likelihood.begin())];
}

}  // namespace isac::explain
