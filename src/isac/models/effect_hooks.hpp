/// @file
/// The effects of the valve unit and of the sensors, by their index in the catalogue, for who simulates a rig.
///
/// One step of a simulation, with any set of effects of the catalogue; each function leaves its argument alone for
/// effects of another hook, so a simulator calls all of them for all effects in its model:
///   1. u = commands, delayed by the sum of effect_delay over effects of the valve unit (the caller's buffer)
///   2. effect_command (and effect_valve_step once where u is new), in the order of the model; for each effect
///      `point.command` is the command as the effects before it left it, also in its derivative and its rest
///   3. v = (K_C u − p)/T_C, then effect_pressure_rate; effect_valve_derivative gives the states' rates
///   4. effect_outlet_pressure on p, the units' own pressures: those in the muscles, which sensors read;
///      effect_muscle_pressure on a copy, then Δp, p_mean and Σ effect_torque (effects.hpp)
///   5. motion; then readings: effect_reading (and effect_reading_step once per sample), the angle's delay
///      (time_skew) by the caller's buffer, spikes by his random numbers, quantisation last
/// Units: SI. Real time: no heap, no lock, noexcept, templated on the scalar; safe from any thread.
/// Errors: an index outside the catalogue changes nothing; NaN goes through. `state` may be null for effects without
/// states; effects with states are left out then. Source: docs/derivations/effects.md.
/// Example: `effect_pressure_rate(find_effect("leak"), &per_second, point, nullptr, rates)`.
#pragma once

#include <type_traits>

#include "isac/models/effects.hpp"

namespace isac::models {
namespace detail {

template <class E>
inline constexpr bool kHasStates = E::kInfo.state_count > 0;

template <class S>
struct CommandCall {
  template <class E>
  static void call(const S* q, const ValvePoint<S>& x, const S* z, S* u) noexcept {
    if constexpr (requires { E::command(q, x, z, u); })
      if (!kHasStates<E> || z != nullptr) E::command(q, x, z, u);
  }
};

template <class S>
struct PressureRateCall {
  template <class E>
  static void call(const S* q, const ValvePoint<S>& x, const S* z, S* v) noexcept {
    if constexpr (requires { E::pressure_rate(q, x, z, v); })
      if (!kHasStates<E> || z != nullptr) E::pressure_rate(q, x, z, v);
  }
};

template <class S>
struct OutletPressureCall {
  template <class E>
  static void call(const S* q, S* p) noexcept {
    if constexpr (requires { E::outlet_pressure(q, p); }) E::outlet_pressure(q, p);
  }
};

template <class S>
struct MusclePressureCall {
  template <class E>
  static void call(const S* q, S* p) noexcept {
    if constexpr (requires { E::muscle_pressure(q, p); }) E::muscle_pressure(q, p);
  }
};

template <class S>
struct ValveDerivativeCall {
  template <class E>
  static void call(const S* q, const ValvePoint<S>& x, const S* u, const S* v, const S* z, S* dz) noexcept {
    if constexpr (requires { E::derivative(q, x, u, v, z, dz); }) {
      E::derivative(q, x, u, v, z, dz);
    } else if constexpr (E::kInfo.where == Subsystem::kPcu) {
      for (int i = 0; i < E::kInfo.state_count; ++i) dz[i] = S(0.0);
    }
  }
};

template <class S, class Point>
struct StepCall {
  template <class E>
  static void call(const S* q, const Point& x, S* z) noexcept {
    if constexpr (requires { E::step(q, x, z); }) E::step(q, x, z);
  }
};

template <class S, class Point>
struct RestAtCall {
  template <class E>
  static void call(const S* q, const Point& x, S* z) noexcept {
    if constexpr (requires { E::rest(q, x, z); }) E::rest(q, x, z);
  }
};

template <class S>
struct ReadingCall {
  template <class E>
  static void call(const S* q, const S& t, const S* z, Readings<S>& y) noexcept {
    if constexpr (requires { E::reading(q, t, z, y); })
      if (!kHasStates<E> || z != nullptr) E::reading(q, t, z, y);
  }
};

template <class S>
struct ReadingDerivativeCall {
  template <class E>
  static void call(const S* q, const Readings<S>& y, const S* z, S* dz) noexcept {
    if constexpr (requires { E::derivative(q, y, z, dz); }) {
      E::derivative(q, y, z, dz);
    } else if constexpr (E::kInfo.where == Subsystem::kSensor) {
      for (int i = 0; i < E::kInfo.state_count; ++i) dz[i] = S(0.0);
    }
  }
};

template <class S>
struct DelayCall {
  template <class E>
  static S call(const S* q) noexcept {
    if constexpr (requires { E::delay(q); }) {
      return E::delay(q);
    } else {
      return S(0.0);
    }
  }
};

}  // namespace detail

/// Seconds by which commands (dead_time) or angle readings (time_skew) come later; 0 for all other effects.
template <class S>
[[nodiscard]] S effect_delay(int effect, const S* parameters) noexcept {
  if (!Catalogue::holds(effect)) return S(0.0);
  return Catalogue::kTable<detail::DelayCall<S>>[static_cast<unsigned>(effect)](parameters);
}

/// Changes the two commands, Pa, that the first-order lag is driven by.
template <class S>
void effect_command(int effect, const S* parameters, const ValvePoint<S>& point, const S* state,
                    S* command) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::CommandCall<S>>[static_cast<unsigned>(effect)](parameters, point, state, command);
}

/// Changes the two pressures' rates, Pa/s.
template <class S>
void effect_pressure_rate(int effect, const S* parameters, const ValvePoint<S>& point, const S* state,
                          S* rate) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::PressureRateCall<S>>[static_cast<unsigned>(effect)](parameters, point, state,
                                                                                rate);
}

/// Changes the two pressures, Pa, of the valve units into those in the muscles.
template <class S>
void effect_outlet_pressure(int effect, const S* parameters, S* pressure) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::OutletPressureCall<S>>[static_cast<unsigned>(effect)](parameters, pressure);
}

/// Changes the two pressures, Pa, that the muscles make force of.
template <class S>
void effect_muscle_pressure(int effect, const S* parameters, S* pressure) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::MusclePressureCall<S>>[static_cast<unsigned>(effect)](parameters, pressure);
}

/// Rates of a valve effect's states; `command` and `rate` are those after all effects. 0 for states that only step.
template <class S>
void effect_valve_derivative(int effect, const S* parameters, const ValvePoint<S>& point, const S* command,
                             const S* rate, const S* state, S* state_rate) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::ValveDerivativeCall<S>>[static_cast<unsigned>(effect)](parameters, point, command,
                                                                                   rate, state, state_rate);
}

/// Moves states that follow the command without a rate (valve_hysteresis); once per new command.
template <class S>
void effect_valve_step(int effect, const S* parameters, const ValvePoint<S>& point, S* state) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::StepCall<S, ValvePoint<S>>>[static_cast<unsigned>(effect)](parameters, point,
                                                                                       state);
}

/// States of a valve effect at rest.
template <class S>
void effect_valve_rest(int effect, const S* parameters, const ValvePoint<S>& point, S* state) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::RestAtCall<S, ValvePoint<S>>>[static_cast<unsigned>(effect)](parameters, point,
                                                                                         state);
}

/// Changes what the sensors say at `time`, s since the start.
template <class S>
void effect_reading(int effect, const S* parameters, const S& time, const S* state,
                    Readings<S>& readings) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::ReadingCall<S>>[static_cast<unsigned>(effect)](parameters, time, state, readings);
}

/// Rates of a sensor effect's states, given the undisturbed readings. 0 for states that only step.
template <class S>
void effect_reading_derivative(int effect, const S* parameters, const Readings<S>& readings, const S* state,
                               S* state_rate) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::ReadingDerivativeCall<S>>[static_cast<unsigned>(effect)](parameters, readings,
                                                                                     state, state_rate);
}

/// Moves states that follow a reading without a rate (encoder_play); once per sample, before effect_reading.
template <class S>
void effect_reading_step(int effect, const S* parameters, const Readings<S>& readings, S* state) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::StepCall<S, Readings<S>>>[static_cast<unsigned>(effect)](parameters, readings,
                                                                                     state);
}

/// States of a sensor effect at rest.
template <class S>
void effect_reading_rest(int effect, const S* parameters, const Readings<S>& readings, S* state) noexcept {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::RestAtCall<S, Readings<S>>>[static_cast<unsigned>(effect)](parameters, readings,
                                                                                       state);
}

/// An effect of the valve unit with the functions above, looked up by its index at each call.
struct AnyValveEffect {
  int effect = -1;

  [[nodiscard]] int state_count() const noexcept {
    return Catalogue::holds(effect) ? Catalogue::kInfos[effect].state_count : 0;
  }
  template <class S>
  void command(const S* q, const ValvePoint<S>& x, const S* z, S* u) const noexcept {
    effect_command(effect, q, x, z, u);
  }
  template <class S>
  void pressure_rate(const S* q, const ValvePoint<S>& x, const S* z, S* v) const noexcept {
    effect_pressure_rate(effect, q, x, z, v);
  }
  template <class S>
  void derivative(const S* q, const ValvePoint<S>& x, const S* u, const S* v, const S* z,
                  S* dz) const noexcept {
    effect_valve_derivative(effect, q, x, u, v, z, dz);
  }
  template <class S>
  void step(const S* q, const ValvePoint<S>& x, S* z) const noexcept {
    effect_valve_step(effect, q, x, z);
  }
};

/// The same, of a type that the compiler knows.
template <class E>
struct ValveEffect {
  [[nodiscard]] static constexpr int state_count() noexcept { return E::kInfo.state_count; }
  template <class S>
  static void command(const S* q, const ValvePoint<S>& x, const S* z, S* u) noexcept {
    detail::CommandCall<S>::template call<E>(q, x, z, u);
  }
  template <class S>
  static void pressure_rate(const S* q, const ValvePoint<S>& x, const S* z, S* v) noexcept {
    detail::PressureRateCall<S>::template call<E>(q, x, z, v);
  }
  template <class S>
  static void derivative(const S* q, const ValvePoint<S>& x, const S* u, const S* v, const S* z,
                         S* dz) noexcept {
    detail::ValveDerivativeCall<S>::template call<E>(q, x, u, v, z, dz);
  }
  template <class S>
  static void step(const S* q, const ValvePoint<S>& x, S* z) noexcept {
    detail::StepCall<S, ValvePoint<S>>::template call<E>(q, x, z);
  }
};

namespace detail {

template <class Visitor>
struct ValveVisit {
  template <class E>
  static void call(Visitor& visitor) {
    if constexpr (E::kInfo.where == Subsystem::kPcu) visitor(ValveEffect<E>{});
  }
};

}  // namespace detail

/// Calls `visitor` with the ValveEffect of this index, for a loop that is compiled for it; does nothing for effects of another place.
template <class Visitor>
void visit_valve_effect(int effect, Visitor&& visitor) {
  if (!Catalogue::holds(effect)) return;
  Catalogue::kTable<detail::ValveVisit<std::remove_reference_t<Visitor>>>[static_cast<unsigned>(effect)](
      visitor);
}

}  // namespace isac::models
