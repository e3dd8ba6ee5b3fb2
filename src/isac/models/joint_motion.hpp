/// @file
/// Motion of the joint (seed 4.2): I φ̈ = T + T_ext, and what its linear part (C = 0) looks like to a controller.
///
///   T_J = sqrt(−I/(A r²)),  ζ = D/(2 sqrt(−A r² I)),  K_J = −B/(A r)
///   F_J(s) = K_J/(1 + 2 ζ T_J s + T_J² s²)                                              seed 4.4 to 4.6, mended ζ
///   Step response y, ω_d = sqrt(1 − ζ²)/T_J: the steepest point is at t_i = acos(ζ)/ω_d;
///   latency T_L = t_i − y(t_i)/ẏ(t_i), adjustment time T_A = K_J/ẏ(t_i)                    seed 4.2, figure 4.4
///
/// Units: SI; K_J in rad/Pa. T_L/T_A below 0.1 is easy to control, above 0.8 hardly at all.
/// Real time: no heap, no lock, noexcept, templated on the scalar; safe from any thread.
/// Errors: kOutOfRange where A r² ≥ 0 or I ≤ 0 (no oscillator), or ζ outside 0…1 (no inflection tangent of this form).
/// Source: docs/derivations/joint_model.md. Example: `second_order(testbed_parameters<double>(), 0.019, 0.0085, out)`.
#pragma once

#include <cmath>

#include "isac/core/status.hpp"
#include "isac/models/joint_torque.hpp"

namespace isac::models {

template <class S>
[[nodiscard]] constexpr S joint_acceleration(const S& inertia, const S& torque,
                                             const S& external_torque) noexcept {
  return (torque + external_torque) / inertia;
}

template <class S>
struct SecondOrder {
  S time_constant{};  ///< s, T_J
  S damping{};        ///< -, ζ
  S gain{};           ///< rad/Pa, K_J
};

template <class S>
[[nodiscard]] Status second_order(const JointCoefficients<S>& q, const S& wheel_radius, const S& inertia,
                                  SecondOrder<S>& out) noexcept {
  using std::sqrt;
  const S stiffness = -(q.A * wheel_radius * wheel_radius);
  if (!(stiffness > S(0.0)) || !(inertia > S(0.0))) return Status::kOutOfRange;
  out = {.time_constant = sqrt(inertia / stiffness),
         .damping = q.D / (S(2.0) * sqrt(stiffness * inertia)),
         .gain = -(q.B / (q.A * wheel_radius))};
  return Status::kOk;
}

template <class S>
struct StepShape {
  S latency{};     ///< s, T_L
  S adjustment{};  ///< s, T_A
};

template <class S>
[[nodiscard]] Status step_shape(const SecondOrder<S>& joint, StepShape<S>& out) noexcept {
  using std::acos;
  using std::exp;
  using std::sin;
  using std::sqrt;
  const S z = joint.damping;
  if (!(z >= S(0.0)) || !(z < S(1.0)) || !(joint.time_constant > S(0.0))) return Status::kOutOfRange;
  const S root = sqrt(S(1.0) - z * z);
  const S omega_d = root / joint.time_constant;
  const S phase = acos(z);  // ω_d t_i
  const S steepest = phase / omega_d;
  const S decay = exp(-z * phase / root);
  // Of a step of gain 1: ẏ(t_i) = e^(−ζ t_i/T_J)/T_J, for sin(acos ζ) = √(1 − ζ²); y(t_i) = 1 − 2 ζ e^(−ζ t_i/T_J).
  const S slope = decay / joint.time_constant;
  const S height = S(1.0) - S(2.0) * z * decay;
  out = {.latency = steepest - height / slope, .adjustment = S(1.0) / slope};
  return Status::kOk;
}

}  // namespace isac::models
