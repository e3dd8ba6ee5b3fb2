// R2: a straight line is a straight line, at its speed, or it is refused before anything moves.
#pragma GCC diagnostic ignored \
    "-Wfloat-conversion"  // the seed's lengths are written as doubles, also for float arms
#include "isac/control/trajectory.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <random>

#include "isac/core/units.hpp"

namespace {

using namespace isac::control;
using namespace isac::models;

using Line = LineTrajectory<double, 512>;
using Joints = JointVector<double, 6>;
constexpr double kQuarter = isac::kPi / 4;

ArmReach<double> soft_arm(double limit = 2.8) {
  ArmReach<double> arm;
  arm.middle = {0, -kQuarter, -kQuarter, 0, 2 * kQuarter, 0};
  for (std::size_t i = 0; i < 6; ++i) {
    arm.limits.lower[i] = -limit;
    arm.limits.upper[i] = limit;
    arm.speed[i] = 2 * isac::kPi;
  }
  return arm;
}

Transform<double> wrist_of(const ArmReach<double>& arm, const Joints& phi) {
  Joints theta = multiply<double, 6>(arm.coupling, phi);
  for (std::size_t i = 0; i < 6; ++i) theta[i] += arm.middle[i];
  return chain_frames(soft_arm_chain(arm.geometry), theta)[5];
}

Vec3<double> hand_of(const ArmReach<double>& arm, const Joints& phi) {
  return wrist_of(arm, phi).apply(soft_arm_chain(arm.geometry).tool);
}

double distance(const Vec3<double>& a, const Vec3<double>& b) {
  return std::sqrt(dot(a - b, a - b));
}

Coupling<double, 6> inverse_of(const ArmReach<double>& arm) {
  Coupling<double, 6> inverse;
  const isac::Status status = inverse_coupling<double, 6>(arm.coupling, inverse);
  EXPECT_EQ(status, isac::Status::kOk);
  return inverse;
}

/// Distance of a point from the line through a and b.
double off_line(const Vec3<double>& x, const Vec3<double>& a, const Vec3<double>& b) {
  const Vec3<double> n = cross(b - a, x - a);
  return std::sqrt(dot(n, n)) / distance(a, b);
}

TEST(Trajectory, has_points_two_millimetres_apart_on_the_line_at_the_rate_of_the_seed) {
  const auto arm = soft_arm();
  const Vec3<double> from = hand_of(arm, {}), to = from + Vec3<double>{0, 0.1, 0.2};
  Line line;
  const auto check = line.plan(arm, {}, to, 0.2);
  ASSERT_EQ(check.refusal, LineRefusal::kNone);
  const double length = std::sqrt(0.05);
  ASSERT_EQ(line.count(), static_cast<int>(std::ceil(length / 0.002)) + 1);
  EXPECT_NEAR(line.duration(), length / 0.2, 1e-12);
  EXPECT_NEAR(1 / line.period(), 0.2 / 0.002,
              0.2 / 0.002 * 0.01);  // f = v/s; s shortened so that it divides the length
  const auto start = wrist_of(arm, {});
  for (int k = 0; k < line.count(); ++k) {
    const double share = k / double(line.count() - 1);
    const auto wrist = wrist_of(arm, line.point(k));
    EXPECT_LT(distance(hand_of(arm, line.point(k)), from + share * (to - from)),
              1e-9);  // the inverse kinematics' own
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(wrist.r[r][c], start.r[r][c], 1e-9);  // the hand keeps its direction
    if (k > 0) {
      EXPECT_LE(distance(hand_of(arm, line.point(k)), hand_of(arm, line.point(k - 1))), 0.002 + 1e-9);
    }
  }
}

TEST(Trajectory, stays_on_the_line_between_its_points_and_knows_its_speed) {
  const auto arm = soft_arm();
  const Vec3<double> from = hand_of(arm, {}), to = from + Vec3<double>{0, 0, 0.2};
  Line line;
  ASSERT_EQ(line.plan(arm, {}, to, 0.2).refusal, LineRefusal::kNone);
  EXPECT_EQ(line.count(), 101);  // 200 mm / 2 mm
  EXPECT_NEAR(line.period(), 0.01, 1e-9);
  const double h = 1e-6;
  for (double t = 0.0004; t < line.duration(); t += 0.0037) {
    const auto now = line.at(t), later = line.at(t + h), before = line.at(t - h);
    EXPECT_LT(off_line(hand_of(arm, now.angle), from, to),
              2e-6);  // 1 µm is s²/8 over the arm's reach, and no more
    const double speed = distance(hand_of(arm, later.angle), hand_of(arm, before.angle)) / (2 * h);
    if (t > 0.01 && t < line.duration() - 0.01) {
      EXPECT_NEAR(speed, 0.2, 0.002);
    }
    for (std::size_t i = 0; i < 6; ++i) {
      EXPECT_NEAR(now.velocity[i], (later.angle[i] - before.angle[i]) / (2 * h), 1e-5);
      const double inside = std::fmod(t, line.period());
      if (inside > 2 * h && inside < line.period() - 2 * h) {
        EXPECT_NEAR(now.acceleration[i], (later.velocity[i] - before.velocity[i]) / (2 * h), 1e-3);
      }
    }
  }
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(line.at(-1).velocity[i], 0);
    EXPECT_EQ(line.at(99).velocity[i], 0);
    EXPECT_EQ(line.at(99).angle[i], line.point(100)[i]);
    EXPECT_NEAR(line.at(1e-9).velocity[i], 0, 1e-5);
  }
}

TEST(Trajectory, says_which_point_cannot_be_reached_and_why) {
  auto arm = soft_arm();
  arm.speed.fill(
      1e3);  // the elbow of an arm that is nearly stretched turns without bound: refused before, at any speed
  arm.largest_turn = 0.5;
  const Vec3<double> from = hand_of(arm, {});
  Line line;
  ASSERT_EQ(line.plan(arm, {}, from + Vec3<double>{0, 0, 0.01}, 0.2).refusal, LineRefusal::kNone);
  const auto check = line.plan(arm, {}, from + Vec3<double>{-0.6, 0, 0}, 0.2);
  EXPECT_EQ(check.refusal, LineRefusal::kUnreachable);
  EXPECT_EQ(check.reach, Reach::kTooFar);
  EXPECT_GT(check.point, 0);
  EXPECT_LT(check.position.x, from.x);
  EXPECT_EQ(line.count(), 0);  // nothing is left of the line before either
  EXPECT_EQ(line.at(0.1).angle, Joints{});
  // The point before the refused one is inside the stretched arm: l3 + l4 from the shoulder.
  const auto wrist = wrist_of(arm, {});
  const double beyond = check.point / 300.0;
  const Vec3<double> last = wrist.p + beyond * Vec3<double>{-0.6, 0, 0};
  const double reach =
      std::sqrt(last.x * last.x + last.y * last.y - 0.04 + (last.z - 0.51) * (last.z - 0.51));
  EXPECT_GT(reach, 0.62);
  EXPECT_LT(reach, 0.622);
}

TEST(Trajectory, names_the_joint_whose_limits_end_the_line) {
  auto arm = soft_arm();
  arm.limits.upper[1] = 0.2;
  arm.limits.lower[1] = -0.2;
  Line line;
  const auto check = line.plan(arm, {}, hand_of(arm, {}) + Vec3<double>{0, 0, 0.3}, 0.2);
  EXPECT_EQ(check.refusal, LineRefusal::kOutsideLimits);
  EXPECT_EQ(check.joint, 1);
  EXPECT_GT(check.point, 10);
  const auto at_once = line.plan(arm, {0, 0.5, 0, 0, 0, 0}, hand_of(arm, {}), 0.2);
  EXPECT_EQ(at_once.refusal, LineRefusal::kOutsideLimits);  // it stands outside already
  EXPECT_EQ(at_once.point, 0);
}

TEST(Trajectory, refuses_a_jump_of_the_wrist_and_speeds_that_no_joint_has) {
  // θ5 goes close by 0 with θ4 elsewhere: within a few points the wrist would have to turn by a large angle.
  auto arm = soft_arm(20);
  const Joints start = multiply<double, 6>(inverse_of(arm), {0, 0, 0, 0.3, -2 * kQuarter + 0.15, 0});
  Line line;
  int jumps = 0;
  for (const double x : {-0.1, 0.0, 0.1}) {
    for (const double z : {-0.1, 0.0, 0.1}) {
      const auto check = line.plan(arm, start, hand_of(arm, start) + Vec3<double>{x, 0, z}, 0.001);
      if (check.refusal != LineRefusal::kJump) continue;
      ++jumps;
      EXPECT_EQ(line.count(), 0);
      EXPECT_GT(check.point, 0);
    }
  }
  EXPECT_GE(jumps, 1);  // lines towards θ5 = 0; those away from it pass
  EXPECT_LE(jumps, 6);
  const auto fast = line.plan(soft_arm(), {}, hand_of(arm, {}) + Vec3<double>{0, 0, 0.1}, 20);
  EXPECT_EQ(fast.refusal, LineRefusal::kTooFast);
  EXPECT_GE(fast.joint, 0);
}

TEST(Trajectory, refuses_what_is_no_line) {
  const auto arm = soft_arm();
  const Vec3<double> from = hand_of(arm, {});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Line line;
  EXPECT_EQ(line.plan(arm, {}, {nan, 0, 0}, 0.2).refusal, LineRefusal::kNotFinite);
  EXPECT_EQ(line.plan(arm, {nan}, from, 0.2).refusal, LineRefusal::kNotFinite);
  EXPECT_EQ(line.plan(arm, {}, from, 0).refusal, LineRefusal::kBadSettings);
  auto singular = arm;
  singular.coupling[3] = singular.coupling[2];
  EXPECT_EQ(line.plan(singular, {}, from, 0.2).refusal, LineRefusal::kBadSettings);
  LineTrajectory<double, 20> small;
  EXPECT_EQ(small.plan(arm, {}, from + Vec3<double>{0, 0, 0.1}, 0.2).refusal, LineRefusal::kTooLong);
  // No way to go: one point, where the arm is.
  EXPECT_EQ(line.plan(arm, {}, from, 0.2).refusal, LineRefusal::kNone);
  EXPECT_EQ(line.count(), 1);
  EXPECT_EQ(line.duration(), 0);
}

TEST(Trajectory, holds_its_promises_on_random_lines) {
  auto arm = soft_arm(1.6);
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> pose(-1.2, 1.2), way(-0.4, 0.4), speed(0.05, 1.0);
  auto line = std::make_unique<Line>();
  int accepted = 0, refused = 0;
  for (int n = 0; n < 400; ++n) {
    Joints start;
    for (double& angle : start) angle = pose(random);
    const Vec3<double> from = hand_of(arm, start),
                       to = from + Vec3<double>{way(random), way(random), way(random)};
    const double v = speed(random);
    const auto check = line->plan(arm, start, to, v);
    if (check.refusal != LineRefusal::kNone) {
      ++refused;
      ASSERT_EQ(line->count(), 0);
      continue;
    }
    ++accepted;
    ASSERT_LT(distance(hand_of(arm, line->point(line->count() - 1)), to), 1e-9);
    for (int k = 0; k < line->count(); ++k) {
      ASSERT_LT(off_line(hand_of(arm, line->point(k)), from, to), 1e-8);
      for (std::size_t i = 0; i < 6; ++i) {
        ASSERT_LE(std::abs(line->point(k)[i]), 1.6);
        if (k == 0) continue;
        ASSERT_LE(std::abs(line->point(k)[i] - line->point(k - 1)[i]), arm.speed[i] * line->period() + 1e-12);
      }
    }
  }
  EXPECT_GT(accepted, 20);
  EXPECT_GT(refused, 20);
}

TEST(Trajectory, runs_in_the_microcontrollers_single_precision) {
  const auto wide = soft_arm();
  ArmReach<float> arm;
  for (std::size_t i = 0; i < 6; ++i) {
    arm.middle[i] = static_cast<float>(wide.middle[i]);
    arm.limits.lower[i] = -2.8f;
    arm.limits.upper[i] = 2.8f;
    arm.speed[i] = 6.28f;
  }
  const Vec3<double> to = hand_of(wide, {}) + Vec3<double>{0, 0.05, 0.1};
  LineTrajectory<float, 128> line;
  Line exact;
  ASSERT_EQ(exact.plan(wide, {}, to, 0.2).refusal, LineRefusal::kNone);
  ASSERT_EQ(line.plan(arm, {}, {float(to.x), float(to.y), float(to.z)}, 0.2f).refusal, LineRefusal::kNone);
  ASSERT_EQ(line.count(), exact.count());
  for (int k = 0; k < line.count(); ++k)
    for (std::size_t i = 0; i < 6; ++i)
      EXPECT_NEAR(line.point(k)[i], exact.point(k)[i], 1e-5);  // some 50 ulp of a turn
}

}  // namespace
