#include "isac/explain/two_zeros.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/explain/labels.hpp"
#include "isac/models/effects.hpp"

namespace isac::explain {
namespace {

constexpr const char* kSensors = "pressure_offset";
constexpr const char* kValve = "pressure_gain_error";
constexpr double kBoth = 0.2;  // of the larger zero

Candidate a_valves_zero(Explanation& e) {
  const auto ruled_out =
      std::find_if(e.rejected.begin(), e.rejected.end(), [](const Candidate& c) { return c.id == kValve; });
  if (ruled_out != e.rejected.end()) {
    Candidate c = std::move(*ruled_out);
    e.rejected.erase(ruled_out);
    return c;
  }
  const auto& info = models::effect_catalogue()[static_cast<unsigned>(models::find_effect(kValve))];
  Candidate c;
  c.id = c.form = info.id;
  c.name = info.term;
  c.subsystem = subsystem_name(info.where);
  c.equation = info.equation;
  for (int i = 0; i < info.parameter_count; ++i) {
    Estimated p;
    p.name = info.parameters[i].name;
    p.unit = info.parameters[i].unit;
    c.parameters.push_back(p);
  }
  return c;
}

}  // namespace

std::string tell_a_valves_zero(const std::vector<std::string>& excluded, Explanation& e) {
  const auto is_valve = [](const Candidate& c) { return c.id == kValve; };
  if (std::find(excluded.begin(), excluded.end(), kValve) != excluded.end() ||
      std::any_of(e.effects.begin(), e.effects.end(), is_valve) ||
      std::any_of(e.alternatives.begin(), e.alternatives.end(), is_valve))
    return "";
  const auto sensors =
      std::find_if(e.effects.begin(), e.effects.end(), [](const Candidate& c) { return c.id == kSensors; });
  if (sensors == e.effects.end() || sensors->parameters.size() != 2) return "";
  const double first = sensors->parameters[0].value, second = sensors->parameters[1].value;
  const bool of_first = std::abs(first) > std::abs(second);
  const double common = of_first ? second : first, larger = of_first ? first : second;
  if (!(first * second > 0) || std::abs(common) < kBoth * std::abs(larger)) return "";

  const std::string unit = sensors->parameters[0].unit;
  sensors->confidence *= 0.5;
  Candidate valve = a_valves_zero(e);
  valve.confidence = sensors->confidence;
  valve.behind_best = 0;
  valve.closes = sensors->closes;
  if (valve.parameters.size() == 2) {
    valve.parameters[0].value = 0;
    valve.parameters[1].value = common;
  }
  const std::string sentence = fmt::format(
      "Zeros of both pressure sensors are the same as a zero of the valves, {} {}, with one of sensor {}, {} "
      "{}: no recording in which the valves control the pressure tells them apart; what the sensors read "
      "when "
      "vented does.",
      rounded(common), unit, of_first ? 1 : 2, rounded(larger - common), unit);
  valve.evidence = {{true, sentence}};
  e.alternatives.insert(e.alternatives.begin(), std::move(valve));
  if (e.verdict == Verdict::kNamed) e.verdict = Verdict::kNotSeparable;
  return sentence;
}

}  // namespace isac::explain
