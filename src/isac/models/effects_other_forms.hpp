/// @file
/// Other forms that effects of the catalogue take on real rigs: each has an id of its own and `reported_as`, the effect whose
/// form it is, under whose id a search names it.
///
///   leak_per_muscle       each muscle leaks at its own rate
///   crosstalk_per_muscle  either muscle's pressure moves the other's reference by its own share
///   crosstalk_direct      either muscle's pressure moves the other's at once, without the valve's lag
///   valve_stiction        the valve does not answer errors below its band, and answers larger ones in full
///   pressure_creep        the force follows a change of pressure late (bladder): a torque with a slow state of Δp
///   series_elasticity_within  the second inertia is part of the one that is known, not besides it
///   maxwell_slip          one elasto-plastic element: a spring that slips at T_h, with corners instead of Dahl's curve
///
/// Conventions, units and promises as in effects_torque.hpp and effects_pcu.hpp. Source: docs/derivations/effects.md.
#pragma once

#include <cmath>

#include "isac/models/effect_types.hpp"
#include "isac/models/effects_memory.hpp"
#include "isac/models/scalar.hpp"

namespace isac::models::effect {

struct LeakPerMuscle {
  static constexpr EffectInfo kInfo{
      .id = "leak_per_muscle",
      .term = "leak of either muscle",
      .where = Subsystem::kPcu,
      .equation = "p_i' -> p_i' - k_i p_i",
      .parameter_count = 2,
      .parameters = {{"k1", "1/s", 1, 0, 5, 0.1}, {"k2", "1/s", 1, 0, 5, 0.1}},
      .state_count = 0,
      .torque_term = false,
      .linear = true,
      .confused_with = "leak, pressure_sensor_gain",
      .told_apart_by = "one muscle stays below its reference, the other does not",
      .hook = Hook::kPressureRate,
      .reported_as = "leak"};
  template <class S>
  static void pressure_rate(const S* q, const ValvePoint<S>& x, const S*, S* v) noexcept {
    for (int i = 0; i < 2; ++i) v[i] = v[i] - q[i] * x.pressure[i];
  }
};

struct CrosstalkPerMuscle {
  static constexpr EffectInfo kInfo{
      .id = "crosstalk_per_muscle",
      .term = "crosstalk of the references, either way",
      .where = Subsystem::kPcu,
      .equation = "u1 -> u1 + x12 p2, u2 -> u2 + x21 p1",
      .parameter_count = 2,
      .parameters = {{"x12", "-", 1, -0.2, 0.2, 0.02}, {"x21", "-", 1, -0.2, 0.2, 0.02}},
      .state_count = 0,
      .torque_term = false,
      .linear = true,
      .confused_with = "crosstalk, pressure_gain_error",
      .told_apart_by = "move one muscle only: one of the others answers",
      .hook = Hook::kCommand,
      .reported_as = "crosstalk"};
  template <class S>
  static void command(const S* q, const ValvePoint<S>& x, const S*, S* u) noexcept {
    u[0] = u[0] + q[0] * x.pressure[1];
    u[1] = u[1] + q[1] * x.pressure[0];
  }
};

/// p_i = (what unit i makes of u_i) + x p_j: neither unit answers to the other's share.
struct CrosstalkDirect {
  static constexpr EffectInfo kInfo{
      .id = "crosstalk_direct",
      .term = "crosstalk of the pressures, without lag",
      .where = Subsystem::kPcu,
      .equation = "p1 -> p1 + x12 p2, p2 -> p2 + x21 p1",
      .parameter_count = 2,
      .parameters = {{"x12", "-", 1, -0.2, 0.2, 0.02}, {"x21", "-", 1, -0.2, 0.2, 0.02}},
      .state_count = 0,
      .torque_term = false,
      .linear = true,
      .confused_with = "crosstalk, pressure_sensor_gain",
      .told_apart_by = "the other answers at once",
      .hook = Hook::kOutletPressure,
      .reported_as = "crosstalk"};
  template <class S>
  static void outlet_pressure(const S* q, S* p) noexcept {
    const S p0 = p[0], p1 = p[1];
    p[0] = p0 + q[0] * p1;
    p[1] = p1 + q[1] * p0;
  }
};

struct ValveStiction {
  static constexpr EffectInfo kInfo{
      .id = "valve_stiction",
      .term = "valve that does not answer small errors",
      .where = Subsystem::kPcu,
      .equation = "u -> p where |u - p| < d",
      .parameter_count = 1,
      .parameters = {{"d", "kg/cm2", kPascalPerKgfCm2, 0, kPascalPerKgfCm2, 0.03 * kPascalPerKgfCm2}},
      .state_count = 0,
      .torque_term = false,
      .linear = false,
      .confused_with = "valve_deadband, valve_hysteresis",
      .told_apart_by = "large errors are answered in full",
      .hook = Hook::kCommand,
      .reported_as = "valve_deadband"};
  template <class S>
  static void command(const S* q, const ValvePoint<S>& x, const S*, S* u) noexcept {
    for (int i = 0; i < 2; ++i)
      if (magnitude<S>(u[i] - x.pressure[i]) < q[0]) u[i] = x.pressure[i];
  }
};

struct PressureCreep {
  static constexpr double kUnit = 1.0 / kPascalPerKgfCm2;
  static constexpr EffectInfo kInfo{
      .id = "pressure_creep",
      .term = "force that follows the pressure late",
      .where = Subsystem::kMuscle,
      .equation = "-b r (dp - c), c' = (dp - c)/tau",
      .parameter_count = 2,
      .parameters = {{"b", "N cm2/kg", kUnit, -100 * kUnit, 100 * kUnit, 5 * kUnit},
                     {"tau", "s", 1, 1, 2000, 10, kAnyValue}},
      .state_count = 1,
      .torque_term = true,
      .linear = false,
      .confused_with = "creep, thermal_drift",
      .told_apart_by = "follows every change of the pressure, also when clamped",
      .reported_as = "creep"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x, const S* z) noexcept {
    return -(q[0] * x.wheel_radius * (x.delta_pressure - z[0]));
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    dz[0] = (x.delta_pressure - z[0]) / q[1];
  }
  template <class S>
  static void rest(const S*, const JointPoint<S>& x, S* z) noexcept {
    z[0] = x.delta_pressure;
  }
};

struct MaxwellSlip {
  static constexpr EffectInfo kInfo{
      .id = "maxwell_slip",
      .term = "hysteresis with corners (one Maxwell-slip element)",
      .where = Subsystem::kMuscle,
      .equation = "-T_h z, z' = w/phi_s while |z| < 1",
      .parameter_count = 2,
      .parameters = {{"T_h", "N m", 1, 0, 1e4, 0.2}, {"phi_s", "rad", 1, 1e-3, 2, 0.05, kAnyValue}},
      .state_count = 1,
      .torque_term = true,
      .linear = false,
      .confused_with = "hysteresis, coulomb_friction",
      .told_apart_by = "minor loops close",
      .dissipative = true,
      .reported_as = "hysteresis"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>&, const S* z) noexcept {
    return -(q[0] * clamp<S>(z[0], S(-1.0), S(1.0)));
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    const bool slips = (z[0] >= S(1.0) && x.velocity > S(0.0)) || (z[0] <= S(-1.0) && x.velocity < S(0.0));
    dz[0] = slips ? S(0.0) : S(x.velocity / q[1]);
  }
  template <class S>
  static void rest(const S*, const JointPoint<S>&, S* z) noexcept {
    z[0] = S(0.0);
  }
};

/// The whole supply sags with the flow, not only its upper end: the valve opens in proportion to it.
struct SupplySag {
  static constexpr EffectInfo kInfo{.id = "supply_sag",
                                    .term = "supply that falls in proportion to the flow",
                                    .where = Subsystem::kPcu,
                                    .equation = "u -> (1 - k z) u, z' = (p1'+ + p2'+ - z)/tau",
                                    .parameter_count = 2,
                                    .parameters = {{"k", "s cm2/kg", 1.0 / kPascalPerKgfCm2, 0,
                                                    1.0 / kPascalPerKgfCm2, 0.03 / kPascalPerKgfCm2},
                                                   {"tau", "s", 1, 0.05, 100, 0.5, kAnyValue}},
                                    .state_count = 1,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "flow_limit, asymmetric_fill_vent",
                                    .told_apart_by = "one muscle's filling slows the other",
                                    .hook = Hook::kCommand,
                                    .reported_as = "supply_droop"};
  template <class S>
  static void command(const S* q, const ValvePoint<S>&, const S* z, S* u) noexcept {
    for (int i = 0; i < 2; ++i) u[i] = (S(1.0) - q[0] * z[0]) * u[i];
  }
  template <class S>
  static void derivative(const S* q, const ValvePoint<S>&, const S*, const S* v, const S* z, S* dz) noexcept {
    dz[0] = (positive_part(v[0]) + positive_part(v[1]) - z[0]) / q[1];
  }
  template <class S>
  static void rest(const S*, const ValvePoint<S>&, S* z) noexcept {
    z[0] = S(0.0);
  }
};

/// The lever arm put into the seed's law as it stands, A r² φ with r(φ): without the travel that a longer lever winds up.
struct LeverArmInLaw {
  static constexpr EffectInfo kInfo{
      .id = "lever_arm_in_law",
      .term = "lever arm depends on the angle, travel does not",
      .where = Subsystem::kMuscle,
      .equation = "A r(phi)^2 phi + B r(phi) dp - A r^2 phi - B r dp, r(phi) = r (1 + a phi + b phi^2)",
      .parameter_count = 2,
      .parameters = {{"a", "1/rad", 1, -1, 1, 0.05}, {"b", "1/rad2", 1, -1, 1, -0.05}},
      .state_count = 0,
      .torque_term = true,
      .linear = false,
      .confused_with = "cubic_stiffness, quadratic_pressure_angle, encoder_gain",
      .told_apart_by = "the pressure's part changes with the angle too",
      .reported_as = "lever_arm_variation"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    const S more = x.angle * (q[0] + q[1] * x.angle), r = x.wheel_radius;
    return x.pressure_gain * r * x.delta_pressure * more +
           x.stiffness * r * r * x.angle * more * (S(2.0) + more);
  }
};

/// Where the inertia was weighed whole: (I - J2) phi'' + J2 z'' = T.
struct SeriesElasticityWithin {
  static constexpr EffectInfo kInfo{
      .id = "series_elasticity_within",
      .term = "compliance within the inertia that is known",
      .where = Subsystem::kJoint,
      .equation = "-J2 (s - phi''), s = W^2 (phi - z1) + 2 d W (w - z2), z1' = z2, z2' = s, W = 2 pi f",
      .parameter_count = 3,
      .parameters = {{"J2", "kg m2", 1, 0, 1e3, 0.001},
                     {"f", "Hz", 1, 1, 500, 20, kAnyValue},
                     {"d", "-", 1, 0, 2, 0.05, kAnyValue}},
      .state_count = 2,
      .torque_term = true,
      .linear = false,
      .confused_with = "sensor_lag, inertia_error, dead_time",
      .told_apart_by = "a pair of anti-resonance and resonance, not a pure lag",
      .dissipative = true,
      .reported_as = "series_elasticity"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x, const S* z) noexcept {
    return -(q[0] * (SeriesElasticity::pull(q, x, z) - x.acceleration));
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    SeriesElasticity::derivative(q, x, z, dz);
  }
  template <class S>
  static void rest(const S* q, const JointPoint<S>& x, S* z) noexcept {
    SeriesElasticity::rest(q, x, z);
  }
};

/// The muscles' damping sits on the wheel too: while the joint crosses the play, the wheel stands and nothing is damped.
struct BacklashOfWheel {
  static constexpr EffectInfo kInfo{
      .id = "backlash_of_wheel",
      .term = "play between the wheel with all that the muscles do, and the joint",
      .where = Subsystem::kJoint,
      .equation = "A r^2 (z - phi) + (D phi' + C phi'^3 where z stands), z follows phi with play b",
      .parameter_count = 1,
      .parameters = {{"b", "rad", 1, 0, 0.2, 0.01}},
      .state_count = 1,
      .torque_term = true,
      .linear = false,
      .confused_with = "hysteresis, time_skew, encoder_play, coulomb_friction",
      .told_apart_by = "scales with the stiffness; gone when one side stays loaded",
      .reported_as = "backlash"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x, const S* z) noexcept {
    // What a step of a simulation leaves of the gap is not taken for crossing.
    const S nearly = q[0] * S(0.95), gap = x.angle - z[0], w = x.velocity;
    const bool follows = (gap >= nearly && w > S(0.0)) || (gap <= -nearly && w < S(0.0));
    const S free = follows ? S(0.0) : w * (x.damping + x.cubic_damping * w * w);
    return Backlash::torque(q, x, z) + (q[0] > S(0.0) ? free : S(0.0));
  }
  template <class S>
  static void derivative(const S* q, const JointPoint<S>& x, const S* z, S* dz) noexcept {
    Backlash::derivative(q, x, z, dz);
  }
  template <class S>
  static void rest(const S* q, const JointPoint<S>& x, S* z) noexcept {
    Backlash::rest(q, x, z);
  }
};

using OtherForms =
    EffectList<LeakPerMuscle, CrosstalkPerMuscle, CrosstalkDirect, ValveStiction, PressureCreep, MaxwellSlip,
               SupplySag, LeverArmInLaw, SeriesElasticityWithin, BacklashOfWheel>;

}  // namespace isac::models::effect
