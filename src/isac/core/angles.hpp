/// @file
/// Angles on the circle: wrapped to 0…2π or ±π, and the shortest way from one to another (seed, appendix
/// D.2.2).
///
///   wrap_to_2pi(x) = x − 2π ⌊x/2π⌋          in [0, 2π)
///   wrap_to_pi(x)  = wrap_to_2pi(x + π) − π  in [−π, π)
///   shortest_turn(a, b) = wrap_to_pi(b − a): what must be added to a to arrive at b, |·| ≤ π
///
/// Units: radian. `T` is float, double, or any scalar with +, −, ×, ÷, comparison and floor found by lookup.
/// Accuracy: the result is as near as x itself, about ulp(x); a joint that has turned a thousand times keeps
/// 1e-12 rad. Real time: no heap, no lock, constant time; safe from any thread. Errors: NaN and infinities
/// give NaN. Example: `shortest_turn(0.1, 6.2)` is −0.183, not 6.1.
#pragma once

#include <cmath>

#include "isac/core/units.hpp"

namespace isac {

template <typename T>
[[nodiscard]] T wrap_to_2pi(const T& angle) noexcept {
  using std::floor;
  const T circle = T(2.0 * kPi);
  const T wrapped = angle - circle * floor(angle / circle);
  // Rounding can land on the far end: −1e-20 + 2π is 2π in floating point, and 2π is 0 on the circle; and,
  // for a quotient that rounds up to a whole number, a hair below 0.
  if (wrapped >= circle) return wrapped - circle;
  return wrapped < T(0.0) ? T(0.0) : wrapped;
}

template <typename T>
[[nodiscard]] T wrap_to_pi(const T& angle) noexcept {
  const T half = T(kPi);
  if (angle >= -half && angle < half) return angle;  // not a bit is lost where nothing is to be done
  const T wrapped = wrap_to_2pi(T(angle + half)) - half;
  return wrapped >= half ? T(-half) : wrapped;
}

template <typename T>
[[nodiscard]] T shortest_turn(const T& from, const T& to) noexcept {
  return wrap_to_pi(T(to - from));
}

}  // namespace isac
