#include "isac/explain/describe.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/explain/labels.hpp"
#include "isac/explain/uncertainty.hpp"
#include "isac/explain/variable_words.hpp"
#include "isac/models/effects.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kTracePoints = 2000;
constexpr double kWorthTelling = 0.03;  // relative change of a base parameter

std::string with_unit(double value, const std::string& unit) {
  return rounded(value) + (unit.empty() || unit == "-" ? "" : " " + unit);
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return text;
}

std::string numbers_of(const Candidate& c) {
  std::vector<const Estimated*> told;
  for (const Estimated& p : c.parameters)
    if (std::isfinite(p.value)) told.push_back(&p);
  std::vector<std::string> words;
  for (std::size_t i = 0; i < told.size(); ++i) {
    const Estimated& p = *told[i];
    const bool once_more = i + 1 < told.size() && told[i + 1]->reason == p.reason;
    words.push_back(with_error(p.name, p.value, p.std_error, p.unit) +
                    (p.reason.empty() || once_more ? "" : " (" + p.reason + ")"));
  }
  return joined(words);
}

std::string p_in_words(double p) {
  return p < 0.001 ? "p < 0.001" : "p = " + rounded(p, p < 0.01 ? 1 : 2);
}

Chain chain_of(const Prepared& data, const std::string& signal) {
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2, Chain::kMotion})
    if (label_of(data, chain).signal == signal) return chain;
  return Chain::kTorque;
}

/// The model of which the explanation tells: nothing was added where nothing was named, or the held-out runs speak against it.
const Fit& told_model(const Found& found, const Explanation& e) {
  return e.adds() ? found.model : found.baseline;
}

/// p-value of what shows in one chain; where something was found in it, of the whole search.
double chain_p_value(const Found& found, Chain chain) {
  if (found.steps.empty()) return 1;
  if (chain == found.gate.chain && found.gate.significant) return found.gate.p_value;
  return found.steps.front().screen.chain_p[static_cast<int>(chain)];
}

void add_signals(const Predictor& predictor, const Found& found, Explanation& e) {
  const Prepared& data = predictor.data();
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2, Chain::kMotion}) {
    if (!data.has(chain)) continue;
    const Label label = label_of(data, chain);
    SignalGap s;
    s.signal = label.signal;
    s.unit = label.unit;
    if (s.signal == e.gap.signal) {  // as the gap has it, with what was found at the recording's rate
      s.rmse = e.gap.before;
      s.after = e.gap.after;
    } else {
      s.rmse = label.scale * raw_residual(predictor, found.baseline.model, chain).rms();
      s.after = e.adds() && !found.added.empty()
                    ? label.scale * raw_residual(predictor, found.model.model, chain).rms()
                    : s.rmse;
    }
    const auto c = static_cast<std::size_t>(chain);
    s.noise_floor = label.scale * found.floors.all(static_cast<Chain>(c));
    s.floor_from = found.floors.from[c].empty() ? "differences" : found.floors.from[c];
    s.p_value = chain_p_value(found, chain);
    e.signals.push_back(std::move(s));
  }
}

void add_numbers(const Predictor& predictor, const Found& found, const std::optional<Uncertain>& numbers,
                 Explanation& e) {
  const Fit& fit = told_model(found, e);
  const Uncertain after =
      numbers && &fit == &found.model ? *numbers : uncertainties(predictor, fit, found.weights);
  e.base = after.base;
  const Uncertain& named = numbers ? *numbers : after;
  for (std::size_t i = 0; i < named.effects.size() && i < e.effects.size() && i < found.added.size(); ++i)
    if (named.effects[i].size() == e.effects[i].parameters.size()) e.effects[i].parameters = named.effects[i];
  if (!e.adds() || found.added.empty()) return;
  // Of several effects the first that enters the rows which the parameter enters.
  const auto stood_in_for = [&](const BaseParameter& base) -> std::string {
    for (std::size_t i = 0; i < e.effects.size() && i < found.added.size(); ++i) {
      const Hypothesis& h = *found.model.model.effects[found.model.tolerances + i].hypothesis;
      if ((h.chains & together_with(base.chains)) != 0) return e.effects[i].name;
    }
    return e.effects.front().name;
  };
  for (std::size_t j = 0; j < predictor.base().size(); ++j) {
    const BaseParameter& b = predictor.base()[j];
    BaseChange change;
    change.name = b.name;
    change.unit = axis_unit(b.unit, predictor.data().baseline);
    change.before = found.baseline.model.base[j] / b.si_per_unit;
    change.after = found.model.model.base[j] / b.si_per_unit;
    const double moved = std::abs(change.after - change.before);
    const bool beyond_error = !std::isfinite(after.base[j].std_error) || moved > after.base[j].std_error;
    if (moved > kWorthTelling * std::abs(change.before) && beyond_error)
      change.sentence = change_sentence(change, stood_in_for(b));
    e.base_changes.push_back(std::move(change));
  }
}

void add_waterfall(const Predictor& predictor, const Library& library, const Found& found, const Proof& proof,
                   Chain chain, Explanation& e) {
  const double scale = label_of(predictor.data(), chain).scale;
  e.waterfall.insert(e.waterfall.begin(), {"baseline", e.gap.before, e.gap.heldout_before});
  if (!e.adds()) return;
  std::vector<WaterfallStep> steps;
  Fit fit = found.baseline;
  for (std::size_t k = 0; k < found.added.size(); ++k) {
    const bool last = k + 1 == found.added.size();
    if (!last) {
      const Trial& trial = found.steps[k].trials.front();
      const Active active{&library.hypotheses[static_cast<std::size_t>(found.added[k])], trial.values};
      fit = refit(predictor, fit, {active}, found.weights, 4);
    }
    const ModelPoint& model = last ? found.model.model : fit.model;
    WaterfallStep step;
    step.label = library.hypotheses[static_cast<std::size_t>(found.added[k])].info().term;
    step.rmse = scale * raw_residual(predictor, model, chain).rms();
    if (proof.runs() > 0) step.heldout_rmse = scale * proof.residual(model, chain).rms();
    steps.push_back(std::move(step));
  }
  e.waterfall.insert(e.waterfall.begin() + 1, steps.begin(), steps.end());
}

std::string missed(const Explanation& e) {
  const Gap& gap = e.gap;
  std::string text =
      fmt::format("{}: the baseline misses {}", upper_first(gap.signal), with_unit(gap.before, gap.unit));
  if (std::isfinite(gap.noise_floor))
    text += fmt::format(" against a floor of {}", with_unit(gap.noise_floor, gap.unit));
  return text + " (" + p_in_words(e.p_value) + ").";
}

std::string closing(const Explanation& e) {
  const Gap& gap = e.gap;
  if (!e.withheld.empty()) return "on the fitted runs, and nothing is added: " + e.withheld;
  if (std::isfinite(gap.freed_before))
    return fmt::format("{} → {} on held-out runs, freed of the noise's slow part", rounded(gap.freed_before),
                       with_unit(gap.freed_after, gap.unit));
  const bool heldout = std::isfinite(gap.heldout_before) && std::isfinite(gap.heldout_after);
  constexpr double kHardly = 0.995;  // of the rms before
  if (heldout && gap.heldout_after > kHardly * gap.heldout_before)
    return fmt::format("{} → {} on the fitted runs; the held-out ones hardly show it", rounded(gap.before),
                       with_unit(gap.after, gap.unit));
  const double before = heldout ? gap.heldout_before : gap.before;
  const double after = heldout ? gap.heldout_after : gap.after;
  return fmt::format("{} → {}{}", rounded(before), with_unit(after, gap.unit),
                     heldout ? " on held-out runs" : " on the fitted runs (none was held out)");
}

std::vector<std::string> terms_of(const std::vector<Candidate>& candidates, std::size_t most) {
  std::vector<std::string> words;
  for (const Candidate& c : candidates) {
    if (words.size() == most) {
      words.push_back("others");
      break;
    }
    words.push_back(c.name);
  }
  return words;
}

/// Standard errors by which a base parameter changed.
double moved_by(const Explanation& e, const BaseChange& change) {
  for (const Estimated& b : e.base)
    if (b.name == change.name && b.std_error > 0) return std::abs(change.after - change.before) / b.std_error;
  return std::abs(change.after - change.before) / std::abs(change.before);
}

std::string largest_hidden(const Explanation& e) {
  if (e.could_hide.empty()) return "";
  const CouldHide& most = e.could_hide.front();
  return fmt::format(" What could hide most is {}, up to {}.", most.id, with_unit(most.size, most.unit));
}

/// What is there and was taken for how the recorder counts; who knows that it does not count so knows what it is.
std::string left_to_the_recorder(const Explanation& e) {
  std::string text;
  for (const TrialNote& note : e.trials) {
    const std::size_t at = note.sentence.find(kLeftToTheRecorder);
    if (at == std::string::npos) continue;
    const auto& info = models::effect_catalogue()[static_cast<unsigned>(models::find_effect(note.id))];
    const std::string one = fmt::format(" {}, {}is taken for how the recorder counts.",
                                        upper_first(info.term), note.sentence.substr(0, at));
    if (text.find(one) == std::string::npos) text += one;  // a search that began anew found it twice
  }
  return text;
}

/// Every unit that the catalogue or a variable brought along, as it is on this axis.
void tell_in_units_of(const BaselineModel& baseline, Explanation& e) {
  const auto mend = [&](std::string& unit) { unit = axis_unit(unit, baseline); };
  for (auto* candidates : {&e.effects, &e.alternatives, &e.rejected})
    for (Candidate& c : *candidates)
      for (Estimated& p : c.parameters) mend(p.unit);
  for (Estimated& p : e.base) mend(p.unit);
  for (CouldHide& one : e.could_hide) mend(one.unit);
  for (Region& region : e.where) mend(region.unit);
  if (e.unknown) mend(e.unknown->variable_unit);
}

/// Of an effect that no name explains: which came nearest, and what ruled it out.
std::string nearest_name(const Explanation& e) {
  constexpr std::string_view kRuledOut = "ruled out: ";
  if (!e.effects.empty() || e.rejected.empty()) return "";
  const Candidate& nearest = e.rejected.front();
  for (auto note = e.trials.rbegin(); note != e.trials.rend(); ++note)
    if (note->id == nearest.id && note->sentence.starts_with(kRuledOut))
      return fmt::format(" {} came nearest and is ruled out: {}.", upper_first(nearest.name),
                         note->sentence.substr(kRuledOut.size()));
  return "";
}

}  // namespace

std::string change_sentence(const BaseChange& change, const std::string& effect) {
  const double ratio = std::abs(change.after) / std::abs(change.before);
  const std::string because = effect.empty() ? "" : ": it had stood in for " + effect;
  if (change.after * change.before < 0)
    return fmt::format("{} changed its sign, from {} to {}{}.", change.name, rounded(change.before),
                       with_unit(change.after, change.unit), because);
  if (!(ratio < 3 && ratio > 1.0 / 3))
    return fmt::format("{} {} from {} to {}{}.", change.name, ratio < 1 ? "fell" : "rose",
                       rounded(change.before), with_unit(change.after, change.unit), because);
  return fmt::format("{} {} by {:.0f} %{}.", change.name, ratio < 1 ? "fell" : "rose",
                     100 * std::abs(ratio - 1), because);
}

std::string how_much_worse(double sigma) {
  constexpr double kAsWell = 0.3;
  return sigma < kAsWell ? "fits as well" : fmt::format("fits only {} sigma worse", rounded(sigma, 2));
}

/// Outliers close it, unequal muscles too; a friction closes it.
const char* close_or_closes(const std::vector<Candidate>& effects) {
  const bool many =
      effects.size() > 1 || effects.front().id == "spikes" || effects.front().id == "muscle_asymmetry";
  return many ? "close" : "closes";
}

std::string summary_of(const Explanation& e) {
  switch (e.verdict) {
    case Verdict::kNone:
      return fmt::format(
          "Nothing is missing: what the model leaves of the {}, {}, cannot be told from noise ({}).{}",
          e.gap.signal, with_unit(e.gap.before, e.gap.unit), p_in_words(e.p_value), largest_hidden(e));
    case Verdict::kImmaterial:
      return fmt::format(
          "Something is there ({}), but too small against the noise floor of {} to matter; nothing was "
          "added.{}",
          p_in_words(e.p_value), with_unit(e.gap.noise_floor, e.gap.unit), largest_hidden(e));
    case Verdict::kUnknown: {
      std::string text = missed(e);
      if (e.effects.empty()) {
        text += " No effect of the catalogue explains it";
      } else {
        text += fmt::format(
            " {} {} part of it ({}), but something significant is left that no effect of "
            "the catalogue explains",
            upper_first(joined(terms_of(e.effects, 3))), close_or_closes(e.effects), closing(e));
      }
      if (e.unknown && !e.unknown->depends_on.empty())
        text += "; it depends on " +
                joined(variables_in_words(e.unknown->depends_on, of_linear_axis(e.gap.unit)));
      return text + "." + nearest_name(e);
    }
    case Verdict::kNamed: {
      if (e.effects.empty()) return missed(e);
      std::string text = missed(e);
      if (!e.withheld.empty()) {
        const bool one = e.effects.size() == 1;
        return text + fmt::format(" {}{} {} what the fitted runs show, and {} not added: {}.",
                                  upper_first(joined(terms_of(e.effects, 4))),
                                  one ? ", " + numbers_of(e.effects.front()) + "," : "", one ? "is" : "are",
                                  one ? "is" : "are", e.withheld);
      }
      if (e.effects.size() == 1) {
        text += fmt::format(" {}, {}, {} it: {}.", upper_first(e.effects.front().name),
                            numbers_of(e.effects.front()), close_or_closes(e.effects), closing(e));
      } else {
        text += fmt::format(" {} close it together: {}.", upper_first(joined(terms_of(e.effects, 4))),
                            closing(e));
      }
      const BaseChange* largest = nullptr;
      double most = 0;
      for (const BaseChange& change : e.base_changes) {
        const double moved = moved_by(e, change);
        if (change.sentence.empty() || moved <= most) continue;
        largest = &change;
        most = moved;
      }
      if (largest != nullptr) text += " " + largest->sentence;
      return text;
    }
    case Verdict::kFamily:
    case Verdict::kNotSeparable: {
      std::vector<std::string> names = terms_of(e.effects, 3), rivals = terms_of(e.alternatives, 3);
      std::string text = missed(e);
      if (names.empty()) return text + " These data cannot tell what is missing.";
      const char* close = close_or_closes(e.effects);
      if (e.alternatives.size() == 1 && e.alternatives.front().id == "unknown")
        return text + fmt::format(" {} {} it ({}), but it may also be none of the catalogue. {}",
                                  upper_first(joined(names)), close, closing(e),
                                  e.doubts.empty() ? "" : e.doubts.front());
      text +=
          fmt::format(" {} {} it ({}), but {} cannot be ruled out{}", upper_first(joined(names)), close,
                      closing(e), joined(rivals), e.verdict == Verdict::kFamily ? ", all of one kind" : "");
      if (!e.alternatives.empty())
        text += fmt::format(": {} {}", e.alternatives.front().name,
                            how_much_worse(e.alternatives.front().behind_best));
      return text + ".";
    }
  }
  return {};
}

void describe(const Predictor& predictor, const Library& library, const Found& found, const Proof& proof,
              const ExplainOptions& options, const std::optional<Uncertain>& numbers, Explanation& e) {
  const Chain chain = chain_of(predictor.data(), e.gap.signal);
  add_numbers(predictor, found, numbers, e);
  tell_in_units_of(predictor.data().baseline, e);
  add_signals(predictor, found, e);
  add_waterfall(predictor, library, found, proof, chain, e);
  if (options.traces) {
    const ModelPoint &before = found.baseline.model, &after = told_model(found, e).model;
    for (const bool heldout : {true, false}) {
      std::vector<RunTrace> traces = heldout
                                         ? proof.traces(before, after, chain, kTracePoints)
                                         : traces_of(predictor, before, after, chain, false, kTracePoints);
      for (RunTrace& t : traces) e.traces.push_back(std::move(t));
    }
  }
  add_evidence(predictor, library, found, e);
  e.summary = summary_of(e) + left_to_the_recorder(e);
}

}  // namespace isac::explain
