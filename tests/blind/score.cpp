#include "score.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "ledger.hpp"

namespace blind {
namespace {

using nlohmann::json;

bool holds(const std::vector<std::string>& list, const std::string& name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

std::vector<std::string> words(const json& list) {
  std::vector<std::string> out;
  if (list.is_array())
    for (const json& word : list) out.push_back(word.get<std::string>());
  return out;
}

double number(const json& object, const char* name) {
  return object.contains(name) && object[name].is_number() ? object[name].get<double>() : 0.0;
}

Truth read_truth(const json& label) {
  Truth t;
  t.kind = label.at("kind");
  t.noise = label.at("noise");
  t.side = label.at("side");
  t.signal = label.value("signal", "");
  t.ratio = label.at("ratio_asked");
  t.testable = label.at("testable");
  t.ids = words(label.at("ids"));
  t.subsystems = words(label.at("subsystems"));
  t.depends_on = words(label.at("depends_on"));
  for (const auto& [signal, gap] : label.at("gap").items()) {
    t.gap[signal] = number(gap, "heldout_before");
    t.gap_noise[signal] = number(gap, "heldout_noise");
    if (gap.contains("heldout_closes")) t.gap_closes[signal] = number(gap, "heldout_closes");
  }
  if (const json& oracle = label.at("oracle"); oracle.is_object()) {
    double nearest = 3.0;
    for (const auto& [id, sigma] : oracle.at("rivals").items()) {
      if (sigma.is_number() && sigma.get<double>() < 3.0) t.equals.push_back(id);
      if (!sigma.is_number() || sigma.get<double>() >= nearest) continue;
      nearest = sigma.get<double>();
      t.nearest_equal = id;
    }
    if (oracle.contains("alone"))
      for (const auto& [id, sigma] : oracle["alone"].items())
        if (sigma.is_number() && sigma.get<double>() < 3.0) t.alone = id;
  }
  return t;
}

void read_effects(const json& j, Answer& a) {
  for (const json& effect : j.at("effects")) {
    a.effects.push_back(effect.at("id"));
    a.subsystems.push_back(effect.value("subsystem", ""));
    a.confidences.push_back(number(effect, "confidence"));
  }
  for (const json& effect : j.at("alternatives")) a.alternatives.push_back(effect.at("id"));
}

Answer read_answer(const std::string& text) {
  Answer a;
  const json j = json::parse(text, nullptr, false);
  if (j.is_discarded() || !j.is_object() || j.value("schema", "") != "isac.explain/1") {
    a.failed = "no answer of schema isac.explain/1";
    return a;
  }
  try {
    a.verdict = j.at("verdict");
    const json& disagreement = j.at("disagreement");
    a.detected = disagreement.at("detected");
    if (disagreement.contains("p_value") && disagreement["p_value"].is_number())
      a.p_value = disagreement["p_value"];
    if (const json& where = disagreement.at("where"); !where.empty()) a.where = where[0].at("subsystem");
    read_effects(j, a);
    if (const json& unknown = j.at("unknown"); unknown.is_object()) {
      a.depends_on = words(unknown.at("depends_on"));
      a.where = unknown.at("subsystem");
    }
    const json& gap = j.at("gap");
    if (gap.is_object()) {
      a.signal = gap.value("signal", "");
      a.heldout_before = number(gap, "heldout_before");
      a.heldout_after = number(gap, "heldout_after");
      a.freed_before = number(gap, "freed_before");
      a.freed_after = number(gap, "freed_after");
    }
  } catch (const json::exception& wrong) {
    a.failed = std::string("an answer that lacks something: ") + wrong.what();
  }
  return a;
}

/// Power on held-out runs that the answer took away.
double power_taken(const Answer& a) {
  return a.heldout_before * a.heldout_before - a.heldout_after * a.heldout_after;
}

/// `power_taken` over what lies between the baseline and what the same program leaves of the same day with nothing hidden.
double closed_to_twin(const Answer& a, const std::map<std::string, double>& floor) {
  const auto left = floor.find(a.signal);
  if (a.heldout_before <= 0.0 || left == floor.end()) return -1.0;
  const double open = a.heldout_before * a.heldout_before - left->second * left->second;
  return open < 0.02 * left->second * left->second ? -1.0 : power_taken(a) / open;
}

/// `power_taken` over what the generator's own model takes out of these recordings, its parameters and the effect's being the true ones.
double closed_of_truth(const Truth& t, const Answer& a) {
  const std::string signal = signal_of_label(a.signal);
  if (a.heldout_before <= 0.0 || !t.gap.contains(signal)) return -1.0;
  const double gap = t.gap.at(signal), noise = t.gap_noise.at(signal);
  if (gap * gap < 1e-3 * noise * noise)
    return -1.0;  // nothing to close in the signal that the answer speaks of
  const auto closes = t.gap_closes.find(signal);
  const double true_closes = closes != t.gap_closes.end() ? closes->second : gap * gap;
  if (true_closes < 0.2 * gap * gap) return -1.0;  // the recordings' own noise hides it
  return power_taken(a) / true_closes;
}

std::map<std::string, double> read_floor(const std::string& text) {
  std::map<std::string, double> floor;
  const json j = json::parse(text, nullptr, false);
  if (!j.is_object() || !j.contains("disagreement")) return floor;
  for (const json& signal : j["disagreement"].value("signals", json::array()))
    if (const double left = number(signal, "heldout"); left > 0) floor[signal.value("signal", "")] = left;
  return floor;
}

}  // namespace

std::string signal_of_label(const std::string& signal) {
  return signal == "motion" ? "balance" : signal == "torque" ? "driven" : signal;
}

Case read_case(const std::string& line) {
  if (const std::optional<Case> kept = read_ledger_line(line)) return *kept;
  const json j = json::parse(line, nullptr, false);
  if (j.is_discarded() || !j.contains("label"))
    throw std::runtime_error("not a line of a results file: " + line.substr(0, 60));
  Case one;
  one.truth = read_truth(j["label"]);
  one.truth.key = j.value("key", "");
  if (j.contains("excluded")) one.truth.kind = "left_out";
  if (j.contains("answer")) {
    one.answer = read_answer(j["answer"].get<std::string>());
    one.answer.seconds = number(j, "seconds");
    if (number(j, "exit") < -1.5) one.answer.failed = "killed: too slow";
  } else {
    one.answer.failed = kNotAsked;
  }
  if (j.contains("bare")) one.floor = read_floor(j["bare"].get<std::string>());
  if (j.contains("baselines") && j["baselines"].is_object())
    for (const auto& [method, answer] : j["baselines"].items()) {
      one.baselines[method] = read_answer(answer.dump());
      one.baselines[method].seconds = number(answer, "seconds");
    }
  return one;
}

Case read_pair(const std::string& label, const std::string& answer) {
  const json j = json::parse(label, nullptr, false);
  if (j.is_discarded()) throw std::runtime_error("the label is not JSON");
  return {read_truth(j), read_answer(answer)};
}

Judgement judge_case(const Case& one) {
  const Truth& t = one.truth;
  const Answer& a = one.answer;
  Judgement j;
  if (!a.failed.empty()) return j;
  std::vector<std::string> ranking;
  if (!a.effects.empty()) ranking.push_back(a.effects.front());
  ranking.insert(ranking.end(), a.alternatives.begin(), a.alternatives.end());
  std::vector<std::string> set = a.effects;
  for (const std::string& id : a.alternatives)
    if (!holds(set, id)) set.push_back(id);
  j.set_size = static_cast<int>(set.size());
  j.closed_truth = closed_of_truth(t, a);
  j.closed = one.floor.contains(a.signal) ? closed_to_twin(a, one.floor) : j.closed_truth;
  j.left_unnamed = a.verdict == "unknown" && a.effects.empty();
  const bool one_name = a.verdict == "named" && a.effects.size() == 1 && a.alternatives.empty();
  j.asserted = a.verdict == "named" && !a.effects.empty() && a.alternatives.empty();
  j.single_wrong = one_name && !holds(t.ids, a.effects.front()) && !holds(t.equals, a.effects.front());
  if (t.kind == "single") {
    const std::string& truth = t.ids.front();
    const bool tie = !t.nearest_equal.empty();
    const bool both = holds(set, truth) && holds(set, t.nearest_equal);
    j.in_set = tie ? both : holds(set, truth);
    j.first = tie ? both : !ranking.empty() && ranking.front() == truth;
    const auto end = ranking.begin() + std::min<std::ptrdiff_t>(3, std::ssize(ranking));
    j.first_three = tie ? both : std::find(ranking.begin(), end, truth) != end;
  }
  if (t.kind == "pair") {
    j.all_named = holds(a.effects, t.ids[0]) && holds(a.effects, t.ids[1]);
    j.one_named = holds(a.effects, t.ids[0]) != holds(a.effects, t.ids[1]);
    j.in_set = holds(set, t.ids[0]) && holds(set, t.ids[1]);
    j.both_told = t.nearest_equal.empty() && t.alone.empty()
                      ? j.all_named
                      : j.in_set && (t.nearest_equal.empty() || holds(set, t.nearest_equal));
  }
  if (t.kind == "unknown") {
    const bool all = std::all_of(t.depends_on.begin(), t.depends_on.end(),
                                 [&](const std::string& name) { return holds(a.depends_on, name); });
    j.right_variables = j.left_unnamed && all && a.depends_on.size() <= t.depends_on.size() + 1;
  }
  const std::string subsystem = a.subsystems.empty() ? a.where : a.subsystems.front();
  if (t.kind == "single" || t.kind == "unknown")
    j.right_side = (j.in_set && !t.nearest_equal.empty()) ||
                   (!subsystem.empty() && (subsystem == "sensor") == (t.side == "sensor"));
  if (t.kind == "left_out") j.tied = j.asserted && holds(t.equals, a.effects.front());
  return j;
}

void join_asked_alone(std::vector<Case>& cases) {
  const auto alone = [](const Case& one) { return one.answer.failed == kNotAsked; };
  std::map<std::string, Case*> answered;
  for (Case& one : cases)
    if (!alone(one)) answered.emplace(one.truth.key, &one);
  std::vector<bool> joined(cases.size());
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto other = alone(cases[i]) ? answered.find(cases[i].truth.key) : answered.end();
    if (other == answered.end()) continue;
    other->second->baselines.insert(cases[i].baselines.begin(), cases[i].baselines.end());
    joined[i] = true;
  }
  std::size_t at = 0;
  std::erase_if(cases, [&](const Case&) { return joined[at++]; });
}

std::string seed_of_key(const std::string& key) {
  const std::size_t from = key.rfind('/') + 1, to = key.rfind('.');
  return to == std::string::npos || to < from ? "" : key.substr(from, to - from);
}

}  // namespace blind
