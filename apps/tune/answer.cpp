#include "tune/answer.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "isac/control/stability.hpp"
#include "isac/core/units.hpp"
#include "isac/record/answer.hpp"
#include "isac/tune/linear_step.hpp"
#include "isac/tune/rules.hpp"

namespace isac::apps {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}
Json quantity(double value, const char* unit) {
  return {{"value", number(value)}, {"unit", unit}};
}

const char* name_of(control::Structure structure) {
  switch (structure) {
    case control::Structure::kPid:
      return "PID";
    case control::Structure::kCascade:
      return "PI-PI";
    case control::Structure::kModelBased:
      break;
  }
  return "PI-MBPI";
}

Json gains_of(const tune::Gains& g) {
  Json out = Json::object();
  if (g.structure == control::Structure::kPid) {
    out["K_P"] = quantity(g.position.proportional / kPascalPerKgfCm2, "kg/cm2/rad");
    out["K_I"] = quantity(g.position.integral / kPascalPerKgfCm2, "kg/cm2/rad s");
    out["K_D"] = quantity(g.position.derivative / kPascalPerKgfCm2, "kg/cm2 s/rad");
    return out;
  }
  for (const Estimated& e : gains_section(g)) out[e.name] = {{"value", number(e.value)}, {"unit", e.unit}};
  return out;
}

Json figures_of(const tune::Assessment& a) {
  return {{"draws", a.draws},
          {"stable_share", a.stable_share},
          {"within_limits_share", a.good_share},
          {"tracking_rms", quantity(a.tracking, "rad")},
          {"tracking_rms_p95", quantity(a.tracking_p95, "rad")},
          {"overshoot", number(a.overshoot)},
          {"overshoot_p95", number(a.overshoot_p95)},
          {"rise", quantity(a.rise, "s")},
          {"settling", quantity(a.settling, "s")},
          {"effort", quantity(a.effort / kPascalPerKgfCm2, "kg/cm2/s")},
          {"modulus_margin_p05", number(a.modulus_p05)},
          {"margins",
           {{"stable", a.margins.stable},
            {"gain", number(a.margins.gain)},
            {"gain_down", number(a.margins.gain_down)},
            {"phase", quantity(a.margins.phase, "rad")},
            {"delay", quantity(a.margins.delay, "s")},
            {"modulus", number(a.margins.modulus)}}}};
}

Json candidate(const tune::Candidate& c) {
  Json out = {{"name", c.name}, {"structure", name_of(c.gains.structure)}, {"gains", gains_of(c.gains)}};
  if (c.figures.draws > 0) out["figures"] = figures_of(c.figures);
  return out;
}

/// Of the loop without dead time and sampling: the seed's criterion.
Json hurwitz_of(const tune::JointModel& m, const tune::Gains& g) {
  const control::CascadeLoop<double> loop{m.muscle, m.wheel_radius, m.inertia, m.valve, g.position, g.torque};
  const auto polynomial = control::model_based_polynomial(loop);
  Json minors = Json::array();
  for (const double h : control::hurwitz_minors(polynomial)) minors.push_back(number(h));
  return {{"stable", control::is_hurwitz(polynomial)}, {"minors", std::move(minors)}};
}

/// P2 of the model: the joint alone and with its valve unit.
Json plant_of(const tune::JointModel& m) {
  tune::LagPlant plant;
  if (!ok(tune::lag_plant(m, plant))) return nullptr;
  const auto whole = tune::step_shape(plant), joint = tune::joint_step_shape(plant);
  const auto critical = tune::ultimate(tune::plant_loop(plant));
  return {{"T_J", quantity(plant.time_constant, "s")},
          {"zeta", number(plant.damping)},
          {"K_J", quantity(plant.gain * kPascalPerKgfCm2, "rad/(kg/cm2)")},
          {"T_L", quantity(whole.latency, "s")},
          {"T_A", quantity(whole.adjustment, "s")},
          {"joint_T_L", quantity(joint.latency, "s")},
          {"joint_T_A", quantity(joint.adjustment, "s")},
          {"controllability",
           {{"ratio", whole.latency / whole.adjustment},
            {"verdict", tune::describe(tune::controllability(whole))}}},
          {"K_crit", critical ? quantity(critical->gain / kPascalPerKgfCm2, "kg/cm2/rad") : Json(nullptr)},
          {"T_crit", critical ? quantity(critical->period, "s") : Json(nullptr)}};
}

}  // namespace

std::string format_tuning(const TuneAnswer& a) {
  record::Answer answer;
  answer.schema = "isac.tune/1";
  answer.warnings = a.warnings;
  if (a.fit != nullptr) {
    answer.parameters = a.fit->parameters;
    answer.parameters.insert(answer.parameters.end(), a.fit->derived.begin(), a.fit->derived.end());
    answer.fit.rmse = a.fit->rmse;
    answer.fit.unit = "rad";
    answer.fit.nrmse = a.fit->misfit;
    answer.fit.samples = static_cast<double>(a.fit->record.time.size());
  }
  Json extra = Json::object();
  extra["method"] = a.method;
  extra["rule"] = a.rule;
  extra["verdict"] = a.refusal.empty() ? "tuned" : "kept";
  extra["reason"] = a.refusal.empty() ? Json(nullptr) : Json(a.refusal);
  extra["deployed"] = a.deployed.empty() ? Json(nullptr) : Json(a.deployed);
  extra["gains"] = nullptr;
  extra["old_gains"] = a.joint != nullptr && a.joint->gains ? gains_of(*a.joint->gains) : Json(nullptr);
  if (a.tuning != nullptr && a.tuning->chosen) {
    const tune::Candidate& c = a.tuning->candidates[*a.tuning->chosen];
    extra["gains"] = gains_of(c.gains);
    extra["figures"] = figures_of(c.figures);
    extra["hurwitz"] = hurwitz_of(a.joint->model, c.gains);
  }
  if (a.joint != nullptr) extra["plant"] = plant_of(a.joint->model);
  Json candidates = Json::array();
  if (a.tuning != nullptr) {
    if (a.tuning->before) candidates.push_back(candidate(*a.tuning->before));
    for (const tune::Candidate& c : a.tuning->candidates) candidates.push_back(candidate(c));
  }
  extra["candidates"] = std::move(candidates);
  extra["experiment"] = nullptr;
  if (a.run != nullptr) {
    extra["experiment"] = {{"log", a.log.empty() ? Json(nullptr) : Json(a.log)},
                           {"samples", a.run->rows},
                           {"late", a.run->late},
                           {"dropped", a.run->dropped}};
    if (std::isfinite(a.describing.gain))
      extra["experiment"]["describing_function"] = {
          {"K_crit", quantity(a.describing.gain / kPascalPerKgfCm2, "kg/cm2/rad")},
          {"T_crit", quantity(a.describing.period, "s")},
          {"amplitude", quantity(a.describing.amplitude, "rad")}};
  }
  return record::format_answer(answer, extra);
}

}  // namespace isac::apps
