#include "explain/answer.hpp"

#include <nlohmann/json.hpp>

#include "common/summary.hpp"
#include "isac/record/answer.hpp"
#include "isac/report/explain_words.hpp"

namespace isac::apps {
namespace {

using Json = nlohmann::ordered_json;
using explain::Candidate;

Json words_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

Json numbers(const std::vector<double>& values) {
  Json out = Json::array();
  for (const double value : values) out.push_back(json_number(value));
  return out;
}

Json disagreement_of(const explain::Explanation& e) {
  Json signals = Json::array(), where = Json::array();
  for (const explain::SignalGap& gap : e.signals) {
    signals.push_back({{"signal", gap.signal},
                       {"unit", gap.unit},
                       {"rmse", json_number(gap.rmse)},
                       {"after", json_number(gap.after)},
                       {"heldout", json_number(gap.heldout)},
                       {"noise_floor", json_number(gap.noise_floor)},
                       {"noise_floor_from", words_or_null(gap.floor_from)},
                       {"p_value", json_number(gap.p_value)}});
  }
  for (const explain::Region& region : e.where) {
    where.push_back({{"subsystem", region.subsystem},
                     {"signal", region.signal},
                     {"variable", region.variable},
                     {"range", {json_number(region.low), json_number(region.high)}},
                     {"unit", region.unit},
                     {"share", json_number(region.share)}});
  }
  return {
      {"detected", e.detected}, {"p_value", json_number(e.p_value)}, {"signals", signals}, {"where", where}};
}

Json candidate_of(const Candidate& candidate) {
  Json supports = Json::array(), against = Json::array();
  for (const explain::Evidence& evidence : candidate.evidence)
    (evidence.supports ? supports : against).push_back(evidence.sentence);
  return {{"id", candidate.id},
          {"form", candidate.form.empty() ? candidate.id : candidate.form},
          {"name", candidate.name},
          {"subsystem", candidate.subsystem},
          {"equation", words_or_null(candidate.equation)},
          {"confidence", json_number(candidate.confidence)},
          {"behind_best_sigma", json_number(candidate.behind_best)},
          {"closes", json_number(candidate.closes)},
          {"missed_by_sigma", json_number(candidate.missed_by)},
          {"parameters", record::json_parameters(candidate.parameters)},
          {"supports", supports},
          {"against", against}};
}

Json candidates_of(const std::vector<Candidate>& candidates) {
  Json out = Json::array();
  for (const Candidate& candidate : candidates) out.push_back(candidate_of(candidate));
  return out;
}

Json unknown_of(const explain::Explanation& e) {
  if (!e.unknown) return nullptr;
  const explain::Unknown& u = *e.unknown;
  Json out = {{"subsystem", u.subsystem},
              {"signal", u.signal},
              {"depends_on", u.depends_on},
              {"independent_of", u.independent},
              {"share", json_number(u.share)}};
  if (!u.at.empty()) {
    out["shape"] = {{"variable", u.variable},   {"variable_unit", u.variable_unit},
                    {"unit", u.unit},           {"at", numbers(u.at)},
                    {"mean", numbers(u.shape)}, {"half_width", numbers(u.band)}};
  }
  return out;
}

Json could_hide_of(const explain::Explanation& e) {
  Json out = Json::array();
  for (const explain::CouldHide& one : e.could_hide)
    out.push_back({{"id", one.id}, {"size", json_number(one.size)}, {"unit", one.unit}});
  return out;
}

Json gap_of(const explain::Gap& gap) {
  return {{"signal", gap.signal},
          {"unit", gap.unit},
          {"before", json_number(gap.before)},
          {"after", json_number(gap.after)},
          {"noise_floor", json_number(gap.noise_floor)},
          {"heldout_before", json_number(gap.heldout_before)},
          {"heldout_after", json_number(gap.heldout_after)},
          {"heldout_zero_model", json_number(gap.heldout_zero_model)},
          {"share_closed", json_number(gap.share_closed)},
          {"freed_before", json_number(gap.freed_before)},
          {"freed_after", json_number(gap.freed_after)}};
}

}  // namespace

std::string format_explanation(const explain::Explanation& e, const std::vector<std::string>& compensation) {
  Json extra;
  extra["verdict"] = explain::to_string(e.verdict);
  extra["summary"] = report::verdict_sentence(e);
  extra["disagreement"] = disagreement_of(e);
  extra["effects"] = candidates_of(e.effects);
  extra["withheld"] = words_or_null(e.withheld);
  extra["alternatives"] = candidates_of(e.alternatives);
  extra["rejected"] = candidates_of(e.rejected);
  extra["unknown"] = unknown_of(e);
  extra["not_testable"] = e.not_testable;
  extra["could_hide"] = could_hide_of(e);
  extra["next_experiment"] = e.next_experiment ? words_or_null(e.next_experiment->sentence) : Json(nullptr);
  extra["separation"] = nullptr;
  if (e.next_experiment && !e.next_experiment->separates_a.empty()) {
    extra["separation"] = {{"between", {e.next_experiment->separates_a, e.next_experiment->separates_b}},
                           {"now_sigma", json_number(e.next_experiment->separation_now)},
                           {"expected_sigma", json_number(e.next_experiment->separation_expected)}};
  }
  extra["gap"] = gap_of(e.gap);
  extra["waterfall"] = Json::array();
  for (const explain::WaterfallStep& step : e.waterfall) {
    extra["waterfall"].push_back({{"label", step.label},
                                  {"rmse", json_number(step.rmse)},
                                  {"heldout_rmse", json_number(step.heldout_rmse)}});
  }
  extra["base_changes"] = Json::array();
  for (const explain::BaseChange& change : e.base_changes) {
    extra["base_changes"].push_back({{"name", change.name},
                                     {"unit", change.unit},
                                     {"before", json_number(change.before)},
                                     {"after", json_number(change.after)},
                                     {"text", change.sentence}});
  }
  extra["compensation"] = compensation;
  extra["data"] = {{"fitted_runs", e.fitted_runs},
                   {"heldout_runs", e.heldout_runs},
                   {"samples", e.samples},
                   {"blocks", e.blocks},
                   {"block_seconds", json_number(e.block_seconds)},
                   {"seconds", json_number(e.seconds)}};

  record::Answer answer;
  answer.schema = "isac.explain/1";
  answer.parameters = e.base;
  answer.fit = {.rmse = e.gap.after,
                .unit = e.gap.unit,
                .samples = static_cast<double>(e.samples),
                .heldout_rmse = e.gap.heldout_after};
  answer.warnings = e.warnings;
  return record::format_answer(answer, extra);
}

}  // namespace isac::apps
