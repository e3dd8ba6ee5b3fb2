/// @file
/// Muscle models whose constants are identified: Bridgestone (M2), Cai-Yamaura (M4), Kerscher (M5), a polynomial and
/// a second-order black box (M6).
///
///   M2   F = D0² p (a (1 − ε)² − b)                                            seed 2.2, 3.1
///   M4   F = α (1 − ε)² p + β p − ω ε̇ + γ                                      seed 2.13 (ω = 0), 2.14
///   M5   F = π r0² p (a (1 − ε(p) κ)² − b) + σ(−κ) (−f0) κ,  ε(p) = a_ε e^(−p/p_e) − b_ε       seed 2.15 to 2.19
///   M6a  F = Σ_{i+j≤3} c_ij (p/p_u)^i ε^j
///   M6b  F = F0 + F1 p − (K0 + K1 p) ε − (B0 + B1 p) ε̇
///
/// κ is Kerscher's name of the contraction; his e^(−p) has p in bar, so p_e = 1e5 Pa. f0 > 0: a muscle stretched beyond
/// its length pulls. σ(0) does not matter, for the term is 0 there: F is continuous at κ = 0 with a kink of −f0.
/// M6b is the muscle's part of M x″ + B(p) x′ + K(p) x = F_ce(p) − load; the mass is the joint's, not the muscle's.
///
/// Units: Pa (gauge), N (pull positive), ε dimensionless, ε̇ 1/s.
/// Real time: no heap, no lock, noexcept, templated on the scalar; safe from any thread. Errors: none; NaN goes through.
/// Source: seed 2.3.1; M6a after Caldwell, Medrano-Cerda, Goodwin 1995, M6b after Repperger 1998 and Reynolds 2003;
/// docs/derivations/muscle_models.md says which form was taken and why.
/// Example: `force(BridgestoneMuscle<double>{.diameter = 0.012, .a = 60, .b = 35}, 3e5, 0.1)`.
#pragma once

#include <cmath>

#include "isac/core/units.hpp"
#include "isac/models/muscle_geometry.hpp"

namespace isac::models {

template <class S>
struct BridgestoneMuscle {
  S diameter{};  ///< m, D0, before displacement
  S a{};         ///< -
  S b{};         ///< -
};

template <class S>
struct CaiYamauraMuscle {
  S alpha{};  ///< N/Pa
  S beta{};   ///< N/Pa, negative: −D0² b of M2
  S gamma{};  ///< N
  S omega{};  ///< N s
};

template <class S>
struct KerscherMuscle {
  S radius{};                     ///< m, r0
  S a{};                          ///< -
  S b{};                          ///< -
  S a_epsilon{};                  ///< -
  S b_epsilon = S(-1.0);          ///< -, so that ε(p) → 1 at high pressure
  S stretch_stiffness{};          ///< N, f0
  S pressure_unit = S(100000.0);  ///< Pa, p_e: 1 bar
};

/// Coefficients in the order 1, p, ε, p², p ε, ε², p³, p² ε, p ε², ε³, p in units of `pressure_unit`.
template <class S>
struct PolynomialMuscle {
  static constexpr int kTerms = 10;
  S c[kTerms]{};                  ///< N
  S pressure_unit = S(100000.0);  ///< Pa, p_u: 1 bar
};

template <class S>
struct SecondOrderMuscle {
  S force_0{};                 ///< N, F0
  S force_per_pressure{};      ///< N/Pa, F1
  S stiffness_0{};             ///< N, K0
  S stiffness_per_pressure{};  ///< N/Pa, K1
  S damping_0{};               ///< N s, B0
  S damping_per_pressure{};    ///< N s/Pa, B1
};

template <class S>
[[nodiscard]] S force(const BridgestoneMuscle<S>& m, const S& pressure, const S& contraction,
                      const S& /*rate*/ = S(0.0)) noexcept {
  const S u = S(1.0) - contraction;
  return m.diameter * m.diameter * pressure * (m.a * u * u - m.b);
}

template <class S>
[[nodiscard]] S force(const CaiYamauraMuscle<S>& m, const S& pressure, const S& contraction,
                      const S& rate = S(0.0)) noexcept {
  const S u = S(1.0) - contraction;
  return m.alpha * u * u * pressure + m.beta * pressure - m.omega * rate + m.gamma;
}

/// Seed 2.17.
template <class S>
[[nodiscard]] S kerscher_epsilon(const KerscherMuscle<S>& m, const S& pressure) noexcept {
  using std::exp;
  return m.a_epsilon * exp(-pressure / m.pressure_unit) - m.b_epsilon;
}

template <class S>
[[nodiscard]] S force(const KerscherMuscle<S>& m, const S& pressure, const S& contraction,
                      const S& /*rate*/ = S(0.0)) noexcept {
  const S u = S(1.0) - kerscher_epsilon(m, pressure) * contraction;
  const S pneumatic = S(kPi) * m.radius * m.radius * pressure * (m.a * u * u - m.b);
  return contraction < S(0.0) ? S(pneumatic - m.stretch_stiffness * contraction) : pneumatic;
}

template <class S>
[[nodiscard]] S force(const PolynomialMuscle<S>& m, const S& pressure, const S& contraction,
                      const S& /*rate*/ = S(0.0)) noexcept {
  const S p = pressure / m.pressure_unit;
  const S& e = contraction;
  const S* c = m.c;
  return c[0] + p * (c[1] + p * (c[3] + p * c[6])) + e * (c[2] + p * (c[4] + p * c[7])) +
         e * e * (c[5] + p * c[8] + e * c[9]);
}

template <class S>
[[nodiscard]] S force(const SecondOrderMuscle<S>& m, const S& pressure, const S& contraction,
                      const S& rate = S(0.0)) noexcept {
  return m.force_0 + m.force_per_pressure * pressure -
         (m.stiffness_0 + m.stiffness_per_pressure * pressure) * contraction -
         (m.damping_0 + m.damping_per_pressure * pressure) * rate;
}

/// The seed's substitution: b = π/4, a = 3π/4 (l0/b_thread)² = 3π/4 cos² Θ0, D0 the diameter at 90°. M2 is then M1.
template <class S>
[[nodiscard]] BridgestoneMuscle<S> bridgestone_of(const SchulteMuscle<S>& m) noexcept {
  using std::cos;
  const S c = cos(m.rest_angle);
  return {.diameter = m.diameter, .a = S(3.0 * kPi / 4) * c * c, .b = S(kPi / 4)};
}

/// α = D0² a, β = −D0² b, γ = ω = 0.
template <class S>
[[nodiscard]] CaiYamauraMuscle<S> cai_yamaura_of(const BridgestoneMuscle<S>& m) noexcept {
  const S area = m.diameter * m.diameter;
  return {.alpha = area * m.a, .beta = -(area * m.b), .gamma = S(0.0), .omega = S(0.0)};
}

}  // namespace isac::models
