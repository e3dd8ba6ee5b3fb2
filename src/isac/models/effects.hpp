/// @file
/// The catalogue of effects: every term that a joint's torque, its valve unit or its sensors may contain, written once.
/// The simulator, the fit, explain, the report and the controller's feed-forward all read this place.
///
/// Torque terms: T = Σ effect_torque(id, parameters, point), signs as in docs/errata.md (a dissipative term is −D φ̇).
/// Units: SI inside; `ParameterInfo::si_per_unit` leads from the reporting unit to SI.
/// Real time: no heap, no lock, noexcept, templated on the scalar (double, float, ceres::Jet).
/// Source: docs/effects.md (ids are fixed; add, never rename).
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace isac::models {

enum class Subsystem : std::uint8_t { kMuscle, kJoint, kPcu, kSensor, kRig };

struct ParameterInfo {
  const char* name;      ///< "T_c"; for a one-parameter effect the answer's key is the effect's id
  const char* unit;      ///< reporting unit, "N m"
  double si_per_unit;    ///< value_SI = value · si_per_unit
  double lower, upper;   ///< plausible range in SI
  double typical;        ///< a start value in SI
};

inline constexpr int kMaxEffectParameters = 4;

struct EffectInfo {
  const char* id;            ///< "coulomb_friction"
  const char* term;          ///< "Coulomb friction"
  Subsystem where;
  const char* equation;      ///< "-T_c sgn(w)"
  int parameter_count;
  ParameterInfo parameters[kMaxEffectParameters];
  int state_count;           ///< states of its own (hysteresis, creep), 0 for memoryless terms
  bool torque_term;          ///< enters as an added torque, so effect_torque() evaluates it
  bool linear;               ///< the torque is linear in all its parameters
  const char* confused_with; ///< ids, comma-separated
  const char* told_apart_by;
};

/// All effects; the position in the list is the effect's index for effect_torque().
[[nodiscard]] std::span<const EffectInfo> effect_catalogue() noexcept;
/// Index in the catalogue, or −1. Knows the aliases A (stiffness), B (pressure), C (cubic_damping), D (viscous_damping).
[[nodiscard]] int find_effect(std::string_view id_or_alias) noexcept;

}  // namespace isac::models
