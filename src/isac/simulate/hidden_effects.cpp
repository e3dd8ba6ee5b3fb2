#include "isac/simulate/hidden_effects.hpp"

#include <cmath>
#include <string>

#include "isac/core/error.hpp"

namespace isac::simulate {

namespace {

[[noreturn]] void refuse_unknown(const std::string& id) {
  std::string known;
  for (const auto& info : models::effect_catalogue())
    known += (known.empty() ? "" : ", ") + std::string(info.id);
  throw Error(ErrorKind::kUsage, "effect_unknown",
              "there is no effect '" + id + "'; the catalogue has " + known + ".");
}

std::string parameter_list(const models::EffectInfo& info) {
  std::string list;
  for (int k = 0; k < info.parameter_count; ++k) {
    list += (list.empty() ? "" : ", ") + std::string(info.parameters[k].name);
  }
  return list;
}

}  // namespace

std::vector<CompiledEffect> compile_effects(const std::vector<HiddenEffect>& effects) {
  std::vector<CompiledEffect> compiled;
  for (const HiddenEffect& effect : effects) {
    CompiledEffect c;
    c.index = models::find_effect(effect.id);
    if (c.index < 0) refuse_unknown(effect.id);
    c.info = &models::effect_catalogue()[static_cast<std::size_t>(c.index)];
    const auto count = static_cast<std::size_t>(c.info->parameter_count);
    if (effect.parameters.size() > count) {
      throw Error(ErrorKind::kUsage, "effect_parameters",
                  "effect '" + effect.id + "' takes " + std::to_string(count) + " parameter(s) (" +
                      parameter_list(*c.info) + "), but " + std::to_string(effect.parameters.size()) +
                      " were given.");
    }
    for (std::size_t k = 0; k < count; ++k) {
      c.parameters[k] = k < effect.parameters.size() ? effect.parameters[k] : c.info->parameters[k].typical;
      if (!std::isfinite(c.parameters[k])) {
        throw Error(ErrorKind::kUsage, "effect_parameters",
                    "parameter " + std::string(c.info->parameters[k].name) + " of effect '" + effect.id +
                        "' is not a finite number.");
      }
    }
    compiled.push_back(c);
  }
  return compiled;
}

}  // namespace isac::simulate
