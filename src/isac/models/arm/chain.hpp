/// @file
/// A serial arm of N turning joints with point masses: where its frames are, what gravity and inertia ask of
/// its joints.
///
///   0_T_k   = Π dh(i)                                      direct kinematics (seed 4.11)
///   J_j(q)  = z_j × (q − o_j)   for a point q on link k ≥ j   its Jacobian (seed 4.42 to 4.48, all rows)
///   τ_g     = Σ_m J_mᵀ m g                                  torque of gravity on the joints (4.39, 4.49)
///   M       = Σ_m m J_mᵀ J_m                                mass matrix; M(1,1) is I_1 of 4.37 with the
///   factor ½ taken out
///
/// Shapes: θ and τ have N entries (arm angles of the convention, not actuator angles; see coupling.hpp); M is
/// N × N. Units: m, rad, kg, N m. `gravity` points the way things fall, (0, 0, −9.81) m/s² for an upright
/// base. Real time: fixed size, no heap, no lock, noexcept; the trigonometry is N sines and cosines. Source:
/// seed 4.3, 4.4; errata of 4.36, 4.37, 4.48. Example: tests/models/arm_test.cpp.
#pragma once

#include <array>

#include "isac/models/arm/transform.hpp"

namespace isac::models {

template <class S, int N>
using JointVector = std::array<S, static_cast<std::size_t>(N)>;

/// A mass fixed to link `link` (0 … N−1), at `position` in that link's frame.
template <class S>
struct PointMass {
  int link = 0;
  Vec3<S> position;
  S mass{0};
};

inline constexpr int kMaxMasses = 8;

template <class S, int N>
struct Chain {
  std::array<DhLink<S>, static_cast<std::size_t>(N)> links{};
  std::array<PointMass<S>, kMaxMasses> masses{};
  int mass_count = 0;
  int tool_link = N - 1;  ///< link that carries the tool centre point
  Vec3<S> tool;           ///< tool centre point in that link's frame
  Vec3<S> gravity{S(0), S(0), S(-9.81)};
};

/// Frames 0_T_1 … 0_T_N for the angles θ.
template <class S, int N>
[[nodiscard]] std::array<Transform<S>, static_cast<std::size_t>(N)> chain_frames(
    const Chain<S, N>& chain, const JointVector<S, N>& theta) noexcept {
  std::array<Transform<S>, static_cast<std::size_t>(N)> frames;
  Transform<S> so_far;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    so_far = so_far * dh_transform(chain.links[i], theta[i]);
    frames[i] = so_far;
  }
  return frames;
}

/// Position of the tool centre point in the base frame (seed 4.12 with its errata).
template <class S, int N>
[[nodiscard]] Vec3<S> tool_position(const Chain<S, N>& chain, const JointVector<S, N>& theta) noexcept {
  return chain_frames(chain, theta)[static_cast<std::size_t>(chain.tool_link)].apply(chain.tool);
}

/// Columns of the translational Jacobian of the point `position` on link `link`; columns behind the link are
/// zero.
template <class S, int N>
[[nodiscard]] std::array<Vec3<S>, static_cast<std::size_t>(N)> point_jacobian(
    const std::array<Transform<S>, static_cast<std::size_t>(N)>& frames, int link,
    const Vec3<S>& position) noexcept {
  std::array<Vec3<S>, static_cast<std::size_t>(N)> columns{};
  const Vec3<S> q = frames[static_cast<std::size_t>(link)].apply(position);
  for (std::size_t j = 0; j <= static_cast<std::size_t>(link); ++j) {
    columns[j] = cross(frames[j].z_axis(), q - frames[j].p);
  }
  return columns;
}

/// Torque of gravity on every joint per kilogram of the mass `mass` (so that masses are a linear problem).
template <class S, int N>
[[nodiscard]] JointVector<S, N> gravity_per_kilogram(
    const Chain<S, N>& chain, const std::array<Transform<S>, static_cast<std::size_t>(N)>& frames,
    int mass) noexcept {
  JointVector<S, N> torque{};
  const PointMass<S>& point = chain.masses[static_cast<std::size_t>(mass)];
  const auto columns = point_jacobian<S, N>(frames, point.link, point.position);
  for (std::size_t j = 0; j < torque.size(); ++j) torque[j] = dot(columns[j], chain.gravity);
  return torque;
}

/// Derivative of gravity_per_kilogram by the angles: entry (j, l) = ∂τ_j/∂θ_l = g · (z_a × (z_b × (q − o_b))),
/// a = min(j, l), b = max(j, l); symmetric, as the second derivative of the potential energy is.
template <class S, int N>
[[nodiscard]] std::array<JointVector<S, N>, static_cast<std::size_t>(N)> gravity_gradient_per_kilogram(
    const Chain<S, N>& chain, const std::array<Transform<S>, static_cast<std::size_t>(N)>& frames,
    int mass) noexcept {
  std::array<JointVector<S, N>, static_cast<std::size_t>(N)> gradient{};
  const PointMass<S>& point = chain.masses[static_cast<std::size_t>(mass)];
  const auto columns = point_jacobian<S, N>(frames, point.link, point.position);
  for (std::size_t b = 0; b <= static_cast<std::size_t>(point.link); ++b) {
    for (std::size_t a = 0; a <= b; ++a) {
      gradient[a][b] = dot(cross(frames[a].z_axis(), columns[b]), chain.gravity);
      gradient[b][a] = gradient[a][b];
    }
  }
  return gradient;
}

/// τ_g: the torque that gravity exerts on every joint; the actuators must give −τ_g to hold the arm.
template <class S, int N>
[[nodiscard]] JointVector<S, N> gravity_torque(const Chain<S, N>& chain,
                                               const JointVector<S, N>& theta) noexcept {
  const auto frames = chain_frames(chain, theta);
  JointVector<S, N> torque{};
  for (int m = 0; m < chain.mass_count; ++m) {
    const auto share = gravity_per_kilogram(chain, frames, m);
    for (std::size_t j = 0; j < torque.size(); ++j)
      torque[j] += chain.masses[static_cast<std::size_t>(m)].mass * share[j];
  }
  return torque;
}

/// M(θ) of the point masses, row by row.
template <class S, int N>
[[nodiscard]] std::array<JointVector<S, N>, static_cast<std::size_t>(N)> mass_matrix(
    const Chain<S, N>& chain, const JointVector<S, N>& theta) noexcept {
  const auto frames = chain_frames(chain, theta);
  std::array<JointVector<S, N>, static_cast<std::size_t>(N)> matrix{};
  for (int m = 0; m < chain.mass_count; ++m) {
    const PointMass<S>& point = chain.masses[static_cast<std::size_t>(m)];
    const auto columns = point_jacobian<S, N>(frames, point.link, point.position);
    for (std::size_t i = 0; i < matrix.size(); ++i) {
      for (std::size_t j = 0; j <= i; ++j) matrix[i][j] += point.mass * dot(columns[i], columns[j]);
    }
  }
  for (std::size_t i = 0; i < matrix.size(); ++i) {
    for (std::size_t j = i + 1; j < matrix.size(); ++j) matrix[i][j] = matrix[j][i];
  }
  return matrix;
}

}  // namespace isac::models
