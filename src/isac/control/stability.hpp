/// @file
/// Characteristic polynomials of the loops, and Hurwitz's criterion: what tuning may stand on (seed 5.1.3, 5.3.3).
///
///   PID        (1 + T_C s)(1 + 2 ζ T_J s + T_J² s²) s + K_C K_J (K_D s² + K_P s + K_I) = 0                  5.2, 5.3 mended
///   PI-PI      (J s² + D s − A r²)(1 + T_C s) s² + J s² · B r (K_Pτ s + K_Iτ) s
///                + B r (K_Pτ s + K_Iτ)(K_Pp s + K_Ip) = 0                                        5.9, 5.10 mended (D = 0)
///   PI-MBPI    (J s² + D s − A r²)(1 + T_C s)(s + R) s + R (s (A r² − D s) + K_Pp s + K_Ip) = 0,
///                where s + R stands for s + B r (K_Pτ s + K_Iτ): the model sees Δp *commanded*, the joint Δp behind T_C
///   Hurwitz    a_0 s^n + … + a_n: H_ij = a_(2j−i), minors H_1 … H_n; all roots left of 0 ⇔ a_0 > 0 and all H_i > 0
///   inner loop of PI-MBPI, sampled: u_k = K_P e_k + …, e_k of u_(k−1):  z² − z (1 − a − b) − a = 0, a = B r K_Pτ,
///                b = B r K_Iτ h; stable ⇔ b > 0 and a + b/2 < 1
///
/// Coefficients stand from the highest power down. The printed forms and numbers are in tests/control/stability_test.cpp.
/// Units: SI throughout; K_J in rad/Pa with K in Pa/rad, or both per kg/cm². Real time: fixed size, no heap, noexcept; not
/// meant for the loop. Threads: pure. Errors: none; NaN in, "not stable" out.
/// Source: docs/derivations/stability.md, docs/errata.md. Example: `is_hurwitz(pid_polynomial(plant, valve, gains))`.
#pragma once

#include <array>
#include <cstddef>

#include "isac/control/pid.hpp"
#include "isac/models/joint_motion.hpp"
#include "isac/models/joint_torque.hpp"
#include "isac/models/scalar.hpp"
#include "isac/models/valve_unit.hpp"

namespace isac::control {

template <class S, std::size_t Order>
using Polynomial = std::array<S, Order + 1>;  ///< a_0 s^n + a_1 s^(n−1) + … + a_n

/// p q.
template <class S, std::size_t P, std::size_t Q>
[[nodiscard]] constexpr std::array<S, P + Q - 1> product(const std::array<S, P>& p,
                                                         const std::array<S, Q>& q) noexcept {
  std::array<S, P + Q - 1> r{};
  for (std::size_t i = 0; i < P; ++i)
    for (std::size_t j = 0; j < Q; ++j) r[i + j] += p[i] * q[j];
  return r;
}

/// p + q, where q has at most p's order.
template <class S, std::size_t P, std::size_t Q>
[[nodiscard]] constexpr std::array<S, P> sum(std::array<S, P> p, const std::array<S, Q>& q) noexcept {
  static_assert(Q <= P);
  for (std::size_t i = 0; i < Q; ++i) p[P - Q + i] += q[i];
  return p;
}

/// Position → Δp by a PID, through the valve unit's lag and the joint's second-order lag.
template <class S>
[[nodiscard]] constexpr Polynomial<S, 4> pid_polynomial(const models::SecondOrder<S>& joint,
                                                        const models::ValveUnit<S>& valve,
                                                        const PidGains<S>& k) noexcept {
  const S t = joint.time_constant, gain = valve.gain * joint.gain;
  const std::array<S, 2> lag = {valve.lag, S(1.0)};
  const std::array<S, 3> motion = {t * t, S(2.0) * joint.damping * t, S(1.0)};
  const std::array<S, 2> s = {S(1.0), S(0.0)};
  return sum(product(product(lag, motion), s),
             std::array<S, 3>{gain * k.derivative, gain * k.proportional, gain * k.integral});
}

template <class S>
struct CascadeLoop {
  models::JointCoefficients<S> muscle{};  ///< C does not enter a linear loop
  S wheel_radius{}, inertia{};
  models::ValveUnit<S> valve{};
  PidGains<S> position{}, torque{};  ///< K_D is not used
};

namespace detail {
/// (J s² + D s − A r²)(1 + T_C s).
template <class S>
[[nodiscard]] constexpr Polynomial<S, 3> cascade_plant(const CascadeLoop<S>& l) noexcept {
  const S r = l.wheel_radius;
  return product(std::array<S, 3>{l.inertia, l.muscle.D, -(l.muscle.A * r * r)},
                 std::array<S, 2>{l.valve.lag, S(1.0)});
}
/// K_C B r (K_Pτ s + K_Iτ).
template <class S>
[[nodiscard]] constexpr std::array<S, 2> torque_pi(const CascadeLoop<S>& l) noexcept {
  const S gain = l.valve.gain * l.muscle.B * l.wheel_radius;
  return {gain * l.torque.proportional, gain * l.torque.integral};
}
template <class S>
[[nodiscard]] constexpr std::array<S, 2> position_pi(const CascadeLoop<S>& l) noexcept {
  return {l.position.proportional, l.position.integral};
}
}  // namespace detail

/// PI-PI with the torque that turns the joint, J φ̈, fed back without delay: the seed's proof. D = 0 gives 5.10.
template <class S>
[[nodiscard]] constexpr Polynomial<S, 5> cascade_polynomial(const CascadeLoop<S>& l) noexcept {
  const auto inner = product(std::array<S, 4>{l.inertia, S(0.0), S(0.0), S(0.0)}, detail::torque_pi(l));
  const auto plant = product(detail::cascade_plant(l), std::array<S, 3>{S(1.0), S(0.0), S(0.0)});
  return sum(sum(plant, inner), product(detail::torque_pi(l), detail::position_pi(l)));
}

/// PI-MBPI as it runs: the torque fed back is the model's, of Δp commanded.
template <class S>
[[nodiscard]] constexpr Polynomial<S, 5> model_based_polynomial(const CascadeLoop<S>& l) noexcept {
  const S r = l.wheel_radius;
  const std::array<S, 2> modelled = {l.muscle.B * r * l.torque.proportional,
                                     l.muscle.B * r * l.torque.integral};
  const std::array<S, 2> controller = {S(1.0) + modelled[0], modelled[1]};  // s (1 + R B r)
  const auto plant = product(product(detail::cascade_plant(l), controller), std::array<S, 2>{S(1.0), S(0.0)});
  const std::array<S, 3> fed_back = {-l.muscle.D, l.muscle.A * r * r + l.position.proportional,
                                     l.position.integral};
  return sum(plant, product(detail::torque_pi(l), fed_back));
}

/// The largest B r (K_Pτ + K_Iτ h/2) at which the sampled inner loop of PI-MBPI stays stable is 1; this is its value.
template <class S>
[[nodiscard]] constexpr S inner_loop_use(const CascadeLoop<S>& l, const S& sample_time) noexcept {
  return l.muscle.B * l.wheel_radius * (l.torque.proportional + l.torque.integral * sample_time / S(2.0));
}

/// Leading minors H_1 … H_n of the Hurwitz matrix, by Gaussian elimination with exchange of rows.
template <class S, std::size_t Size>
[[nodiscard]] constexpr std::array<S, Size - 1> hurwitz_minors(const std::array<S, Size>& a) noexcept {
  constexpr std::size_t kOrder = Size - 1;
  std::array<S, kOrder> minors{};
  for (std::size_t n = 1; n <= kOrder; ++n) {
    std::array<std::array<S, kOrder>, kOrder> h{};
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j)
        if (2 * j + 1 >= i && 2 * j + 1 - i <= kOrder) h[i][j] = a[2 * j + 1 - i];
    S determinant(1.0);
    for (std::size_t column = 0; column < n; ++column) {
      std::size_t pivot = column;
      for (std::size_t i = column + 1; i < n; ++i)
        if (models::magnitude(h[i][column]) > models::magnitude(h[pivot][column])) pivot = i;
      if (pivot != column) {
        const std::array<S, kOrder> row = h[pivot];
        h[pivot] = h[column];
        h[column] = row;
        determinant = -determinant;
      }
      determinant *= h[column][column];
      if (h[column][column] == S(0.0)) break;
      for (std::size_t i = column + 1; i < n; ++i) {
        const S factor = h[i][column] / h[column][column];
        for (std::size_t j = column; j < n; ++j) h[i][j] -= factor * h[column][j];
      }
    }
    minors[n - 1] = determinant;
  }
  return minors;
}

/// All roots left of the imaginary axis?
template <class S, std::size_t Size>
[[nodiscard]] constexpr bool is_hurwitz(const std::array<S, Size>& a) noexcept {
  if (!(a[0] > S(0.0))) return false;
  for (const S& minor : hurwitz_minors(a))
    if (!(minor > S(0.0))) return false;
  return true;
}

}  // namespace isac::control
