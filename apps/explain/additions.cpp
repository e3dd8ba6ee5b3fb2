#include "explain/additions.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "isac/control/feed_forward.hpp"
#include "isac/models/effects.hpp"

namespace isac::apps {
namespace {

bool is_valve(const Estimated& parameter) {
  return parameter.name == "K_C" || parameter.name == "T_C";
}

/// The name that isac-identify joint writes: "coulomb_friction", "stribeck_friction.T_s"; the seed's letters stay.
std::string joint_name(const std::string& name, const std::vector<std::string>& terms) {
  for (const std::string& term : terms) {
    const int effect = models::find_effect(term);
    if (effect < 0) continue;
    const models::EffectInfo& info = models::effect_catalogue()[static_cast<std::size_t>(effect)];
    for (int i = 0; i < info.parameter_count; ++i) {
      if (name == info.parameters[i].name) return info.parameter_count == 1 ? term : term + "." + name;
    }
  }
  return name;
}

/// The entry of the catalogue whose parameters these are.
const std::string& form_of(const explain::Candidate& effect) {
  return effect.form.empty() ? effect.id : effect.form;
}

const Estimated* delay_of(const explain::Explanation& answer) {
  if (!answer.adds()) return nullptr;
  for (const explain::Candidate& effect : answer.effects)
    if (form_of(effect) == "dead_time" && !effect.parameters.empty()) return &effect.parameters.front();
  return nullptr;
}

record::ParamsSection section_of(const char* name, const std::string& label, const ExplainInputs& inputs) {
  record::ParamsSection section;
  section.name = name;
  section.label = label;
  section.sources = inputs.sources;
  return section;
}

record::ParamsSection valve_of(const explain::Explanation& answer, const ExplainInputs& inputs) {
  record::ParamsSection valve = section_of("pcu", {}, inputs);
  for (const Estimated& parameter : answer.base)
    if (is_valve(parameter)) valve.values.push_back(parameter);
  if (const Estimated* delay = delay_of(answer)) {
    valve.values.push_back(*delay);
    valve.values.back().name = "dead_time";
  }
  return valve;
}

std::string memory_sentence(const models::EffectInfo& info) {
  if (info.state_count > 0)
    return "it has a memory, which feed-forward of the desired motion does not follow";
  switch (info.where) {
    case models::Subsystem::kPcu:
      return "it sits in the valve unit, whose command the feed-forward does not change; mend the valve or "
             "lower the gains";
    case models::Subsystem::kSensor:
      return "it sits in a sensor; calibrate it away (isac-log calibrate), for a controller that trusts it "
             "follows it";
    case models::Subsystem::kRig:
      return "something outside the joint moves it; find and stop that";
    default:
      return "it bends the model or limits the range, and is carried in the model instead of pushed against";
  }
}

}  // namespace

record::Params params_of(const explain::Explanation& answer, const ExplainInputs& inputs,
                         const std::string& created) {
  record::Params params;
  params.created = created;
  record::ParamsSection joint =
      section_of("joint", inputs.rig.name.empty() ? "joint" : inputs.rig.name, inputs);
  for (const Estimated& parameter : answer.base) {
    if (is_valve(parameter)) continue;
    joint.values.push_back(parameter);
    joint.values.back().name = joint_name(parameter.name, inputs.baseline.terms);
  }
  if (std::isfinite(inputs.facts.wheel_radius))
    joint.constants.emplace_back("wheel_radius_m", inputs.facts.wheel_radius);
  if (inputs.baseline.terms.empty() || !inputs.rig_file.empty())
    joint.constants.emplace_back("initial_pressure_Pa", inputs.facts.initial_pressure);
  if (std::isfinite(inputs.facts.inertia))
    joint.constants.emplace_back("inertia_kg_m2", inputs.facts.inertia);
  params.sections.push_back(std::move(joint));
  if (record::ParamsSection valve = valve_of(answer, inputs); !valve.values.empty())
    params.sections.push_back(std::move(valve));
  if (!answer.adds()) return params;
  for (const explain::Candidate& effect : answer.effects) {
    record::ParamsSection section = section_of("effects", form_of(effect), inputs);
    section.values = effect.parameters;
    params.sections.push_back(std::move(section));
  }
  return params;
}

std::vector<std::string> compensation_of(const explain::Explanation& answer) {
  std::vector<std::string> sentences;
  if (!answer.adds()) return sentences;
  for (const explain::Candidate& effect : answer.effects) {
    const int index = models::find_effect(form_of(effect));
    if (index < 0) continue;
    std::string name = effect.name;
    if (!name.empty() && name[0] >= 'a' && name[0] <= 'z') name[0] = static_cast<char>(name[0] - 'a' + 'A');
    const models::EffectInfo& info = models::effect_catalogue()[static_cast<std::size_t>(index)];
    if (control::feed_forward_serves(index)) {
      sentences.push_back(
          name +
          ": the controller feeds it forward on the desired motion, once the parameters are exported.");
    } else if (form_of(effect) == "dead_time") {
      sentences.push_back(name +
                          ": the controller's predictor carries it, as the dead time of the valve unit.");
    } else {
      sentences.push_back(name + ": cannot be compensated; " + memory_sentence(info) + ".");
    }
  }
  return sentences;
}

}  // namespace isac::apps
