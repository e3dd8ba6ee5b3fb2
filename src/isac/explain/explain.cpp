#include "isac/explain/explain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/explain/candidates.hpp"
#include "isac/explain/could_hide.hpp"
#include "isac/explain/describe.hpp"
#include "isac/explain/doubt.hpp"
#include "isac/explain/experiment.hpp"
#include "isac/explain/free_torque.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/left_over.hpp"
#include "isac/explain/number_doubts.hpp"
#include "isac/explain/proof.hpp"
#include "isac/explain/quiet_pressure.hpp"
#include "isac/explain/raw_effects.hpp"
#include "isac/explain/search.hpp"
#include "isac/explain/slip_moment.hpp"
#include "isac/explain/taken_out.hpp"
#include "isac/explain/two_zeros.hpp"
#include "isac/explain/uncertainty.hpp"
#include "isac/explain/unknown.hpp"
#include "isac/explain/where.hpp"

namespace isac::explain {
namespace {

void check_terms(const BaselineModel& baseline) {
  for (const std::string& term : baseline.terms)
    if (models::find_effect(term) < 0)
      throw Error(ErrorKind::kUsage, "term_unknown",
                  "the term '" + term + "' is not in the catalogue (docs/effects.md).");
}

}  // namespace

const char* to_string(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kNone:
      return "none";
    case Verdict::kImmaterial:
      return "immaterial";
    case Verdict::kNamed:
      return "named";
    case Verdict::kFamily:
      return "family";
    case Verdict::kNotSeparable:
      return "not_separable";
    case Verdict::kUnknown:
      return "unknown";
  }
  return "";
}

namespace {

/// The baseline as anyone would fit it, by plain least squares and without tolerances. (What fits beside effects has them.)
ModelPoint plain_baseline(const Predictor& predictor, const Found& found) {
  Weights plain = found.weights;
  for (Colour& colour : plain.colour) colour = {};
  plain.filter.reset();
  return fit_baseline(predictor, {}, plain, false).model;
}

void fill_heldout(const Predictor& predictor, const ModelPoint& plain, const Proof& proof,
                  std::vector<SignalGap>& signals) {
  if (proof.runs() == 0) return;
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2, Chain::kMotion}) {
    if (!predictor.data().has(chain)) continue;
    const Label label = label_of(predictor.data(), chain);
    for (SignalGap& gap : signals)
      if (gap.signal == label.signal) gap.heldout = label.scale * proof.residual(plain, chain).rms();
  }
}

void fill_gap(const Predictor& predictor, const Found& found, const ModelPoint& plain, const Proof& proof,
              Chain chain, const BaselineModel& baseline, Gap& gap) {
  const bool pressure = chain == Chain::kPressure1 || chain == Chain::kPressure2;
  const double scale = pressure ? 1 / kPascalPerKgfCm2 : 1.0;
  gap.signal = chain == Chain::kTorque      ? baseline.output
               : chain == Chain::kMotion    ? "motion"
               : chain == Chain::kPressure1 ? "p1"
                                            : "p2";
  gap.unit = chain == Chain::kTorque ? baseline.output_unit : pressure ? "kg/cm2" : "N m";
  const ModelPoint& user = found.added.empty() ? found.baseline.model : plain;
  gap.before = scale * raw_residual(predictor, user, chain).rms();
  gap.after = scale * raw_residual(predictor, found.model.model, chain).rms();
  const auto c = static_cast<int>(chain);
  gap.noise_floor =
      scale * (chain == Chain::kMotion ? std::hypot(found.weights.sigma[c], found.floors.slow[c])
                                       : found.floors.all(chain));
  // What an adequate model leaves of the fitted runs, nothing significant, is noise, also what neighbouring samples do not differ by.
  const bool all_found = found.adequate && !found.added.empty() && found.steps.size() > found.added.size() &&
                         !found.steps.back().gate.significant;
  if (all_found && gap.after < gap.before) gap.noise_floor = std::max(gap.noise_floor, gap.after);
  if (proof.runs() == 0) return;
  const Sums before = proof.residual(user, chain), after = proof.residual(found.model.model, chain);
  gap.heldout_before = scale * before.rms();
  gap.heldout_after = scale * after.rms();
  gap.heldout_zero_model = scale * before.signal_rms();
  const double floor2 = gap.noise_floor * gap.noise_floor,
               open = gap.heldout_before * gap.heldout_before - floor2;
  constexpr double kShowing = 0.02;  // of the floor's square; less is not known so well
  if (open > kShowing * floor2)
    gap.share_closed = 1 - (gap.heldout_after * gap.heldout_after - floor2) / open;
}

/// An effect of the forces enters the torque and, where the joint is free, its motion. Where slow noise decides in one of them, and by little if it
/// refutes the name, the other may show it: then the gap is told there.
bool other_reading_shows(const Predictor& predictor, const Library& library, const Found& found,
                         const ModelPoint& plain, const Proof& proof, Chain chain, bool refuted,
                         const ExplainOptions& options, Gap& gap) {
  constexpr double kByLittle = 1.05, kShows = 0.999;
  if (chain != Chain::kTorque && chain != Chain::kMotion) return false;
  const Chain other = chain == Chain::kTorque ? Chain::kMotion : Chain::kTorque;
  const Colour& colour = found.weights.colour[static_cast<int>(chain)];
  const bool enters = std::all_of(found.added.begin(), found.added.end(), [&](int h) {
    return (library.hypotheses[static_cast<std::size_t>(h)].chains & bit(other)) != 0;
  });
  if (!enters || !predictor.data().has(other) || !(colour.slow > 0 || colour.wander > 0) ||
      (refuted && gap.heldout_after > kByLittle * gap.heldout_before) ||
      proof.freed(found.model.model, plain, found.weights, other).behind.t < kSetLimit)
    return false;
  Gap there;
  fill_gap(predictor, found, plain, proof, other, options.baseline, there);
  if (!(there.heldout_after < kShows * there.heldout_before) || (refuted && closes_little(there)))
    return false;
  gap = there;
  return true;
}

/// Do indexes of one library mean the same in the other?
bool same_hypotheses(const Library& a, const Library& b) {
  return std::equal(a.hypotheses.begin(), a.hypotheses.end(), b.hypotheses.begin(), b.hypotheses.end(),
                    [](const Hypothesis& x, const Hypothesis& y) {
                      return x.effect == y.effect && x.clock == y.clock && x.seen_by == y.seen_by &&
                             x.chains == y.chains;
                    });
}

/// What is named is not added where the model would be further off for it on runs that it has not seen.
void withhold(Explanation& e) {
  constexpr double kWorse = 1.001;  // less is nothing
  Gap& gap = e.gap;
  const bool freed_speaks_for_it = std::isfinite(gap.freed_before) && gap.freed_after < gap.freed_before;
  if (e.verdict == Verdict::kUnknown || e.effects.empty() ||
      !(gap.heldout_after > kWorse * gap.heldout_before) || freed_speaks_for_it)
    return;
  e.withheld = fmt::format("the held-out runs are {:#.4g} {} off without it and {:#.4g} with it",
                           gap.heldout_before, gap.unit, gap.heldout_after);
  e.waterfall.clear();
  gap.after = gap.before;
  gap.heldout_after = gap.heldout_before;
  gap.share_closed = gap.freed_before = gap.freed_after = kNotKnown;
}

/// None of the catalogue: what came nearest is told as ruled out, nothing is added.
void leave_unnamed(const Predictor& predictor, const Found& found, Explanation& e) {
  for (Candidate& c : e.effects) e.rejected.insert(e.rejected.begin(), c);
  for (Candidate& c : e.alternatives) e.rejected.push_back(c);
  for (Candidate& c : e.rejected) c.confidence = 0;  // nearest, and still ruled out
  e.effects.clear();
  e.alternatives.clear();
  e.gap.after = e.gap.before;
  e.gap.heldout_after = e.gap.heldout_before;
  e.gap.share_closed = 0;
  e.gap.freed_before = e.gap.freed_after = kNotKnown;
  if (!found.steps.empty())
    e.unknown =
        describe_unknown(around(predictor, found.baseline, found.weights), found.steps.front().screen);
  if (e.unknown && found.comes_and_goes) add_time(*e.unknown);
}

/// Is what was found first less than what is material, and there only because it is beyond doubt? Something larger may show elsewhere.
bool is_little(const Found& found, const ExplainOptions& options) {
  if (found.steps.empty()) return false;
  const Step& first = found.steps.front();
  return first.gate.dense_size < options.material &&
         (first.trials.empty() || first.trials.front().material < options.material);
}

}  // namespace

Explanation explain(std::span<const series::Recording> runs, const HeldOut& heldout,
                    const ExplainOptions& options) {
  check_terms(options.baseline);
  Prepared data = prepare(runs, options.rig, options.baseline, 4.0, heldout.first_start());
  QuietPressure quiet = QuietPressure::learn(data, nullptr, options.threads);
  auto library_here = std::make_unique<Library>(make_library(data, options.excluded));
  auto predictor_here = std::make_unique<Predictor>(data, options.threads);
  Look first;
  first.provisional = true;
  Found found = search(*predictor_here, *library_here, data, options, first);
  const bool nothing =
      (found.added.empty() && !(found.gate.significant && found.gate.material)) || is_little(found, options);
  const bool unseen = !found.wants_torque_of_free_runs && nothing && can_add_torque_of_free_runs(data) &&
                      free_torque_is_off(*predictor_here, found.model.model);
  if (found.wants_torque_of_free_runs || unseen) {
    if (options.progress)
      options.progress(unseen ? "the torque of free runs is further off than that of others: it is fitted too"
                              : "the force sensors' zero wanders: free runs tell it beside their motion");
    add_torque_of_free_runs(data);
    const std::unique_ptr<Library> before = std::move(library_here);
    library_here = std::make_unique<Library>(make_library(data, options.excluded));
    predictor_here = std::make_unique<Predictor>(data, options.threads);
    if (!found.hid_the_zero.empty() && same_hypotheses(*before, *library_here)) {
      first.colour_beside_best = true;
      first.found = std::move(found.hid_the_zero);
    }
    found = search(*predictor_here, *library_here, data, options, first);
  }
  // What a valve does besides its lag stood in the torque as if it were half noise: with the effect known, once more.
  std::unique_ptr<Library> first_library;
  if (found.worth_another_look) {
    const ModelPoint valves = found.model.model;
    std::optional<TrialNote> recorder;
    first_library = std::move(library_here);
    quiet = QuietPressure::learn(data, &valves, options.threads);
    library_here = std::make_unique<Library>(make_library(data, options.excluded));
    // How the recorder counts is known by now, and among the contenders of another look it is not.
    const auto counts = std::find_if(found.notes.begin(), found.notes.end(), [](const TrialNote& note) {
      return note.id == "encoder_offset" && note.sentence.ends_with(kLeftToTheRecorder);
    });
    if (counts != found.notes.end()) {
      recorder = *counts;
      tolerate(*library_here, data, "encoder_offset", -0.5 * data.rig.angle_step, 0.5 * data.rig.angle_step);
    }
    predictor_here = std::make_unique<Predictor>(data, options.threads);
    if (options.progress) options.progress("the torque is looked at once more, beside what the valves do");
    Look again;
    again.contenders = std::move(found.contenders);
    again.gate = found.gate;
    again.another_pair = found.another_pair;
    if (same_hypotheses(*first_library, *library_here)) {
      again.settled = std::move(found.settled);
      again.weights = found.weights;
      again.colour_beside_best = found.colour_beside_best;
      for (std::size_t i = 0; i < found.added.size(); ++i)
        again.found.emplace_back(found.added[i],
                                 found.model.model.effects[found.model.tolerances + i].values);
      again.notes = std::move(found.notes);
    }
    found = search(*predictor_here, *library_here, data, options, again);
    if (recorder && std::none_of(found.notes.begin(), found.notes.end(),
                                 [&](const TrialNote& note) { return note.sentence == recorder->sentence; }))
      found.notes.push_back(*recorder);
  }
  const Library& library = *library_here;
  const Predictor& predictor = *predictor_here;

  const Proof proof(heldout, data, quiet);
  take_away_what_is_refuted(predictor, library, proof, found);
  std::string moment = slip_instead(predictor, library, proof, found);
  if (moment.empty()) moment = settle_slip(predictor, library, proof, found);

  Explanation e;
  e.samples = data.rows.size();
  e.blocks = data.blocks;
  e.block_seconds = data.block_seconds;
  e.fitted_runs = data.runs.size();
  if (data.untold() > 0)
    e.warnings.push_back(
        {"slow_turns_left_out",
         fmt::format("{:.0f} s of slow turns, in which the encoder does not tell which way the joint "
                     "goes, do not count in the torque.",
                     data.untold())});
  e.not_testable = library.not_testable;
  e.p_value = found.gate.p_value;
  e.detected = found.gate.significant;
  for (const TrialNote& note : found.notes) e.trials.push_back(note);
  bool single = true, one_family = true;
  std::string family;
  for (std::size_t s = 0; s < found.added.size(); ++s) {
    const Step& step = found.steps[s];
    e.effects.push_back(candidate_of(library, step.trials.front(), step.trials.front().weight));
    family = family_of(library.hypotheses[static_cast<std::size_t>(step.trials.front().hypothesis)].effect);
    for (std::size_t i = 1; i < step.trials.size(); ++i) {
      const Trial& t = step.trials[i];
      (t.in_set ? e.alternatives : e.rejected).push_back(candidate_of(library, t, t.weight));
      if (!t.in_set) continue;
      single = false;
      one_family = one_family &&
                   family == family_of(library.hypotheses[static_cast<std::size_t>(t.hypothesis)].effect);
    }
  }
  if (!found.gate.significant) {
    e.verdict = Verdict::kNone;
  } else if (!found.gate.material) {
    e.verdict = Verdict::kImmaterial;
  } else if (!found.adequate || found.added.empty()) {
    e.verdict = Verdict::kUnknown;
  } else {
    e.verdict = single ? Verdict::kNamed : (one_family ? Verdict::kFamily : Verdict::kNotSeparable);
  }
  Chain chain = found.gate.chain;
  if (!found.added.empty())
    (void)size_over_floor(data, found.weights, found.floors, found.model.residual - found.baseline.residual,
                          &chain);
  e.heldout_runs = proof.runs();
  const ModelPoint plain = plain_baseline(predictor, found);
  const ModelPoint& user = found.added.empty() ? found.baseline.model : plain;
  fill_gap(predictor, found, plain, proof, chain, options.baseline, e.gap);
  const bool refuted = is_refuted(predictor, found, user, proof, chain, options, e.gap);
  const bool told =
      (refuted || e.gap.heldout_after > e.gap.heldout_before) && !found.added.empty() &&
      other_reading_shows(predictor, library, found, plain, proof, chain, refuted, options, e.gap);
  if (refuted && !told) {
    e.verdict = Verdict::kUnknown;
    const std::string why =
        fmt::format("ruled out by the held-out runs: {:.3g} {} off without it, {:.3g} with it",
                    e.gap.heldout_before, e.gap.unit, e.gap.heldout_after);
    e.trials.push_back({e.effects.front().id, why});
    if (options.progress) options.progress(e.effects.front().id + ": " + why);
  }
  constexpr double kFurtherOff = 1.01;  // noise decides that much
  constexpr double kFew = 25;           // units of noise on the fitted runs, five sigma
  std::optional<Uncertain> numbers;
  if (e.verdict != Verdict::kUnknown && !found.added.empty()) {
    doubt_what_is_left(predictor, library, proof, options, found);
    doubt_what_differs_by_half(predictor, options, found, e);
    numbers = uncertainties(predictor, found.model, found.weights);
    for (std::size_t i = 0; i < found.added.size(); ++i) {
      e.effects[i].missed_by = missed_by(predictor, found, i);
      std::vector<std::string> doubts = doubts_of_numbers(
          library.hypotheses[static_cast<std::size_t>(found.added[i])].info(), numbers->effects[i]);
      const bool hardly_general = found.hardly_general.contains(found.added[i]);
      if (!doubts.empty() || hardly_general) keep_simple_case(library, found.steps[i].trials, i, e);
      if (hardly_general) continue;  // told already, by a fit: its numbers say no more
      for (std::string& why : doubts) found.doubts.push_back(std::move(why));
    }
    if (std::string why = told_by_one_run(predictor, proof, found); !why.empty())
      found.doubts.push_back(std::move(why));
    if (std::string why = told_by_few_sigma(e.effects); !why.empty()) found.doubts.push_back(std::move(why));
    for (std::size_t i = 0; i < e.effects.size(); ++i)
      if (is_told_by_few_sigma(e.effects[i])) keep_general_cases(library, found.steps[i].trials, i, e);
    keep_what_both_are(library, found, e);
    if (e.gap.heldout_after > kFurtherOff * e.gap.heldout_before && found.steps.front().units < kFew)
      found.doubts.push_back(
          fmt::format("On held-out runs the {} is {:.3g} {} off with it and {:.3g} {} without: only freed of "
                      "the noise's slow part it is nearer.",
                      e.gap.signal, e.gap.heldout_after, e.gap.unit, e.gap.heldout_before, e.gap.unit));
  }
  if (e.effects.size() == 1)  // of several, each has alternatives of its own
    std::stable_sort(e.alternatives.begin(), e.alternatives.end(),
                     [](const Candidate& a, const Candidate& b) { return a.confidence > b.confidence; });
  if (e.verdict == Verdict::kUnknown) {
    leave_unnamed(predictor, found, e);
  } else if (!e.effects.empty() && (!found.doubts.empty() || closes_little(e.gap))) {
    doubt(predictor, found, e);
  }
  if (options.next_experiment && e.verdict != Verdict::kUnknown)
    e.next_experiment =
        next_experiment(predictor, library, found, {.limits = options.limits, .threads = options.threads});
  e.where = regions(predictor, library, found);
  constexpr std::size_t kMostHidden = 64;  // every effect that was looked for and not found has a bound
  add_raw_effects(predictor, found, proof, options, e);
  withhold(e);  // of all that was named: a line or spikes may have mended the gap
  e.could_hide = could_hide(data, library, found, kMostHidden);
  e.not_testable = not_testable(data, library, found);
  std::erase_if(e.not_testable, [&](const std::string& id) {  // what was refitted was tested
    const auto is = [&](const Candidate& c) { return c.id == id; };
    return std::any_of(e.effects.begin(), e.effects.end(), is) ||
           std::any_of(e.alternatives.begin(), e.alternatives.end(), is) ||
           std::any_of(e.rejected.begin(), e.rejected.end(), is);
  });
  const std::string zeros = tell_a_valves_zero(options.excluded, e);
  describe(predictor, library, found, proof, options, numbers, e);
  if (!zeros.empty()) e.summary += " " + zeros;
  if (!moment.empty() && e.verdict != Verdict::kUnknown) e.summary += " " + moment;
  fill_heldout(predictor, plain, proof, e.signals);
  look_beyond_fitted_runs(data, found, proof, e);
  look_at_slow_noise(predictor, found, options.material, e);
  look_at_moments(predictor, found, e);
  look_at_curves(data, found, options, e);
  return e;
}

}  // namespace isac::explain
