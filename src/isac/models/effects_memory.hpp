/// @file
/// Torque effects with states of their own: hysteresis, creep, backlash, warm-up, a second inertia.
///
/// `torque(q, x, z)` in N m and `derivative(q, x, z, dz)` (dz in state units per second) at point x with parameters q
/// and states z. States start at `rest(q, x, z)`: the effect has been left alone at x for long.
/// Real time: no heap, no lock, noexcept. Errors: none; NaN goes through. Source: docs/derivations/effects.md.
#pragma once

#include <cmath>

#include "isac/models/effect_types.hpp"
#include "isac/models/scalar.hpp"

namespace isac::models::effect {

/// Dahl: z → sgn φ̇ within a turn of φ_s. It can return at most ½ T_h φ_s of energy that it was given before.
struct Hysteresis {
  static constexpr EffectInfo kInfo{
      .id = "hysteresis",
      .term = "rate-independent hysteresis (Dahl)",
      .where = Subsystem::kMuscle,
      .equation = "-T_h z, z' = w/phi_s (1 - z sgn(w))",
      .parameter_count = 2,
      .parameters = {{"T_h", "N m", 1, 0, 1e4, 0.2}, {"phi_s", "rad", 1, 1e-3, 2, 0.05, kAnyValue}},
      .state_count = 1,
      .torque_term = true,
      .linear = false,
      .confused_with = "coulomb_friction, backlash, asymmetric_hysteresis",
      .told_apart_by = "the curve after a reversal",
      .dissipative = true,
      .linear_in_state = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>&, const S* z) noexcept {
    return -(q[0] * z[0]);
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    dz[0] = x.velocity / q[1] * (S(1.0) - z[0] * sgn(x.velocity));
  }
  template <class S>
  static void rest(const S*, const JointPoint<S>&, S* z) noexcept {
    z[0] = S(0.0);
  }
};

/// The Dahl loop with its own height and length in either direction; the height changes where z = 0, without a jump.
/// Not passive in general: with unequal lengths a small to and fro ratchets against the load (docs/derivations/effects.md).
struct AsymmetricHysteresis {
  static constexpr EffectInfo kInfo{.id = "asymmetric_hysteresis",
                                    .term = "hysteresis that differs by direction",
                                    .where = Subsystem::kMuscle,
                                    .equation = "-T_h(sgn z) z, z' = w/phi_s(sgn w) (1 - z sgn(w))",
                                    .parameter_count = 4,
                                    .parameters = {{"T_h_up", "N m", 1, 0, 1e4, 0.2},
                                                   {"T_h_down", "N m", 1, 0, 1e4, 0.15},
                                                   {"phi_s_up", "rad", 1, 1e-3, 2, 0.05, kAnyValue},
                                                   {"phi_s_down", "rad", 1, 1e-3, 2, 0.05, kAnyValue}},
                                    .state_count = 1,
                                    .torque_term = true,
                                    .linear = false,
                                    .confused_with = "hysteresis, asymmetric_fill_vent",
                                    .told_apart_by = "survives at 0.01 Hz",
                                    .linear_in_state = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>&, const S* z) noexcept {
    return -((z[0] > S(0.0) ? q[0] : q[1]) * z[0]);
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    const S length = x.velocity > S(0.0) ? q[2] : q[3];
    dz[0] = x.velocity / length * (S(1.0) - z[0] * sgn(x.velocity));
  }
  template <class S>
  static void rest(const S*, const JointPoint<S>&, S* z) noexcept {
    z[0] = S(0.0);
  }
};

/// Standard linear solid: a spring k1 whose foot c follows the angle within τ.
struct Creep {
  static constexpr EffectInfo kInfo{
      .id = "creep",
      .term = "creep, relaxation",
      .where = Subsystem::kMuscle,
      .equation = "-k1 (phi - c), c' = (phi - c)/tau",
      .parameter_count = 2,
      .parameters = {{"k1", "N m/rad", 1, 0, 1e3, 0.5}, {"tau", "s", 1, 1, 2000, 20, kAnyValue}},
      .state_count = 1,
      .torque_term = true,
      .linear = false,
      .confused_with = "thermal_drift, hysteresis, encoder_drift",
      .told_apart_by = "returns after unloading",
      .dissipative = true,
      .linear_in_state = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x, const S* z) noexcept {
    return -(q[0] * (x.angle - z[0]));
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    dz[0] = (x.angle - z[0]) / q[1];
  }
  template <class S>
  static void rest(const S*, const JointPoint<S>& x, S* z) noexcept {
    z[0] = x.angle;
  }
};

/// Play of half-width b: the wheel z stands still until the joint has crossed the gap, and the muscles pull at the
/// wheel's angle. Needs the baseline's A in the point. The wheel's own mass is neglected.
struct Backlash {
  static constexpr EffectInfo kInfo{
      .id = "backlash",
      .term = "play in the chain",
      .where = Subsystem::kJoint,
      .equation = "A r^2 (z - phi), z follows phi with play b",
      .parameter_count = 1,
      .parameters = {{"b", "rad", 1, 0, 0.2, 0.01}},
      .state_count = 1,
      .torque_term = true,
      .linear = false,
      .confused_with = "hysteresis, time_skew, encoder_play, coulomb_friction",
      .told_apart_by = "scales with the stiffness; gone when one side stays loaded"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x, const S* z) noexcept {
    const S wheel = clamp<S>(z[0], x.angle - q[0], x.angle + q[0]);
    return x.stiffness * x.wheel_radius * x.wheel_radius * (wheel - x.angle);
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    const S gap = x.angle - z[0];
    const bool pushed = (gap >= q[0] && x.velocity > S(0.0)) || (gap <= -q[0] && x.velocity < S(0.0));
    dz[0] = pushed ? x.velocity : S(0.0);
  }
  template <class S>
  static void rest(const S*, const JointPoint<S>& x, S* z) noexcept {
    z[0] = x.angle;
  }
};

/// Warm-up: shares of A, of B and a constant that arrive with e^(−t/τ). No state, but a memory of the start.
struct ThermalDrift {
  static constexpr double kUnit = 1.0 / kPascalPerKgfCm2;
  static constexpr EffectInfo kInfo{
      .id = "thermal_drift",
      .term = "warm-up drift",
      .where = Subsystem::kMuscle,
      .equation = "(a r^2 phi + b r dp + T_0) (1 - exp(-t/tau))",
      .parameter_count = 4,
      .parameters = {{"a", "N/m", 1, -1e5, 1e5, 1000},
                     {"b", "N cm2/kg", kUnit, -100 * kUnit, 100 * kUnit, 5 * kUnit},
                     {"T_0", "N m", 1, -100, 100, 0.1},
                     {"tau", "s", 1, 10, 1e5, 600, kAnyValue}},
      .state_count = 0,
      .torque_term = true,
      .linear = false,
      .confused_with = "creep, force_drift",
      .told_apart_by = "proportional to pressure or to nothing"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    using std::exp;
    const S r = x.wheel_radius;
    return (q[0] * r * r * x.angle + q[1] * r * x.delta_pressure + q[2]) * (S(1.0) - exp(-x.time / q[3]));
  }
};

/// A mass J2 that hangs on the joint by the chain's or the frame's spring: z = (its angle, its speed).
struct SeriesElasticity {
  static constexpr EffectInfo kInfo{.id = "series_elasticity",
                                    .term = "chain or frame compliance",
                                    .where = Subsystem::kJoint,
                                    .equation =
                                        "-J2 s, s = W^2 (phi - z1) + 2 d W (w - z2), z1' = z2, z2' = s, "
                                        "W = 2 pi f",
                                    .parameter_count = 3,
                                    .parameters = {{"J2", "kg m2", 1, 0, 1e3, 0.001},
                                                   {"f", "Hz", 1, 1, 500, 20, kAnyValue},
                                                   {"d", "-", 1, 0, 2, 0.05, kAnyValue}},
                                    .state_count = 2,
                                    .torque_term = true,
                                    .linear = false,
                                    .confused_with = "sensor_lag, inertia_error, dead_time",
                                    .told_apart_by = "a pair of anti-resonance and resonance, not a pure lag",
                                    .dissipative = true};
  template <class S>
  static S pull(const S* q, const JointPoint<S>& x, const S* z) noexcept {
    const S omega = S(2.0 * kPi) * q[1];
    return omega * omega * (x.angle - z[0]) + S(2.0) * q[2] * omega * (x.velocity - z[1]);
  }
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x, const S* z) noexcept {
    return -(q[0] * pull(q, x, z));
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    dz[0] = z[1];
    dz[1] = pull(q, x, z);
  }
  template <class S>
  static void rest(const S*, const JointPoint<S>& x, S* z) noexcept {
    z[0] = x.angle;
    z[1] = x.velocity;
  }
};

using MemoryEffects =
    EffectList<Hysteresis, AsymmetricHysteresis, Creep, Backlash, ThermalDrift, SeriesElasticity>;

}  // namespace isac::models::effect
