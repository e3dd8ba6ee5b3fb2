/// @file
/// What an effect is: its description, the points at which it is evaluated, and the list that joins effects.
///
/// An effect is a struct with `static constexpr EffectInfo kInfo` and, for its hook, one or two static function
/// templates on the scalar; it stands in one file, and a list at the end of that file names it (effects.hpp).
/// Units: SI. Real time: no heap, no lock, noexcept. Source: docs/effects.md.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "isac/core/units.hpp"

namespace isac::models {

enum class Subsystem : std::uint8_t { kMuscle, kJoint, kPcu, kSensor, kRig };

/// Where in the chain command → pressure → torque → motion → reading an effect is applied, and by which function.
enum class Hook : std::uint8_t {
  kTorque,          ///< effect_torque: added to the torque on the joint
  kCommand,         ///< effect_command: changes what the valves are asked for
  kPressureRate,    ///< effect_pressure_rate: changes how fast the pressures move
  kOutletPressure,  ///< effect_outlet_pressure: what both units' own pressures make of those in the muscles
  kMusclePressure,  ///< effect_muscle_pressure: changes the pressure that the muscle makes force of
  kReading,         ///< effect_reading: changes what the sensors say
  kDelay,           ///< effect_delay: commands or angle readings come later; who simulates holds the buffer
  kOutlier,         ///< random; who simulates draws the numbers
};

inline constexpr double kAnyValue = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kUnlimited = std::numeric_limits<double>::infinity();

struct ParameterInfo {
  const char* name;     ///< "T_c"; for a one-parameter effect the answer's key is the effect's id
  const char* unit;     ///< reporting unit, "N m"
  double si_per_unit;   ///< value_SI = value · si_per_unit
  double lower, upper;  ///< plausible range in SI
  double typical;       ///< a start value in SI
  double null_value =
      0;  ///< with all parameters at it the effect is not there; kAnyValue: has no say in that
};

inline constexpr int kMaxEffectParameters = 4;
inline constexpr int kMaxEffectStates = 2;

struct EffectInfo {
  const char* id;        ///< "coulomb_friction"
  const char* term;      ///< "Coulomb friction"
  Subsystem where;       ///< kMuscle: the force sensors see it; kJoint, kRig: they do not
  const char* equation;  ///< "-T_c sgn(w)"
  int parameter_count;
  ParameterInfo parameters[kMaxEffectParameters];
  int state_count;            ///< states of its own (hysteresis, creep), 0 for memoryless terms
  bool torque_term;           ///< enters as an added torque, so effect_torque() evaluates it
  bool linear;                ///< what it adds is linear in all its parameters
  const char* confused_with;  ///< ids, comma-separated
  const char* told_apart_by;
  Hook hook = Hook::kTorque;
  bool dissipative =
      false;  ///< never gives energy: torque · velocity ≤ 0 (over a cycle, where it has states)
  bool added_to_output =
      false;  ///< a constant of the recorded output, not a resistance: its sign is never turned
  bool linear_in_state = false;       ///< of one state, whose rate at a given point is a + b z
  const char* reported_as = nullptr;  ///< another form of this effect: the id under which a search names it
};

/// Where a torque effect is evaluated. A linear axis puts metres and newtons in place of radians and newton metres.
template <class S>
struct JointPoint {
  S delta_pressure{};      ///< Pa, Δp = (p2 − p1)/2
  S mean_pressure{};       ///< Pa, (p1 + p2)/2
  S angle{};               ///< rad
  S velocity{};            ///< rad/s
  S acceleration{};        ///< rad/s²
  S time{};                ///< s since the start
  S wheel_radius{};        ///< m
  S reference_pressure{};  ///< Pa, p0
  S stiffness{};           ///< N/m, A of the baseline; only effects that bend the baseline need it
  S pressure_gain{};       ///< N/Pa, B of the baseline; likewise
  S cubic_damping{};       ///< N m s³, C of the baseline; likewise
  S damping{};             ///< N m s, D of the baseline; likewise
};

/// The valve unit of one pair; index 0 is muscle 1, index 1 muscle 2.
template <class S>
struct ValvePoint {
  S command[2]{};   ///< Pa, as the effects before left it
  S pressure[2]{};  ///< Pa, the state of the first-order lag
  S velocity{};     ///< rad/s of the joint
  S lag{};          ///< s, T_C of the baseline
};

/// What the sensors say at one instant; an effect changes it in place.
template <class S>
struct Readings {
  S force[2]{};     ///< N
  S pressure[2]{};  ///< Pa
  S angle{};        ///< rad
};

/// Effects in the order of the catalogue. `kTable<Call>` holds Call::call<Effect> of each: one look-up, no search.
template <class... Effects>
struct EffectList {
  static constexpr int kSize = static_cast<int>(sizeof...(Effects));
  static constexpr EffectInfo kInfos[sizeof...(Effects)] = {Effects::kInfo...};
  template <class Call>
  static constexpr auto kTable = std::array{&Call::template call<Effects>...};

  [[nodiscard]] static constexpr bool holds(int index) noexcept { return index >= 0 && index < kSize; }
};

template <class... Lists>
struct Join;
template <class... E>
struct Join<EffectList<E...>> {
  using type = EffectList<E...>;
};
template <class... E, class... F, class... Rest>
struct Join<EffectList<E...>, EffectList<F...>, Rest...> {
  using type = typename Join<EffectList<E..., F...>, Rest...>::type;
};

}  // namespace isac::models
