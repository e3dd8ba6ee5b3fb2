/// @file
/// Is a number a number? Asked without <cmath>, of any scalar.
///
/// Real time: no heap, no lock, noexcept; safe from any thread. Errors: none; NaN and infinities give false.
/// Source: the house builds without -ffast-math (docs/decisions/0003). Example: `finite(angle, velocity)`.
#pragma once

namespace isac::control {

/// True when every argument is finite.
template <class... S>
[[nodiscard]] constexpr bool finite(const S&... values) noexcept {
  return ((values - values == S(0.0)) && ...);  // NOLINT(misc-redundant-expression): NaN - NaN is not 0
}

}  // namespace isac::control
