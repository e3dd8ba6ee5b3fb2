/// @file
/// What an effect depends on, asked of its equation instead of written down twice.
///
/// A NaN goes through every equation that reads it, so an effect depends on a quantity exactly if a NaN there makes its
/// torque NaN. Real time: not for the loop. Errors: none; an index outside the catalogue depends on nothing.
/// Source: house rule "one equation, one place". Example: `effect_uses_pressure(find_effect("B"))` is true.
#pragma once

#include <limits>

#include "isac/models/effects.hpp"

namespace isac::models {

/// Does the torque of the effect read Δp or the mean pressure?
[[nodiscard]] inline bool effect_uses_pressure(int effect) noexcept {
  if (effect < 0 || effect >= static_cast<int>(effect_catalogue().size())) return false;
  const EffectInfo& info = effect_catalogue()[static_cast<unsigned>(effect)];
  double parameters[kMaxEffectParameters] = {};
  for (int i = 0; i < info.parameter_count; ++i) parameters[i] = info.parameters[i].typical;
  const double state[kMaxEffectStates] = {0.5, 0.5};
  JointPoint<double> point;
  point.angle = 0.3;
  point.velocity = 1.1;
  point.acceleration = 0.7;
  point.time = 2.0;
  point.wheel_radius = 0.019;
  point.reference_pressure = 3e5;
  point.stiffness = -20000;
  point.pressure_gain = 1.8e-3;
  point.delta_pressure = point.mean_pressure = std::numeric_limits<double>::quiet_NaN();
  const double torque = effect_torque<double>(effect, parameters, point, state);
  return torque != torque;
}

}  // namespace isac::models
