#include "tune/inputs.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/tables.hpp"

namespace isac::apps {
namespace {

using models::JointField;

/// Standard error over value of a parameter of a section; 0 where neither is known.
double relative_error(const record::ParamsSection* section, const std::string& name) {
  if (section == nullptr) return 0;
  for (const Estimated& e : section->values)
    if (e.name == name && std::isfinite(e.std_error) && e.value != 0) return std::abs(e.std_error / e.value);
  return 0;
}

const record::ParamsSection* section_of(const record::Params& params, const std::string& name,
                                        const std::string& label) {
  const record::ParamsSection* any = nullptr;
  for (const record::ParamsSection& s : params.sections) {
    if (s.name != name) continue;
    if (s.label == label) return &s;
    if (s.label.empty()) any = &s;
  }
  return any;
}

void set_limits(tune::JointModel& model, const record::Rig& rig) {
  auto& l = model.limits;
  l.delta_pressure = rig.limits.delta_pressure;
  l.pressure = rig.limits.pressure;
  l.angle_low = -rig.limits.angle;
  l.angle_high = rig.limits.angle;
  l.speed = rig.limits.speed;
}

}  // namespace

std::optional<TunedJoint> read_joint(const std::string& path, const std::string& label,
                                     const record::Rig& rig) {
  if (path.empty() || !std::filesystem::exists(path)) return {};
  const record::Params params = record::read_params(path);
  std::vector<std::string> labels;
  for (const record::ParamsSection& s : params.sections)
    if (s.name == "joint") labels.push_back(s.label);
  if (labels.empty()) return {};
  const auto found = label.empty() ? labels.begin() : std::find(labels.begin(), labels.end(), label);
  if (found == labels.end())
    throw Error(ErrorKind::kUsage, "joint_unknown",
                "there is no [[joint]] labelled '" + label + "'; name one that is there with --joint",
                {path, 0, 0});
  TunedJoint joint;
  joint.label = *found;
  const models::ParameterTable table = record::parameter_table(params);
  const models::JointParameters& p = table.joints[static_cast<std::size_t>(found - labels.begin())];
  using enum JointField;
  for (const auto& [field, name] : {std::pair{kA, "A"}, {kB, "B"}, {kC, "C"}, {kD, "D"}})
    if (!p.has(field))
      throw Error(ErrorKind::kAnswerIsNo, "parameter_missing",
                  std::string(name) + " of joint '" + joint.label +
                      "' is not known; identify it first (isac-identify joint)",
                  {path, 0, 0});
  const auto value = [&p](JointField field, double fallback) { return p.has(field) ? p[field] : fallback; };
  tune::JointModel& m = joint.model;
  m.muscle = {.A = p[kA], .B = p[kB], .C = p[kC], .D = p[kD]};
  m.wheel_radius = value(kWheelRadius, rig.joint.wheel_radius);
  m.mean_pressure = value(kInitialPressure, rig.joint.initial_pressure);
  m.inertia = value(kInertia, rig.joint.inertia);
  if (!std::isfinite(m.inertia) || !(m.inertia > 0))
    throw Error(
        ErrorKind::kAnswerIsNo, "inertia_missing",
        "the joint's inertia is not known; give inertia in [joint] of the rig file, e.g. \"0.0085 kg m2\"",
        {path, 0, 0});
  if (!(m.muscle.A < 0) || !(m.muscle.B > 0) || !(m.muscle.D > 0))
    throw Error(ErrorKind::kAnswerIsNo, "joint_impossible",
                "A must be negative, B and D positive for a joint that can be tuned; identify it anew from "
                "other sweeps",
                {path, 0, 0});
  m.valve.gain = value(kValveGain, 1.0);
  if (p.has(kValveLagFill) && p.has(kValveLagVent)) m.valve.lag = 0.5 * (p[kValveLagFill] + p[kValveLagVent]);
  m.valve.lag = value(kValveLag, m.valve.lag);
  m.valve.dead_time = value(kValveDeadTime, 0.0);
  if (!p.has(kValveLag) && !p.has(kValveLagFill))
    joint.warnings.push_back(
        {"valve_assumed",
         "No [pcu] in the parameters: the seed's valve unit was taken, K_C = 1 and T_C = 0.17 s."});
  set_limits(m, rig);
  const record::ParamsSection* of_joint = section_of(params, "joint", joint.label);
  const record::ParamsSection* pcu = section_of(params, "pcu", joint.label);
  auto& e = joint.relative_errors;
  e[tune::kDrawA] = relative_error(of_joint, "A");
  e[tune::kDrawB] = relative_error(of_joint, "B");
  e[tune::kDrawC] = relative_error(of_joint, "C");
  e[tune::kDrawD] = relative_error(of_joint, "D");
  e[tune::kDrawValveGain] = relative_error(pcu, "K_C");
  e[tune::kDrawLag] = relative_error(pcu, "T_C");
  e[tune::kDrawDeadTime] = relative_error(pcu, "dead_time");
  if (p.has(kPositionP) && p.has(kPositionI) && p.has(kTorqueP) && p.has(kTorqueI)) {
    tune::Gains g;
    g.position = {.proportional = p[kPositionP], .integral = p[kPositionI]};
    g.torque = {.proportional = p[kTorqueP], .integral = p[kTorqueI]};
    joint.gains = g;
  }
  return joint;
}

TunedJoint joint_of(const tune::PlantFit& fit, const record::Rig& rig,
                    const std::optional<TunedJoint>& known) {
  const double inertia = known ? known->model.inertia : rig.joint.inertia;
  if (!std::isfinite(inertia) || !(inertia > 0))
    throw Error(
        ErrorKind::kAnswerIsNo, "inertia_missing",
        "the joint's inertia is not known; give inertia in [joint] of the rig file, e.g. \"0.0085 kg m2\"");
  TunedJoint joint;
  joint.model = tune::joint_model(fit.plant, rig.joint.wheel_radius, inertia);
  joint.model.mean_pressure = rig.joint.initial_pressure;
  if (known) {
    joint.model.muscle.C = known->model.muscle.C;
    joint.gains = known->gains;
    joint.label = known->label;
  }
  set_limits(joint.model, rig);
  const auto relative = [&fit](const char* name) {
    const Estimated& e = tune::value_of(fit, name);
    return std::isfinite(e.std_error) && e.value > 0 ? std::min(0.3, e.std_error / e.value) : 0.0;
  };
  auto& e = joint.relative_errors;  // A = −I/(T_J r)², B = −K A r, D = 2 ζ I/T_J
  e[tune::kDrawA] = 2 * relative("T_J");
  e[tune::kDrawB] = std::hypot(relative("K"), e[tune::kDrawA]);
  e[tune::kDrawD] = std::hypot(relative("zeta"), relative("T_J"));
  e[tune::kDrawLag] = relative("T_C");
  e[tune::kDrawDeadTime] = relative("dead_time");
  return joint;
}

std::vector<Estimated> gains_section(const tune::Gains& g) {
  const auto one = [](const char* name, const char* unit, double value) {
    Estimated e;
    e.name = name;
    e.unit = unit;
    e.value = value;
    return e;
  };
  return {one("K_P_position", "N m/rad", g.position.proportional),
          one("K_I_position", "N m/rad s", g.position.integral),
          one("K_P_torque", "kgf/cm2/N m", g.torque.proportional / kPascalPerKgfCm2),
          one("K_I_torque", "kgf/cm2/N m s", g.torque.integral / kPascalPerKgfCm2)};
}

}  // namespace isac::apps
