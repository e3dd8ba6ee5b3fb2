// Kinematics, gravity and inertia of the Soft Arm: every formula of the errata, both ways, and the round
// trip.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "isac/models/arm/coupling.hpp"
#include "isac/models/arm/soft_arm.hpp"

namespace isac::models {
namespace {

using Angles = JointVector<double, 6>;
constexpr double kPiHere = 3.14159265358979323846;
constexpr double kExact = 1e-9;  // what docs/errata.md promises of a mended form
constexpr double kClear = 1e-3;  // a printed form that is wrong is wrong by more than this somewhere

struct Trig {  // the seed's abbreviations (4.10)
  double s1, c1, s2, c2, s3, c3, s4, c4, s5, c5, s6, c6, s23, c23;
  explicit Trig(const Angles& t)
      : s1(std::sin(t[0])),
        c1(std::cos(t[0])),
        s2(std::sin(t[1])),
        c2(std::cos(t[1])),
        s3(std::sin(t[2])),
        c3(std::cos(t[2])),
        s4(std::sin(t[3])),
        c4(std::cos(t[3])),
        s5(std::sin(t[4])),
        c5(std::cos(t[4])),
        s6(std::sin(t[5])),
        c6(std::cos(t[5])),
        s23(std::sin(t[1] + t[2])),
        c23(std::cos(t[1] + t[2])) {}
};

class Arm : public ::testing::Test {
 protected:
  Angles random_angles() {
    std::uniform_real_distribution<double> angle(-kPiHere, kPiHere);
    Angles theta;
    for (double& entry : theta) entry = angle(random_);
    return theta;
  }
  /// Largest |formula − truth| over random poses.
  template <class Formula, class Truth>
  double worst(Formula formula, Truth truth) {
    double largest = 0;
    for (int k = 0; k < 200; ++k) {
      const Angles theta = random_angles();
      largest = std::max(largest, std::abs(formula(theta) - truth(theta)));
    }
    return largest;
  }

  std::mt19937 random_{20030531};
  SoftArmGeometry<double> g_;
  Chain<double, 6> chain_ = soft_arm_chain(g_);
};

double angle_between(double a, double b) {
  return std::abs(wrap_to_pi(a - b));
}

TEST_F(Arm, tool_position_holds_4_12_in_x_and_y) {
  const auto x = [this](const Angles& t) {
    const Trig q(t);
    return -(((q.c1 * q.c23 * q.c4 - q.s1 * q.s4) * q.c5 - q.c1 * q.s23 * q.s5) * q.c6 +
             (-q.c1 * q.c23 * q.s4 - q.s1 * q.c4) * q.s6) *
               g_.l5 +
           q.c1 * q.s23 * g_.l4 - q.c1 * q.c2 * g_.l3 - q.s1 * g_.l2;
  };
  const auto y = [this](const Angles& t) {
    const Trig q(t);
    return -(((q.s1 * q.c23 * q.c4 + q.c1 * q.s4) * q.c5 - q.s1 * q.s23 * q.s5) * q.c6 +
             (-q.s1 * q.c23 * q.s4 + q.c1 * q.c4) * q.s6) *
               g_.l5 +
           q.s1 * q.s23 * g_.l4 - q.s1 * q.c2 * g_.l3 + q.c1 * g_.l2;
  };
  EXPECT_LT(worst(x, [this](const Angles& t) { return tool_position(chain_, t).x; }), kExact);
  EXPECT_LT(worst(y, [this](const Angles& t) { return tool_position(chain_, t).y; }), kExact);
}

TEST_F(Arm, tool_height_needs_the_mended_4_12) {
  const auto truth = [this](const Angles& t) { return tool_position(chain_, t).z; };
  const auto mended = [this](const Angles& t) {
    const Trig q(t);
    return -((-q.s23 * q.c4 * q.c5 - q.c23 * q.s5) * q.c6 + q.s23 * q.s4 * q.s6) * g_.l5 + q.c23 * g_.l4 +
           q.s2 * g_.l3 + g_.l1;
  };
  const auto printed = [this](const Angles& t) {
    const Trig q(t);
    return (-(q.s23 * q.c4 * q.c5 + q.s23 * q.s5) * q.c6 + q.s23 * q.s4 * q.s6) * g_.l5 + q.c23 * g_.l4 +
           q.s2 * g_.l3 + g_.l1;
  };
  EXPECT_LT(worst(mended, truth), kExact);
  EXPECT_GT(worst(printed, truth), kClear);
}

TEST_F(Arm, wrist_position_holds_4_14_and_wants_d4_positive) {
  Chain<double, 6> printed_chain = chain_;
  printed_chain.links[3].d = -g_.l4;  // table 4.3 as printed
  const auto formula = [this](const Angles& t) {
    const Trig q(t);
    return q.c23 * g_.l4 + q.s2 * g_.l3 + g_.l1;
  };
  EXPECT_LT(worst(formula, [this](const Angles& t) { return chain_frames(chain_, t)[5].p.z; }), kExact);
  EXPECT_GT(worst(formula, [&](const Angles& t) { return chain_frames(printed_chain, t)[5].p.z; }), kClear);
}

TEST_F(Arm, first_angle_needs_the_mended_root_of_4_19) {
  double mended_worst = 0, printed_worst = 0;
  for (int k = 0; k < 500; ++k) {
    const Angles theta = random_angles();
    const Vec3<double> p = chain_frames(chain_, theta)[5].p;
    const auto best = [&](double root) {
      double nearest = 10;
      for (double sign : {1.0, -1.0}) {
        nearest =
            std::min(nearest, angle_between(std::atan2(p.y, p.x) - std::atan2(g_.l2, sign * root), theta[0]));
      }
      return nearest;
    };
    mended_worst =
        std::max(mended_worst, best(std::sqrt(std::max(0.0, p.x * p.x + p.y * p.y - g_.l2 * g_.l2))));
    printed_worst = std::max(printed_worst, best(std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z)));
  }
  EXPECT_LT(mended_worst,
            1e-6);  // the root loses half its digits where the wrist passes the shoulder's circle
  EXPECT_GT(printed_worst, 0.5);  // up to 1.3 rad off
}

TEST_F(Arm, wrist_angles_need_the_mended_4_29_4_31_4_33) {
  double mended = 0, printed4 = 0, printed5 = 0, printed6 = 0;
  for (int k = 0; k < 500; ++k) {
    Angles theta = random_angles();
    theta[4] =
        0.1 + 0.9 * std::abs(theta[4]);  // 0.1 … 2.93: θ5 > 0 is the branch that 4.29 gives; the flip is 4.34
    const Trig q(theta);
    const Transform<double> pose = chain_frames(chain_, theta)[5];
    const auto& r = pose.r;
    const double y4 = -r[0][2] * q.s1 + r[1][2] * q.c1;
    const double x4 = r[0][2] * q.c1 * q.c23 + r[1][2] * q.s1 * q.c23 - r[2][2] * q.s23;
    mended = std::max(mended, angle_between(std::atan2(y4, x4), theta[3]));
    printed4 = std::max(printed4, angle_between(std::atan2(y4, -x4), theta[3]));
    const double s5 = r[0][2] * (q.c1 * q.c23 * q.c4 - q.s1 * q.s4) +
                      r[1][2] * (q.s1 * q.c23 * q.c4 + q.c1 * q.s4) - r[2][2] * q.s23 * q.c4;
    const double c5 = r[0][2] * q.c1 * q.s23 + r[1][2] * q.s1 * q.s23 + r[2][2] * q.c23;
    mended = std::max(mended, angle_between(std::atan2(s5, c5), theta[4]));
    const double s5_printed = -r[0][2] * (q.c1 * q.c23 * q.c4 + q.s1 * q.s4) -
                              r[1][2] * (q.s1 * q.c23 * q.c4 - q.c1 * q.s4) + r[2][2] * q.s23 * q.c4;
    printed5 = std::max(printed5, angle_between(std::atan2(s5_printed, -c5), theta[4]));
    const double s6 = -r[0][0] * (q.c1 * q.c23 * q.s4 + q.s1 * q.c4) -
                      r[1][0] * (q.s1 * q.c23 * q.s4 - q.c1 * q.c4) + r[2][0] * q.s23 * q.s4;
    const double c6 = r[0][0] * ((q.c1 * q.c23 * q.c4 - q.s1 * q.s4) * q.c5 - q.c1 * q.s23 * q.s5) +
                      r[1][0] * ((q.s1 * q.c23 * q.c4 + q.c1 * q.s4) * q.c5 - q.s1 * q.s23 * q.s5) -
                      r[2][0] * (q.s23 * q.c4 * q.c5 + q.c23 * q.s5);
    mended = std::max(mended, angle_between(std::atan2(s6, c6), theta[5]));
    const double s6_printed = -r[0][0] * q.c1 * q.c23 * q.s4 - r[1][0] * (q.s1 * q.c23 * q.s4 + q.c1 * q.c4) +
                              r[2][0] * q.s23 * q.s4;
    printed6 = std::max(printed6, angle_between(std::atan2(s6_printed, c6), theta[5]));
  }
  EXPECT_LT(mended, kExact);
  EXPECT_GT(printed4, kClear);
  EXPECT_GT(printed5, kClear);
  EXPECT_GT(printed6, kClear);
}

TEST_F(Arm, inverse_gives_eight_solutions_that_all_return_to_the_pose) {
  for (const auto& g : {g_, left_soft_arm(g_)}) {
    const Chain<double, 6> chain = soft_arm_chain(g);
    double worst_pose = 0;
    for (int k = 0; k < 50000; ++k) {
      const Angles theta = random_angles();
      const Transform<double> pose = chain_frames(chain, theta)[5];
      const auto found = soft_arm_inverse(g, pose, theta);
      ASSERT_EQ(found.reach, Reach::kReachable);
      ASSERT_EQ(found.count, 8);
      double nearest = 10;
      for (const auto& solution : found.solutions) {
        const Transform<double> back = chain_frames(chain, solution.theta)[5];
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j)
            worst_pose = std::max(worst_pose, std::abs(back.r[i][j] - pose.r[i][j]));
        }
        const Vec3<double> gap = back.p - pose.p;
        worst_pose = std::max({worst_pose, std::abs(gap.x), std::abs(gap.y), std::abs(gap.z)});
        double turn = 0;
        for (std::size_t j = 0; j < 6; ++j) turn = std::max(turn, angle_between(solution.theta[j], theta[j]));
        nearest = std::min(nearest, turn);
      }
      ASSERT_LT(nearest, 1e-5) << "the angles the pose was made of are among the eight";
    }
    EXPECT_LT(worst_pose, kExact);
  }
}

TEST_F(Arm, unreachable_poses_are_always_said) {
  std::uniform_real_distribution<double> direction(-1, 1);
  const double longest = g_.l3 + g_.l4;
  int too_far = 0, inside = 0;
  for (int k = 0; k < 20000; ++k) {
    Transform<double> pose;
    pose.p = {direction(random_), direction(random_), g_.l1 + direction(random_)};
    const double flat2 = pose.p.x * pose.p.x + pose.p.y * pose.p.y - g_.l2 * g_.l2;
    const double h = pose.p.z - g_.l1;
    const auto found = soft_arm_inverse(g_, pose, Angles{});
    if (flat2 < -1e-6) {
      EXPECT_EQ(found.reach, Reach::kInsideShoulder);
      ++inside;
    } else if (std::sqrt(std::max(0.0, flat2) + h * h) > longest + 1e-6) {
      EXPECT_EQ(found.reach, Reach::kTooFar);
      ++too_far;
    } else if (std::sqrt(std::max(0.0, flat2) + h * h) < longest - 1e-6 &&
               std::sqrt(std::max(0.0, flat2) + h * h) > std::abs(g_.l3 - g_.l4) + 1e-6) {
      EXPECT_EQ(found.reach, Reach::kReachable);
    }
    if (found.reach != Reach::kReachable) {
      EXPECT_EQ(found.count, 0);
    }
  }
  EXPECT_GT(too_far, 100);
  EXPECT_GT(inside, 100);
  Transform<double> folded;
  folded.p = {0.0, g_.l2, g_.l1 + 0.01};  // one centimetre from the shoulder; the folded arm ends at 4 cm
  EXPECT_EQ(soft_arm_inverse(g_, folded, Angles{}).reach, Reach::kTooNear);
  Transform<double> nonsense;
  nonsense.p.x = std::nan("");
  EXPECT_EQ(soft_arm_inverse(g_, nonsense, Angles{}).reach, Reach::kNotFinite);
}

TEST_F(Arm, a_singular_wrist_keeps_the_angle_it_has_and_says_so) {
  const Angles theta{0.3, -0.6, -0.4, 0.7, 0.0, 0.2};
  const auto pose = chain_frames(chain_, theta)[5];
  const auto found = soft_arm_inverse(g_, pose, theta);
  bool kept = false;
  for (int i = 0; i < found.count; ++i) {
    const auto& solution = found.solutions[static_cast<std::size_t>(i)];
    const auto back = chain_frames(chain_, solution.theta)[5];
    EXPECT_LT(std::abs(back.r[0][0] - pose.r[0][0]) + std::abs(back.r[1][1] - pose.r[1][1]), 1e-6);
    double turn = 0;
    for (std::size_t j = 0; j < 6; ++j) turn = std::max(turn, angle_between(solution.theta[j], theta[j]));
    kept = kept || (solution.wrist_singular && turn < 1e-6);
  }
  EXPECT_TRUE(kept);
}

TEST_F(Arm, the_nearest_solution_inside_the_limits_is_chosen) {
  Coupling<double, 6> inverse;
  ASSERT_TRUE(ok(inverse_coupling<double, 6>(soft_arm_coupling<double>(), inverse)));
  const Angles theta{0.2, -0.8, -0.3, 0.1, 0.9, -0.2};
  const auto found = soft_arm_inverse(g_, chain_frames(chain_, theta)[5], theta);
  JointLimits<double> wide;
  wide.lower.fill(-10);
  wide.upper.fill(10);
  const int chosen = nearest_solution(found, theta, inverse, wide);
  ASSERT_GE(chosen, 0);
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_NEAR(found.solutions[static_cast<std::size_t>(chosen)].theta[j], theta[j], 1e-9);
  }
  JointLimits<double> none = wide;
  none.lower[0] = 5;  // no solution has its first angle beyond 5 rad
  EXPECT_EQ(nearest_solution(found, theta, inverse, none), -1);
}

TEST_F(Arm, coupling_keeps_power_and_inverts) {
  const auto k = soft_arm_coupling<double>();
  Coupling<double, 6> inverse;
  ASSERT_TRUE(ok(inverse_coupling<double, 6>(k, inverse)));
  const Angles phi = random_angles(), tau = random_angles();
  const Angles theta = multiply<double, 6>(k, phi);
  const Angles back = multiply<double, 6>(inverse, theta);
  const Angles tau_phi = multiply_transposed<double, 6>(k, tau);
  double power_theta = 0, power_phi = 0;
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_NEAR(back[j], phi[j], 1e-14);
    power_theta += tau[j] * theta[j];
    power_phi += tau_phi[j] * phi[j];
  }
  EXPECT_NEAR(power_theta, power_phi, 1e-12);
  EXPECT_DOUBLE_EQ(theta[2], (phi[2] + phi[3]) / 2);
  EXPECT_DOUBLE_EQ(theta[5], (phi[4] - phi[5]) / 2);
  Coupling<double, 6> singular{};
  EXPECT_FALSE(ok(inverse_coupling<double, 6>(singular, inverse)));
}

TEST_F(Arm, gravity_at_45_degrees_gives_the_recomputed_torques) {
  const double q = kPiHere / 4;
  const Angles torque = gravity_torque<double, 6>(chain_, {0, -q, -q, 0, 2 * q, 0});
  EXPECT_NEAR(torque[1], -4.6117, 5e-5);  // printed with four digits in docs/errata.md
  EXPECT_NEAR(torque[2], -1.2581, 5e-5);
  EXPECT_NEAR(torque[4], -0.2197, 5e-5);
  EXPECT_NEAR(torque[0], 0, 1e-12);
}

TEST_F(Arm, gravity_is_the_gradient_of_the_potential_energy) {
  const auto energy = [this](const Angles& t) {
    const auto frames = chain_frames(chain_, t);
    double v = 0;
    for (int m = 0; m < chain_.mass_count; ++m) {
      const auto& point = chain_.masses[static_cast<std::size_t>(m)];
      v -= point.mass *
           dot(frames[static_cast<std::size_t>(point.link)].apply(point.position), chain_.gravity);
    }
    return v;
  };
  for (int k = 0; k < 50; ++k) {
    const Angles theta = random_angles();
    const Angles torque = gravity_torque<double, 6>(chain_, theta);
    for (std::size_t j = 0; j < 6; ++j) {
      Angles up = theta, down = theta;
      up[j] += 1e-6;
      down[j] -= 1e-6;
      EXPECT_NEAR(torque[j], -(energy(up) - energy(down)) / 2e-6,
                  1e-8);  // central difference: 1e-12 curvature, 1e-10 rounding
    }
  }
}

TEST_F(Arm, third_mass_row_six_needs_the_mended_4_48) {
  const auto truth = [this](const Angles& t) {
    return point_jacobian<double, 6>(chain_frames(chain_, t), 5, chain_.tool)[5].z;
  };
  const auto mended = [this](const Angles& t) {
    const Trig q(t);
    const double p6 = -q.s23 * q.c4 * q.c5 - q.c23 * q.s5;
    return -(-p6 * q.s6 + q.s23 * q.s4 * q.c6) * g_.l5;
  };
  const auto printed = [this](const Angles& t) {  // the brackets of 4.48 as they stand
    const Trig q(t);
    return -(-q.s23 * q.c4 * q.c5 - q.c23 * q.s5) * q.s6 + q.s23 * q.s4 * q.c6 * g_.l5;
  };
  EXPECT_LT(worst(mended, truth), kExact);
  EXPECT_GT(worst(printed, truth), kClear);
}

TEST_F(Arm, rows_two_to_five_of_4_46_to_4_48_hold) {
  for (int k = 0; k < 200; ++k) {
    const Angles theta = random_angles();
    const Trig q(theta);
    const auto frames = chain_frames(chain_, theta);
    const auto j1 = point_jacobian<double, 6>(frames, 1, chain_.masses[0].position);
    const auto j2 = point_jacobian<double, 6>(frames, 2, chain_.masses[1].position);
    const auto j3 = point_jacobian<double, 6>(frames, 5, chain_.masses[2].position);
    EXPECT_NEAR(j1[1].z, 0.5 * q.c2 * g_.l3, kExact);
    EXPECT_NEAR(j2[1].z, -0.5 * q.s23 * g_.l4 + q.c2 * g_.l3, kExact);
    EXPECT_NEAR(j2[2].z, -0.5 * q.s23 * g_.l4, kExact);
    const double wrist = -((-q.c23 * q.c4 * q.c5 + q.s23 * q.s5) * q.c6 + q.c23 * q.s4 * q.s6) * g_.l5;
    EXPECT_NEAR(j3[1].z, wrist - q.s23 * g_.l4 + q.c2 * g_.l3, kExact);
    EXPECT_NEAR(j3[2].z, wrist - q.s23 * g_.l4, kExact);
    EXPECT_NEAR(j3[3].z, -(q.s23 * q.s4 * q.c5 * q.c6 + q.s23 * q.c4 * q.s6) * g_.l5, kExact);
    EXPECT_NEAR(j3[4].z, -(q.s23 * q.c4 * q.s5 - q.c23 * q.c5) * q.c6 * g_.l5, kExact);
  }
}

TEST_F(Arm, inertia_about_joint_one_is_the_sum_of_m_d_squared) {
  double half_worst = 0;
  for (int k = 0; k < 200; ++k) {
    const Angles theta = random_angles();
    const Trig q(theta);
    const double d1 = 0.25 * q.c2 * q.c2 * g_.l3 * g_.l3 + g_.l2 * g_.l2;
    const double x2 = 0.5 * q.s23 * g_.l4 - q.c2 * g_.l3;
    const double d2 = x2 * x2 + g_.l2 * g_.l2;
    const double x3 = -((q.c23 * q.c4 * q.c5 - q.s23 * q.s5) * q.c6 - q.c23 * q.s4 * q.s6) * g_.l5 +
                      q.s23 * g_.l4 - q.c2 * g_.l3;
    const double y3 = -(q.s4 * q.c5 * q.c6 + q.c4 * q.s6) * g_.l5 + g_.l2;
    const double sum = g_.m1 * d1 + g_.m2 * d2 + g_.m3 * (x3 * x3 + y3 * y3);  // 4.36 mended, 4.37 without ½
    const double matrix = mass_matrix<double, 6>(chain_, theta)[0][0];
    EXPECT_NEAR(matrix, sum, kExact);
    half_worst = std::max(half_worst, std::abs(matrix - 0.5 * sum));
  }
  EXPECT_GT(half_worst, kClear);  // the printed factor ½
}

TEST_F(Arm, mass_matrix_is_twice_the_kinetic_energy) {
  for (int k = 0; k < 20; ++k) {
    const Angles theta = random_angles(), rate = random_angles();
    const auto matrix = mass_matrix<double, 6>(chain_, theta);
    double quadratic = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = 0; j < 6; ++j) quadratic += rate[i] * matrix[i][j] * rate[j];
    }
    const double h = 1e-6;
    Angles up = theta, down = theta;
    for (std::size_t j = 0; j < 6; ++j) {
      up[j] += h * rate[j];
      down[j] -= h * rate[j];
    }
    const auto later = chain_frames(chain_, up), earlier = chain_frames(chain_, down);
    double twice_energy = 0;
    for (int m = 0; m < 3; ++m) {
      const auto& point = chain_.masses[static_cast<std::size_t>(m)];
      const auto link = static_cast<std::size_t>(point.link);
      const Vec3<double> v =
          (0.5 / h) * (later[link].apply(point.position) - earlier[link].apply(point.position));
      twice_energy += point.mass * dot(v, v);
    }
    EXPECT_NEAR(quadratic, twice_energy,
                1e-7 * std::max(1.0, twice_energy));  // central difference of positions
  }
}

TEST_F(Arm, wrist_frames_share_an_origin_at_minus_l4_of_link_three) {
  const Angles theta = random_angles();
  const auto frames = chain_frames(chain_, theta);
  const Vec3<double> expected = frames[2].apply({0, -g_.l4, 0});  // appendix G, 3→6
  for (std::size_t link : {std::size_t{3}, std::size_t{4}, std::size_t{5}}) {
    EXPECT_NEAR(frames[link].p.x, expected.x, 1e-12);
    EXPECT_NEAR(frames[link].p.y, expected.y, 1e-12);
    EXPECT_NEAR(frames[link].p.z, expected.z, 1e-12);
  }
}

}  // namespace
}  // namespace isac::models
