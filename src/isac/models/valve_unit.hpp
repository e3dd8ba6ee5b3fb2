/// @file
/// Pressure control unit (P1): a first-order lag with gain, behind a dead time.
///
///   T_C ṗ + p = K_C u(t − L)              seed 4.1; testbed K_C = 1, T_C = 0.17 s (4.2), tubes included
///   p(t + h) = K_C u + (p(t) − K_C u) e^(−h/T_C)     exactly, for u constant over the step
///   p(t + h) = K_C u1 − m T_C + (p(t) − K_C u0 + m T_C) e^(−h/T_C),  m = K_C (u1 − u0)/h, for u along a line
///
/// The dead time is the caller's: he hands in u(t − L) from his buffer; `valve_response` has it in closed form.
/// Units: s, Pa. Real time: no heap, no lock, noexcept, templated on the scalar; safe from any thread.
/// Errors: none; T_C = 0 divides by zero in valve_rate and passes u through in valve_step.
/// Source: seed 4.1; docs/derivations/valve_unit.md. Example: `p = valve_step(unit, p, u_delayed, 0.002)`.
#pragma once

#include <cmath>

namespace isac::models {

template <class S>
struct ValveUnit {
  S gain = S(1.0);  ///< -, K_C
  S lag = S(0.17);  ///< s, T_C
  S dead_time{};    ///< s, L
};

/// ṗ, Pa/s.
template <class S>
[[nodiscard]] constexpr S valve_rate(const ValveUnit<S>& unit, const S& pressure,
                                     const S& delayed_command) noexcept {
  return (unit.gain * delayed_command - pressure) / unit.lag;
}

/// Pressure after `step` seconds of a constant command.
template <class S>
[[nodiscard]] S valve_step(const ValveUnit<S>& unit, const S& pressure, const S& delayed_command,
                           const S& step) noexcept {
  using std::exp;
  const S target = unit.gain * delayed_command;
  if (!(unit.lag > S(0.0))) return target;
  return target + (pressure - target) * exp(-step / unit.lag);
}

/// Pressure after `step` seconds of a command that ran along a line from `from` to `to`.
template <class S>
[[nodiscard]] S valve_ramp(const ValveUnit<S>& unit, const S& pressure, const S& from, const S& to,
                           const S& step) noexcept {
  using std::exp;
  if (!(unit.lag > S(0.0)) || !(step > S(0.0))) return step > S(0.0) ? S(unit.gain * to) : pressure;
  const S behind = unit.gain * (to - from) / step * unit.lag;
  return unit.gain * to - behind + (pressure - unit.gain * from + behind) * exp(-step / unit.lag);
}

/// Pressure at `time` after the command jumped from `from` to `to` at 0, at rest before.
template <class S>
[[nodiscard]] S valve_response(const ValveUnit<S>& unit, const S& from, const S& to, const S& time) noexcept {
  const S rest = unit.gain * from;
  const S since = time - unit.dead_time;
  return since > S(0.0) ? valve_step(unit, rest, to, since) : rest;
}

}  // namespace isac::models
