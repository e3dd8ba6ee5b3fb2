// The rows of docs/errata.md that are signs and numbers: the mended form holds, the printed one is shown to fail.
// The rows on kinematics, gravity and inertia are in arm_test.cpp.
#include <gtest/gtest.h>

#include <cmath>

#include "isac/models/effects.hpp"
#include "isac/models/joint_motion.hpp"
#include "isac/models/muscle_pair.hpp"

namespace isac::models {
namespace {

constexpr double kExact = 1e-9;  // what docs/errata.md promises of a mended form
constexpr double kR = kTestbedWheelRadius;
constexpr double kInertia = 0.0085;

SecondOrder<double> testbed_joint(double radius) {
  SecondOrder<double> joint;
  EXPECT_EQ(second_order(testbed_parameters<double>(), radius, kInertia, joint), Status::kOk);
  return joint;
}
double per_kgf(double per_pascal) {
  return per_pascal * kPascalPerKgfCm2;
}

TEST(Errata, eq_3_10_as_printed_feeds_energy_in_and_mended_takes_it_out) {
  const auto q = testbed_parameters<double>();
  for (double w : {-6.0, -0.3, 0.3, 6.0}) {
    const double printed = q.C * w * w * w + q.D * w;
    EXPECT_GT(printed * w, 0.0);
    EXPECT_LT(joint_torque(q, kR, 0.0, 0.0, w) * w, 0.0);
    EXPECT_NEAR(joint_torque(q, kR, 0.0, 0.0, w), -printed, kExact);
  }
}

TEST(Errata, sec_2_1_1_angle_is_half_the_difference_of_the_lengths_over_the_radius) {
  const double l0 = 0.25, r = 0.019, phi = 0.4;
  const double l1 = l0 + r * phi, l2 = l0 - r * phi;
  EXPECT_NEAR((l1 - l2) / (2 * r), phi, kExact);
  EXPECT_NEAR((l2 - l1) / r, -2 * phi, kExact);  // the printed form: other sign, twice as large
}

TEST(Errata, delta_pressure_inflates_muscle_2_and_moves_the_angle_positive) {
  MusclePair<BridgestoneMuscle, double> pair;
  pair.muscle_1 = pair.muscle_2 = {.diameter = 0.015, .a = 18, .b = 11};
  pair.middle_length = pair.maximal_length = 0.29;
  pair.wheel_radius = kR;
  const auto p = split_pressure(3e5, 0.5e5);
  EXPECT_GT(p.muscle_2, p.muscle_1);
  EXPECT_GT(pair_torque(pair, p.muscle_1, p.muscle_2, 0.0), 0.0);
}

TEST(Errata, eq_3_4_holds_in_sign_and_factor) {
  const double d0 = 0.015, a = 18, b = 11, l0 = 0.29, p1 = 2.5e5, p2 = 3.7e5, phi = 0.8;
  const BridgestoneMuscle<double> m{.diameter = d0, .a = a, .b = b};
  const double direct = (force(m, p2, kR * phi / l0) - force(m, p1, -kR * phi / l0)) * kR;
  const double dp = (p2 - p1) / 2;
  const double printed = 2 * d0 * d0 * a * kR * kR * kR / (l0 * l0) * dp * phi * phi -
                         2 * d0 * d0 * (p1 + p2) * a * kR * kR / l0 * phi +
                         d0 * d0 * kR * (2 * a - 2 * b) * dp;
  EXPECT_NEAR(direct, printed, kExact);
}

TEST(Errata, eq_2_9_needs_the_pressure_that_is_missing_in_print) {
  const ThinWallMuscle<double> m{.thread_length = 0.33, .turns = 2.1, .rest_angle = 0.42};
  const double theta = 0.5, p = 3e5;
  const double contraction = 1 - std::cos(theta) / std::cos(m.rest_angle);
  const double printed = 0.33 * 0.33 * (3 * std::cos(theta) * std::cos(theta) - 1) / (4 * kPi * 2.1 * 2.1);
  EXPECT_NEAR(force(m, p, contraction), p * printed, kExact * p * printed);
  EXPECT_GT(std::abs(force(m, p, contraction) / printed - 1), 1e5);
}

TEST(Errata, eq_2_12_holds_as_printed) {
  const ThickWallMuscle<double> m{.thread_length = 0.33, .turns = 2.1, .rest_angle = 0.42, .wall = 0.001};
  const double theta = 0.55, p = 3e5, d0 = 0.33 / (2.1 * kPi), d = m.wall;
  const double c = std::cos(theta), s = std::sin(theta);
  const double printed =
      kPi * d0 * d0 * p / 4 * (3 * c * c - 1) + p * kPi * (d0 * d * (2 * s - 1 / s) - d * d);
  EXPECT_NEAR(force(m, p, 1 - c / std::cos(m.rest_angle)), printed, kExact * printed);
}

TEST(Errata, eq_4_4_zeta_is_positive_only_as_mended) {
  const auto q = testbed_parameters<double>();
  const double stiffness = q.A * kR * kR;  // negative
  const double printed = q.D / (2 * stiffness * std::sqrt(-kInertia / stiffness));
  EXPECT_LT(printed, 0.0);
  EXPECT_NEAR(testbed_joint(kR).damping, q.D / (2 * std::sqrt(-stiffness * kInertia)), kExact);
  EXPECT_NEAR(testbed_joint(kR).damping, -printed, kExact);
}

TEST(Errata, eq_5_5_is_a_sum_and_not_its_inverse) {
  // PI at s = jω: K_P + K_I/s grows without bound for s → 0, its inverse dies away; eq 5.9 has the former.
  const double kp = 0.1, ki = 10, s = 1e-6;
  EXPECT_GT(kp + ki / s, 1e6);
  EXPECT_LT(1 / (kp + ki / s), 1e-6);
}

TEST(Errata, testbed_radius_of_19_mm_gives_the_printed_joint) {
  const auto joint = testbed_joint(kR);
  EXPECT_NEAR(joint.time_constant, 0.032, 5e-4);  // printed to two digits
  EXPECT_NEAR(joint.damping, 0.26, 5e-3);
  EXPECT_NEAR(per_kgf(joint.gain), 0.391, 5e-4);  // printed 0.3
}

TEST(Errata, printed_joint_gain_of_0_3_would_need_another_radius) {
  const double radius = 174.2 / (23450 * 0.3);
  EXPECT_NEAR(radius, 0.0248, 5e-5);
  EXPECT_NEAR(per_kgf(testbed_joint(radius).gain), 0.3, kExact);
  EXPECT_GT(std::abs(testbed_joint(radius).time_constant - 0.032), 5e-3);  // and would spoil T_J
}

TEST(Errata, table_6_1_column_is_a_diameter_in_metres) {
  // Static range at ±2 kg/cm²: |φ| = B Δp/(−A r). The arm's own pose of sec 6.4 bends joints 2, 3 and 5 (coupled with 4
  // and 6) by 45° and more against gravity; read as a radius, the column would not even let them get there.
  struct Row {
    double a, b, column;
  };
  for (const Row& joint : {Row{-108000, 970, 0.025}, Row{-80600, 334, 0.020}, Row{-37600, 138, 0.015}}) {
    const auto reach = [&](double radius) { return joint.b * 2 / (-joint.a * radius); };
    EXPECT_GT(reach(joint.column / 2), kPi / 4);
    EXPECT_LT(reach(joint.column), kPi / 4);
  }
}

TEST(Errata, eq_4_7_has_a_latency_of_14_ms_and_not_15) {
  // Coefficients as printed in eq 4.7: 0.001 and 0.018.
  const double tj = std::sqrt(0.001);
  StepShape<double> shape;
  ASSERT_EQ(
      step_shape(SecondOrder<double>{.time_constant = tj, .damping = 0.018 / (2 * tj), .gain = 0.3}, shape),
      Status::kOk);
  EXPECT_NEAR(shape.latency, 0.0140, 5e-5);
  EXPECT_NEAR(shape.adjustment, 0.0463, 5e-5);
  EXPECT_NEAR(shape.latency / shape.adjustment, 0.303, 5e-4);
  EXPECT_GT(std::abs(shape.latency / shape.adjustment - 0.36), 0.05);
}

TEST(Errata, ziegler_nichols_integral_gain_is_8_57) {
  const double critical_gain = 1.25, critical_period = 0.175, kp = 0.6 * critical_gain;
  EXPECT_NEAR(kp / (0.5 * critical_period), 8.57, 5e-3);
  EXPECT_NEAR(critical_gain / (0.5 * critical_period), 14.3, 5e-2);  // where the printed number comes from
}

TEST(Errata, chien_hrones_reswick_gains_are_6_133_and_0_045) {
  const double latency = 0.015, adjustment = 0.045, gain = 0.3;
  const double kp = 0.6 * adjustment / (gain * latency);
  EXPECT_NEAR(kp, 6.0, kExact);
  EXPECT_NEAR(kp / adjustment, 133.3, 0.05);       // printed 120
  EXPECT_NEAR(0.5 * kp * latency, 0.045, kExact);  // printed 0.04
}

/// (1 + T_C s)(1 + 2 ζ T_J s + T_J² s²) with the printed 0.17, 0.018, 0.001, from s³ down.
struct Plant {
  double s3 = 0.17 * 0.001, s2 = 0.001 + 0.17 * 0.018, s1 = 0.018 + 0.17, s0 = 1;
};

TEST(Errata, eq_5_3_is_a_hundred_times_the_plants_denominator_with_the_controller) {
  // s (denominator) + 0.3 (K_D s² + K_P s + K_I) = 0.
  const Plant plant;
  EXPECT_NEAR(plant.s3, 0.00017, kExact);
  EXPECT_NEAR(plant.s2, 0.00406, kExact);
  EXPECT_NEAR(plant.s1, 0.188, kExact);
  EXPECT_NEAR(100 * plant.s3, 0.017, kExact);
  EXPECT_NEAR(100 * plant.s2, 0.4, 0.01);   // printed with one digit
  EXPECT_NEAR(100 * plant.s1, 18.5, 0.35);  // printed 18.5, is 18.8
}

TEST(Errata, eq_5_4_results_are_a_hundredth_of_what_the_printed_coefficients_give) {
  // Third Hurwitz determinant of a4 s⁴ + a3 s³ + a2 s² + a1 s + a0, for the two tunings as run.
  const auto determinant = [](double kp, double ki, double kd) {
    const double a4 = 0.017, a3 = 0.4, a2 = 18.5 + 30 * kd, a1 = 100 + 30 * kp, a0 = 30 * ki;
    return a3 * a2 * a1 - a4 * a1 * a1 - a3 * a3 * a0;
  };
  EXPECT_NEAR(determinant(0.4, 7, 0.08), 689, 0.5);      // printed 6.8
  EXPECT_NEAR(determinant(0.2, 4.0, 0.0014), 576, 0.5);  // printed 5.7
}

TEST(Errata, eq_5_10_coefficient_of_s_holds_both_torque_gains) {
  // Outer PI (K_Pp, K_Ip) around an inner PI (K_Pτ, K_Iτ): (K_Pp s + K_Ip)(K_Pτ s + K_Iτ), coefficient of s.
  const double kpp = 4.0, kip = 8.0, kpt = 0.1, kit = 10;
  const auto product = [&](double s) { return (kpp * s + kip) * (kpt * s + kit); };
  const double coefficient = (product(1) - product(-1)) / 2;
  EXPECT_NEAR(coefficient, kpp * kit + kip * kpt, kExact);
  EXPECT_GT(std::abs(coefficient - (kpp * kit + kip * kpp)), 1.0);  // the printed K_Ip K_Pp
}

TEST(Errata, eq_5_12_row_4_repeats_row_2_and_the_printed_minors_follow) {
  // A Hurwitz matrix repeats its first two rows, shifted: 0.015 for 0.0015 is a typing error, 1.66 is 1.7 with a digit
  // more. H2 and H3 as printed follow from 0.0015 and 1.66.
  const double a0 = 0.0015, a1 = 0.011, a2 = 1.66, a3 = 9.5, a4 = 100, a5 = 200;
  const double h2 = a1 * a2 - a0 * a3;
  const double h3 = a3 * h2 - a1 * (a1 * a4 - a0 * a5);
  EXPECT_NEAR(h2, 0.0040, 5e-5);
  EXPECT_NEAR(h3, 0.030, 1e-3);
  EXPECT_NEAR(kInertia * 0.17, a0, 1e-4);  // J T_C
  const double wrong = a1 * a2 - 0.015 * a3;
  EXPECT_LT(wrong, 0.0);  // with 0.015 the loop would not be stable at all
}

}  // namespace
}  // namespace isac::models
