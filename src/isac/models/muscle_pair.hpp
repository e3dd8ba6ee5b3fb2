/// @file
/// Two muscles on a chain wheel (M7), of any muscle model that has a `force`.
///
///   l1 = l0 + r φ,  l2 = l0 − r φ,  ε_i = (l_max − l_i)/l_max,  T = (F2 − F1) r          seed 2.1.1, 3.2, 3.3
///
/// For the Bridgestone muscle (M2) and l_max = l0 this is, without remainder,
///   T = 2 D0² a r³/l0² Δp φ² − 2 D0² (p1 + p2) a r²/l0 φ + D0² r (2a − 2b) Δp             seed 3.4
/// (M2 is a quadratic in l, so its second-order expansion is the whole); for l_max ≠ l0, a stands for a (l0/l_max)².
///
/// Units: Pa (gauge), m, rad, N m. Δp > 0 moves φ positive. A muscle only pulls, but the models give negative forces
/// beyond their zero; `slack` cuts them off.
/// Real time: no heap, no lock, noexcept, templated on the scalar; safe from any thread. Errors: none; NaN goes through.
/// Source: docs/derivations/muscle_pair.md. Example: `pair_torque(pair, p1, p2, angle, velocity)`.
#pragma once

#include "isac/models/joint_torque.hpp"
#include "isac/models/muscle_empirical.hpp"
#include "isac/models/scalar.hpp"

namespace isac::models {

template <template <class> class Muscle, class S>
struct MusclePair {
  Muscle<S> muscle_1{}, muscle_2{};
  S middle_length{};   ///< m, l0: of both at φ = 0
  S maximal_length{};  ///< m, l_max: uninflated, unloaded; l0 = (1 − pre-contraction) l_max
  S wheel_radius{};    ///< m, r
  bool slack = false;  ///< true: a muscle that would push gives no force
};

template <class S>
struct PairForces {
  S force_1{}, force_2{};  ///< N
};

template <template <class> class Muscle, class S>
[[nodiscard]] PairForces<S> pair_forces(const MusclePair<Muscle, S>& pair, const S& pressure_1,
                                        const S& pressure_2, const S& angle,
                                        const S& velocity = S(0.0)) noexcept {
  const S travel = pair.wheel_radius * angle;
  const S rate = pair.wheel_radius * velocity / pair.maximal_length;
  const S contraction_1 = S(1.0) - (pair.middle_length + travel) / pair.maximal_length;
  const S contraction_2 = S(1.0) - (pair.middle_length - travel) / pair.maximal_length;
  PairForces<S> f{.force_1 = force(pair.muscle_1, pressure_1, contraction_1, S(-rate)),
                  .force_2 = force(pair.muscle_2, pressure_2, contraction_2, rate)};
  if (pair.slack) f = {.force_1 = positive_part(f.force_1), .force_2 = positive_part(f.force_2)};
  return f;
}

template <template <class> class Muscle, class S>
[[nodiscard]] S pair_torque(const MusclePair<Muscle, S>& pair, const S& pressure_1, const S& pressure_2,
                            const S& angle, const S& velocity = S(0.0)) noexcept {
  const PairForces<S> f = pair_forces(pair, pressure_1, pressure_2, angle, velocity);
  return (f.force_2 - f.force_1) * pair.wheel_radius;
}

/// Parameters of seed 3.5: T = a' Δp r³ φ² + b' r² φ + c' Δp r.
template <class S>
struct PairCoefficients {
  S a{};  ///< N/(Pa m²), a'
  S b{};  ///< N/m, b' = A of seed 3.7
  S c{};  ///< N/Pa, c' = B of seed 3.7
};

/// Of a pair of equal Bridgestone muscles at p1 + p2 = 2 p0 (seed 3.4, 3.5).
template <class S>
[[nodiscard]] PairCoefficients<S> pair_coefficients(const BridgestoneMuscle<S>& m, const S& middle_length,
                                                    const S& maximal_length,
                                                    const S& mean_pressure) noexcept {
  const S area = m.diameter * m.diameter;
  const S a = m.a * middle_length * middle_length / (maximal_length * maximal_length);
  return {.a = S(2.0) * area * a / (middle_length * middle_length),
          .b = -(S(4.0) * area * mean_pressure * a / middle_length),
          .c = S(2.0) * area * (a - m.b)};
}

/// Seed 3.5.
template <class S>
[[nodiscard]] S pair_torque(const PairCoefficients<S>& k, const S& delta_pressure, const S& angle,
                            const S& wheel_radius) noexcept {
  const S travel = wheel_radius * angle;
  return wheel_radius * (k.a * delta_pressure * travel * travel + k.b * travel + k.c * delta_pressure);
}

}  // namespace isac::models
