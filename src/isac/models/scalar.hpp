/// @file
/// The few functions that the equations need beyond <cmath>, for double, float and ceres::Jet alike.
///
/// Kinks are exact: sgn(0) = 0, and the derivative at a kink is the one of the branch that is taken.
/// Real time: no heap, no lock, noexcept. Errors: none; NaN goes through.
#pragma once

namespace isac::models {

template <class S>
[[nodiscard]] constexpr S sgn(const S& x) noexcept {
  if (x > S(0.0)) return S(1.0);
  if (x < S(0.0)) return S(-1.0);
  return x == x ? S(0.0) : x;
}

template <class S>
[[nodiscard]] constexpr S magnitude(const S& x) noexcept {
  return x < S(0.0) ? S(-x) : x;
}

/// x for x > 0, else 0.
template <class S>
[[nodiscard]] constexpr S positive_part(const S& x) noexcept {
  return x <= S(0.0) ? S(0.0) : x;
}

/// What is left of x outside the dead zone ±width.
template <class S>
[[nodiscard]] constexpr S dead_zone(const S& x, const S& width) noexcept {
  if (x > width) return x - width;
  if (x < -width) return x + width;
  return x == x ? S(0.0) : x;
}

template <class S>
[[nodiscard]] constexpr S clamp(const S& x, const S& low, const S& high) noexcept {
  if (x < low) return low;
  if (x > high) return high;
  return x;
}

}  // namespace isac::models
