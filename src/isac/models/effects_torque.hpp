/// @file
/// Torque effects without memory: the seed's A, B, C, D, inertia, offsets, stiffness, lever arm, gravity.
/// Friction and damping stand in effects_friction.hpp, effects with states in effects_memory.hpp.
///
/// Each struct is one effect: `torque(q, x)` is the torque in N m that it exerts on the joint at point x with
/// parameters q (SI). Real time: no heap, no lock, noexcept. Errors: none; NaN goes through.
/// Source: seed 3.5, 3.10 with the signs of docs/errata.md; docs/derivations/effects.md.
#pragma once

#include <cmath>

#include "isac/models/effect_types.hpp"
#include "isac/models/scalar.hpp"

namespace isac::models::effect {

inline constexpr double kPerPressure = 1.0 / kPascalPerKgfCm2;  ///< N cm²/kg → N/Pa

struct Stiffness {
  static constexpr EffectInfo kInfo{.id = "stiffness",
                                    .term = "stiffness of the muscle pair",
                                    .where = Subsystem::kMuscle,
                                    .equation = "A r^2 phi",
                                    .parameter_count = 1,
                                    .parameters = {{"A", "N/m", 1, -1e6, 1e6, -23450}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "gravity_imbalance, encoder_gain",
                                    .told_apart_by = "slow sweeps at constant pressure"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return q[0] * x.wheel_radius * x.wheel_radius * x.angle;
  }
};

struct Pressure {
  static constexpr EffectInfo kInfo{.id = "pressure",
                                    .term = "torque by pressure difference",
                                    .where = Subsystem::kMuscle,
                                    .equation = "B r dp",
                                    .parameter_count = 1,
                                    .parameters = {{"B", "N cm2/kg", kPerPressure, -2000 * kPerPressure,
                                                    2000 * kPerPressure, 174.2 * kPerPressure}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "pressure_sensor_gain, force_gain_error",
                                    .told_apart_by = "runs at several pressure differences"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return q[0] * x.wheel_radius * x.delta_pressure;
  }
};

struct Offset {
  static constexpr EffectInfo kInfo{.id = "offset",
                                    .term = "constant added to the recorded output",
                                    .where = Subsystem::kSensor,
                                    .equation = "c",
                                    .parameter_count = 1,
                                    .parameters = {{"c", "N m", 1, -1e3, 1e3, 0.1}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "torque_offset, force_offset",
                                    .told_apart_by = "an unloaded reading",
                                    .added_to_output = true};
  template <class S>
  static S torque(const S* q, const JointPoint<S>&) noexcept {
    return q[0];
  }
};

struct TorqueOffset {
  static constexpr EffectInfo kInfo{.id = "torque_offset",
                                    .term = "constant torque",
                                    .where = Subsystem::kMuscle,
                                    .equation = "T_0",
                                    .parameter_count = 1,
                                    .parameters = {{"T_0", "N m", 1, -1e3, 1e3, 0.1}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "force_offset, muscle_asymmetry, gravity_imbalance",
                                    .told_apart_by = "an unloaded reading, the sum F1 + F2"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>&) noexcept {
    return q[0];
  }
};

struct Inertia {
  static constexpr EffectInfo kInfo{.id = "inertia",
                                    .term = "inertia",
                                    .where = Subsystem::kJoint,
                                    .equation = "-I w'",
                                    .parameter_count = 1,
                                    .parameters = {{"I", "kg m2", 1, 0, 1e4, 0.0085}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "inertia_error, series_elasticity",
                                    .told_apart_by = "fast motion"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * x.acceleration);
  }
};

struct InertiaError {
  static constexpr EffectInfo kInfo{.id = "inertia_error",
                                    .term = "added inertia",
                                    .where = Subsystem::kJoint,
                                    .equation = "-dI w'",
                                    .parameter_count = 1,
                                    .parameters = {{"dI", "kg m2", 1, -1, 1, 0.001}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "inertia, series_elasticity",
                                    .told_apart_by = "the resonance moves, the static curve does not"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * x.acceleration);
  }
};

struct MuscleAsymmetry {
  static constexpr EffectInfo kInfo{.id = "muscle_asymmetry",
                                    .term = "unequal muscles",
                                    .where = Subsystem::kMuscle,
                                    .equation = "b r p_mean",
                                    .parameter_count = 1,
                                    .parameters = {{"b", "N cm2/kg", kPerPressure, -100 * kPerPressure,
                                                    100 * kPerPressure, 2 * kPerPressure}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "torque_offset",
                                    .told_apart_by = "runs at another mean pressure"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return q[0] * x.wheel_radius * x.mean_pressure;
  }
};

struct CubicStiffness {
  static constexpr EffectInfo kInfo{.id = "cubic_stiffness",
                                    .term = "hardening or softening stiffness",
                                    .where = Subsystem::kMuscle,
                                    .equation = "-k3 phi^3",
                                    .parameter_count = 1,
                                    .parameters = {{"k3", "N m/rad3", 1, -1e3, 1e3, 0.5}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "tension_loss, lever_arm_variation, gravity_imbalance",
                                    .told_apart_by = "smooth or kinked"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * x.angle * x.angle * x.angle);
  }
};

struct
    PressureDependentStiffness {  // k is α A of the baseline: the share α of A that follows the mean pressure
  static constexpr EffectInfo kInfo{.id = "pressure_dependent_stiffness",
                                    .term = "stiffness with mean pressure",
                                    .where = Subsystem::kMuscle,
                                    .equation = "k r^2 phi (p_mean/p0 - 1)",
                                    .parameter_count = 1,
                                    .parameters = {{"k", "N/m", 1, -1e6, 1e6, -10000}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "thermal_drift",
                                    .told_apart_by = "mean pressure varied"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return q[0] * x.wheel_radius * x.wheel_radius * x.angle *
           (x.mean_pressure / x.reference_pressure - S(1.0));
  }
};

struct QuadraticPressureAngle {
  static constexpr EffectInfo kInfo{.id = "quadratic_pressure_angle",
                                    .term = "second-order term of the muscle pair",
                                    .where = Subsystem::kMuscle,
                                    .equation = "a dp r^3 phi^2",
                                    .parameter_count = 1,
                                    .parameters = {{"a", "N cm2/(kg m2)", kPerPressure, -1e8 * kPerPressure,
                                                    1e8 * kPerPressure, 1e4 * kPerPressure}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = true,
                                    .confused_with = "lever_arm_variation, cubic_stiffness",
                                    .told_apart_by = "pressure difference and angle varied together"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    const S lever = x.wheel_radius;
    return q[0] * x.delta_pressure * lever * lever * lever * x.angle * x.angle;
  }
};

struct NonlinearPressureGain {
  static constexpr double kUnit = kPerPressure * kPerPressure * kPerPressure;
  static constexpr EffectInfo kInfo{
      .id = "nonlinear_pressure_gain",
      .term = "torque not linear in the pressure difference",
      .where = Subsystem::kMuscle,
      .equation = "b3 dp^3",
      .parameter_count = 1,
      .parameters = {{"b3", "N m cm6/kg3", kUnit, -10 * kUnit, 10 * kUnit, 0.05 * kUnit}},
      .state_count = 0,
      .torque_term = true,
      .linear = true,
      .confused_with = "cubic_stiffness, threshold_pressure",
      .told_apart_by = "also there when the joint is clamped"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return q[0] * x.delta_pressure * x.delta_pressure * x.delta_pressure;
  }
};

struct TensionLoss {  // the slack muscle takes k off the restoring torque; passive while k ≤ −A r²
  static constexpr EffectInfo kInfo{
      .id = "tension_loss",
      .term = "slack muscle",
      .where = Subsystem::kMuscle,
      .equation = "k (|phi| - phi_s)+ sgn(phi)",
      .parameter_count = 2,
      .parameters = {{"k", "N m/rad", 1, 0, 1e3, 4}, {"phi_s", "rad", 1, 0, kPi, 0.9, kAnyValue}},
      .state_count = 0,
      .torque_term = true,
      .linear = false,
      .confused_with = "cubic_stiffness, end_stop, threshold_pressure",
      .told_apart_by = "onset moves with the lower pressure"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return q[0] * dead_zone(x.angle, q[1]);
  }
};

struct EndStop {  // a one-sided stop has its other side out of reach
  static constexpr EffectInfo kInfo{.id = "end_stop",
                                    .term = "one- or two-sided stop",
                                    .where = Subsystem::kJoint,
                                    .equation = "-k ((phi - phi_high)+ - (phi_low - phi)+)",
                                    .parameter_count = 3,
                                    .parameters = {{"k", "N m/rad", 1, 0, 1e5, 50},
                                                   {"phi_high", "rad", 1, 0, kPi, 1.1, kAnyValue},
                                                   {"phi_low", "rad", 1, -kPi, 0, -1.1, kAnyValue}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = false,
                                    .confused_with = "tension_loss, cubic_stiffness",
                                    .told_apart_by = "sharp onset at one angle, whatever the pressure"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    return -(q[0] * (positive_part<S>(x.angle - q[1]) - positive_part<S>(q[2] - x.angle)));
  }
};

/// r(φ) = r (1 + a φ + b φ²) bends both parts of the baseline: T = r(φ) (A s(φ) + B Δp), s(φ) = ∫ r(φ) dφ.
struct LeverArmVariation {
  static constexpr EffectInfo kInfo{
      .id = "lever_arm_variation",
      .term = "lever arm depends on the angle",
      .where = Subsystem::kMuscle,
      .equation =
          "r(phi) (A s(phi) + B dp) - A r^2 phi - B r dp, "
          "r(phi) = r (1 + a phi + b phi^2), s = int r(phi)",
      .parameter_count = 2,
      .parameters = {{"a", "1/rad", 1, -1, 1, 0.05}, {"b", "1/rad2", 1, -1, 1, -0.05}},
      .state_count = 0,
      .torque_term = true,
      .linear = false,
      .confused_with = "cubic_stiffness, quadratic_pressure_angle, encoder_gain",
      .told_apart_by = "the pressure's part changes with the angle too"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    const S& phi = x.angle;
    const S more_lever = q[0] * phi + q[1] * phi * phi;
    const S more_travel = phi * (q[0] * phi / S(2.0) + q[1] * phi * phi / S(3.0));
    const S r = x.wheel_radius;
    return x.pressure_gain * r * x.delta_pressure * more_lever +
           x.stiffness * r * r * (phi * more_lever + more_travel + more_lever * more_travel);
  }
};

struct TorqueRipple {
  static constexpr EffectInfo kInfo{.id = "torque_ripple",
                                    .term = "chordal action of the chain",
                                    .where = Subsystem::kMuscle,
                                    .equation = "s sin(N phi) + c cos(N phi)",
                                    .parameter_count = 3,
                                    .parameters = {{"s", "N m", 1, -10, 10, 0.05},
                                                   {"c", "N m", 1, -10, 10, 0.05},
                                                   {"N", "-", 1, 8, 100, 16, kAnyValue}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = false,
                                    .confused_with = "encoder_gain, periodic_disturbance",
                                    .told_apart_by = "its period is a tooth, at any speed"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    using std::cos;
    using std::sin;
    const S turn = q[2] * x.angle;
    return q[0] * sin(turn) + q[1] * cos(turn);
  }
};

/// −m g l sin(φ + φ0) with G_sin = m g l cos φ0, G_cos = m g l sin φ0: linear, and regular at no imbalance.
struct GravityImbalance {
  static constexpr EffectInfo kInfo{
      .id = "gravity_imbalance",
      .term = "unbalanced mass",
      .where = Subsystem::kJoint,
      .equation = "-m g l sin(phi + phi0) = -G_sin sin(phi) - G_cos cos(phi)",
      .parameter_count = 2,
      .parameters = {{"G_sin", "N m", 1, -1e3, 1e3, 0.3}, {"G_cos", "N m", 1, -1e3, 1e3, 0.1}},
      .state_count = 0,
      .torque_term = true,
      .linear = true,
      .confused_with = "torque_offset, cubic_stiffness, stiffness",
      .told_apart_by = "only in free motion"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    using std::cos;
    using std::sin;
    return -(q[0] * sin(x.angle) + q[1] * cos(x.angle));
  }
};

struct PeriodicDisturbance {
  static constexpr EffectInfo kInfo{.id = "periodic_disturbance",
                                    .term = "something else moves",
                                    .where = Subsystem::kRig,
                                    .equation = "s sin(2 pi f t) + c cos(2 pi f t)",
                                    .parameter_count = 3,
                                    .parameters = {{"s", "N m", 1, -10, 10, 0.05},
                                                   {"c", "N m", 1, -10, 10, 0.05},
                                                   {"f", "Hz", 1, 0.05, 500, 1.7, kAnyValue}},
                                    .state_count = 0,
                                    .torque_term = true,
                                    .linear = false,
                                    .confused_with = "mains_hum, torque_ripple",
                                    .told_apart_by = "not locked to the command, there at rest"};
  template <class S>
  static S torque(const S* q, const JointPoint<S>& x) noexcept {
    using std::cos;
    using std::sin;
    const S turn = S(2.0 * kPi) * q[2] * x.time;
    return q[0] * sin(turn) + q[1] * cos(turn);
  }
};

using TorqueEffects =
    EffectList<Stiffness, Pressure, Offset, TorqueOffset, Inertia, InertiaError, MuscleAsymmetry,
               CubicStiffness, PressureDependentStiffness, QuadraticPressureAngle, NonlinearPressureGain,
               TensionLoss, EndStop, LeverArmVariation, TorqueRipple, GravityImbalance, PeriodicDisturbance>;

}  // namespace isac::models::effect
