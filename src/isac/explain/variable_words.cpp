#include "isac/explain/variable_words.hpp"

#include <map>

namespace isac::explain {
namespace {

const std::map<std::string, std::string> kJoint{{"delta_pressure", "pressure difference Δp"},
                                                {"mean_pressure", "mean pressure"},
                                                {"p1", "pressure p1"},
                                                {"p2", "pressure p2"},
                                                {"angle", "angle φ"},
                                                {"velocity", "speed φ̇"},
                                                {"speed", "speed |φ̇|"},
                                                {"direction", "direction of motion"},
                                                {"memory", "what happened before"},
                                                {"pressure_rate", "rate of the pressures"}};
const std::map<std::string, std::string> kLinear{
    {"angle", "position x"}, {"velocity", "speed v"}, {"speed", "speed |v|"}};

}  // namespace

std::string variable_in_words(const std::string& variable, bool linear_axis) {
  if (linear_axis)
    if (const auto found = kLinear.find(variable); found != kLinear.end()) return found->second;
  const auto found = kJoint.find(variable);
  return found == kJoint.end() ? variable : found->second;
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
