/// @file
/// What a joint may be asked for, and the last gate before the valves.
///
/// A command passes in this order: rate limit → finite check → clamp → split onto the muscles → clamp each pressure:
///   Δp' = Δp_last + clamp(Δp − Δp_last, ± rate · h)      a value that is not finite goes through the rate limit as it is
///   not finite → kNotFinite, and nothing is clamped: a controller that has lost its numbers is at fault, not at a limit
///   Δp'' = clamp(Δp', ± 2 kg/cm²)                         seed 6.3
///   p1 = clamp(p0 − Δp'', 0, p_max), p2 = clamp(p0 + Δp'', 0, p_max)                     seed 2.1.1
///
/// Units: Pa, rad, rad/s, N m. Real time: no heap, no lock, noexcept, templated on the scalar; safe from any thread.
/// Errors: kNotFinite as above; check() says kOutOfRange for limits that are empty or negative.
/// Source: seed 3.5, 6.3; order as in libfranka. Example: `condition(limits, p0, last, wanted, dt, out)`.
#pragma once

#include <cstdint>
#include <limits>

#include "isac/control/finite.hpp"
#include "isac/core/status.hpp"
#include "isac/models/joint_torque.hpp"
#include "isac/models/scalar.hpp"

namespace isac::control {

template <class S>
struct JointLimits {
  S delta_pressure = S(2.0 * kPascalPerKgfCm2);                ///< Pa, |Δp|
  S delta_pressure_rate = std::numeric_limits<S>::infinity();  ///< Pa/s
  S pressure = S(5.0 * kPascalPerKgfCm2);         ///< Pa, of either muscle: what a valve unit reaches
  S torque = std::numeric_limits<S>::infinity();  ///< N m, |T| asked of the muscle pair
  S angle_low = S(-3.0 * kPi / 8.0), angle_high = S(3.0 * kPi / 8.0);  ///< rad, of the desired angle
  S speed = S(2.0 * kPi);  ///< rad/s, how fast the desired angle may move: what the seed's sweeps reached
};

template <class S>
[[nodiscard]] Status check(const JointLimits<S>& limits) noexcept {
  const bool positive = limits.delta_pressure > S(0.0) && limits.delta_pressure_rate > S(0.0) &&
                        limits.pressure > S(0.0) && limits.torque > S(0.0) && limits.speed > S(0.0);
  return positive && limits.angle_low < limits.angle_high ? Status::kOk : Status::kOutOfRange;
}

/// What a limit changed; a set of bits.
enum LimitFlag : std::uint8_t {
  kDeltaPressureLimited = 1,
  kRateLimited = 2,
  kPressureLimited = 4,
  kTorqueLimited = 8,
  kAngleLimited = 16,
  kSpeedLimited = 32,
};

/// `wanted`, or as near to it as `largest_change` from `last` allows; what is not finite comes back as it is.
template <class S>
[[nodiscard]] constexpr S limit_change(const S& last, const S& wanted, const S& largest_change) noexcept {
  const S change = wanted - last;
  if (!finite(change)) return wanted;
  return last + models::clamp<S>(change, -largest_change, largest_change);
}

template <class S>
struct Conditioned {
  models::PressurePair<S> pressure{};  ///< Pa
  S delta_pressure{};                  ///< Pa, of that pair: what the valves are really asked for
  std::uint8_t limited = 0;            ///< LimitFlag
};

/// `out` is untouched unless the status is ok.
template <class S>
[[nodiscard]] Status condition(const JointLimits<S>& limits, const S& mean_pressure, const S& last,
                               const S& wanted, const S& dt, Conditioned<S>& out) noexcept {
  const S slowed = limit_change<S>(last, wanted, limits.delta_pressure_rate * dt);
  if (!finite(slowed, mean_pressure)) return Status::kNotFinite;
  const S held = models::clamp<S>(slowed, -limits.delta_pressure, limits.delta_pressure);
  const models::PressurePair<S> split = models::split_pressure(mean_pressure, held);
  const models::PressurePair<S> pair = {
      .muscle_1 = models::clamp<S>(split.muscle_1, S(0.0), limits.pressure),
      .muscle_2 = models::clamp<S>(split.muscle_2, S(0.0), limits.pressure)};
  const bool cut = pair.muscle_1 != split.muscle_1 || pair.muscle_2 != split.muscle_2;
  out.pressure = pair;
  out.delta_pressure = cut ? models::delta_pressure_of(pair) : held;
  out.limited =
      static_cast<std::uint8_t>((slowed != wanted ? kRateLimited : 0) |
                                (held != slowed ? kDeltaPressureLimited : 0) | (cut ? kPressureLimited : 0));
  return Status::kOk;
}

}  // namespace isac::control
