/// @file
/// The Soft Arm of the seed: its Denavit-Hartenberg chain, and its inverse kinematics with up to eight
/// solutions.
///
///   θ1 = atan2(py, px) − atan2(l2, ±√(px² + py² − l2²))                                    4.19, mended
///   s3 = (l1² … ) / (2 l3 l4),  c3 = ±√(1 − s3²)                                           4.22
///   θ2 = θ23 − θ3 from c23, s23                                                            4.26, 4.27
///   θ4, θ5, θ6 from the rotation, and once more with the wrist flipped                      4.29 to 4.34,
///   mended
///
/// Shapes and units: m, rad; a pose is 0_T_6, the wrist's frame (the tool lies l5 beyond it along −x6).
/// Real time: fixed size, no heap, no lock, noexcept. Errors: `InverseKinematics::reach` says why there is no
/// solution; a singular wrist (θ5 = 0, only θ4 + θ6 is determined) or a singular shoulder (wrist on axis one)
/// is said per solution, and the free angle is taken from `near`. Source: seed 4.3, appendix G,
/// tables 4.1, 4.3; docs/errata.md for every mended form. Example: `auto found = soft_arm_inverse(geometry,
/// pose, near);`
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "isac/models/arm/chain.hpp"

namespace isac::models {

/// Table 4.1. The left arm has l2 < 0 (seed 4.3: d3 = −l2).
template <class S>
struct SoftArmGeometry {
  S l1 = S(0.510), l2 = S(0.200), l3 = S(0.330), l4 = S(0.290), l5 = S(0.160);
  S m1 = S(1.750), m2 = S(0.450), m3 = S(0.140);
};

template <class S>
[[nodiscard]] constexpr SoftArmGeometry<S> left_soft_arm(SoftArmGeometry<S> right = {}) noexcept {
  right.l2 = -right.l2;
  return right;
}

/// Table 4.3 with d4 = +l4 (errata), masses m1 to m3 at their places, the tool centre point at m3.
template <class S>
[[nodiscard]] constexpr Chain<S, 6> soft_arm_chain(const SoftArmGeometry<S>& g) noexcept {
  constexpr double kQuarterTurn = 1.57079632679489661923;
  const S quarter = S(kQuarterTurn);  // the cast says that float rounds it
  Chain<S, 6> chain;
  chain.links = {{{S(0), S(0), g.l1, S(0)},
                  {-quarter, S(0), S(0), S(0)},
                  {S(0), -g.l3, g.l2, S(0)},
                  {quarter, S(0), g.l4, S(0)},
                  {-quarter, S(0), S(0), S(0)},
                  {quarter, S(0), S(0), S(0)}}};
  // m1 hangs on link 2 at (−l3/2, 0, l2); m2 on link 3, a quarter turn about x and −l4/2 along: (0, −l4/2,
  // 0).
  chain.masses[0] = {1, {S(-0.5) * g.l3, S(0), g.l2}, g.m1};
  chain.masses[1] = {2, {S(0), S(-0.5) * g.l4, S(0)}, g.m2};
  chain.masses[2] = {5, {-g.l5, S(0), S(0)}, g.m3};
  chain.mass_count = 3;
  chain.tool_link = 5;
  chain.tool = {-g.l5, S(0), S(0)};
  return chain;
}

enum class Reach : std::uint8_t {
  kReachable,
  kTooFar,          ///< beyond the stretched arm
  kTooNear,         ///< inside what the folded arm can reach
  kInsideShoulder,  ///< nearer to axis one than the shoulder's width |l2|
  kNotFinite,
};

[[nodiscard]] constexpr const char* describe(Reach reach) noexcept {
  switch (reach) {
    case Reach::kReachable:
      return "reachable";
    case Reach::kTooFar:
      return "beyond the stretched arm";
    case Reach::kTooNear:
      return "nearer than the folded arm can reach";
    case Reach::kInsideShoulder:
      return "nearer to the first axis than the shoulder is wide";
    case Reach::kNotFinite:
      return "not a number";
  }
  return "unknown";
}

template <class S>
struct InverseSolution {
  JointVector<S, 6> theta{};    ///< arm angles in ±π
  bool wrist_singular = false;  ///< θ5 ≈ 0: only θ4 + θ6 is determined
  bool shoulder_singular =
      false;  ///< the wrist lies on axis two's normal plane through the shoulder: θ2 is free
};

template <class S>
struct InverseKinematics {
  Reach reach = Reach::kNotFinite;
  int count = 0;
  std::array<InverseSolution<S>, 8> solutions{};
};

/// Angle brought into ±π.
template <class S>
[[nodiscard]] S wrap_to_pi(const S& angle) noexcept {
  using std::floor;
  constexpr double kPiExact = 3.14159265358979323846;
  const S turn = S(2 * kPiExact);
  return angle - turn * floor((angle + S(kPiExact)) / turn);
}

/// All solutions for the wrist pose `pose`; `near` gives the angle that a singular pose leaves free.
template <class S>
[[nodiscard]] InverseKinematics<S> soft_arm_inverse(const SoftArmGeometry<S>& g, const Transform<S>& pose,
                                                    const JointVector<S, 6>& near) noexcept {
  using std::atan2;
  using std::cos;
  using std::hypot;
  using std::isfinite;
  using std::sin;
  using std::sqrt;
  InverseKinematics<S> result;
  const S px = pose.p.x, py = pose.p.y, pz = pose.p.z;
  for (const auto& row : pose.r) {
    for (const S& entry : row) {
      if (!isfinite(entry)) return result;
    }
  }
  if (!isfinite(px) || !isfinite(py) || !isfinite(pz)) return result;

  const S h = pz - g.l1;
  const S across2 = px * px + py * py - g.l2 * g.l2;  // squared distance along the arm's plane
  const S reach2 = across2 + h * h;
  const S s3 = (g.l3 * g.l3 + g.l4 * g.l4 - reach2) / (S(2) * g.l3 * g.l4);  // 4.22
  const S slack = S(1e-9);  // rounding at the border of the workspace is not "unreachable"
  if (across2 < -slack) {
    result.reach = Reach::kInsideShoulder;
    return result;
  }
  if (s3 < S(-1) - slack) {
    result.reach = Reach::kTooFar;
    return result;
  }
  if (s3 > S(1) + slack) {
    result.reach = Reach::kTooNear;
    return result;
  }
  result.reach = Reach::kReachable;
  const S across = across2 > S(0) ? sqrt(across2) : S(0);
  const S clamped = s3 > S(1) ? S(1) : (s3 < S(-1) ? S(-1) : s3);
  const S c3_size = sqrt((S(1) - clamped) * (S(1) + clamped));

  for (int shoulder = 0; shoulder < 2; ++shoulder) {
    const S root = shoulder == 0 ? across : -across;
    const S theta1 = atan2(py, px) - atan2(g.l2, root);  // 4.19, mended
    const S c1 = cos(theta1), s1 = sin(theta1);
    const S u = c1 * px + s1 * py;  // along the arm's plane
    for (int elbow = 0; elbow < 2; ++elbow) {
      const S c3 = elbow == 0 ? c3_size : -c3_size;
      const S theta3 = atan2(clamped, c3);
      // u = s23 l4 − c2 l3, h = c23 l4 + s2 l3 (4.20), solved for c23, s23: 4.26, 4.27
      const S c23_part = (-c3 * u - clamped * h) * g.l3 + h * g.l4;
      const S s23_part = -((clamped * u - c3 * h) * g.l3 - u * g.l4);
      const bool shoulder_singular = u * u + h * h < S(1e-16);
      const S theta2 = shoulder_singular ? near[1] : atan2(s23_part, c23_part) - theta3;
      const S theta23 = theta2 + theta3;
      const S c23 = cos(theta23), s23 = sin(theta23);
      const auto& r = pose.r;
      const S y4 = -r[0][2] * s1 + r[1][2] * c1;  // 4.29, mended
      const S x4 = r[0][2] * c1 * c23 + r[1][2] * s1 * c23 - r[2][2] * s23;
      const bool wrist_singular = hypot(x4, y4) < S(1e-7);
      for (int flip = 0; flip < 2; ++flip) {
        const S theta4 = wrist_singular ? near[3] + (flip == 0 ? S(0) : S(3.14159265358979323846))
                                        : (flip == 0 ? atan2(y4, x4) : atan2(-y4, -x4));  // 4.34
        const S c4 = cos(theta4), s4 = sin(theta4);
        const S s5 =
            r[0][2] * (c1 * c23 * c4 - s1 * s4) + r[1][2] * (s1 * c23 * c4 + c1 * s4) - r[2][2] * s23 * c4;
        const S c5 = r[0][2] * c1 * s23 + r[1][2] * s1 * s23 + r[2][2] * c23;  // 4.31, mended
        const S theta5 = atan2(s5, c5);
        const S cos5 = cos(theta5), sin5 = sin(theta5);
        const S s6 =
            -r[0][0] * (c1 * c23 * s4 + s1 * c4) - r[1][0] * (s1 * c23 * s4 - c1 * c4) + r[2][0] * s23 * s4;
        const S c6 = r[0][0] * ((c1 * c23 * c4 - s1 * s4) * cos5 - c1 * s23 * sin5) +
                     r[1][0] * ((s1 * c23 * c4 + c1 * s4) * cos5 - s1 * s23 * sin5) -
                     r[2][0] * (s23 * c4 * cos5 + c23 * sin5);  // 4.33, mended
        InverseSolution<S>& solution = result.solutions[static_cast<std::size_t>(result.count++)];
        solution.theta = {wrap_to_pi(theta1), wrap_to_pi(theta2), wrap_to_pi(theta3),
                          wrap_to_pi(theta4), wrap_to_pi(theta5), wrap_to_pi(atan2(s6, c6))};
        solution.wrist_singular = wrist_singular;
        solution.shoulder_singular = shoulder_singular;
      }
    }
  }
  return result;
}

/// Limits of the actuators' angles φ, rad.
template <class S>
struct JointLimits {
  JointVector<S, 6> lower{}, upper{};
};

/// Index of the solution inside the limits (checked on the actuators' angles φ = K⁻¹ θ) that is nearest to
/// `near` in arm angles, the largest turn of any joint being the distance; −1 when none is inside.
template <class S>
[[nodiscard]] int nearest_solution(const InverseKinematics<S>& found, const JointVector<S, 6>& near,
                                   const std::array<JointVector<S, 6>, 6>& inverse_coupling,
                                   const JointLimits<S>& limits) noexcept {
  using std::abs;
  int best = -1;
  S best_turn(0);
  for (int i = 0; i < found.count; ++i) {
    const JointVector<S, 6>& theta = found.solutions[static_cast<std::size_t>(i)].theta;
    bool inside = true;
    for (std::size_t row = 0; row < 6 && inside; ++row) {
      S phi(0);
      for (std::size_t j = 0; j < 6; ++j) phi += inverse_coupling[row][j] * theta[j];
      inside = phi >= limits.lower[row] && phi <= limits.upper[row];
    }
    if (!inside) continue;
    S turn(0);
    for (std::size_t j = 0; j < 6; ++j) {
      const S step = abs(wrap_to_pi(theta[j] - near[j]));
      if (step > turn) turn = step;
    }
    if (best < 0 || turn < best_turn) {
      best = i;
      best_turn = turn;
    }
  }
  return best;
}

}  // namespace isac::models
