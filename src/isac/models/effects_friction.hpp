/// @file
/// Friction and damping without memory; each one takes energy: torque · velocity ≤ 0 for plausible parameters.
///
/// `torque(q, x)` in N m at point x with parameters q (SI). sgn is exact (sgn 0 = 0): a fit over samples needs no
/// smoothing, a simulation that must hold still at zero speed takes `hysteresis` (presliding) instead.
/// Real time: no heap, no lock, noexcept. Errors: none; NaN goes through.
/// Source: seed 3.9, 3.10 with the signs of docs/errata.md; docs/derivations/effects.md.
#pragma once

#include <cmath>

#include "isac/models/effect_types.hpp"
#include "isac/models/scalar.hpp"

namespace isac::models::effect {

struct ViscousDamping {
  static constexpr EffectInfo kInfo{.id = "viscous_damping",
                                    .term = "viscous damping",
                                    .where = Subsystem::kMuscle,
                                    .equation = "-D w",
                                    .parameter_count = 1,
                                    .parameters = {{"D", "N m s", 1, 0, 1e5, 0.14}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "sensor_lag, time_skew",
                                    .told_apart_by = "also visible in the clamped runs",
                                    .dissipative = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * x.velocity);
  }
};

struct CubicDamping {
  static constexpr EffectInfo kInfo{.id = "cubic_damping",
                                    .term = "cubic damping",
                                    .where = Subsystem::kMuscle,
                                    .equation = "-C w^3",
                                    .parameter_count = 1,
                                    .parameters = {{"C", "N m s3", 1, 0, 1e4, 0.0026}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "viscous_damping, quadratic_damping",
                                    .told_apart_by = "speed range",
                                    .dissipative = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * x.velocity * x.velocity * x.velocity);
  }
};

struct QuadraticDamping {
  static constexpr EffectInfo kInfo{.id = "quadratic_damping",
                                    .term = "air or seal damping",
                                    .where = Subsystem::kJoint,
                                    .equation = "-c2 w |w|",
                                    .parameter_count = 1,
                                    .parameters = {{"c2", "N m s2", 1, 0, 1e4, 0.02}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "cubic_damping, viscous_damping",
                                    .told_apart_by = "free decay",
                                    .dissipative = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * x.velocity * magnitude(x.velocity));
  }
};

struct PressureDependentDamping {  // by itself it gives energy where p_mean < p0: it only corrects D
  static constexpr double kUnit = 1.0 / kPascalPerKgfCm2;
  static constexpr EffectInfo kInfo{
      .id = "pressure_dependent_damping",
      .term = "damping with mean pressure",
      .where = Subsystem::kMuscle,
      .equation = "-D1 w (p_mean - p0)",
      .parameter_count = 1,
      .parameters = {{"D1", "N m s cm2/kg", kUnit, -10 * kUnit, 10 * kUnit, 0.03 * kUnit}},
      .state_count = 0,
      .torque_term = true,
      .linear = true,
      .confused_with = "pressure_dependent_friction, viscous_damping",
      .told_apart_by = "the loop's width at zero speed does not change"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * x.velocity * (x.mean_pressure - x.reference_pressure));
  }
};

struct CoulombFriction {
  static constexpr EffectInfo kInfo{.id = "coulomb_friction",
                                    .term = "Coulomb friction",
                                    .where = Subsystem::kMuscle,
                                    .equation = "-T_c sgn(w)",
                                    .parameter_count = 1,
                                    .parameters = {{"T_c", "N m", 1, 0, 1e4, 0.15}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with =
                                        "hysteresis, backlash, stribeck_friction, bearing_friction, "
                                        "pressure_dependent_friction",
                                    .told_apart_by = "width at zero and at high speed",
                                    .dissipative = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * sgn(x.velocity));
  }
};

struct BearingFriction {
  static constexpr EffectInfo kInfo{.id = "bearing_friction",
                                    .term = "friction outside the muscles",
                                    .where = Subsystem::kJoint,
                                    .equation = "-T_b sgn(w)",
                                    .parameter_count = 1,
                                    .parameters = {{"T_b", "N m", 1, 0, 1e4, 0.1}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "coulomb_friction",
                                    .told_apart_by = "the force sensors do not see it",
                                    .dissipative = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * sgn(x.velocity));
  }
};

struct StribeckFriction {
  static constexpr EffectInfo kInfo{.id = "stribeck_friction",
                                    .term = "Stribeck friction",
                                    .where = Subsystem::kMuscle,
                                    .equation = "-(T_c + (T_s - T_c) exp(-(w/v_s)^2)) sgn(w)",
                                    .parameter_count = 3,
                                    .parameters = {{"T_c", "N m", 1, 0, 1e4, 0.15},
                                                   {"T_s", "N m", 1, 0, 1e4, 0.3},
                                                   {"v_s", "rad/s", 1, 1e-3, 10, 0.1, kAnyValue}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = false,
                                    .confused_with = "coulomb_friction, viscous_damping",
                                    .told_apart_by = "very slow sweeps",
                                    .dissipative = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    using std::exp;
    const S ratio = x.velocity / q[2];
    return -((q[0] + (q[1] - q[0]) * exp(-ratio * ratio)) * sgn(x.velocity));
  }
};

struct PressureDependentFriction {
  static constexpr EffectInfo kInfo{
      .id = "pressure_dependent_friction",
      .term = "load-dependent Coulomb friction",
      .where = Subsystem::kMuscle,
      .equation = "-T_c (p_mean/p0)^n sgn(w)",
      .parameter_count = 2,
      .parameters = {{"T_c", "N m", 1, 0, 1e4, 0.15}, {"n", "-", 1, 0, 4, 1, kAnyValue}},
      .state_count = 0,
      .torque_term = true,
      .linear = false,
      .confused_with = "coulomb_friction, pressure_dependent_damping",
      .told_apart_by = "mean pressure varied",
      .dissipative = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    using std::pow;
    const S load = x.mean_pressure / x.reference_pressure;
    if (load <= S(0.0)) return S(0.0);  // a muscle without pressure presses on nothing
    return -(q[0] * pow(load, q[1]) * sgn(x.velocity));
  }
};

using FrictionEffects =
    EffectList<ViscousDamping, CubicDamping, QuadraticDamping, PressureDependentDamping, CoulombFriction,
               BearingFriction, StribeckFriction, PressureDependentFriction>;

}  // namespace isac::models::effect
