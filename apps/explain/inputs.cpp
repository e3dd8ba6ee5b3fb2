#include "explain/inputs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "common/dataset.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/explain/step_records.hpp"
#include "isac/models/effect_queries.hpp"
#include "isac/record/model_file.hpp"

namespace isac::apps {
namespace {

constexpr std::array<std::string_view, 14> kRead = {
    "time", "angle", "velocity", "p1",          "p2",       "p1_cmd",   "p2_cmd",
    "F1",   "F2",    "torque",   "temperature", "p_supply", "pressure", "pressure_cmd"};

/// The seed's joint, or the sum of terms of a model.toml; inertia among the terms says that the output drives the axis, as in
/// the fit of a joint.
explain::BaselineModel baseline_of(const record::ModelFile& model) {
  explain::BaselineModel baseline;
  baseline.terms = model.terms;
  baseline.output = model.output_signal;
  baseline.output_unit = model.output_unit;
  baseline.position = model.position;
  const int inertia = models::find_effect("inertia");
  baseline.driven = std::any_of(model.terms.begin(), model.terms.end(), [inertia](const std::string& term) {
    return models::find_effect(term) == inertia;
  });
  return baseline;
}

explain::RigFacts facts_of(const record::Rig& rig, bool rig_given) {
  explain::RigFacts facts;
  facts.wheel_radius = rig.joint.wheel_radius;
  if (std::isfinite(rig.joint.initial_pressure)) facts.initial_pressure = rig.joint.initial_pressure;
  facts.inertia = rig.joint.inertia;
  if (rig_given) facts.angle_step = 2 * kPi / rig.encoder.steps_per_turn;
  facts.force_lag = rig.sensors.force_lag;
  facts.force_noise = rig.sensors.force_noise;
  facts.pressure_noise = rig.sensors.pressure_noise;
  return facts;
}

series::ExcitationOptions limits_of(const record::RigLimits& limits) {
  series::ExcitationOptions out;
  out.delta_pressure_limit = limits.delta_pressure;
  out.pressure_limit = limits.pressure;
  out.angle_limit = limits.angle;
  out.speed_limit = limits.speed;
  out.force_limit = limits.force;
  return out;
}

bool uses_pressure(const explain::BaselineModel& baseline) {
  return baseline.terms.empty() ||
         std::any_of(baseline.terms.begin(), baseline.terms.end(), [](const std::string& term) {
           return models::effect_uses_pressure(models::find_effect(term));
         });
}

/// What no step of explain() reads takes no memory while it runs.
void keep_columns(series::Recording& recording, const explain::BaselineModel& baseline) {
  std::erase_if(recording.columns, [&baseline](const series::Column& column) {
    return std::find(kRead.begin(), kRead.end(), column.name) == kRead.end() &&
           column.name != baseline.output && column.name != baseline.position;
  });
  for (series::Column& column : recording.columns) column.values.shrink_to_fit();
}

std::vector<series::Recording> read_runs(const std::vector<std::filesystem::path>& paths,
                                         const record::ReadOptions& reading,
                                         const explain::BaselineModel& baseline) {
  std::vector<series::Recording> runs;
  for (const std::filesystem::path& path : paths) {
    runs.push_back(record::read_recording(path, reading));
    keep_columns(runs.back(), baseline);
  }
  return runs;
}

void require_known(const std::vector<std::string>& effects) {
  for (const std::string& id : effects) {
    if (models::find_effect(id) < 0) {
      throw Error(
          ErrorKind::kUsage, "effect_unknown",
          "--exclude names '" + id + "', which is no effect of the catalogue; docs/effects.md lists them");
    }
  }
}

}  // namespace

ExplainInputs read_inputs(const ExplainWords& words) {
  require_known(words.excluded);
  ExplainInputs inputs;
  if (!words.model.empty()) {
    const record::ModelFile model = record::read_model(words.model);
    inputs.baseline = baseline_of(model);
    inputs.title = model.name;
  }
  const Files files = find_files(words.dataset, words.heldout, words.rig);
  if (!files.rig.empty()) {
    inputs.rig = record::read_rig(files.rig);
    inputs.rig_file = files.rig.string();
  }
  if (inputs.title.empty()) inputs.title = inputs.rig.name;
  inputs.facts = facts_of(inputs.rig, !files.rig.empty());
  inputs.limits = limits_of(inputs.rig.limits);
  record::ReadOptions reading{.map = parse_maps(words.maps), .require_time = true, .hash = words.hash};
  inputs.runs = read_runs(files.runs, reading, inputs.baseline);
  if ((uses_pressure(inputs.baseline) || inputs.baseline.output == "torque") &&
      !std::isfinite(inputs.facts.wheel_radius) && !explain::only_pressures(inputs.runs)) {
    throw Error(ErrorKind::kBadInput, "wheel_missing",
                "the chain wheel is not known; give --rig rig.toml with chain_wheel_diameter in [joint]");
  }

  inputs.sources = sources_of(inputs.runs);
  for (const series::Recording& run : inputs.runs) {
    const series::Column* position = run.find(inputs.baseline.position);
    if (position == nullptr) continue;
    inputs.baseline.position_unit = position->unit;
    break;
  }
  reading.hash = false;
  inputs.heldout = explain::HeldOut(read_runs(files.heldout, reading, inputs.baseline));
  return inputs;
}

}  // namespace isac::apps
