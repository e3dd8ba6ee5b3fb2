/// @file
/// The catalogue of effects: every term that a joint's torque, its valve unit or its sensors may contain, written once.
/// The simulator, the fit, explain, the report and the controller's feed-forward all read this place.
///
/// Torque terms: T = Σ effect_torque(id, parameters, point), signs as in docs/errata.md (a dissipative term is −D φ̇):
/// effect_torque is what the effect exerts on the joint. Where the recorded output is the force that *drives* an axis,
/// F = −Σ effect_torque, except for terms with `added_to_output`, which keep their sign; the fit of a driven axis turns
/// the signs itself. Only effects of the muscle are in what the force sensors see, (F2 − F1) r; those of the joint and
/// the rig act on the motion.
/// An effect with `linear` is linear in its parameters, so a fit builds regressors by unit parameters. At
/// `null_value` of all parameters an effect is exactly absent.
/// The other hooks (EffectInfo::hook), from the valve's command to the sensor's reading, stand in effect_hooks.hpp.
/// Units: SI inside; `ParameterInfo::si_per_unit` leads from the reporting unit to SI.
/// Real time: no heap, no lock, noexcept, templated on the scalar (double, float, ceres::Jet); safe from any thread.
/// Errors: an index outside the catalogue contributes nothing (0, identity); NaN goes through.
/// Source: docs/effects.md (ids are fixed; add, never rename).
/// Example: `double p[] = {0.14}; effect_torque(find_effect("D"), p, JointPoint<double>{.velocity = 2.0})` is −0.28.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include "isac/models/effect_types.hpp"
#include "isac/models/effects_friction.hpp"
#include "isac/models/effects_memory.hpp"
#include "isac/models/effects_other_forms.hpp"
#include "isac/models/effects_pcu.hpp"
#include "isac/models/effects_sensor.hpp"
#include "isac/models/effects_torque.hpp"

namespace isac::models {

using Catalogue = Join<effect::TorqueEffects, effect::FrictionEffects, effect::MemoryEffects,
                       effect::PcuEffects, effect::SensorEffects, effect::OtherForms>::type;

/// All effects; the position in the list is the effect's index for effect_torque() and the other hooks.
[[nodiscard]] inline std::span<const EffectInfo> effect_catalogue() noexcept {
  return Catalogue::kInfos;
}

/// Index in the catalogue, or −1. Knows the aliases A (stiffness), B (pressure), C (cubic_damping), D (viscous_damping).
[[nodiscard]] constexpr int find_effect(std::string_view id_or_alias) noexcept {
  constexpr const char* kAliases[][2] = {
      {"A", "stiffness"}, {"B", "pressure"}, {"C", "cubic_damping"}, {"D", "viscous_damping"}};
  for (const auto& alias : kAliases)
    if (id_or_alias == alias[0]) id_or_alias = alias[1];
  for (int i = 0; i < Catalogue::kSize; ++i)
    if (id_or_alias == Catalogue::kInfos[i].id) return i;
  return -1;
}

/// Has it a value with which the effect is absent? The others are shapes: a width, a time, a place.
[[nodiscard]] constexpr bool is_amplitude(const ParameterInfo& parameter) noexcept {
  return parameter.null_value == parameter.null_value;  // not NaN
}

[[nodiscard]] constexpr int amplitude_count(const EffectInfo& info) noexcept {
  int count = 0;
  for (int i = 0; i < info.parameter_count; ++i) count += is_amplitude(info.parameters[i]) ? 1 : 0;
  return count;
}

/// Is a torque effect linear in the parameters that have a null value, all of them 0, for given others, which alone its states depend on? So is
/// each that is linear at all, and each that has a shape (a width, a time, a place) besides its amplitudes.
[[nodiscard]] constexpr bool is_linear_for_its_shape(const EffectInfo& info) noexcept {
  return (info.linear || amplitude_count(info) < info.parameter_count) && info.hook == Hook::kTorque;
}

namespace detail {

template <class S>
struct TorqueCall {
  template <class E>
  static S call(const S* q, const JointPoint<S>& x, const S* z) noexcept {
    if constexpr (requires { E::torque(q, x, z); }) {
      return z == nullptr ? S(0.0) : E::torque(q, x, z);
    } else if constexpr (requires { E::torque(q, x); }) {
      return E::torque(q, x);
    } else {
      return S(0.0);
    }
  }
};

/// A loop for each effect, so that only what its equation asks of a point is reckoned.
template <class S, class PointAt>
struct TorquesCall {
  template <class E>
  static void call(const S* q, const PointAt& at, const S& factor, std::span<S> sum) noexcept {
    if constexpr (requires(const JointPoint<S>& x) { E::torque(q, x); })
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += factor * E::torque(q, at(k));
  }
};

/// One loop for all amplitudes: what their equation asks of a point is reckoned once.
template <class S, class PointAt>
struct AmplitudeTorquesCall {
  template <class E>
  static void call(const S* shape, const PointAt& at, const S& factor, std::size_t count,
                   std::span<S* const> sums) noexcept {
    if constexpr (requires(const JointPoint<S>& x) { E::torque(shape, x); })
      [&]<std::size_t... I>(std::index_sequence<I...>) {
        constexpr int kParameters = E::kInfo.parameter_count;
        S q[sizeof...(I)][kParameters];
        for (std::size_t i = 0, j = 0; j < std::size_t{kParameters}; ++j) {
          const bool amplitude = is_amplitude(E::kInfo.parameters[j]);
          for (std::size_t a = 0; a < sizeof...(I); ++a)
            q[a][j] = amplitude ? S(a == i ? 1.0 : 0.0) : shape[j];
          i += amplitude;
        }
        for (std::size_t k = 0; k < count; ++k) {
          const JointPoint<S> x = at(k);
          ((sums[I][k] += factor * E::torque(q[I], x)), ...);
        }
      }
    (std::make_index_sequence<amplitude_count(E::kInfo)>());
  }
};

template <class S>
struct DerivativeCall {
  template <class E>
  static void call(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    if constexpr (requires { E::derivative(q, x, z, dz); }) E::derivative(q, x, z, dz);
  }
};

template <class S>
struct RestCall {
  template <class E>
  static void call(const S* q, const JointPoint<S>& x, S* z) noexcept {
    if constexpr (requires { E::rest(q, x, z); }) E::rest(q, x, z);
  }
};

}  // namespace detail

/// Torque of an effect on the joint, N m. `state` may be null; an effect with states is then absent.
template <class S>
[[nodiscard]] S effect_torque(int effect, const S* parameters, const JointPoint<S>& point,
                              const S* state) noexcept {
  if (!Catalogue::holds(effect)) return S(0.0);
  return Catalogue::kTable<detail::TorqueCall<S>>[static_cast<unsigned>(effect)](parameters, point, state);
}

/// Torque of an effect without states, N m; 0 for an effect that has some.
template <class S>
[[nodiscard]] S effect_torque(int effect, const S* parameters, const JointPoint<S>& point) noexcept {
  return effect_torque<S>(effect, parameters, point, nullptr);
}

/// sum[k] += factor · torque of an effect without states at the point at(k), for all k; `at` returns a JointPoint<S> and must not throw.
template <class S, class PointAt>
void add_effect_torques(int effect, const S* parameters, const PointAt& at, const S& factor,
                        std::span<S> sum) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::TorquesCall<S, PointAt>>[static_cast<unsigned>(effect)](parameters, at, factor,
                                                                                    sum);
}

/// For an effect without states that is linear for its shape: sums[i][k] += factor · torque at the point at(k) with 1 for its amplitude i and 0
/// for the others, for k < count. One of `sums` for each of its amplitudes; of `shape` only the other parameters are read.
template <class S, class PointAt>
void add_amplitude_torques(int effect, const S* shape, const PointAt& at, const S& factor, std::size_t count,
                           std::span<S* const> sums) noexcept {
  if (!Catalogue::holds(effect) ||
      sums.size() != static_cast<std::size_t>(amplitude_count(Catalogue::kInfos[effect])))
    return;
  Catalogue::kTable<detail::AmplitudeTorquesCall<S, PointAt>>[static_cast<unsigned>(effect)](
      shape, at, factor, count, sums);
}

/// Rates of a torque effect's states, per second; nothing is written for effects without states.
template <class S>
void effect_derivative(int effect, const S* parameters, const JointPoint<S>& point, const S* state,
                       S* state_rate) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::DerivativeCall<S>>[static_cast<unsigned>(effect)](parameters, point, state,
                                                                              state_rate);
}

/// States of a torque effect that has long been left alone at `point`: where a simulation starts.
template <class S>
void effect_rest(int effect, const S* parameters, const JointPoint<S>& point, S* state) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::RestCall<S>>[static_cast<unsigned>(effect)](parameters, point, state);
}

/// A torque effect of a type that the compiler knows, with the functions above.
template <class E>
struct TorqueEffect {
  static constexpr const EffectInfo& kInfo = E::kInfo;
  template <class S>
  [[nodiscard]] static S torque(const S* q, const JointPoint<S>& x, const S* z) noexcept {
    return detail::TorqueCall<S>::template call<E>(q, x, z);
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    detail::DerivativeCall<S>::template call<E>(q, x, z, dz);
  }
  template <class S>
  static void rest(const S* q, const JointPoint<S>& x, S* z) noexcept {
    detail::RestCall<S>::template call<E>(q, x, z);
  }
};

namespace detail {

template <class Visitor>
struct TorqueVisit {
  template <class E>
  static void call(Visitor& visitor) {
    if constexpr (E::kInfo.hook == Hook::kTorque && E::kInfo.state_count > 0) visitor(TorqueEffect<E>{});
  }
};

}  // namespace detail

/// Calls `visitor` with the TorqueEffect of this index, for a loop that is compiled for it; does nothing for effects without states, for which
/// there is add_effect_torques, and for those of another hook.
template <class Visitor>
void visit_torque_memory(int effect, Visitor&& visitor) {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::TorqueVisit<std::remove_reference_t<Visitor>>>[static_cast<unsigned>(effect)](
      visitor);
}

}  // namespace isac::models
