#include "isac/report/explain_report.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/explain/variable_words.hpp"
#include "isac/models/effects.hpp"
#include "isac/report/explain_figures.hpp"
#include "isac/report/explain_words.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/plotter.hpp"
#include "isac/report/report_head.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

using explain::Candidate;
using explain::Explanation;
using explain::Verdict;

constexpr std::size_t kMostRunFigures = 4;
constexpr std::size_t kMostNear = 6;

std::string amount(double value, const std::string& unit, int digits = 3) {
  const std::string pretty = pretty_unit(unit);
  return number(value, digits) + (pretty.empty() || !std::isfinite(value) ? "" : " " + pretty);
}

/// The catalogue's name of an id, the id itself where it has none.
std::string name_of(const std::string& id) {
  const int effect = models::find_effect(id);
  return effect < 0 ? id : models::effect_catalogue()[static_cast<std::size_t>(effect)].term;
}

/// A sentence as the progress lines have it, with the catalogue's names in place of ids of several words; "creep" is a word already.
std::string with_names(const std::string& sentence) {
  const auto in_id = [](char c) { return (c >= 'a' && c <= 'z') || c == '_'; };
  std::string out;
  for (std::size_t i = 0; i < sentence.size();) {
    std::size_t end = i;
    while (end < sentence.size() && in_id(sentence[end])) ++end;
    const std::string word = sentence.substr(i, end - i);
    out += word.find('_') == std::string::npos ? word : name_of(word);
    if (end < sentence.size()) out += sentence[end++];
    i = end;
  }
  return out;
}

/// "p = 0.41", "p < 0.001".
std::string chance(double p) {
  const std::string text = probability(p);
  return text.starts_with("<") ? "p " + text : "p = " + text;
}

BoxKind box_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNone:
    case Verdict::kNamed:
      return BoxKind::kGood;
    case Verdict::kImmaterial:
      return BoxKind::kNote;
    default:
      return BoxKind::kWarning;
  }
}

const char* verdict_word(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNone:
      return "Nothing missing";
    case Verdict::kImmaterial:
      return "Immaterial";
    case Verdict::kNamed:
      return "Named";
    case Verdict::kFamily:
      return "Family named";
    case Verdict::kNotSeparable:
      return "Not separable";
    case Verdict::kUnknown:
      return "Unknown effect";
  }
  return "";
}

void add_answer(Document& page, const Explanation& e) {
  std::vector<std::string> lines = {verdict_sentence(e)};
  if (const std::string gap = gap_sentence(e); !gap.empty()) lines.push_back(gap);
  if ((e.verdict == Verdict::kFamily || e.verdict == Verdict::kNotSeparable) && e.next_experiment)
    lines.push_back("To settle it: " + pretty_sentence(e.next_experiment->sentence));
  page.box(box_of(e.verdict), "The answer", lines);

  const explain::Gap& gap = e.gap;
  const bool heldout = std::isfinite(gap.heldout_before), added = e.adds();
  // What moments, a curve or the held-out runs tell, the search's own test does not see.
  constexpr double kLevel = 0.01;
  const bool beside_the_search = e.verdict == Verdict::kUnknown && e.p_value > kLevel;
  std::vector<Card> cards = {
      {"Verdict", std::string(verdict_word(e.verdict)) + (e.withheld.empty() ? "" : ", not added"),
       beside_the_search ? "not seen by the search's own test, " + chance(e.p_value)
                         : chance(e.p_value) + " for “only noise”"}};
  const bool freed = std::isfinite(gap.freed_before);
  const char* where = freed     ? "rms, held-out runs, freed of the noise's slow part"
                      : heldout ? "rms, held-out runs"
                                : "rms, fitted runs";
  const double before = freed     ? gap.freed_before
                        : heldout ? gap.heldout_before
                                  : gap.before,
               after = freed     ? gap.freed_after
                       : heldout ? gap.heldout_after
                                 : gap.after;
  cards.push_back({"Gap before", amount(before, gap.unit), where});
  if (added) {
    cards.push_back({"Gap after", amount(after, gap.unit), where});
    if (std::isfinite(gap.share_closed))
      cards.push_back({"Closed", share_closed_in_words(gap.share_closed), "of what can be explained"});
  }
  cards.push_back({"Noise floor", amount(gap.noise_floor, gap.unit), "what does not repeat"});
  if (std::isfinite(gap.heldout_zero_model))
    cards.push_back(
        {"No model at all", amount(gap.heldout_zero_model, gap.unit), "rms of the signal itself"});
  page.cards(cards);
}

void add_gap(Document& page, const Explanation& e) {
  Table table{.caption =
                  "Measured less modelled, signal by signal, on the fitted runs. p: chance that noise alone "
                  "does this, over the "
                  "whole search.",
              .columns = {{"Signal"},
                          {"rms before", true},
                          {"rms after", true},
                          {"Noise floor", true},
                          {"Unit"},
                          {"Floor from"},
                          {"p", true}}};
  for (const explain::SignalGap& s : e.signals) {
    table.rows.push_back({signal_in_words(s.signal), number(s.rmse, 3), number(s.after, 3),
                          number(s.noise_floor, 3), pretty_unit(s.unit),
                          s.floor_from.empty() ? "–" : s.floor_from, probability(s.p_value)});
  }
  if (!table.rows.empty()) page.table(table);
  if (page.add_figure(waterfall_figure(e))) {
    Table steps{.caption = "The same in numbers (" + pretty_unit(e.gap.unit) + ").",
                .columns = {{"Step"}, {"rms, fitted runs", true}, {"rms, held-out runs", true}}};
    for (const explain::WaterfallStep& step : e.waterfall)
      steps.rows.push_back({step.label, number(step.rmse, 3), number(step.heldout_rmse, 3)});
    page.table(steps);
    for (const Candidate& effect : e.effects) {
      const bool is_step = std::any_of(e.waterfall.begin(), e.waterfall.end(),
                                       [&](const auto& step) { return step.label.ends_with(effect.name); });
      if (!is_step && e.adds())
        page.paragraph(upper_first(effect.name) +
                       " closes another signal's gap, and is no step of this one.");
    }
  }
}

void add_where(Document& page, const ExplainReportInput& input) {
  const Explanation& e = *input.answer;
  page.heading("Where");
  std::vector<std::string> regions;
  for (const explain::Region& region : e.where) regions.push_back(upper_first(region_sentence(region)) + ".");
  if (!regions.empty()) page.bullets(regions);
  bool any = false;
  for (const std::string& signal : signals_of(e)) {
    if (signal != e.gap.signal && !signals_of(e).empty() && signal != signals_of(e).front()) continue;
    any = page.add_figure(profile_figure(e, signal, input.position_unit)) || any;
    any = page.add_figure(map_figure(e, signal, input.position_unit)) || any;
  }
  if (!any && regions.empty()) page.paragraph("No region stands out.");
}

std::vector<std::string> evidence_of(const Candidate& candidate, bool supports) {
  std::vector<std::string> out;
  for (const explain::Evidence& evidence : candidate.evidence)
    if (evidence.supports == supports) out.push_back(pretty_sentence(evidence.sentence));
  return out;
}

void add_candidate(Document& page, const Candidate& candidate) {
  std::string title = upper_first(candidate.name) + " (" + subsystem_in_words(candidate.subsystem);
  if (std::isfinite(candidate.confidence)) title += ", confidence " + percent(candidate.confidence);
  page.subheading(title + ")");
  std::vector<std::string> lines;
  if (!candidate.equation.empty()) lines.push_back(equation_in_words(candidate.equation));
  if (const std::string found = parameters_in_words(candidate); !found.empty()) lines.push_back(found);
  if (!lines.empty()) page.equation(lines);
  if (const auto speaks_for = evidence_of(candidate, true); !speaks_for.empty()) {
    page.paragraph("For it:");
    page.bullets(speaks_for);
  }
  if (const auto against = evidence_of(candidate, false); !against.empty()) {
    page.paragraph("Against it:");
    page.bullets(against);
  }
}

void add_ranking(Document& page, const std::string& caption, const std::vector<Candidate>& candidates,
                 bool reasons) {
  if (candidates.empty()) return;
  Table table{.caption = caption,
              .columns = {{"Effect"},
                          {"In"},
                          {"Confidence", true},
                          {"Behind (σ)", true},
                          {"Closes", true},
                          {reasons ? "Why, or refitted as" : "Refitted as"}}};
  for (std::size_t i = 0; i < std::min(kMostNear, candidates.size()); ++i) {
    const Candidate& c = candidates[i];
    std::string last = parameters_in_words(c);
    if (reasons && !evidence_of(c, false).empty()) last = evidence_of(c, false).front();
    table.rows.push_back({c.name, subsystem_in_words(c.subsystem), percent(c.confidence),
                          number(c.behind_best, 2), percent(c.closes), last.empty() ? "–" : last});
  }
  page.table(table);
  if (candidates.size() > kMostNear)
    page.paragraph(whole(static_cast<double>(candidates.size() - kMostNear)) + " more stand farther behind.");
}

void add_unknown(Document& page, const Explanation& e) {
  if (!e.unknown) return;
  page.subheading("An effect without a name");
  const explain::Unknown& u = *e.unknown;
  const bool linear = explain::of_linear_axis(e.gap.unit);
  const std::vector<std::string> on = explain::variables_in_words(u.depends_on, linear);
  const std::vector<std::string> off = explain::variables_in_words(u.independent, linear);
  std::string text = "It sits in the " + subsystem_in_words(u.subsystem) + " and shows in the " +
                     signal_in_words(u.signal) + ".";
  if (!on.empty())
    text += " It depends on " + joined(on) + (off.empty() ? "." : ", not on " + joined(off) + ".");
  if (std::isfinite(u.share))
    text += " The shape below takes " + percent(u.share) + " of what can be explained.";
  page.paragraph(text);
  page.add_figure(unknown_figure(e));
}

void add_what(Document& page, const Explanation& e) {
  if (e.effects.empty() && e.alternatives.empty() && e.rejected.empty() && !e.unknown) return;
  page.heading("What");
  for (const Candidate& effect : e.effects) add_candidate(page, effect);
  add_unknown(page, e);
  add_ranking(page,
              "Not ruled out by these data, best first: σ is how much worse the fit is than the best one.",
              e.alternatives, false);
  for (std::size_t i = 0; i < std::min<std::size_t>(3, e.alternatives.size()); ++i)
    if (!e.alternatives[i].evidence.empty()) add_candidate(page, e.alternatives[i]);
  add_ranking(page, "Tried and ruled out, nearest first.", e.rejected, true);
}

void add_proof(Document& page, const Explanation& e) {
  const std::vector<Figure> figures = run_figures(e, kMostRunFigures);
  if (figures.empty()) return;
  page.heading(e.heldout_runs > 0 ? "Before and after, on held-out runs" : "Measured and modelled");
  if (e.heldout_runs == 0)
    page.paragraph(
        "No run was held out, so these are runs that were fitted: keep one or two back (heldout/) for a "
        "proof.");
  for (const Figure& figure : figures) page.add_figure(figure);
}

void add_numbers(Document& page, const Explanation& e) {
  if (e.base.empty() && e.base_changes.empty()) return;
  page.heading("Parameters");
  add_parameters(
      page, e.base,
      e.adds() ? "The baseline's parameters, refitted beside the effects." : "The baseline's parameters.");
  std::vector<Estimated> added;
  for (const Candidate& effect : e.effects) {
    for (Estimated parameter : effect.parameters) {
      parameter.name = effect.name + ", " + parameter.name;
      added.push_back(std::move(parameter));
    }
  }
  add_parameters(page, added, e.adds() ? "Parameters of what was added." : "Parameters of what was named.");
  if (!e.adds()) return;
  const bool told = std::any_of(e.base_changes.begin(), e.base_changes.end(),
                                [](const explain::BaseChange& change) { return !change.sentence.empty(); });
  Table table{.caption = told ? "What the baseline had stood in for."
                              : "The baseline without and with what was added.",
              .columns = {{"Parameter"}, {"Before", true}, {"After", true}, {"Unit"}, {"Change (%)", true}}};
  if (told) table.columns.push_back({"In words"});
  for (const explain::BaseChange& change : e.base_changes) {
    const double moved = change.after - change.before;
    table.rows.push_back({change.name, number(change.before, 4), number(change.after, 4),
                          pretty_unit(change.unit),
                          moved == 0 ? "0" : number(100 * moved / std::abs(change.before), 2)});
    if (told) table.rows.back().push_back(change.sentence.empty() ? "–" : pretty_sentence(change.sentence));
  }
  if (!table.rows.empty()) page.table(table);
}

void add_use(Document& page, const ExplainReportInput& input) {
  if (!input.answer->adds()) return;
  page.heading("In the controller and the simulator");
  if (!input.compensation.empty()) page.bullets(input.compensation);
  if (input.params_file.empty()) {
    page.paragraph(
        "`isac-explain -o params.toml` writes the effects where the simulator, the tables and the controller "
        "read them.");
    return;
  }
  page.paragraph("The simulated rig has what was found with `--card sim:params=" + input.params_file +
                 "`; `isac-identify export " + input.params_file + "` makes the controller's tables.");
}

std::string planned(double value, const char* unit) {
  return std::isfinite(value) ? number(value, 3) + " " + unit : "–";
}

void add_next(Document& page, const ExplainReportInput& input) {
  const Explanation& e = *input.answer;
  if (!e.next_experiment) return;
  const explain::NextExperiment& next = *e.next_experiment;
  page.heading("What to record next");
  std::vector<std::string> lines = {pretty_sentence(next.sentence)};
  if (!next.separates_a.empty() && !next.separates_b.empty()) {
    lines.push_back("It separates " + name_of(next.separates_a) + " from " + name_of(next.separates_b) +
                    ": " + fixed_decimals(next.separation_now, 1) + " σ now, " +
                    fixed_decimals(next.separation_expected, 1) + " σ expected after it.");
  }
  if (!input.plan_file.empty() && !next.runs.empty())
    lines.push_back("`isac-log --plan " + input.plan_file +
                    " --rig rig.toml -o DATASET` records it; then call `isac-explain DATASET` again.");
  page.box(BoxKind::kNext, "Next experiment", lines);
  Table table{.caption = "The runs.",
              .columns = {{"No.", true},
                          {"Experiment"},
                          {"Seconds", true},
                          {"Δp"},
                          {"Mean pressure"},
                          {"Sweep"},
                          {"Speed"},
                          {"Swing"}}};
  for (std::size_t i = 0; i < next.runs.size(); ++i) {
    const explain::PlannedRun& run = next.runs[i];
    const bool by_hand = run.experiment == "constant-pressure";
    std::string swing = "–";
    if (run.pressure_swing_kgcm2 > 0)
      swing = number(run.pressure_swing_kgcm2, 3) + " kg/cm², " + number(run.pressure_period_s, 3) + " s " +
              run.waveform;
    table.rows.push_back({whole(static_cast<double>(i + 1)), run.experiment, number(run.seconds, 3),
                          planned(run.delta_pressure_kgcm2, "kg/cm²"),
                          planned(run.mean_pressure_kgcm2, "kg/cm²"),
                          by_hand ? "± " + number(run.amplitude_rad, 2) + " rad" : "–",
                          by_hand ? planned(run.peak_speed_rad_s, "rad/s") : "–", swing});
  }
  if (!table.rows.empty()) page.table(table);
}

void add_limits(Document& page, const Explanation& e) {
  if (e.could_hide.empty() && e.not_testable.empty()) return;
  page.heading("What these data could still hide");
  Table table{
      .caption = "Largest that would go unnoticed here (95 % upper bound of the effect's first parameter).",
      .columns = {{"Effect"}, {"Up to", true}, {"Unit"}}};
  constexpr std::size_t kMost = 12;  // largest first; the JSON answer has all
  for (const explain::CouldHide& one : e.could_hide)
    if (table.rows.size() < kMost)
      table.rows.push_back({name_of(one.id), number(one.size, 2), pretty_unit(one.unit)});
  if (!table.rows.empty()) page.table(table);
  if (e.not_testable.empty()) return;
  Table untested{.caption = "Not excited by these runs, so neither found nor excluded.",
                 .columns = {{"Effect"}, {"Would show by"}}};
  for (const std::string& id : e.not_testable) {
    const int effect = models::find_effect(id);
    const std::string by =
        effect < 0 ? "" : models::effect_catalogue()[static_cast<std::size_t>(effect)].told_apart_by;
    untested.rows.push_back({name_of(id), by.empty() ? "–" : by});
  }
  page.table(untested);
}

void add_trials(Document& page, const Explanation& e) {
  page.heading("How the answer was found");
  page.paragraph(whole(static_cast<double>(e.fitted_runs)) + " runs fitted, " +
                 whole(static_cast<double>(e.heldout_runs)) + " held out" +
                 (e.seconds > 0 ? "; " + number(e.seconds, 3) + " s of recording" : "") + "; " +
                 whole(static_cast<double>(e.samples)) + " rows in " + whole(static_cast<double>(e.blocks)) +
                 " blocks of " + number(e.block_seconds, 2) +
                 " s. Significance is judged by flipping the signs of whole blocks, which holds for noise of "
                 "any colour.");
  std::vector<std::string> lines;
  for (const explain::TrialNote& trial : e.trials)
    lines.push_back((trial.id.empty() ? "" : name_of(trial.id) + ": ") +
                    pretty_sentence(with_names(trial.sentence)));
  if (!lines.empty()) page.bullets(lines);
}

}  // namespace

std::string render_explain_report(const ExplainReportInput& input) {
  if (input.answer == nullptr)
    throw Error(ErrorKind::kUsage, "answer_missing",
                "a report of what is missing needs the explanation it reports on");
  require_gnuplot();
  const Explanation& e = *input.answer;
  Document page = open_page(input.head, "What is missing");
  add_answer(page, e);
  page.box(BoxKind::kWarning, "Before you rely on this", warning_texts(e.warnings));
  add_gap(page, e);
  add_where(page, input);
  add_what(page, e);
  add_proof(page, e);
  add_numbers(page, e);
  add_use(page, input);
  add_next(page, input);
  add_limits(page, e);
  add_trials(page, e);
  close_page(page, input.head);
  return page.html();
}

}  // namespace isac::report
