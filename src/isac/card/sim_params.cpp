#include "isac/card/sim_params.hpp"

#include <algorithm>

#include "isac/core/error.hpp"
#include "isac/models/effects.hpp"
#include "isac/record/params.hpp"
#include "isac/record/tables.hpp"

namespace isac::card {
namespace {

using models::JointField;

models::ParameterTable table_of(const std::string& path) {
  const record::Params params = record::read_params(path);
  try {
    return record::parameter_table(params);
  } catch (const Error& error) {
    throw Error(error.kind(), error.code(), error.text(), {path, 0, 0});
  }
}

void apply_joint(simulate::RigConfig& config, const models::JointParameters& joint) {
  const auto take = [&joint](JointField field, double& value) {
    if (joint.has(field)) value = joint[field];
  };
  take(JointField::kA, config.joint.A);
  take(JointField::kB, config.joint.B);
  take(JointField::kC, config.joint.C);
  take(JointField::kD, config.joint.D);
  take(JointField::kWheelRadius, config.joint.wheel_radius);
  take(JointField::kInitialPressure, config.joint.initial_pressure);
  take(JointField::kInertia, config.joint.inertia);
  for (simulate::ValveUnit& valve : config.valves) {
    take(JointField::kValveGain, valve.gain);
    take(JointField::kValveLag, valve.fill_lag);
    take(JointField::kValveLag, valve.vent_lag);
    take(JointField::kValveLagFill, valve.fill_lag);
    take(JointField::kValveLagVent, valve.vent_lag);
    take(JointField::kValveDeadTime, valve.dead_time);
  }
}

void apply_effects(simulate::RigConfig& config, const models::ParameterTable& table) {
  const bool has_dead_time = table.joints[0].has(JointField::kValveDeadTime);
  for (int i = 0; i < table.effect_count; ++i) {
    const models::TableEffect& effect = table.effects[static_cast<std::size_t>(i)];
    if (effect.joint != models::kAllJoints && effect.joint != 0) continue;
    for (const models::EffectInfo& info : models::effect_catalogue()) {
      if (models::effect_id_hash(info.id) != effect.id_hash) continue;
      if (has_dead_time && std::string_view(info.id) == "dead_time") continue;
      config.effects.push_back(
          {info.id, {effect.parameters.begin(), effect.parameters.begin() + effect.parameter_count}});
    }
  }
}

}  // namespace

void apply_params(simulate::RigConfig& config, const std::string& path) {
  const models::ParameterTable table = table_of(path);
  apply_joint(config, table.joints[0]);
  apply_effects(config, table);
}

}  // namespace isac::card
