#include "ledger.hpp"

#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

namespace blind {
namespace {

using json = nlohmann::ordered_json;

double five_digits(double x) {
  char text[40];
  std::snprintf(text, sizeof text, "%.5g", x);
  return std::strtod(text, nullptr);
}

class Writer {
 public:
  void add(const char* name, const std::string& word) {
    if (!word.empty()) object[name] = word;
  }
  void add(const char* name, double number) {
    if (number != 0.0) object[name] = five_digits(number);
  }
  void add(const char* name, const std::vector<std::string>& words) {
    if (!words.empty()) object[name] = words;
  }
  void add(const char* name, const std::vector<double>& numbers) {
    for (const double x : numbers) object[name].push_back(five_digits(x));
  }
  void add(const char* name, const std::map<std::string, double>& numbers,
           const std::set<std::string>& only) {
    for (const auto& [key, number] : numbers)
      if (only.contains(key)) object[name][key] = five_digits(number);
  }
  json object = json::object();
};

json write_truth(const Truth& t, const std::set<std::string>& gap_signals) {
  Writer w;
  w.add("kind", t.kind);
  w.add("noise", t.noise);
  w.add("side", t.side);
  w.add("signal", t.signal);
  w.add("ratio", t.ratio);
  if (!t.testable) w.object["testable"] = false;
  w.add("ids", t.ids);
  w.add("subsystems", t.subsystems);
  w.add("depends_on", t.depends_on);
  w.add("nearest_equal", t.nearest_equal);
  w.add("equals", t.equals);
  w.add("alone", t.alone);
  w.add("gap", t.gap, gap_signals);
  w.add("gap_noise", t.gap_noise, gap_signals);
  w.add("gap_closes", t.gap_closes, gap_signals);
  return w.object;
}

json write_answer(const Answer& a) {
  Writer w;
  w.add("failed", a.failed);
  w.add("verdict", a.verdict);
  w.add("where", a.where);
  w.add("signal", a.signal);
  if (a.detected) w.object["detected"] = true;
  w.add("effects", a.effects);
  w.add("confidences", a.confidences);
  w.add("subsystems", a.subsystems);
  w.add("alternatives", a.alternatives);
  w.add("depends_on", a.depends_on);
  if (a.p_value >= 0.0) w.object["p_value"] = a.p_value;  // all digits: it is one of a grid's (p_distance)
  w.add("heldout_before", a.heldout_before);
  w.add("heldout_after", a.heldout_after);
  w.add("freed_before", a.freed_before);
  w.add("freed_after", a.freed_after);
  w.add("seconds", a.seconds);
  return w.object;
}

using Words = std::vector<std::string>;
using Numbers = std::map<std::string, double>;

Truth read_truth(const json& j) {
  Truth t;
  t.kind = j.at("kind");
  t.noise = j.at("noise");
  t.side = j.value("side", "");
  t.signal = j.value("signal", "");
  t.ratio = j.value("ratio", 0.0);
  t.testable = j.value("testable", true);
  t.ids = j.value("ids", Words{});
  t.subsystems = j.value("subsystems", Words{});
  t.depends_on = j.value("depends_on", Words{});
  t.nearest_equal = j.value("nearest_equal", "");
  t.equals = j.value("equals", t.nearest_equal.empty() ? Words{} : Words{t.nearest_equal});
  t.alone = j.value("alone", "");
  t.gap = j.value("gap", Numbers{});
  t.gap_noise = j.value("gap_noise", Numbers{});
  t.gap_closes = j.value("gap_closes", Numbers{});
  return t;
}

Answer read_answer(const json& j) {
  Answer a;
  a.failed = j.value("failed", "");
  a.verdict = j.value("verdict", "");
  a.where = j.value("where", "");
  a.signal = j.value("signal", "");
  a.detected = j.value("detected", false);
  a.effects = j.value("effects", Words{});
  a.confidences = j.value("confidences", std::vector<double>{});
  a.subsystems = j.value("subsystems", Words{});
  a.alternatives = j.value("alternatives", Words{});
  a.depends_on = j.value("depends_on", Words{});
  a.p_value = j.value("p_value", -1.0);
  a.heldout_before = j.value("heldout_before", 0.0);
  a.heldout_after = j.value("heldout_after", 0.0);
  a.freed_before = j.value("freed_before", 0.0);
  a.freed_after = j.value("freed_after", 0.0);
  a.seconds = j.value("seconds", 0.0);
  if (a.confidences.size() != a.effects.size() || a.subsystems.size() != a.effects.size())
    throw std::runtime_error("a line of the ledger has not one confidence and subsystem for each effect");
  return a;
}

}  // namespace

std::string ledger_line(const Case& one, const std::string& program) {
  std::set<std::string> said = {one.answer.signal}, labelled;  // the gap of any other signal is not scored
  for (const auto& [method, answer] : one.baselines) said.insert(answer.signal);
  for (const std::string& signal : said) labelled.insert(signal_of_label(signal));
  Writer w;
  w.add("key", one.truth.key);
  w.add("program", program);
  w.object["truth"] = write_truth(one.truth, labelled);
  w.object["answer"] = write_answer(one.answer);
  w.add("floor", one.floor, said);
  for (const auto& [method, answer] : one.baselines) w.object["baselines"][method] = write_answer(answer);
  return w.object.dump();
}

std::optional<Case> read_ledger_line(const std::string& line) {
  const json j = json::parse(line, nullptr, false);
  if (!j.is_object() || !j.contains("truth")) return {};
  try {
    Case one;
    one.truth = read_truth(j["truth"]);
    one.truth.key = j.value("key", "");
    one.answer = read_answer(j.at("answer"));
    one.floor = j.value("floor", Numbers{});
    if (j.contains("baselines"))
      for (const auto& [method, answer] : j["baselines"].items()) one.baselines[method] = read_answer(answer);
    return one;
  } catch (const json::exception& wrong) {
    throw std::runtime_error(std::string("a line of the ledger lacks something: ") + wrong.what());
  }
}

}  // namespace blind
