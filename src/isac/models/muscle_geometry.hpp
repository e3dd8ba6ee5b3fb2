/// @file
/// Muscle models that follow from the geometry of the thread: Schulte (M1), Chou-Hannaford thin and thick wall (M3).
///
///   l = b cos Θ,  D = b sin Θ/(n π) = D0 sin Θ,  D0 = b/(n π) the diameter at Θ = 90°
///   M1   F = π D0² p/4 (3 cos² Θ − 1)                                            seed 2.1, 2.10
///   M3   F = −p dV/dl,  V = π/4 D² l             = b² p (3 cos² Θ − 1)/(4 π n²)    seed 2.6 to 2.9 (printed without p)
///        F = −p dV/dl,  V = π/4 (D − 2d)² l      = M1 + p π (D0 d (2 sin Θ − 1/sin Θ) − d²)   seed 2.11, 2.12
///   Θ by contraction: cos Θ = (1 − ε) cos Θ0, Θ0 the thread's angle in the unloaded, uninflated muscle (ε = 0).
///
/// Units: Pa (gauge), m, rad, N (pull positive); ε = (l0 − l)/l0. Range: |(1 − ε) cos Θ0| ≤ 1; NaN outside (sqrt).
/// Real time: no heap, no lock, noexcept, templated on the scalar; safe from any thread. Errors: none; NaN goes through.
/// Source: seed 2.3.1; Chou, Hannaford 1994, 1996; derivation in docs/derivations/muscle_models.md.
/// Example: `force(SchulteMuscle<double>{.diameter = 0.02, .rest_angle = 0.4}, 3e5, 0.1)`.
#pragma once

#include <cmath>

#include "isac/core/units.hpp"

namespace isac::models {

template <class S>
struct SchulteMuscle {
  S diameter{};    ///< m, D0, at a thread angle of 90°
  S rest_angle{};  ///< rad, Θ0
};

template <class S>
struct ThinWallMuscle {
  S thread_length{};  ///< m, b
  S turns{};          ///< -, n
  S rest_angle{};     ///< rad, Θ0
};

template <class S>
struct ThickWallMuscle {
  S thread_length{};  ///< m, b
  S turns{};          ///< -, n
  S rest_angle{};     ///< rad, Θ0
  S wall{};           ///< m, d: shell and bladder together, taken as constant
};

/// cos Θ at contraction ε.
template <class S>
[[nodiscard]] S thread_cosine(const S& rest_angle, const S& contraction) noexcept {
  using std::cos;
  return (S(1.0) - contraction) * cos(rest_angle);
}

/// Seed 2.1 with the thread's angle Θ itself.
template <class S>
[[nodiscard]] S schulte_force(const S& diameter, const S& pressure, const S& thread_angle) noexcept {
  using std::cos;
  const S c = cos(thread_angle);
  return S(kPi / 4) * diameter * diameter * pressure * (S(3.0) * c * c - S(1.0));
}

template <class S>
[[nodiscard]] S force(const SchulteMuscle<S>& m, const S& pressure, const S& contraction,
                      const S& /*rate*/ = S(0.0)) noexcept {
  const S c = thread_cosine(m.rest_angle, contraction);
  return S(kPi / 4) * m.diameter * m.diameter * pressure * (S(3.0) * c * c - S(1.0));
}

template <class S>
[[nodiscard]] S force(const ThinWallMuscle<S>& m, const S& pressure, const S& contraction,
                      const S& /*rate*/ = S(0.0)) noexcept {
  const S c = thread_cosine(m.rest_angle, contraction);
  const S b_per_n = m.thread_length / m.turns;
  return b_per_n * b_per_n * pressure * (S(3.0) * c * c - S(1.0)) / S(4.0 * kPi);
}

template <class S>
[[nodiscard]] S force(const ThickWallMuscle<S>& m, const S& pressure, const S& contraction,
                      const S& /*rate*/ = S(0.0)) noexcept {
  using std::sqrt;
  const S c = thread_cosine(m.rest_angle, contraction);
  const S s = sqrt(S(1.0) - c * c);
  const S diameter = m.thread_length / (m.turns * S(kPi));
  const S thin = S(kPi / 4) * diameter * diameter * pressure * (S(3.0) * c * c - S(1.0));
  const S wall_part = diameter * m.wall * (S(2.0) * s - S(1.0) / s) - m.wall * m.wall;
  return thin + pressure * S(kPi) * wall_part;
}

/// Volume of the thin (wall = 0) or thick muscle, m³: what −p dV/dl is taken of (seed 2.7, 2.11).
template <class S>
[[nodiscard]] S volume(const ThickWallMuscle<S>& m, const S& contraction) noexcept {
  using std::sqrt;
  const S c = thread_cosine(m.rest_angle, contraction);
  const S inner = m.thread_length / (m.turns * S(kPi)) * sqrt(S(1.0) - c * c) - S(2.0) * m.wall;
  return S(kPi / 4) * inner * inner * m.thread_length * c;
}

}  // namespace isac::models
