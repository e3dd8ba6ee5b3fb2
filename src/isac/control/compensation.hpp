/// @file
/// What gravity and inertia of the arm ask of its joints: the added part of PI-CMBPI (seed 5.4, D.2.2 GetStatDynModel).
///
///   θ = K φ,   τ_θ = −τ_g(θ) + share of M(θ) θ̈_d,   τ_φ = Kᵀ τ_θ            models/arm/chain, models/arm/coupling
///   τ_g,j = Σ m (x g_y − y g_x),   M(1,1) = Σ m (x² + y²)      in the frame of joint j: masses carried inwards, gravity outwards
///   share: kNone nothing, kFirstJoint M(1,1) θ̈_1d only (the seed's), kWhole the whole M θ̈_d
///
/// The same numbers as models::gravity_torque and models::mass_matrix to rounding, by vectors instead of frames and with a
/// quarter of the sines: those of the links' twists α are kept (LinkTwists), because no motion changes them.
/// The acceleration is the desired one: the measured one comes out of encoder steps differentiated twice, and −M φ̈ of it
/// would be feedback of noise. The angles are the measured ones, so an arm that is led by hand is held where it is.
/// Shapes: N joints, all arrays N. Units: rad, rad/s², N m. Real time: N sines and cosines, no heap, noexcept.
/// Threads: pure; LinkTwists belong to one. Errors: none here; what is not finite in comes out so, and the joint's controller
/// refuses it. Source: seed 4.4, 5.4 (gravity for shoulder and elbow, inertia for joint one). Example: tests/control/arm_test.cpp.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "isac/models/arm/chain.hpp"
#include "isac/models/arm/coupling.hpp"

namespace isac::control {

enum class InertiaShare : std::uint8_t { kNone, kFirstJoint, kWhole };

/// Sine and cosine of the twists α of a chain; another chain is noticed by its twists.
template <class S, int N>
class LinkTwists {
 public:
  struct Twist {
    S alpha{}, sine{}, cosine = S(1.0);
  };

  [[nodiscard]] const Twist& of(const models::DhLink<S>& link, std::size_t index) noexcept {
    using std::cos;
    using std::sin;
    Twist& twist = twists_[index];
    if (!(twist.alpha == link.alpha))
      twist = {.alpha = link.alpha, .sine = sin(link.alpha), .cosine = cos(link.alpha)};
    return twist;
  }

 private:
  std::array<Twist, static_cast<std::size_t>(N)> twists_{};
};

namespace detail {

/// The turn from one link to the next: about x by the twist, about z by the joint's angle (mask 4.9).
template <class S>
struct LinkTurn {
  S sine, cosine, twist_sine, twist_cosine;

  [[nodiscard]] models::Vec3<S> to_child(const models::Vec3<S>& v) const noexcept {
    const S y = twist_cosine * v.y + twist_sine * v.z;
    return {cosine * v.x + sine * y, cosine * y - sine * v.x, twist_cosine * v.z - twist_sine * v.y};
  }
  [[nodiscard]] models::Vec3<S> to_parent(const models::Vec3<S>& v) const noexcept {
    const S y = sine * v.x + cosine * v.y;
    return {cosine * v.x - sine * v.y, twist_cosine * y - twist_sine * v.z,
            twist_sine * y + twist_cosine * v.z};
  }
  /// A point, seen from the parent.
  [[nodiscard]] models::Vec3<S> place(const models::DhLink<S>& link,
                                      const models::Vec3<S>& q) const noexcept {
    models::Vec3<S> p = to_parent({q.x, q.y, q.z + link.d});
    p.x += link.a;
    return p;
  }
};

/// m M_m θ̈ of one mass, added to the torques: its acceleration from θ̈ alone, collected outwards, and what it takes, handed
/// inwards. `place` are its places in the frames 0 … link.
template <class S, int N>
void add_inertia(const models::PointMass<S>& point,
                 const std::array<LinkTurn<S>, static_cast<std::size_t>(N)>& turn,
                 const std::array<models::Vec3<S>, static_cast<std::size_t>(N)>& place,
                 const models::JointVector<S, N>& acceleration, models::JointVector<S, N>& torque) noexcept {
  const auto link = static_cast<std::size_t>(point.link);
  if (link >= turn.size()) return;  // hangs on no link of this chain
  models::Vec3<S> a;
  for (std::size_t j = 0; j <= link; ++j) {
    a = turn[j].to_child(a);
    a.x -= acceleration[j] * place[j].y;
    a.y += acceleration[j] * place[j].x;
  }
  for (std::size_t j = link + 1; j-- > 0;) {
    torque[j] += point.mass * (place[j].x * a.y - place[j].y * a.x);
    a = turn[j].to_parent(a);
  }
}

}  // namespace detail

/// Torques that the actuators must add, by joint (actuator) angle φ and its desired acceleration.
template <class S, int N>
[[nodiscard]] models::JointVector<S, N> compensation_torque(
    const models::Chain<S, N>& chain, const models::Coupling<S, N>& coupling,
    const models::JointVector<S, N>& angle, const models::JointVector<S, N>& desired_acceleration,
    InertiaShare share, LinkTwists<S, N>& twists) noexcept {
  using std::cos;
  using std::sin;
  const models::JointVector<S, N> theta = models::multiply<S, N>(coupling, angle);
  models::JointVector<S, N> bend{};
  if (share == InertiaShare::kWhole) {
    bend = models::multiply<S, N>(coupling, desired_acceleration);
  } else if (share == InertiaShare::kFirstJoint) {
    for (std::size_t i = 0; i < bend.size(); ++i) bend[0] += coupling[0][i] * desired_acceleration[i];
  }

  std::array<detail::LinkTurn<S>, static_cast<std::size_t>(N)> turn;
  std::array<models::Vec3<S>, static_cast<std::size_t>(N)> falling,
      place;  // gravity, and a mass, in each frame
  for (std::size_t j = 0; j < turn.size(); ++j) {
    const S whole = theta[j] + chain.links[j].theta_offset;
    turn[j].sine = sin(whole);
    turn[j].cosine = cos(whole);
  }
  for (std::size_t j = 0; j < turn.size(); ++j) {
    const auto& twist = twists.of(chain.links[j], j);
    turn[j].twist_sine = twist.sine;
    turn[j].twist_cosine = twist.cosine;
    falling[j] = turn[j].to_child(j == 0 ? chain.gravity : falling[j - 1]);
  }

  models::JointVector<S, N> torque{};
  for (std::size_t m = 0; m < static_cast<std::size_t>(chain.mass_count); ++m) {
    const models::PointMass<S>& point = chain.masses[m];
    if (static_cast<std::size_t>(point.link) >= turn.size()) continue;  // hangs on no link of this chain
    models::Vec3<S> q = point.position;
    for (std::size_t j = static_cast<std::size_t>(point.link);; --j) {
      place[j] = q;
      torque[j] -= point.mass * (q.x * falling[j].y - q.y * falling[j].x);
      if (j == 0) break;
      q = turn[j].place(chain.links[j], q);
    }
    if (share == InertiaShare::kFirstJoint) torque[0] += point.mass * (q.x * q.x + q.y * q.y) * bend[0];
    if (share == InertiaShare::kWhole) detail::add_inertia<S, N>(point, turn, place, bend, torque);
  }
  return models::multiply_transposed<S, N>(coupling, torque);
}

template <class S, int N>
[[nodiscard]] models::JointVector<S, N> compensation_torque(
    const models::Chain<S, N>& chain, const models::Coupling<S, N>& coupling,
    const models::JointVector<S, N>& angle, const models::JointVector<S, N>& desired_acceleration,
    InertiaShare share) noexcept {
  LinkTwists<S, N> twists;
  return compensation_torque<S, N>(chain, coupling, angle, desired_acceleration, share, twists);
}

}  // namespace isac::control
