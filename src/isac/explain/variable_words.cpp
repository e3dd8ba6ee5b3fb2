#include "isac/explain/variable_words.hpp"

#include <map>

namespace isac::explain {
namespace {

struct Words {
  const char *name, *symbol;
};

Words words_of(const std::string& variable, bool linear_axis) {
  static const std::map<std::string, Words> kJoint{{"delta_pressure", {"pressure difference", "Δp"}},
                                                   {"mean_pressure", {"mean pressure", ""}},
                                                   {"p1", {"pressure p1", ""}},
                                                   {"p2", {"pressure p2", ""}},
                                                   {"angle", {"angle", "φ"}},
                                                   {"velocity", {"speed", "φ̇"}},
                                                   {"speed", {"speed", "|φ̇|"}},
                                                   {"direction", {"direction of motion", ""}},
                                                   {"memory", {"what happened before", ""}},
                                                   {"pressure_rate", {"rate of the pressures", ""}}};
  static const std::map<std::string, Words> kLinear{
      {"angle", {"position", "x"}}, {"velocity", {"speed", "v"}}, {"speed", {"speed", "|v|"}}};
  if (linear_axis)
    if (const auto found = kLinear.find(variable); found != kLinear.end()) return found->second;
  const auto found = kJoint.find(variable);
  return found == kJoint.end() ? Words{variable.c_str(), ""} : found->second;
}

}  // namespace

std::string variable_name(const std::string& variable, bool linear_axis) {
  return words_of(variable, linear_axis).name;
}

std::string variable_in_words(const std::string& variable, bool linear_axis) {
  const Words words = words_of(variable, linear_axis);
  const std::string symbol = words.symbol;
  return words.name + (symbol.empty() ? "" : " " + symbol);
}

std::vector<std::string> variables_in_words(const std::vector<std::string>& variables, bool linear_axis) {
  std::vector<std::string> words;
  for (const std::string& variable : variables) words.push_back(variable_in_words(variable, linear_axis));
  return words;
}

bool of_linear_axis(const std::string& unit) {
  return unit == "m" || unit == "m/s" || unit == "N";
}

}  // namespace isac::explain
