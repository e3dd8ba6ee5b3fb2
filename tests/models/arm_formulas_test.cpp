// Formulas of the seed's kinematics one by one, as printed and as mended (docs/errata.md), and Jacobians against differences.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "isac/models/arm/soft_arm.hpp"

namespace isac::models {
namespace {

using Angles = JointVector<double, 6>;
constexpr double kExact = 1e-9;  // what docs/errata.md promises of a mended form
constexpr double kClear = 1e-3;  // a printed form that is wrong is wrong by more than this somewhere
constexpr double kHalfTurn = 3.14159265358979323846;

class ArmFormulas : public ::testing::Test {
 protected:
  Angles random_angles() {
    std::uniform_real_distribution<double> angle(-kHalfTurn, kHalfTurn);
    Angles theta;
    for (double& entry : theta) entry = angle(random_);
    return theta;
  }
  std::mt19937 random_{4711};
  SoftArmGeometry<double> g_;
  Chain<double, 6> chain_ = soft_arm_chain(g_);
};

TEST_F(ArmFormulas, the_elbow_by_4_22_and_the_shoulder_by_4_26_and_4_27_hold_as_printed) {
  int tried = 0;
  for (int k = 0; k < 500; ++k) {
    const Angles t = random_angles();
    const Vec3<double> p = chain_frames(chain_, t)[5].p;
    const double c1 = std::cos(t[0]), s1 = std::sin(t[0]), c3 = std::cos(t[2]), s3 = std::sin(t[2]);
    const double squares = p.x * p.x + p.y * p.y + p.z * p.z;
    const double sine =
        (-squares + 2 * p.z * g_.l1 - g_.l1 * g_.l1 + g_.l2 * g_.l2 + g_.l3 * g_.l3 + g_.l4 * g_.l4) /
        (2 * g_.l3 * g_.l4);
    EXPECT_NEAR(sine, s3, kExact);  // 4.22
    const double below = c1 * c1 * p.x * p.x + s1 * s1 * p.y * p.y + p.z * p.z + 2 * c1 * s1 * p.x * p.y -
                         2 * g_.l1 * p.z + g_.l1 * g_.l1;
    if (below < 1e-3) continue;  // the wrist at the shoulder: θ2 is free
    ++tried;
    const double c23 =
        ((-c1 * c3 * p.x - s1 * c3 * p.y - s3 * p.z + s3 * g_.l1) * g_.l3 + (p.z - g_.l1) * g_.l4) / below;
    const double s23 =
        -((c1 * s3 * p.x + s1 * s3 * p.y - c3 * p.z + c3 * g_.l1) * g_.l3 + (-c1 * p.x - s1 * p.y) * g_.l4) /
        below;
    EXPECT_NEAR(c23, std::cos(t[1] + t[2]), kExact);  // 4.26
    EXPECT_NEAR(s23, std::sin(t[1] + t[2]), kExact);  // 4.27
  }
  EXPECT_GT(tried, 400);
}

TEST_F(ArmFormulas, distances_of_4_36_hold_for_m1_and_m2_and_need_another_y_for_m3) {
  double printed_off = 0;
  for (int k = 0; k < 200; ++k) {
    const Angles t = random_angles();
    const auto frames = chain_frames(chain_, t);
    const auto from_axis = [&](std::size_t m) {
      const PointMass<double>& mass = chain_.masses[m];
      const Vec3<double> q = frames[static_cast<std::size_t>(mass.link)].apply(mass.position);
      return std::hypot(q.x, q.y);
    };
    const double c2 = std::cos(t[1]), s23 = std::sin(t[1] + t[2]), c23 = std::cos(t[1] + t[2]);
    const double s4 = std::sin(t[3]), c4 = std::cos(t[3]), s5 = std::sin(t[4]), c5 = std::cos(t[4]);
    const double s6 = std::sin(t[5]), c6 = std::cos(t[5]);
    EXPECT_NEAR(from_axis(0), std::sqrt(0.25 * c2 * c2 * g_.l3 * g_.l3 + g_.l2 * g_.l2), kExact);
    EXPECT_NEAR(from_axis(1), std::hypot(0.5 * s23 * g_.l4 - c2 * g_.l3, g_.l2), kExact);
    const double x = -((c23 * c4 * c5 - s23 * s5) * c6 - c23 * s4 * s6) * g_.l5 + s23 * g_.l4 - c2 * g_.l3;
    EXPECT_NEAR(from_axis(2), std::hypot(x, -(s4 * c5 * c6 + c4 * s6) * g_.l5 + g_.l2), kExact);
    const double printed = std::hypot(x, (-s4 * c5 * c6 + c4 * s6) * g_.l5 + g_.l2);
    printed_off = std::max(printed_off, std::abs(printed - from_axis(2)));
  }
  EXPECT_GT(printed_off, kClear);
}

TEST_F(ArmFormulas, appendix_g_needs_a_sign_in_m2_and_a_zero_from_three_to_six) {
  double sign_off = 0, column_off = 0;
  for (int k = 0; k < 200; ++k) {
    Angles t = random_angles();
    t[0] = 0;  // seen from joint one
    const auto frames = chain_frames(chain_, t);
    const Vec3<double> m2 = frames[2].apply(chain_.masses[1].position);
    const double c2 = std::cos(t[1]), s2 = std::sin(t[1]), s23 = std::sin(t[1] + t[2]),
                 c23 = std::cos(t[1] + t[2]);
    EXPECT_NEAR(m2.x, 0.5 * s23 * g_.l4 - c2 * g_.l3, kExact);
    EXPECT_NEAR(m2.y, g_.l2, kExact);
    EXPECT_NEAR(m2.z - g_.l1, 0.5 * c23 * g_.l4 + s2 * g_.l3, kExact);
    sign_off = std::max(sign_off, std::abs(m2.x - (-0.5 * s23 * g_.l4 - c2 * g_.l3)));
    // 3_6_T: its last column in frame 3, mended (0, −l4, 0); printed with −(s4 c5 c6 + c4 s6) l5 in the third row.
    const Vec3<double> wrist = frames[2].apply({0, -g_.l4, 0});
    EXPECT_NEAR(frames[5].p.x, wrist.x, kExact);
    EXPECT_NEAR(frames[5].p.y, wrist.y, kExact);
    EXPECT_NEAR(frames[5].p.z, wrist.z, kExact);
    const double third =
        -(std::sin(t[3]) * std::cos(t[4]) * std::cos(t[5]) + std::cos(t[3]) * std::sin(t[5])) * g_.l5;
    const Vec3<double> off = frames[2].apply({0, -g_.l4, third}) - frames[5].p;
    column_off = std::max(column_off, std::sqrt(dot(off, off)));
  }
  EXPECT_GT(sign_off, kClear);
  EXPECT_GT(column_off, kClear);
}

TEST_F(ArmFormulas, jacobians_of_every_mass_and_the_hand_are_central_differences_on_both_arms) {
  for (const SoftArmGeometry<double>& geometry : {g_, left_soft_arm(g_)}) {
    const Chain<double, 6> chain = soft_arm_chain(geometry);
    for (int k = 0; k < 100; ++k) {
      const Angles t = random_angles();
      const auto frames = chain_frames(chain, t);
      for (int m = 0; m <= chain.mass_count; ++m) {
        const bool hand = m == chain.mass_count;
        const PointMass<double>& mass =
            chain.masses[static_cast<std::size_t>(std::min(m, chain.mass_count - 1))];
        const int link = hand ? chain.tool_link : mass.link;
        const Vec3<double> place = hand ? chain.tool : mass.position;
        const auto columns = point_jacobian<double, 6>(frames, link, place);
        for (std::size_t j = 0; j < 6; ++j) {
          constexpr double h = 1e-5;
          Angles up = t, down = t;
          up[j] += h;
          down[j] -= h;
          const auto at = static_cast<std::size_t>(link);
          const Vec3<double> difference = (0.5 / h) * (chain_frames(chain, up)[at].apply(place) -
                                                       chain_frames(chain, down)[at].apply(place));
          // h²/6 of the third derivative, at most the arm's metre, and 1e-16/h of rounding: below 1e-10.
          const Vec3<double> off = columns[j] - difference;
          EXPECT_LT(std::sqrt(dot(off, off)), 1e-10) << m << " " << j;
        }
      }
    }
  }
}

}  // namespace
}  // namespace isac::models
