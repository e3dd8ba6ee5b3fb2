/// @file
/// Joint torque (J1), its range of validity (J5), and the splitting of Δp onto the two muscles.
///
///   T = A r² φ + B r Δp − C φ̇³ − D φ̇          seed 3.10 with the signs of docs/errata.md: A < 0; B, C, D > 0
///   Δp = (B r)⁻¹ (T − A r² φ + C φ̇³ + D φ̇)      the same, solved for the pressure that gives a torque (seed 3.4)
///   p1 = p0 − Δp, p2 = p0 + Δp;  Δp = (p2 − p1)/2      seed 2.1.1
///
/// Units: SI: A N/m, B N/Pa, C N m s³, D N m s, r m; the seed reports B in N cm²/kg (kg = kgf): 1 N cm²/kg = 1/98066.5 N/Pa.
/// Real time: no heap, no lock, noexcept, templated on the scalar; safe from any thread.
/// Errors: kOutOfRange where B r = 0 or a value leaves the range; kNotFinite for NaN and infinity.
/// Source: seed 3.3, 3.5; docs/derivations/joint_model.md. Example: `joint_torque(testbed<double>(), 0.019, point…)`.
#pragma once

#include <cmath>
#include <cstdint>

#include "isac/core/status.hpp"
#include "isac/core/units.hpp"

namespace isac::models {

template <class S>
struct JointCoefficients {
  S A{};  ///< N/m
  S B{};  ///< N/Pa
  S C{};  ///< N m s³
  S D{};  ///< N m s
};

/// B in N cm²/kg → N/Pa.
template <class S>
[[nodiscard]] constexpr S pressure_gain_from_reported(const S& newton_cm2_per_kgf) noexcept {
  return newton_cm2_per_kgf / S(kPascalPerKgfCm2);
}

/// B in N/Pa → N cm²/kg.
template <class S>
[[nodiscard]] constexpr S pressure_gain_to_reported(const S& newton_per_pascal) noexcept {
  return newton_per_pascal * S(kPascalPerKgfCm2);
}

/// The seed's testbed (3.3): A = −23450 N/m, B = 174.2 N cm²/kg, C = 0.0026 N m s³, D = 0.14 N m s.
template <class S>
[[nodiscard]] constexpr JointCoefficients<S> testbed_parameters() noexcept {
  return {.A = S(-23450.0), .B = pressure_gain_from_reported(S(174.2)), .C = S(0.0026), .D = S(0.14)};
}

/// r of the testbed's chain wheel, m: the seed does not give it; this one reproduces T_J, ζ and the Hurwitz entries.
inline constexpr double kTestbedWheelRadius = 0.019;

template <class S>
[[nodiscard]] constexpr S joint_torque(const JointCoefficients<S>& q, const S& wheel_radius, const S& angle,
                                       const S& delta_pressure, const S& velocity) noexcept {
  const S r = wheel_radius;
  return q.A * r * r * angle + q.B * r * delta_pressure - q.C * velocity * velocity * velocity -
         q.D * velocity;
}

/// The Δp that gives `torque`; `delta_pressure` is untouched unless the status is ok.
template <class S>
[[nodiscard]] Status delta_pressure_for_torque(const JointCoefficients<S>& q, const S& wheel_radius,
                                               const S& torque, const S& angle, const S& velocity,
                                               S& delta_pressure) noexcept {
  const S gain = q.B * wheel_radius;
  if (gain == S(0.0)) return Status::kOutOfRange;
  const S r = wheel_radius;
  const S answer =
      (torque - q.A * r * r * angle + q.C * velocity * velocity * velocity + q.D * velocity) / gain;
  if (!(answer - answer == S(0.0))) return Status::kNotFinite;
  delta_pressure = answer;
  return Status::kOk;
}

template <class S>
struct PressurePair {
  S muscle_1{}, muscle_2{};  ///< Pa
};

template <class S>
[[nodiscard]] constexpr PressurePair<S> split_pressure(const S& mean_pressure,
                                                       const S& delta_pressure) noexcept {
  return {.muscle_1 = mean_pressure - delta_pressure, .muscle_2 = mean_pressure + delta_pressure};
}

template <class S>
[[nodiscard]] constexpr S delta_pressure_of(const PressurePair<S>& p) noexcept {
  return (p.muscle_2 - p.muscle_1) / S(2.0);
}

template <class S>
[[nodiscard]] constexpr S mean_pressure_of(const PressurePair<S>& p) noexcept {
  return (p.muscle_1 + p.muscle_2) / S(2.0);
}

/// Where identified parameters hold (seed 3.5): the defaults are the testbed's.
template <class S>
struct ValidityRange {
  S delta_pressure = S(2.0 * kPascalPerKgfCm2);    ///< Pa, |Δp| at most
  S angle = S(3.0 * kPi / 8.0);                    ///< rad, |φ| at most
  S speed = S(2.0 * kPi);                          ///< rad/s, |φ̇| at most: what the seed's sweeps reached
  S initial_pressure = S(3.0 * kPascalPerKgfCm2);  ///< Pa, p0
  S initial_pressure_tolerance = S(0.05 * kPascalPerKgfCm2);  ///< Pa
  S pre_tension = S(0.15);                                    ///< -, contraction at φ = 0 as mounted
  S pre_tension_tolerance = S(0.03);
};

/// What left the range; a set of bits, 0 when nothing did.
enum ValidityFlag : std::uint8_t {
  kDeltaPressureOutside = 1,
  kAngleOutside = 2,
  kSpeedOutside = 4,
  kInitialPressureOutside = 8,
  kPreTensionOutside = 16,
  kSomethingNotFinite = 32,
};

namespace detail {
template <class S>
[[nodiscard]] std::uint8_t flag_unless_within(const S& value, const S& limit, ValidityFlag flag) noexcept {
  if (!(value - value == S(0.0))) return kSomethingNotFinite;
  return value > limit || value < -limit ? static_cast<std::uint8_t>(flag) : std::uint8_t{0};
}
}  // namespace detail

/// Run-time check of one instant, as a set of ValidityFlag.
template <class S>
[[nodiscard]] std::uint8_t outside_validity(const ValidityRange<S>& range, const S& delta_pressure,
                                            const S& angle, const S& velocity) noexcept {
  return static_cast<std::uint8_t>(
      detail::flag_unless_within(delta_pressure, range.delta_pressure, kDeltaPressureOutside) |
      detail::flag_unless_within(angle, range.angle, kAngleOutside) |
      detail::flag_unless_within(velocity, range.speed, kSpeedOutside));
}

/// Check of the mounting, once: initial pressure and pre-tension (contraction at φ = 0).
template <class S>
[[nodiscard]] std::uint8_t mounting_outside_validity(const ValidityRange<S>& range, const S& initial_pressure,
                                                     const S& pre_tension) noexcept {
  return static_cast<std::uint8_t>(
      detail::flag_unless_within(S(initial_pressure - range.initial_pressure),
                                 range.initial_pressure_tolerance, kInitialPressureOutside) |
      detail::flag_unless_within(S(pre_tension - range.pre_tension), range.pre_tension_tolerance,
                                 kPreTensionOutside));
}

[[nodiscard]] constexpr Status validity_status(std::uint8_t flags) noexcept {
  if ((flags & kSomethingNotFinite) != 0) return Status::kNotFinite;
  return flags == 0 ? Status::kOk : Status::kOutOfRange;
}

}  // namespace isac::models
