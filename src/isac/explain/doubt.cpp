#include "isac/explain/doubt.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "isac/core/units.hpp"
#include "isac/explain/curves.hpp"
#include "isac/explain/halves.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/left_over.hpp"
#include "isac/explain/moments.hpp"
#include "isac/explain/raw_effects.hpp"
#include "isac/explain/slow_noise.hpp"
#include "isac/explain/taken_out.hpp"
#include "isac/explain/unknown.hpp"
#include "isac/explain/variable_words.hpp"

namespace isac::explain {
namespace {

/// The chain in which two fits of the same rows differ most, over the floor.
Chain shows_most_in(const Predictor& predictor, const Found& found, const Fit& with, const Fit& without) {
  Chain chain = Chain::kTorque;
  (void)size_over_floor(predictor.data(), found.weights, found.floors, with.residual - without.residual,
                        &chain);
  return chain;
}

constexpr double kNoneOfThemByHalves =
    0.5;  // of the belief: none of 141 right names differs so, twelve of 51 wrong ones do

/// A model that does worse on what it has not seen is not an explanation, neither beside the search's own baseline nor beside what anyone
/// would have fitted.
bool does_worse(const Found& found, const Proof& proof, Chain chain, const Gap& gap) {
  constexpr double kWorse = 1.002, kWorseThanOwn = 1.01;
  const double own = proof.residual(found.baseline.model, chain).rms();
  return proof.residual(found.model.model, chain).rms() > kWorseThanOwn * own ||
         gap.heldout_after > kWorse * gap.heldout_before;
}

/// The noise's slow part, a zero that wanders most of all, may decide which plain rms is larger; freed of it, the rows may speak for the model all
/// the same.
void free_of_slow_noise(const Prepared& data, const Found& found, const Proof::Freed& freed, Chain chain,
                        Gap& gap) {
  constexpr double kShowing = 0.05;  // of the floor's square; a share of less is a share of the floor's error
  const bool pressure = (bit(chain) & kPressureChains) != 0;
  const double scale = pressure ? 1 / kPascalPerKgfCm2 : 1.0,
               told = weighted_rms(data, found.weights, found.model.residual, chain);
  gap.freed_before = scale * freed.second;
  gap.freed_after = scale * freed.first;
  const double open = freed.second * freed.second - told * told;
  gap.share_closed = open > kShowing * told * told
                         ? (freed.second * freed.second - freed.first * freed.first) / open
                         : kNotKnown;
}

}  // namespace

bool closes_little(const Gap& gap) {
  constexpr double kLittle = 0.25,
                   kOpen = 1.10;  // less open than that, and the floor itself is not known well enough
  const bool open = std::isfinite(gap.freed_before) || gap.heldout_before > kOpen * gap.noise_floor;
  return open && gap.share_closed < kLittle;
}

bool is_refuted(const Predictor& predictor, Found& found, const ModelPoint& user, const Proof& proof,
                Chain chain, const ExplainOptions& options, Gap& gap) {
  constexpr double kClearly = 3.0, kHardly = -1.645;  // sigma, freed of what the noise remembers
  constexpr double kAbout = 1.01;                     // where they hardly show the effect, noise decides
  constexpr double kLikely = 1.645, kWandersBy = 1.05, kLikelyAllTheSame = 2.576;  // by more it casts a doubt
  constexpr double kTooLittle = 8, kHardlyWorse = 1.02;
  if (found.added.empty() || proof.runs() == 0) return false;
  const bool worse = does_worse(found, proof, chain, gap);
  if (!worse && !closes_little(gap) && gap.heldout_after <= gap.heldout_before) return false;
  const Proof::Freed freed = proof.freed(found.model.model, user, found.weights, chain);
  const Colour& colour = found.weights.colour[static_cast<int>(chain)];
  const bool slow = colour.slow > 0 || colour.wander > 0;
  if (slow && freed.behind.t >= kClearly && freed.first < freed.second) {
    free_of_slow_noise(predictor.data(), found, freed, chain, gap);
    return false;
  }
  // Rows in which the two models differ by less than three sigma of data do not show the effect, and refute nothing.
  const bool hardly = freed.behind.t >= kHardly || freed.behind.separation < kSetLimit;
  if (!worse || (gap.heldout_after <= kAbout * gap.heldout_before && hardly)) {
    if (slow && gap.heldout_after > gap.heldout_before && freed.behind.t > 0 && freed.first < freed.second)
      free_of_slow_noise(predictor.data(), found, freed, chain, gap);
    return false;
  }
  // Where held-out rows hold too little of a faint effect to tell, slow noise decides and says nothing.
  const bool says_nothing = freed.behind.separation < kTooLittle && freed.behind.t > 0 &&
                            freed.behind.t < kLikely &&
                            gap.heldout_after <= kHardlyWorse * gap.heldout_before;
  const bool by_more = gap.heldout_after > kWandersBy * gap.heldout_before,
             likely = freed.behind.t >= (by_more ? kLikelyAllTheSame : kLikely);
  if (slow && freed.first < freed.second && (says_nothing || likely)) {
    if (says_nothing)
      found.doubts.push_back(
          fmt::format("The held-out runs neither show nor refute it ({:.1f} sigma for it, freed of the "
                      "noise's slow part).",
                      freed.behind.t));
    else if (by_more)
      found.doubts.push_back(
          fmt::format("The held-out runs, as they were read, are {:.3g} {} off with it and {:.3g} without; "
                      "freed of the noise's slow part they speak for it, by {:.1f} sigma.",
                      gap.heldout_after, gap.unit, gap.heldout_before, freed.behind.t));
    free_of_slow_noise(predictor.data(), found, freed, chain, gap);
    return false;
  }
  const ModelPoint &model = found.model.model, &own = found.baseline.model;
  // Beside a line that nobody took out yet, rows that hold less than three sigma of the effect say nothing against it.
  const bool shows = freed.behind.separation >= kTwinLimit;
  return (shows && proof.freed(model, own, found.weights, chain).behind.t < kClearly) ||
         !is_mended_by_raw_effects(predictor, found, proof, chain, options, gap);
}

namespace {

/// Of a step's trials the one that held-out runs bear, of those hardly behind the name that they refute; its fit beside the others. The trials
/// that they refute too are left out of the set.
std::optional<Fit> borne_instead(const Predictor& predictor, const Library& library,
                                 const std::vector<Active>& others, const Found& found, const Proof& proof,
                                 const Fit& without, std::vector<Trial>& trials) {
  constexpr double kHardlyBehind = 3.0;  // sigma
  std::optional<Fit> first;
  std::vector<Trial> borne, ruled_out;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const Trial& t = trials[i];
    if (i == 0 || !(t.behind.t < kHardlyBehind)) {
      ruled_out.push_back(t);
      continue;
    }
    std::vector<Active> all = others;
    all.push_back({&library.hypotheses[static_cast<std::size_t>(t.hypothesis)], t.values});
    Fit fit = refit(predictor, found.baseline, all, found.weights, kRefitIterations);
    const Chain chain = shows_most_in(predictor, found, fit, without);
    const bool bears = proof.residual(fit.model, chain).rms() <= proof.residual(without.model, chain).rms() ||
                       proof.freed(fit.model, without.model, found.weights, chain).behind.t >= kSetLimit;
    (bears ? borne : ruled_out).push_back(t);
    if (bears && !first) first = std::move(fit);
  }
  if (!first) return first;
  const std::size_t bear = borne.size();
  trials = std::move(borne);
  trials.insert(trials.end(), ruled_out.begin(), ruled_out.end());
  Ranking(predictor.data(), library).mark(trials);
  for (std::size_t i = bear; i < trials.size(); ++i) trials[i].in_set = false;
  Ranking::weigh(trials);
  return first;
}

}  // namespace

void take_away_what_is_refuted(const Predictor& predictor, const Library& library, const Proof& proof,
                               Found& found) {
  constexpr double kWorse = 1.02;
  if (proof.runs() == 0) return;
  for (std::size_t k = found.added.size(); k-- > 0 && found.added.size() > 1;) {
    const std::vector<Active> others = others_than(found, k);
    Fit without = refit(predictor, found.baseline, others, found.weights, kRefitIterations);
    const Chain chain = shows_most_in(predictor, found, found.model, without);
    const auto rms = [&](const Fit& fit) { return proof.residual(fit.model, chain).rms(); };
    const double t = proof.freed(found.model.model, without.model, found.weights, chain).behind.t;
    if (!(rms(found.model) > kWorse * rms(without)) || t >= kSetLimit) continue;
    const char* term = library.hypotheses[static_cast<std::size_t>(found.added[k])].info().term;
    if (std::optional<Fit> fit =
            borne_instead(predictor, library, others, found, proof, without, found.steps[k].trials)) {
      const int instead = found.steps[k].trials.front().hypothesis;
      found.notes.push_back({library.hypotheses[static_cast<std::size_t>(found.added[k])].id(),
                             fmt::format("ruled out: the held-out runs refute it, and bear {}",
                                         library.hypotheses[static_cast<std::size_t>(instead)].id())});
      // The one that was taken is fitted last: it stands where the other stood.
      std::vector<Active> all = others;
      all.insert(all.begin() + static_cast<std::ptrdiff_t>(k), fit->model.effects.back());
      found.model = polished(
          predictor, refit(predictor, found.baseline, all, found.weights, kRefitIterations), found.weights);
      found.added[k] = instead;
      continue;
    }
    found.doubts.push_back(
        fmt::format("Something more is missing on the fitted runs (p = {:.1g}), most like {}; the held-out "
                    "runs refute that "
                    "name.",
                    found.steps[k].gate.p_value, term));
    found.model = polished(predictor, std::move(without), found.weights);
    found.added.erase(found.added.begin() + static_cast<std::ptrdiff_t>(k));
    found.steps.erase(found.steps.begin() + static_cast<std::ptrdiff_t>(k));
  }
}

void doubt_what_is_left(const Predictor& predictor, const Library& library, const Proof& proof,
                        const ExplainOptions& options, Found& found) {
  if (found.added.empty() || !found.adequate) return;
  const LeftOfRuns left = left_of_runs(predictor.data(), library, found, proof,
                                       {.flips = 1999,
                                        .significance = options.significance,
                                        .seed = options.seed,
                                        .threads = options.threads});
  const auto much = [&](const LeftOver& l) {
    if (found.blurred && l.size <= found.steps.back().gate.size) return false;
    return casts_a_doubt(l.p_value, l.size, l.chain, found.steps.front().trials.front().material,
                         predictor.data().baseline.terms.empty());
  };
  const bool of_held_out = much(left.held_out);
  if (!of_held_out && !much(left.all)) return;
  const LeftOver& most = of_held_out ? left.held_out : left.all;
  found.doubts.push_back(fmt::format(
      "What it leaves over of {} noise has on one day in {:.0f}: {:.2f} of the noise floor of the {}.",
      of_held_out ? "the held-out runs" : "all runs, the held-out ones among them", 1 / most.p_value,
      most.size, in_words(label_of(predictor.data(), most.chain))));
  if (options.progress) options.progress(found.doubts.back());
}

void doubt_what_differs_by_half(const Predictor& predictor, const ExplainOptions& options, Found& found,
                                Explanation& e) {
  const Around place = around(predictor, found.model, found.weights);
  for (std::size_t i = 0; i < found.added.size(); ++i) {
    const std::vector<Halves> halves = halves_of(place, found.model.tolerances + i, options.threads);
    if (halves.empty()) continue;
    const auto other =
        std::find_if(halves.begin(), halves.end(), [](const Halves& h) { return differs_by_half(h); });
    if (other == halves.end()) {
      const Halves& most = halves.front();
      e.effects[i].evidence.push_back(
          {true, fmt::format("Cut in halves in {} ways it is the same in both; where they differ most, {}, "
                             "that is {} sigma.",
                             halves.size(), most.where,
                             most.sigma < 1 ? "less than one" : rounded(most.sigma, 2))});
      continue;
    }
    std::string differs = fmt::format("{} is not the same {}: by {:.2g} % of it, {:.1f} sigma.",
                                      found.added.size() == 1 ? "It" : e.effects[i].id, other->where,
                                      100 * other->share, other->sigma);
    // Another machine's friction is seldom of the catalogue's form; and beside slow turns, whose remains are no second effect, no dry one is the same
    // in both halves to better than they leave it.
    const bool blurred =
        found.blurred && found.model.model.effects[found.model.tolerances + i].hypothesis->dry &&
        std::none_of(halves.begin(), halves.end(),
                     [](const Halves& h) { return differs_by_half(h, std::sqrt(kHardlyAny)); });
    if (!predictor.data().baseline.terms.empty() || blurred) {
      e.effects[i].evidence.push_back({false, std::move(differs)});
      continue;
    }
    if (options.progress) options.progress(differs);
    found.doubts.push_back(std::move(differs));
    found.none_of_them = kNoneOfThemByHalves;
  }
}

void doubt(const Predictor& predictor, const Found& found, Explanation& e) {
  for (auto* named : {&e.effects, &e.alternatives})
    for (Candidate& c : *named) c.confidence *= 1 - found.none_of_them;
  const Step& last = found.steps.back();
  Unknown left = describe_unknown(around(predictor, found.model, found.weights), last.screen);
  Candidate none;
  none.id = none.form = "unknown";
  none.name = "an effect that the catalogue does not have";
  none.subsystem = left.subsystem.empty() ? e.effects.front().subsystem : left.subsystem;
  none.confidence = found.none_of_them * kSurest;
  none.behind_best = kNotKnown;  // nothing was fitted
  e.alternatives.push_back(none);
  e.verdict = Verdict::kNotSeparable;
  e.doubts = found.doubts;
  if (closes_little(e.gap))
    e.doubts.push_back(fmt::format("On held-out runs it closes only {:.0f} % of what can be explained.",
                                   100 * std::max(0.0, e.gap.share_closed)));
  for (const std::string& why : e.doubts) e.effects.front().evidence.push_back({false, why});
  if (!left.depends_on.empty()) e.unknown = std::move(left);
}

namespace {

/// The sentence that goes with it; empty where no signal tells.
std::string tell_signal(const std::string& variable, const BaselineModel& baseline, Explanation& e) {
  if (variable.empty()) return "";
  e.unknown->depends_on = {variable};
  return fmt::format(" Most of it goes with {}.",
                     variable_in_words(variable, of_linear_axis(axis_unit("rad", baseline))));
}

}  // namespace

void look_beyond_fitted_runs(const Prepared& data, const Found& found, const Proof& proof, Explanation& e) {
  constexpr double kFarOff =
      1.35;  // noise that begins anew with every run made it 1.22 at most in 96 datasets without an effect
  if (e.verdict != Verdict::kNone && e.verdict != Verdict::kImmaterial) return;
  const auto is_far_off = [&](Chain chain, const SignalGap& s) {
    if (!(s.heldout > kFarOff * s.rmse)) return false;
    if (!(found.weights.colour[static_cast<int>(chain)].wander > 0)) return true;
    const ModelPoint& model = found.model.model;
    return proof.freed(model, model, found.weights, chain).first >
           kFarOff * weighted_rms(data, found.weights, found.model.residual, chain);
  };
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2})
    for (const SignalGap& s : e.signals) {
      if (s.signal != label_of(data, chain).signal || !is_far_off(chain, s)) continue;
      e.verdict = Verdict::kUnknown;
      e.detected = true;
      e.unknown = Unknown{};
      e.unknown->subsystem = chain == Chain::kTorque ? "muscle" : "pcu";
      e.unknown->signal = s.signal;
      e.unknown->unit = s.unit;
      e.summary = fmt::format(
          "Nothing is missing on the fitted runs, but on the held-out ones the {} is {:.3g} {} off, {:.2g} "
          "times as far: something is missing that the fitted runs do not excite. Put one of those runs "
          "among them.{}",
          s.signal, s.heldout, s.unit, s.heldout / s.rmse,
          tell_signal(proof.signal_that_tells(found.model.model, found.weights, chain), data.baseline, e));
      return;
    }
}

namespace {

void leave_unknown(Chain chain, const Label& label, Explanation& e) {
  e.verdict = Verdict::kUnknown;
  e.detected = true;
  e.unknown = Unknown{};
  e.unknown->subsystem = chain == Chain::kTorque ? "muscle" : chain == Chain::kMotion ? "joint" : "pcu";
  e.unknown->signal = label.signal;
  e.unknown->unit = label.unit;
}

}  // namespace

void look_at_slow_noise(const Predictor& predictor, const Found& found, double material, Explanation& e) {
  const Prepared& data = predictor.data();
  constexpr double kMostRange = 1.5;  // 1.21 at most in 150 datasets of a zero that does wander
  constexpr double kFarMore = 8;      // 2.5 at most in 18 datasets of three kinds of noise
  if (e.verdict != Verdict::kNone && e.verdict != Verdict::kImmaterial) return;
  if (!data.has(Chain::kTorque)) return;
  const Label label = label_of(data, Chain::kTorque);
  const auto c = static_cast<int>(Chain::kTorque);
  const double slow = label.scale * found.floors.slow[c];
  const SlowRun most = most_moving_run(data, unfiltered(data, found.weights, found.model.residual));
  for (SignalGap& s : e.signals) {
    if (s.signal != label.signal) continue;
    std::string why;
    if (slow > kMostRange * s.rmse)
      why = fmt::format(
          "as a sensor's zero does that wanders by {:.3g} {}, and stays within {:.3g} {}: that is no zero",
          slow, s.unit, s.rmse, s.unit);
    else if (most.times_usual > kFarMore &&
             most.step * found.weights.sigma[c] > material * found.floors.white[c])
      why = fmt::format("in {} {:.0f} times as much as in other runs, in power", data.runs[most.run].name,
                        most.times_usual);
    if (why.empty()) continue;
    leave_unknown(Chain::kTorque, label, e);
    s.noise_floor = label.scale * found.floors.white[c];  // the slow part is what is missing
    s.floor_from = "differences";
    if (e.gap.signal == s.signal) e.gap.noise_floor = s.noise_floor;
    e.summary = fmt::format(
        "What is left of the {} moves from second to second {}. Something slow is missing, and neither an "
        "effect of the catalogue nor a function of the signals fits it.{}",
        label.signal, why,
        tell_signal(signal_that_tells(around(predictor, found.model, found.weights), Chain::kTorque),
                    data.baseline, e));
    return;
  }
}

void look_at_moments(const Predictor& predictor, const Found& found, Explanation& e) {
  const Prepared& data = predictor.data();
  if (e.verdict != Verdict::kNone && e.verdict != Verdict::kImmaterial) return;
  const Moments moments = moments_of(data, found.model.residual);
  if (!moments.stand_out()) return;
  const Label label = label_of(data, moments.chain);
  leave_unknown(moments.chain, label, e);
  e.summary = fmt::format(
      "In a few moments the {} is off as noise is nowhere else, most of all near {:.1f} s of {}, where "
      "the mean square is {:.0f} times the "
      "usual one: something is missing that shows only there, and neither an effect of the catalogue nor a "
      "function of the signals fits it. "
      "Look at those moments.{}",
      in_words(label), moments.time, data.runs[moments.run].name, moments.times_usual,
      tell_signal(signal_that_tells(around(predictor, found.model, found.weights), moments.chain),
                  data.baseline, e));
}

void look_at_curves(const Prepared& data, const Found& found, const ExplainOptions& options, Explanation& e) {
  if (e.verdict != Verdict::kNone && e.verdict != Verdict::kImmaterial) return;
  const Curve curve =
      clearest_curve(data, found.weights, found.floors, found.model.residual, options.material, options.seed);
  if (!stands_out(curve)) return;
  const Label label = label_of(data, curve.chain);
  leave_unknown(curve.chain, label, e);
  e.unknown->depends_on = {curve.variable};
  e.summary = fmt::format(
      "The {} depends on {} by a curve that neither an effect of the catalogue nor a function of the signals "
      "is like: {:.2f} of the noise floor, {:.0f} standard deviations beyond what noise does.",
      in_words(label), variable_in_words(curve.variable, of_linear_axis(axis_unit("rad", data.baseline))),
      curve.size, curve.z);
}

}  // namespace isac::explain
