/// @file
/// A straight line of the hand at a speed, checked to its last point before anything moves (seed 6.2, D.2.2; row R2).
///
///   points x_k = x_0 + k (x_1 − x_0)/n,  n = ⌈|x_1 − x_0| / s⌉,  s = 2 mm; a new point every s'/v, f = v/s'      seed 6.2
///   θ_k by inverse kinematics, the hand turned as at the start; φ_k = K⁻¹ (θ_k − middle)
///   between the points a cubic through φ_k with the slopes (φ_(k+1) − φ_(k−1))/2 (Catmull, Rom), at rest at both ends
///
/// The seed hands over each point as a step; the cubic passes the same points at the same times and gives the speed and the
/// acceleration that compensation and feed-forward ask for. Of the up to eight solutions of a point the one nearest to the point before is
/// taken; angles are not brought back into ±π, so that a joint may pass it. A line is refused, with the point and the
/// reason, if a point cannot be reached, lies outside a joint's limits, asks a joint to jump (a singular wrist, another
/// branch), or to turn faster than its limit. A refused line holds no points.
///
/// Shapes: six joints; Capacity points are held inside. Units: m, rad, s. Real time: plan() costs one inverse kinematics per point
/// and belongs outside the loop; at() is constant time; no heap, noexcept. Threads: at() is const. Errors: as `LineCheck`.
/// Source: seed 6.2, figure 6.1. Example: `LineTrajectory<double, 512> line; line.plan(arm, start, goal, 0.2);`
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "isac/control/finite.hpp"
#include "isac/models/arm/coupling.hpp"
#include "isac/models/arm/soft_arm.hpp"
#include "isac/models/scalar.hpp"

namespace isac::control {

/// What a trajectory must know of an arm.
template <class S>
struct ArmReach {
  models::SoftArmGeometry<S> geometry;
  models::Coupling<S, 6> coupling = models::soft_arm_coupling<S>();  ///< θ = K φ + middle
  models::JointVector<S, 6> middle{};                                ///< rad
  models::JointLimits<S> limits;                                     ///< of φ, rad
  models::JointVector<S, 6> speed{};                                 ///< rad/s, of φ, |φ̇| at most
  S spacing = S(0.002);                                              ///< m, s
  S largest_turn = S(0.1);  ///< rad, of any θ from one point to the next
};

enum class LineRefusal : std::uint8_t {
  kNone,
  kNotFinite,      ///< a value is NaN or infinite
  kBadSettings,    ///< speed, spacing or a limit is not above 0, limits the wrong way round, or K is singular
  kTooLong,        ///< more points than there is room for
  kUnreachable,    ///< `reach` says why
  kOutsideLimits,  ///< every solution lies outside the limits of a joint
  kJump,           ///< the nearest solution is further away than `largest_turn`
  kTooFast,        ///< `joint` would have to turn faster than its limit
};

[[nodiscard]] constexpr const char* describe(LineRefusal refusal) noexcept {
  switch (refusal) {
    case LineRefusal::kNone:
      return "reachable";
    case LineRefusal::kNotFinite:
      return "a value is not a number";
    case LineRefusal::kBadSettings:
      return "speed, spacing and limits must be above zero and the coupling invertible";
    case LineRefusal::kTooLong:
      return "more points than there is room for";
    case LineRefusal::kUnreachable:
      return "a point cannot be reached";
    case LineRefusal::kOutsideLimits:
      return "a point lies outside the limits of the joints";
    case LineRefusal::kJump:
      return "the joints would have to jump from one point to the next";
    case LineRefusal::kTooFast:
      return "a joint would have to turn faster than it may";
  }
  return "unknown";
}

template <class S>
struct LineCheck {
  LineRefusal refusal = LineRefusal::kNone;
  models::Reach reach = models::Reach::kReachable;
  int point = 0;             ///< the one that was refused, from 0
  int joint = -1;            ///< 0 … 5 where one joint is to blame
  models::Vec3<S> position;  ///< m, of that point
};

/// Desired motion of all joints at one instant.
template <class S>
struct LinePoint {
  models::JointVector<S, 6> angle{}, velocity{}, acceleration{};
};

template <class S, std::size_t Capacity>
class LineTrajectory {
 public:
  /// From the joints' angles `start` straight to `goal` (tool centre point, base frame) at `speed`, m/s.
  [[nodiscard]] LineCheck<S> plan(const ArmReach<S>& arm, const models::JointVector<S, 6>& start,
                                  const models::Vec3<S>& goal, const S& speed) noexcept {
    count_ = 0;
    LineCheck<S> check;
    Walk walk{.theta = models::multiply<S, 6>(arm.coupling, start), .phi = start};
    for (std::size_t i = 0; i < 6; ++i) walk.theta[i] += arm.middle[i];
    check.refusal = settings(arm, start, goal, speed, walk.inverse);
    if (check.refusal != LineRefusal::kNone) return check;

    const models::Chain<S, 6> chain = models::soft_arm_chain(arm.geometry);
    const models::Transform<S> wrist = models::chain_frames(chain, walk.theta)[5];
    const models::Vec3<S> origin = wrist.apply(chain.tool), way = goal - origin;
    const S length = std::sqrt(dot(way, way));
    check.position = goal;
    if (!(length / arm.spacing < S(Capacity - 1))) {
      check.refusal = LineRefusal::kTooLong;
      return check;
    }
    const S exact =
        length / arm.spacing - S(1e-4);  // a whole number of points may have come out a rounding too high
    const int whole = exact > S(0) ? static_cast<int>(exact) : -1;
    const int steps = whole + 1;
    period_ = steps > 0 ? S(length / speed / S(steps)) : S(1);
    for (int k = 0; k <= steps; ++k) {
      const S share = steps > 0 ? S(S(k) / S(steps)) : S(0);
      models::Transform<S> pose = wrist;
      pose.p = wrist.p + share * way;
      check.point = k;
      check.position = origin + share * way;
      next(arm, pose, walk, check);
      if (check.refusal != LineRefusal::kNone) {
        count_ = 0;
        return check;
      }
      points_[static_cast<std::size_t>(k)] = walk.phi;
      count_ = k + 1;
    }
    return check;
  }

  [[nodiscard]] int count() const noexcept { return count_; }
  /// s from one point to the next: the seed's 1/f_v.
  [[nodiscard]] S period() const noexcept { return period_; }
  [[nodiscard]] S duration() const noexcept { return count_ > 1 ? S(S(count_ - 1) * period_) : S(0); }
  [[nodiscard]] const models::JointVector<S, 6>& point(int k) const noexcept {
    return points_[static_cast<std::size_t>(k)];
  }

  /// Where the joints are to be `time` seconds after the start: at rest at the first point before, at the last one after.
  /// All zero without points.
  [[nodiscard]] LinePoint<S> at(const S& time) const noexcept {
    LinePoint<S> out;
    if (count_ == 0) return out;
    if (!(time > S(0)) || count_ == 1) {
      out.angle = points_[0];
      return out;
    }
    if (!(time < duration())) {
      out.angle = points_[static_cast<std::size_t>(count_ - 1)];
      return out;
    }
    int k = static_cast<int>(time / period_);
    if (k > count_ - 2) k = count_ - 2;
    const S u = time / period_ - S(k);
    for (std::size_t i = 0; i < 6; ++i) {
      const S a = points_[static_cast<std::size_t>(k)][i],
              rise = points_[static_cast<std::size_t>(k + 1)][i] - a;
      const S m0 = slope(k, i), m1 = slope(k + 1, i);
      const S b = S(3) * rise - S(2) * m0 - m1, c = m0 + m1 - S(2) * rise;  // a + m0 u + b u² + c u³
      out.angle[i] = a + u * (m0 + u * (b + u * c));
      out.velocity[i] = (m0 + u * (S(2) * b + u * S(3) * c)) / period_;
      out.acceleration[i] = (S(2) * b + u * S(6) * c) / (period_ * period_);
    }
    return out;
  }

 private:
  struct Walk {  ///< the point before, and K⁻¹
    models::JointVector<S, 6> theta{}, phi{};
    models::Coupling<S, 6> inverse{};
  };

  [[nodiscard]] static LineRefusal settings(const ArmReach<S>& arm, const models::JointVector<S, 6>& start,
                                            const models::Vec3<S>& goal, const S& speed,
                                            models::Coupling<S, 6>& inverse) noexcept {
    if (!finite(goal.x, goal.y, goal.z, speed, arm.spacing, arm.largest_turn)) return LineRefusal::kNotFinite;
    for (std::size_t i = 0; i < 6; ++i)
      if (!finite(start[i], arm.middle[i])) return LineRefusal::kNotFinite;
    bool good = speed > S(0) && arm.spacing > S(0) && arm.largest_turn > S(0);
    for (std::size_t i = 0; i < 6; ++i)
      good = good && arm.speed[i] > S(0) && arm.limits.lower[i] < arm.limits.upper[i];
    good = good && ok(models::inverse_coupling<S, 6>(arm.coupling, inverse));
    return good ? LineRefusal::kNone : LineRefusal::kBadSettings;
  }

  /// The nearest solution inside the limits becomes the walk's point, or `check` says why there is none.
  void next(const ArmReach<S>& arm, const models::Transform<S>& pose, Walk& walk,
            LineCheck<S>& check) const noexcept {
    const models::InverseKinematics<S> found = models::soft_arm_inverse(arm.geometry, pose, walk.theta);
    check.reach = found.reach;
    if (found.reach != models::Reach::kReachable) {
      check.refusal = LineRefusal::kUnreachable;
      return;
    }
    Walk best;
    S best_turn(-1), outside_turn(-1);
    int outside_joint = -1;
    for (int n = 0; n < found.count; ++n) {
      models::JointVector<S, 6> theta = found.solutions[static_cast<std::size_t>(n)].theta, from_middle;
      S turn(0);
      for (std::size_t i = 0; i < 6; ++i) {
        const S change = models::wrap_to_pi(S(theta[i] - walk.theta[i]));
        theta[i] = walk.theta[i] + change;
        from_middle[i] = theta[i] - arm.middle[i];
        if (models::magnitude(change) > turn) turn = models::magnitude(change);
      }
      const models::JointVector<S, 6> phi = models::multiply<S, 6>(walk.inverse, from_middle);
      const int blamed = outside(arm.limits, phi);
      if (blamed >= 0) {
        if (outside_joint < 0 || turn < outside_turn) {
          outside_joint = blamed;
          outside_turn = turn;
        }
      } else if (best_turn < S(0) || turn < best_turn) {
        best_turn = turn;
        best.theta = theta;
        best.phi = phi;
      }
    }
    const bool lost = outside_joint >= 0 && !(best_turn >= S(0) && best_turn <= outside_turn);
    if (lost && outside_turn <= arm.largest_turn) {  // the branch that the arm is on leaves the limits
      check.refusal = LineRefusal::kOutsideLimits;
      check.joint = outside_joint;
      return;
    }
    if (best_turn < S(0) || best_turn > arm.largest_turn) {
      check.refusal = best_turn < S(0) ? LineRefusal::kOutsideLimits : LineRefusal::kJump;
      check.joint = best_turn < S(0) ? outside_joint : -1;
      return;
    }
    for (std::size_t i = 0; i < 6; ++i) {
      if (check.point == 0 || models::magnitude(S(best.phi[i] - walk.phi[i])) <= arm.speed[i] * period_)
        continue;
      check.refusal = LineRefusal::kTooFast;
      check.joint = static_cast<int>(i);
      return;
    }
    walk.theta = best.theta;
    walk.phi = best.phi;
  }

  /// The first joint outside its limits, −1 if none is.
  [[nodiscard]] static int outside(const models::JointLimits<S>& limits,
                                   const models::JointVector<S, 6>& phi) noexcept {
    for (std::size_t i = 0; i < 6; ++i)
      if (!(phi[i] >= limits.lower[i] && phi[i] <= limits.upper[i])) return static_cast<int>(i);
    return -1;
  }

  /// dφ/dk at point k; at rest at both ends.
  [[nodiscard]] S slope(int k, std::size_t i) const noexcept {
    if (k == 0 || k == count_ - 1) return S(0);
    return (points_[static_cast<std::size_t>(k + 1)][i] - points_[static_cast<std::size_t>(k - 1)][i]) / S(2);
  }

  std::array<models::JointVector<S, 6>, Capacity> points_{};
  int count_ = 0;
  S period_ = S(1);
};

}  // namespace isac::control
