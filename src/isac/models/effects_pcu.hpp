/// @file
/// Effects of the pressure control unit: what changes between the command and the pressure that the muscle makes
/// force of.
///
/// Each struct is one effect with one of
///   `command(q, x, z, u)`        changes the two commands u in place (Pa)
///   `pressure_rate(q, x, z, v)`  changes the two rates v of the first-order lag in place (Pa/s)
///   `muscle_pressure(q, p)`      changes the two pressures p in place (Pa)
///   `delay(q)`                   seconds by which commands come later
/// and, with states z, `derivative(q, x, u, v, z, dz)`; u and v are the final commands and rates.
/// Gain and offset act on the command, for the lag passes a constant through unchanged. Index 0 is muscle 1.
/// Units: SI. Real time: no heap, no lock, noexcept. Errors: none; NaN goes through.
/// Source: seed 4.1; docs/derivations/effects.md.
#pragma once

#include "isac/models/effect_types.hpp"
#include "isac/models/scalar.hpp"

namespace isac::models::effect {

struct DeadTime {
  static constexpr EffectInfo kInfo{.id = "dead_time",
                                    .term = "transport delay of the tubes",
                                    .where = Subsystem::kPcu,
                                    .equation = "u(t - L)",
                                    .parameter_count = 1,
                                    .parameters = {{"L", "s", 1, 0, 0.5, 0.02}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "second_order_lag, sensor_lag, series_elasticity",
                                    .told_apart_by = "shape of the first milliseconds",
                                    .hook = Hook::kDelay};
  template <class S>
  static S delay(const S* q) noexcept {
    return q[0];
  }
};

/// Needs 0 < T2; at T2 = 0 (or below) the command passes.
struct SecondOrderLag {
  static constexpr EffectInfo kInfo{.id = "second_order_lag",
                                    .term = "second lag",
                                    .where = Subsystem::kPcu,
                                    .equation = "u -> z, T2 z' = u - z",
                                    .parameter_count = 1,
                                    .parameters = {{"T2", "s", 1, 0, 0.5, 0.03}},
                                    .state_count = 2,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "dead_time, sensor_lag",
                                    .told_apart_by = "smooth start; gain rolls off",
                                    .hook = Hook::kCommand};
  template <class S>
  static void command(const S* q, const ValvePoint<S>&, const S* z, S* u) noexcept {
    if (!(q[0] > S(0.0))) return;
    u[0] = z[0];
    u[1] = z[1];
  }
  template <class S>
  static void derivative(const S* q, const ValvePoint<S>& x, const S*, const S*, const S* z, S* dz) noexcept {
    for (int i = 0; i < 2; ++i) dz[i] = q[0] > S(0.0) ? S((x.command[i] - z[i]) / q[0]) : S(0.0);
  }
  template <class S>
  static void rest(const S*, const ValvePoint<S>& x, S* z) noexcept {
    z[0] = x.command[0];
    z[1] = x.command[1];
  }
};

struct AsymmetricFillVent {
  static constexpr EffectInfo kInfo{.id = "asymmetric_fill_vent",
                                    .term = "filling and venting differ",
                                    .where = Subsystem::kPcu,
                                    .equation = "T_vent = q T_C where p falls",
                                    .parameter_count = 1,
                                    .parameters = {{"q", "-", 1, 0.2, 5, 1.4, 1}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "flow_limit, asymmetric_hysteresis",
                                    .told_apart_by = "only the sign of the pressure's rate counts",
                                    .hook = Hook::kPressureRate};
  template <class S>
  static void pressure_rate(const S* q, const ValvePoint<S>&, const S*, S* v) noexcept {
    for (int i = 0; i < 2; ++i)
      if (v[i] < S(0.0)) v[i] = v[i] / q[0];
  }
};

struct FlowLimit {
  static constexpr EffectInfo kInfo{
      .id = "flow_limit",
      .term = "choked flow, rate limit",
      .where = Subsystem::kPcu,
      .equation = "|p'| <= R",
      .parameter_count = 1,
      .parameters = {{"R", "kg/(cm2 s)", kPascalPerKgfCm2, 0.1 * kPascalPerKgfCm2, 1e3 * kPascalPerKgfCm2,
                      10 * kPascalPerKgfCm2, kUnlimited}},
      .state_count = 0,
      .torque_term = false,
      .linear = false,
      .confused_with = "asymmetric_fill_vent, supply_droop",
      .told_apart_by = "large against small steps",
      .hook = Hook::kPressureRate};
  template <class S>
  static void pressure_rate(const S* q, const ValvePoint<S>&, const S*, S* v) noexcept {
    for (int i = 0; i < 2; ++i) v[i] = clamp<S>(v[i], -q[0], q[0]);
  }
};

/// The valve sees the error less the dead zone; beyond it the flow begins from nothing.
struct ValveDeadband {
  static constexpr EffectInfo kInfo{
      .id = "valve_deadband",
      .term = "valve overlap",
      .where = Subsystem::kPcu,
      .equation = "u -> p + dead zone of (u - p) with width d",
      .parameter_count = 1,
      .parameters = {{"d", "kg/cm2", kPascalPerKgfCm2, 0, kPascalPerKgfCm2, 0.03 * kPascalPerKgfCm2}},
      .state_count = 0,
      .torque_term = false,
      .linear = false,
      .confused_with = "valve_hysteresis",
      .told_apart_by = "a steady error anywhere in the band, without memory",
      .hook = Hook::kCommand};
  template <class S>
  static void command(const S* q, const ValvePoint<S>& x, const S*, S* u) noexcept {
    if (q[0] == S(0.0)) return;
    for (int i = 0; i < 2; ++i) u[i] = x.pressure[i] + dead_zone<S>(u[i] - x.pressure[i], q[0]);
  }
};

/// Play of half-width d on each command: z follows the command only when the gap is crossed.
struct ValveHysteresis {
  static constexpr EffectInfo kInfo{
      .id = "valve_hysteresis",
      .term = "spool stiction, memory of direction",
      .where = Subsystem::kPcu,
      .equation = "u -> z, z follows u with play d",
      .parameter_count = 1,
      .parameters = {{"d", "kg/cm2", kPascalPerKgfCm2, 0, kPascalPerKgfCm2, 0.03 * kPascalPerKgfCm2}},
      .state_count = 2,
      .torque_term = false,
      .linear = false,
      .confused_with = "valve_deadband",
      .told_apart_by = "the offset's sign follows the last direction",
      .hook = Hook::kCommand};
  template <class S>
  static void command(const S* q, const ValvePoint<S>&, const S* z, S* u) noexcept {
    for (int i = 0; i < 2; ++i) u[i] = clamp<S>(z[i], u[i] - q[0], u[i] + q[0]);
  }
  /// A play has no rate, for commands jump: `step` is called once per new command.
  template <class S>
  static void step(const S* q, const ValvePoint<S>& x, S* z) noexcept {
    for (int i = 0; i < 2; ++i) z[i] = clamp<S>(z[i], x.command[i] - q[0], x.command[i] + q[0]);
  }
  template <class S>
  static void rest(const S*, const ValvePoint<S>& x, S* z) noexcept {
    z[0] = x.command[0];
    z[1] = x.command[1];
  }
};

struct PressureGainError {
  static constexpr EffectInfo kInfo{.id = "pressure_gain_error",
                                    .term = "valve gain or zero off",
                                    .where = Subsystem::kPcu,
                                    .equation = "u -> (1 + g) u + b",
                                    .parameter_count = 2,
                                    .parameters = {{"g", "-", 1, -0.5, 0.5, 0.03},
                                                   {"b", "kg/cm2", kPascalPerKgfCm2, -kPascalPerKgfCm2,
                                                    kPascalPerKgfCm2, 0.03 * kPascalPerKgfCm2}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = true,
                                    .confused_with = "pressure_offset, pressure_sensor_gain, leak",
                                    .told_apart_by = "torque agrees with the measured pressure or not",
                                    .hook = Hook::kCommand};
  template <class S>
  static void command(const S* q, const ValvePoint<S>&, const S*, S* u) noexcept {
    for (int i = 0; i < 2; ++i) u[i] = (S(1.0) + q[0]) * u[i] + q[1];
  }
};

struct Crosstalk {
  static constexpr EffectInfo kInfo{.id = "crosstalk",
                                    .term = "one muscle's pressure moves the other",
                                    .where = Subsystem::kPcu,
                                    .equation = "u1 -> u1 + x p2, u2 -> u2 + x p1",
                                    .parameter_count = 1,
                                    .parameters = {{"x", "-", 1, -0.2, 0.2, 0.02}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = true,
                                    .confused_with = "leak, pressure_gain_error",
                                    .told_apart_by = "move one muscle only, the other answers",
                                    .hook = Hook::kCommand};
  template <class S>
  static void command(const S* q, const ValvePoint<S>& x, const S*, S* u) noexcept {
    u[0] = u[0] + q[0] * x.pressure[1];
    u[1] = u[1] + q[0] * x.pressure[0];
  }
};

/// The supply is p_s less a droop z that filling feeds and the compressor clears: z′ = k (v1⁺ + v2⁺) − z/τ.
struct SupplyDroop {
  static constexpr EffectInfo kInfo{.id = "supply_droop",
                                    .term = "supply pressure sags",
                                    .where = Subsystem::kPcu,
                                    .equation = "u <= p_s - z, z' = k (p1'+ + p2'+) - z/tau",
                                    .parameter_count = 3,
                                    .parameters = {{"p_s", "kg/cm2", kPascalPerKgfCm2, kPascalPerKgfCm2,
                                                    20 * kPascalPerKgfCm2, 6 * kPascalPerKgfCm2, kUnlimited},
                                                   {"k", "-", 1, 0, 5, 0.2},
                                                   {"tau", "s", 1, 0.05, 100, 1, kAnyValue}},
                                    .state_count = 1,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "flow_limit, pressure_gain_error",
                                    .told_apart_by = "only above a level, in both muscles, and it recovers",
                                    .hook = Hook::kCommand};
  template <class S>
  static void command(const S* q, const ValvePoint<S>&, const S* z, S* u) noexcept {
    const S supply = q[0] - z[0];
    for (int i = 0; i < 2; ++i)
      if (u[i] > supply) u[i] = supply;
  }
  template <class S>
  static void derivative(const S* q, const ValvePoint<S>&, const S*, const S* v, const S* z, S* dz) noexcept {
    dz[0] = q[1] * (positive_part(v[0]) + positive_part(v[1])) - z[0] / q[2];
  }
  template <class S>
  static void rest(const S*, const ValvePoint<S>&, S* z) noexcept {
    z[0] = S(0.0);
  }
};

struct VolumeCoupling {
  static constexpr EffectInfo kInfo{
      .id = "volume_coupling",
      .term = "motion pumps the muscle",
      .where = Subsystem::kPcu,
      .equation = "p1' -> p1' - kappa w, p2' -> p2' + kappa w",
      .parameter_count = 1,
      .parameters = {{"kappa", "kg/(cm2 rad)", kPascalPerKgfCm2, -5 * kPascalPerKgfCm2, 5 * kPascalPerKgfCm2,
                      0.2 * kPascalPerKgfCm2}},
      .state_count = 0,
      .torque_term = false,
      .linear = true,
      .confused_with = "second_order_lag, creep",
      .told_apart_by = "pressure moves with the joint at a constant command",
      .hook = Hook::kPressureRate};
  template <class S>
  static void pressure_rate(const S* q, const ValvePoint<S>& x, const S*, S* v) noexcept {
    v[0] = v[0] - q[0] * x.velocity;
    v[1] = v[1] + q[0] * x.velocity;
  }
};

/// The parameter is 1/T_leak: 0 is tight, and the answer is smooth there.
struct Leak {
  static constexpr EffectInfo kInfo{.id = "leak",
                                    .term = "leak",
                                    .where = Subsystem::kPcu,
                                    .equation = "p' -> p' - p/T_leak, k = 1/T_leak",
                                    .parameter_count = 1,
                                    .parameters = {{"k", "1/s", 1, 0, 5, 0.1}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = true,
                                    .confused_with = "pressure_gain_error, crosstalk",
                                    .told_apart_by = "decay at a closed valve; follows the pressure",
                                    .hook = Hook::kPressureRate};
  template <class S>
  static void pressure_rate(const S* q, const ValvePoint<S>& x, const S*, S* v) noexcept {
    for (int i = 0; i < 2; ++i) v[i] = v[i] - q[0] * x.pressure[i];
  }
};

/// At threshold 0 nothing changes, for gauge pressures below 0 do not occur in a muscle.
struct ThresholdPressure {
  static constexpr EffectInfo kInfo{
      .id = "threshold_pressure",
      .term = "bladder needs a pressure to lift off",
      .where = Subsystem::kMuscle,
      .equation = "p -> max(0, p - p_th)",
      .parameter_count = 1,
      .parameters = {{"p_th", "kg/cm2", kPascalPerKgfCm2, 0, 3 * kPascalPerKgfCm2, 0.3 * kPascalPerKgfCm2}},
      .state_count = 0,
      .torque_term = false,
      .linear = false,
      .confused_with = "pressure_offset, tension_loss, nonlinear_pressure_gain",
      .told_apart_by = "only where one muscle's pressure is low",
      .hook = Hook::kMusclePressure};
  template <class S>
  static void muscle_pressure(const S* q, S* p) noexcept {
    if (q[0] == S(0.0)) return;
    for (int i = 0; i < 2; ++i) p[i] = positive_part<S>(p[i] - q[0]);
  }
};

using PcuEffects =
    EffectList<DeadTime, SecondOrderLag, AsymmetricFillVent, FlowLimit, ValveDeadband, ValveHysteresis,
               PressureGainError, Crosstalk, SupplyDroop, VolumeCoupling, Leak, ThresholdPressure>;

}  // namespace isac::models::effect
