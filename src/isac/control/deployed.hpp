/// @file
/// From the deployment table to settings and feed-forward: the identified parameters go into the controller untranslated.
///
/// Needed per joint: A, B, C, D, wheel radius, initial pressure, and the four gains of the cascade. Taken where known:
/// inertia, valve unit (K_C, T_C, dead time; where filling and venting were told apart, T_C is theirs' mean), and the box of
/// Δp, angle and speed as limits (of Δp the smaller side: the gate is symmetric).
/// Units: SI, narrowed to the scalar here, once. Real time: start-up, not the loop; no heap, noexcept. Threads: pure.
/// Errors: kOutOfRange (a joint the table does not have, a value that is needed and missing, limits that exclude each other),
/// kNotFinite. On refusal `out` is untouched. Effects that feed-forward cannot serve are counted, not refused: they are part
/// of the model, and who starts the controller says so. Source: seed tables 6.1, 6.2; models/parameter_table.hpp.
/// Example: `if (ok(settings_of(table, 0, settings)) && ok(controller.configure(settings))) …`
#pragma once

#include "isac/control/feed_forward.hpp"
#include "isac/control/joint_settings.hpp"
#include "isac/models/parameter_table.hpp"

namespace isac::control {

template <class S>
[[nodiscard]] Status settings_of(const models::ParameterTable& table, int joint,
                                 JointSettings<S>& out) noexcept {
  using enum models::JointField;
  if (joint < 0 || joint >= table.joint_count) return Status::kOutOfRange;
  const models::JointParameters& p = table.joints[static_cast<std::size_t>(joint)];
  for (const models::JointField needed :
       {kA, kB, kC, kD, kWheelRadius, kInitialPressure, kPositionP, kPositionI, kTorqueP, kTorqueI})
    if (!p.has(needed)) return Status::kOutOfRange;
  const auto value = [&p](models::JointField field) { return S(p[field]); };

  JointSettings<S> s;
  s.muscle = {.A = value(kA), .B = value(kB), .C = value(kC), .D = value(kD)};
  s.wheel_radius = value(kWheelRadius);
  s.mean_pressure = value(kInitialPressure);
  s.position = {.proportional = value(kPositionP), .integral = value(kPositionI)};
  s.torque = {.proportional = value(kTorqueP), .integral = value(kTorqueI)};
  if (p.has(kInertia)) s.inertia = value(kInertia);
  if (p.has(kValveGain)) s.valve.gain = value(kValveGain);
  if (p.has(kValveLagFill) && p.has(kValveLagVent))
    s.valve.lag = (value(kValveLagFill) + value(kValveLagVent)) / S(2.0);
  if (p.has(kValveLag)) s.valve.lag = value(kValveLag);
  if (p.has(kValveDeadTime)) s.valve.dead_time = value(kValveDeadTime);
  JointLimits<S>& l = s.limits;
  if (p.has(kDeltaPressureLow) && -value(kDeltaPressureLow) < l.delta_pressure)
    l.delta_pressure = -value(kDeltaPressureLow);
  if (p.has(kDeltaPressureHigh) && value(kDeltaPressureHigh) < l.delta_pressure)
    l.delta_pressure = value(kDeltaPressureHigh);
  if (p.has(kAngleLow)) l.angle_low = value(kAngleLow);
  if (p.has(kAngleHigh)) l.angle_high = value(kAngleHigh);
  if (p.has(kSpeedHigh)) l.speed = value(kSpeedHigh);
  if (const Status status = check(s); !ok(status)) return status;
  out = s;
  return Status::kOk;
}

/// The table's effects on `joint` that can be fed forward; `left_out` counts the others.
template <class S>
[[nodiscard]] Status feed_forward_of(const models::ParameterTable& table, int joint, FeedForward<S>& out,
                                     int& left_out) noexcept {
  if (joint < 0 || joint >= table.joint_count) return Status::kOutOfRange;
  FeedForward<S> made = out;
  int others = 0;
  for (int i = 0; i < table.effect_count; ++i) {
    const models::TableEffect& effect = table.effects[static_cast<std::size_t>(i)];
    if (effect.joint != models::kAllJoints && effect.joint != joint) continue;
    int index = -1;
    for (int k = 0; k < models::Catalogue::kSize; ++k)
      if (models::effect_id_hash(models::Catalogue::kInfos[k].id) == effect.id_hash) index = k;
    if (index < 0) return Status::kOutOfRange;
    if (!feed_forward_serves(index)) {
      ++others;
      continue;
    }
    std::array<S, models::kMaxTableEffectParameters> q{};
    for (std::size_t k = 0; k < q.size(); ++k) q[k] = S(effect.parameters[k]);
    if (const Status status = made.add(index, q.data(), effect.parameter_count); !ok(status)) return status;
  }
  out = made;
  left_out = others;
  return Status::kOk;
}

}  // namespace isac::control
