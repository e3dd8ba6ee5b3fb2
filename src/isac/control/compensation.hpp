/// @file
/// What gravity and inertia of the arm ask of its joints: the added part of PI-CMBPI (seed 5.4, D.2.2 GetStatDynModel).
///
///   θ = K φ,   τ_θ = −τ_g(θ) + share of M(θ) θ̈_d,   τ_φ = Kᵀ τ_θ            models/arm/chain, models/arm/coupling
///   share: kNone nothing, kFirstJoint M(1,1) θ̈_1d only (the seed's), kWhole the whole M θ̈_d
///
/// The acceleration is the desired one: the measured one comes out of encoder steps differentiated twice, and −M φ̈ of it
/// would be feedback of noise. The angles are the measured ones, so an arm that is led by hand is held where it is.
/// Shapes: N joints, all arrays N. Units: rad, rad/s², N m. Real time: N sines and cosines, no heap, noexcept.
/// Threads: pure. Errors: none here; what is not finite in comes out so, and the joint's controller refuses it.
/// Source: seed 4.4, 5.4 (gravity for shoulder and elbow, inertia for joint one). Example: tests/control.
#pragma once

#include <cstddef>
#include <cstdint>

#include "isac/models/arm/chain.hpp"
#include "isac/models/arm/coupling.hpp"

namespace isac::control {

enum class InertiaShare : std::uint8_t { kNone, kFirstJoint, kWhole };

/// Torques that the actuators must add, by joint (actuator) angle φ and its desired acceleration.
template <class S, int N>
[[nodiscard]] models::JointVector<S, N> compensation_torque(
    const models::Chain<S, N>& chain, const models::Coupling<S, N>& coupling,
    const models::JointVector<S, N>& angle, const models::JointVector<S, N>& desired_acceleration,
    InertiaShare share) noexcept {
  const models::JointVector<S, N> theta = models::multiply<S, N>(coupling, angle);
  models::JointVector<S, N> torque = models::gravity_torque(chain, theta);
  for (S& entry : torque) entry = -entry;
  if (share != InertiaShare::kNone) {
    const auto mass = models::mass_matrix(chain, theta);
    const auto acceleration = models::multiply<S, N>(coupling, desired_acceleration);
    if (share == InertiaShare::kFirstJoint) {
      torque[0] += mass[0][0] * acceleration[0];
    } else {
      for (std::size_t i = 0; i < torque.size(); ++i)
        for (std::size_t j = 0; j < torque.size(); ++j) torque[i] += mass[i][j] * acceleration[j];
    }
  }
  return models::multiply_transposed<S, N>(coupling, torque);
}

}  // namespace isac::control
