#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "isac/explain/generic_fit.hpp"
#include "isac/explain/search_run.hpp"
#include "isac/explain/slip_moment.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kShortlist = 9;
constexpr double kWorthRefitting = 0.25;  // of the best linear gain: a candidate below it is not refitted…
constexpr double kWorthRefittingUnits = 12;  // …unless it still is this many units of noise
constexpr double kMinimumBlocks = 24;
constexpr double kWorthALook = 0.5;    // of what is material: a refit may be larger than the linear response
constexpr double kKeptPromise = 0.1;   // of the linear gain
constexpr double kNearlyAsWell = 0.6;  // of the gain: another moment of a slip
constexpr double kFewSigma = 15;       // that moving what was added may bring a rival nearer by
constexpr double kNear = 0.7, kFarUnits = 400;  // of the best gain, and units of noise

}  // namespace

void Search::choose_blocks(const Eigen::VectorXd& residual) {
  const double tau = correlation_seconds(data_, residual);
  double total = 0, longest = 0;
  for (const PreparedRun& run : data_.runs)
    if (!run.time.empty()) {
      total += run.time.back();
      longest = std::max(longest, run.time.back());
    }
  double seconds = std::clamp(6 * tau, kAtomSeconds, std::max(kAtomSeconds, longest / 3));
  seconds = std::max(kAtomSeconds, std::min(seconds, total / kMinimumBlocks));
  cut_blocks(data_, seconds);
}

ScreenOptions Search::screen_options() const {
  return {.flips = 1999,
          .significance = options_.significance,
          .seed = options_.seed,
          .threads = options_.threads,
          .dictionary = true,
          .only = asked_for_};
}

Eigen::VectorXd Search::beside_functions(const Eigen::VectorXd& rows) const {
  if (!functions_) functions_.emplace(data_, options_.threads);
  return functions_->beside(rows);
}

void Search::move_to(const Fit& fit) {
  found_.model = fit;
  place_ = around(predictor_, found_.model, found_.weights);
  refitted_here_.clear();
}

Eigen::VectorXd Search::left_as_known_beforehand(const Trial& t) const {
  Active a = active_of(t);
  if (!has_fitted_states(*a.hypothesis)) return t.residual;
  a.as_known_beforehand = true;
  const Eigen::VectorXd x = place_.project(response(predictor_, *place_.fit, place_.here, a, found_.weights));
  const double norm2 = x.squaredNorm();
  return norm2 > 0 ? Eigen::VectorXd(place_.residual - x * (x.dot(place_.residual) / norm2))
                   : place_.residual;
}

Screen Search::screen_here() {
  choose_blocks(place_.residual);
  Screen s = screen(place_, library_, screen_options(), &responses_, narrow_ ? &*narrow_ : nullptr);
  if (s.candidates.empty() || s.candidates.front().gain <= 0) return s;
  const Screened first = s.candidates.front();
  const double before = data_.block_seconds;
  // The next is refitted beside it by who would have nothing to do: it will be asked for if something is missing.
  std::vector<Screened> asked = {first};
  if (options_.threads > 1 && s.candidates.size() > 1 && s.candidates[1].gain > 0 && !is_slow(first) &&
      !is_slow(s.candidates[1]))
    asked.push_back(s.candidates[1]);
  const std::vector<Trial> refitted = refit_all(asked);
  const Trial& best = refitted.front();
  refitted_here_.clear();
  for (std::size_t i = 0; i < asked.size(); ++i) refitted_here_.push_back({asked[i].start, refitted[i]});
  choose_blocks(best.residual);
  if (data_.block_seconds > before) cut_blocks(data_, before);
  Yardstick yardstick;
  const bool large_and_not_found = !is_significant(first, s) && first.gain > kLargeForSure * s.noise_unit;
  if (large_and_not_found && found_.added.empty() && !colour_beside_best_) {
    // Too little is left of it in the other blocks, or the noise was taken for as slow as the effect is.
    colour_beside_best_ = true;
    take_colour(least_noise_beside(s));
    return found_.wants_torque_of_free_runs ? s : screen_here();
  }
  if (large_and_not_found) {
    yardstick = yardstick_beside(s, place_, responses_, first.hypothesis, left_as_known_beforehand(best));
    judge(s, data_, library_, screen_options(), yardstick);
  } else if (data_.block_seconds < before) {
    judge(s, data_, library_, screen_options());
  }
  hold_rare_against_their_blocks(s, std::move(yardstick));
  return s;
}

void Search::hold_rare_against_their_blocks(Screen& s, Yardstick yardstick) {
  std::vector<Screened> rare;
  std::vector<Elsewhere> elsewhere;
  for (const Screened& c : s.candidates) {
    if (!is_significant(c, s) || c.T >= s.limit) continue;
    const Column* rarest = nullptr;
    for (const Column& column : s.columns)
      if (column.hypothesis == c.hypothesis && (rarest == nullptr || column.rare_p < rarest->rare_p))
        rarest = &column;
    if (rarest == nullptr || !(rarest->elsewhere.unit > 0)) continue;
    rare.push_back(c);
    elsewhere.push_back(rarest->elsewhere);
  }
  if (rare.empty()) return;
  const std::vector<Trial> trials = refit_all(rare);
  const ErrorsOfReading errors = errors_of_reading(place_);
  for (std::size_t i = 0; i < rare.size(); ++i) {
    yardstick.least_p[rare[i].hypothesis] =
        p_in_its_blocks(data_, place_.residual, left_as_known_beforehand(trials[i]), errors, elsewhere[i]);
    const bool known = std::any_of(refitted_here_.begin(), refitted_here_.end(), [&](const RefittedHere& r) {
      return r.trial.hypothesis == rare[i].hypothesis && r.start == rare[i].start;
    });
    if (!known) refitted_here_.push_back({rare[i].start, trials[i]});
  }
  judge(s, data_, library_, screen_options(), yardstick);
}

std::vector<Screened> Search::shortlist(const Screen& s) const {
  std::vector<Screened> list;
  std::map<std::string, int> per_id;
  std::optional<Screened> slip;
  if (s.candidates.empty()) return list;
  const double best = s.candidates.front().gain;
  for (const Screened& c : s.candidates) {
    if (c.gain <= 0) break;
    if (list.size() >= kShortlist) break;
    if (!is_significant(c, s) && c.gain < 0.5 * best) continue;
    if (c.gain < kWorthRefitting * best && c.gain < kWorthRefittingUnits * s.noise_unit) break;
    if (c.gain < 0.15 * best && list.size() >= 4) break;
    const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(c.hypothesis)];
    if (std::any_of(found_.added.begin(), found_.added.end(),
                    [&](int a) { return library_.hypotheses[static_cast<std::size_t>(a)].id() == h.id(); }))
      continue;
    if (++per_id[h.id()] > 3) continue;
    list.push_back(c);
    if (h.id() == "encoder_slip") slip = c;
  }
  // Far behind what takes most, no other moment is nearer: each takes less.
  if (slip && (slip->gain > kNear * best || best - slip->gain < kFarUnits * s.noise_unit))
    add_other_moments(*slip, s, list);
  return list;
}

void Search::add_other_moments(const Screened& best, const Screen& s, std::vector<Screened>& list) {
  for (const Screened& other : s.shapes)
    if (other.hypothesis == best.hypothesis && other.shape != best.shape &&
        other.gain > kNearlyAsWell * best.gain)
      list.push_back(other);
}

void Search::choose_moment(Step& step) const {
  const auto slip = std::find_if(step.trials.begin(), step.trials.end(), [&](const Trial& t) {
    return t.in_set && is_slip(*active_of(t).hypothesis);
  });
  if (slip == step.trials.end()) return;
  const int parameters = ranking_.parameters_of(*slip);
  Trial other = *slip;
  double most = 0, least = std::numeric_limits<double>::infinity();
  for (const Screened& s : step.screen.shapes)
    if (s.hypothesis == slip->hypothesis) most = std::max(most, s.gain);
  for (const Screened& s : step.screen.shapes) {
    if (s.hypothesis != slip->hypothesis || s.gain < kNearlyAsWell * most) continue;
    other.values[kSlipMoment] =
        active_of(*slip).hypothesis->shapes[static_cast<std::size_t>(s.shape)][kSlipMoment];
    if (ranking_.parameters_of(other) > parameters) continue;  // within a run, where it was told between two
    const Fit fit = refit(predictor_, found_.model, {active_of(other)}, found_.weights, 6);
    if (fit.loss >= least) continue;
    least = fit.loss;
    slip->values = fit.model.effects.back().values;
  }
}

Trial Search::refit_one(const Screened& candidate) const {
  for (const RefittedHere& known : refitted_here_)
    if (known.trial.hypothesis == candidate.hypothesis && known.start == candidate.start) return known.trial;
  const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(candidate.hypothesis)];
  Refined refined = refine(place_, h, candidate.start);
  // Where the linear start was a bad one, the shape's own values are another.
  if (!h.info().linear && refined.loss > place_.residual.squaredNorm() - 0.5 * candidate.gain) {
    Refined other = refine(place_, h, h.shapes[static_cast<std::size_t>(candidate.shape)]);
    if (other.loss < refined.loss) refined = std::move(other);
  }
  Trial trial;
  trial.hypothesis = candidate.hypothesis;
  trial.values = refined.values;
  trial.residual = std::move(refined.residual);
  trial.loss = refined.loss;
  trial.material = size_over_floor(data_, found_.weights, found_.floors, trial.residual - place_.residual);
  return trial;
}

bool Search::is_slow(const Screened& candidate) const {
  const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(candidate.hypothesis)];
  return !h.info().linear && (h.chains & kPressureChains) != 0;
}

std::vector<Trial> Search::refit_all(const std::vector<Screened>& list) const {
  // A single slow one has all threads for its runs.
  std::vector<Trial> trials(list.size());
  std::vector<std::size_t> shared, slow;
  for (std::size_t i = 0; i < list.size(); ++i) (is_slow(list[i]) ? slow : shared).push_back(i);
  if (slow.size() > 1) shared.insert(shared.end(), slow.begin(), slow.end());
  share_work(options_.threads, shared.size(),
             [&](std::size_t k) { trials[shared[k]] = refit_one(list[shared[k]]); });
  if (slow.size() == 1) trials[slow.front()] = refit_one(list[slow.front()]);
  return trials;
}

bool Search::a_shape_was_fitted() const {
  return std::any_of(found_.added.begin(), found_.added.end(), [&](int added) {
    const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(added)];
    return (h.chains & kForceChains) != 0 &&
           std::any_of(h.amplitude.begin(), h.amplitude.begin() + h.info().parameter_count,
                       [](bool amplitude) { return !amplitude; });
  });
}

void Search::fit_with_the_baseline(std::vector<Trial>& trials, double nearer_than) const {
  if (trials.empty()) return;
  const Trial first = trials.front();
  share_work(options_.threads, trials.size(), [&](std::size_t i) {
    Trial& t = trials[i];
    if (!ranking_.share_readings(t, first) || told_behind(t.behind) > nearer_than) return;
    const Fit fit = refit(predictor_, found_.model, {active_of(t)}, found_.weights, 12);
    Eigen::VectorXd residual = place_.project(fit.residual);
    const double loss = residual.squaredNorm();
    if (!(loss < t.loss)) return;
    t.values = fit.model.effects.back().values;
    t.residual = std::move(residual);
    t.loss = loss;
  });
  ranking_.rank(trials, place_.residual);
}

bool Search::is_open_at_least(const Step& step, double size) const {
  std::set<std::string> every;
  for (const Hypothesis& h : library_.hypotheses) every.insert(h.id());
  const Gate nameless = gate_of(step.screen, every);
  return step.gate.significant && nameless.dense_size >= std::max(options_.material, size);
}

Step Search::screened_step() {
  Step step;
  step.screen = screen_here();
  step.gate = gate_of(step.screen);
  return step;
}

Step Search::refitted(Step step) {
  const double least = std::max(options_.material, found_.added.empty() ? 0.0 : small_in(step.gate.chain));
  if (!step.gate.significant) return step;
  // What shows beside an effect may be small, and made by something large whose shape the blocks do not agree on.
  const std::vector<Screened>& candidates = step.screen.candidates;
  const bool large_beside = !found_.added.empty() && !candidates.empty() &&
                            candidates.front().gain > kLargeForSure * step.screen.noise_unit;
  if (step.gate.size < kWorthALook * least && !large_beside) return step;
  step.trials = refit_all(shortlist(step.screen));
  std::set<std::string> ignored;
  std::erase_if(step.trials, [&](const Trial& t) {
    const bool wrong = is_implausible(t) || is_empty_promise(t, step.screen);
    if (wrong) ignored.insert(ranking_.id_of(t));
    return wrong;
  });
  if (!ignored.empty()) step.gate = gate_of(step.screen, ignored);
  ranking_.rank(step.trials, place_.residual);
  if (clips_force(found_.model.model))
    fit_with_the_baseline(step.trials, std::numeric_limits<double>::infinity());
  else if (a_shape_was_fitted())
    fit_with_the_baseline(step.trials, kFewSigma);
  choose_moment(step);
  if (found_.added.empty()) put_material_first(step);
  // What shows in a few blocks only is as large as its refit says, not as its linear response promised; and two zeros that go against each other, which
  // close next to nothing, may be of any size.
  const bool closes_some =
      !step.trials.empty() && (!found_.added.empty() || units_closed(step.trials.front()) >= kThreeSigma);
  const double refitted = closes_some ? step.trials.front().material : 0.0;
  step.gate.material = std::max(step.gate.dense_size, refitted) >= least_material(step);
  step.units = std::max(speaks_of_what_shows(step) ? units_closed(step.trials.front()) : 0.0,
                        units_of_functions(step));
  leave_to_slow_noise(step);
  return step;
}

double Search::least_material(const Step& step) const {
  return little_counts_ && is_beyond_doubt(step) ? kWorthALook * options_.material : options_.material;
}

bool Search::is_beyond_doubt(const Step& step) const {
  return found_.added.empty() && step.gate.beyond_doubt && !step.trials.empty() &&
         units_closed(step.trials.front()) >= kLargeForSure;
}

void Search::put_material_first(Step& step) const {
  std::vector<Trial>& trials = step.trials;
  if (trials.empty() || trials.front().material >= options_.material || step.gate.size < options_.material)
    return;
  const auto first = std::find_if(trials.begin(), trials.end(), [&](const Trial& t) {
    return t.in_set && t.material >= options_.material && units_closed(t) >= kThreeSigma;
  });
  if (first == trials.end()) return;
  std::rotate(trials.begin(), first, first + 1);
  ranking_.mark(trials);
  for (Trial& t : trials) t.in_set = t.in_set && t.material >= options_.material;
  Ranking::weigh(trials);
}

void Search::leave_to_slow_noise(Step& step) {
  if (step.trials.empty()) return;
  const double best_of_many = std::min(1.0, static_cast<double>(step.screen.candidates.size()) *
                                                std::erfc(std::sqrt(0.5 * std::max(0.0, step.units))));
  if (found_.added.empty() ? step.units >= kThreeSigma : best_of_many <= options_.significance) return;
  step.gate.significant = false;
  step.gate.p_value = std::max(step.gate.p_value, best_of_many);
  const bool named = speaks_of_what_shows(step);
  const std::string what = named ? ranking_.id_of(step.trials.front()) : step.gate.what;
  const std::string sentence =
      fmt::format("ruled out: {:.1f} sigma, no more than noise as slow as this makes of the best of so many",
                  std::sqrt(std::max(0.0, step.units)));
  if (named) found_.notes.push_back({what, sentence});
  say(what + ": " + sentence);
}

double Search::units_of_functions(const Step& step) const {
  const GenericFit generic = fit_generic(place_, step.screen, options_.threads);
  if (generic.functions.empty()) return 0;
  const double unit =
      compare(data_, generic.residual, place_.residual, 0, noise_density(data_, generic.residual)).unit;
  return generic.gain / unit - 2.0 * kChoosingOne * static_cast<double>(generic.functions.size());
}

bool Search::speaks_of_what_shows(const Step& step) const {
  if (step.trials.empty()) return false;
  const Trial& best = step.trials.front();
  if ((together_with(chains_of(best)) & together_with(bit(step.gate.chain))) != 0) return true;
  return std::any_of(step.screen.candidates.begin(), step.screen.candidates.end(), [&](const Screened& c) {
    return c.hypothesis == best.hypothesis && is_significant(c, step.screen);
  });
}

bool Search::is_implausible(const Trial& t) {
  const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
  const std::string objection = plausible_.objection(h, t.values);
  if (objection.empty()) return false;
  found_.notes.push_back({h.id(), "ruled out: " + objection});
  say(h.id() + ": ruled out: " + objection);
  return true;
}

bool Search::is_empty_promise(const Trial& t, const Screen& s) const {
  for (const Screened& c : s.candidates)
    if (c.hypothesis == t.hypothesis) return place_.residual.squaredNorm() - t.loss < kKeptPromise * c.gain;
  return false;
}

Active Search::active_of(const Trial& t) const {
  Active a;
  a.hypothesis = &library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
  a.values = t.values;
  return a;
}

double Search::units_closed(const Trial& t) const {
  return (place_.residual.squaredNorm() - t.loss) /
         compare(data_, t.residual, place_.residual, 0, noise_density(data_, t.residual)).unit;
}

Fit Search::with(const std::vector<Trial>& effects) const {
  std::vector<Active> active;
  for (const Trial& t : effects) active.push_back(active_of(t));
  return active.empty() ? found_.baseline : refit(predictor_, found_.baseline, active, found_.weights, 6);
}

}  // namespace isac::explain
