// Characteristic polynomials and Hurwitz's criterion: the printed forms, the mended ones, and two independent ways.
#include "isac/control/stability.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <random>
#include <vector>

#include "isac/control/joint_controller.hpp"
#include "rk4_joint.hpp"

namespace {

using namespace isac::control;
using namespace isac::models;
using isac::kPascalPerKgfCm2;
using isac::Status;

constexpr double kKg = kPascalPerKgfCm2;

/// Roots by Durand and Kerner's iteration: independent of any determinant.
template <std::size_t Size>
double largest_real_part(const std::array<double, Size>& a) {
  using Complex = std::complex<double>;
  std::vector<Complex> roots;
  double scale = 0;  // Fujiwara's bound keeps the start near the roots whatever their size
  for (std::size_t i = 1; i < Size; ++i)
    scale = std::max(scale, 2 * std::pow(std::abs(a[i] / a[0]), 1.0 / static_cast<double>(i)));
  for (std::size_t i = 1; i < Size; ++i)
    roots.push_back(scale * std::polar(0.7, 0.4 + 2.3 * static_cast<double>(i)));
  for (int round = 0; round < 2000; ++round) {
    for (std::size_t i = 0; i < roots.size(); ++i) {
      Complex value = 1, others = 1;
      for (std::size_t k = 1; k < Size; ++k) value = value * roots[i] + a[k] / a[0];
      for (std::size_t j = 0; j < roots.size(); ++j)
        if (j != i) others *= roots[i] - roots[j];
      roots[i] -= value / others;
    }
  }
  double largest = -1e300;
  for (const Complex& root : roots) largest = std::max(largest, root.real());
  return largest;
}

CascadeLoop<double> testbed_loop() {
  const JointSettings<double> s = testbed_settings<double>();
  return {s.muscle, s.wheel_radius, s.inertia, s.valve, s.position, s.torque};
}

SecondOrder<double> testbed_joint() {
  SecondOrder<double> joint;
  EXPECT_EQ(second_order(testbed_parameters<double>(), kTestbedWheelRadius, 0.0085, joint), Status::kOk);
  return joint;
}

TEST(Hurwitz, agrees_with_the_roots_of_random_polynomials) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> root(-2, 0.7), imaginary(0, 3);
  int stable = 0;
  for (int k = 0; k < 2000; ++k) {
    const double r = root(random), a = root(random), b = imaginary(random), c = root(random),
                 d = imaginary(random);
    const auto p = product(
        product(std::array<double, 2>{1.7, -1.7 * r}, std::array<double, 3>{1, -2 * a, a * a + b * b}),
        std::array<double, 3>{1, -2 * c, c * c + d * d});
    const double largest = std::max({r, a, c});
    if (std::abs(largest) < 1e-3) continue;  // on the border either answer is right
    EXPECT_EQ(is_hurwitz(p), largest < 0);
    stable += largest < 0;
  }
  EXPECT_GT(stable, 300);
}

TEST(Hurwitz, minors_are_those_of_the_textbook) {
  // Orders 2, 3 and 4: a1 a2, a1 a2 − a0 a3, and a1 a2 a3 − a1² a4 − a0 a3².
  const auto two = hurwitz_minors(std::array<double, 3>{2, 3, 5});
  EXPECT_NEAR(two[1], 15, 1e-12);
  const auto three = hurwitz_minors(std::array<double, 4>{2, 3, 5, 7});
  EXPECT_NEAR(three[1], 1, 1e-12);
  EXPECT_NEAR(three[2], 7, 1e-12);
  const auto four = hurwitz_minors(std::array<double, 5>{2, 3, 5, 7, 11});
  EXPECT_NEAR(four[2], 3 * 5 * 7 - 9 * 11 - 2 * 49, 1e-12);
  EXPECT_NEAR(four[3], 11 * four[2], 1e-10);
}

TEST(Hurwitz, refuses_what_cannot_be_decided) {
  EXPECT_FALSE(is_hurwitz(std::array<double, 3>{1, 0, 1}));  // on the axis
  EXPECT_FALSE(is_hurwitz(std::array<double, 3>{-1, -1, -1}));
  EXPECT_FALSE(is_hurwitz(std::array<double, 3>{1, std::nan(""), 1}));
}

TEST(PidStability, polynomial_is_the_mended_eq_5_3) {
  // The seed's own plant: K_J 0.3, T_J² 0.001, 2 ζ T_J 0.018, T_C 0.17; gains in kg/cm² per rad.
  const double tj = std::sqrt(0.001);
  const SecondOrder<double> seed{.time_constant = tj, .damping = 0.018 / (2 * tj), .gain = 0.3};
  const PidGains<double> k{.proportional = 0.4, .integral = 7, .derivative = 0.08};
  const auto mended = pid_polynomial(seed, ValveUnit<double>{}, k);
  const double expected[] = {0.00017, 0.00406, 0.188 + 0.3 * 0.08, 1 + 0.3 * 0.4, 0.3 * 7};
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(mended[i], expected[i], 1e-12);
  // As printed, a hundred times as much and rounded: 18.5 is 18.8 before rounding.
  const double printed[] = {0.017, 0.4, 18.5 + 30 * 0.08, 100 + 30 * 0.4, 30 * 7};
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(printed[i] / (100 * mended[i]), 1, 0.02);
  EXPECT_GT(std::abs(printed[2] - 100 * mended[2]), 0.25);
}

TEST(PidStability, hurwitz_values_of_the_printed_polynomial_are_689_and_576) {
  const auto h3 = [](double kp, double ki, double kd) {
    return hurwitz_minors(std::array<double, 5>{0.017, 0.4, 30 * kd + 18.5, 30 * kp + 100, 30 * ki})[2];
  };
  EXPECT_NEAR(h3(0.4, 7, 0.08), 689, 0.5);    // printed as 6.8
  EXPECT_NEAR(h3(0.2, 4, 0.0014), 576, 0.5);  // printed as 5.7
  EXPECT_GT(h3(0.4, 7, 0.08) / 6.8, 100);  // so the printed results are not those of the printed coefficients
}

TEST(PidStability, hurwitz_values_of_the_mended_polynomial_on_the_testbed) {
  // r = 0.019 m makes K_J 0.391: gains in Pa/rad with K_J in rad/Pa are the same loop as gains in kg/cm².
  const auto h3 = [](double kp, double ki, double kd) {
    const auto p = pid_polynomial(testbed_joint(), ValveUnit<double>{}, {kp * kKg, ki * kKg, kd * kKg});
    EXPECT_TRUE(is_hurwitz(p));
    return hurwitz_minors(p)[2];
  };
  // Scaling by 1/100 takes 1e-6 off the third minor: 689e-6 and 576e-6 are the seed's.
  EXPECT_NEAR(h3(0.4, 7, 0.08), 693e-6, 1e-6);
  EXPECT_NEAR(h3(0.2, 4, 0.0014), 548e-6, 1e-6);
}

TEST(PidStability, the_gains_as_first_computed_are_where_the_criterion_says) {
  const auto stable = [](double kp, double ki, double kd) {
    return is_hurwitz(pid_polynomial(testbed_joint(), ValveUnit<double>{}, {kp * kKg, ki * kKg, kd * kKg}));
  };
  EXPECT_TRUE(stable(0.75, 8.57, 0.016));  // Ziegler-Nichols; the seed had to turn it down on hardware
  EXPECT_FALSE(stable(6, 133.3, 0.045));   // Chien-Hrones-Reswick: unstable, as the seed found
}

TEST(PidStability, critical_gain_and_period_agree_with_a_simulated_loop) {
  // P only: a0 s³ + a1 s² + a2 s + 1 + K K_J, critical where a1 a2 = a0 (1 + K K_J), at ω² = a2/a0.
  const auto joint = testbed_joint();
  const auto plant = pid_polynomial(joint, ValveUnit<double>{}, {});
  const double critical = (plant[1] * plant[2] / plant[0] - 1) / joint.gain;
  EXPECT_NEAR(critical / kKg, 8.11, 0.01);  // the seed's hardware: 1.25, with friction and dead time in it
  EXPECT_NEAR(2 * isac::kPi / std::sqrt(plant[2] / plant[0]), 0.190, 5e-4);  // seed: 0.175 s

  const auto growth = [&](double gain) {  // ratio of late to early swings of the linear plant
    isac::test::Rk4Joint rig;
    rig.C = 0;
    rig.angle = 1e-3;
    Pid<double> pid({.gains = {.proportional = gain}});
    double early = 0, late = 0;
    constexpr double kStep = 1e-4;  // so short that sampling adds 0.05 ms of dead time only
    for (int k = 0; k < 60000; ++k) {
      double u = 0;
      EXPECT_EQ(pid.step(0.0, rig.angle, kStep, u), Status::kOk);
      rig.step(-u, u, kStep, 1);
      if (k >= 5000 && k < 10000) early = std::max(early, std::abs(rig.angle));
      if (k >= 55000) late = std::max(late, std::abs(rig.angle));
    }
    return late / early;
  };
  EXPECT_LT(growth(0.97 * critical), 0.7);
  EXPECT_GT(growth(1.03 * critical), 1.4);
}

TEST(CascadeStability, polynomial_is_eq_5_10_with_its_mended_coefficient) {
  CascadeLoop<double> l = testbed_loop();
  l.muscle.D = 0;  // the seed's proof leaves the damping out
  const double br = l.muscle.B * l.wheel_radius, ar2 = l.muscle.A * l.wheel_radius * l.wheel_radius;
  const double j = l.inertia, tc = 0.17, kpt = l.torque.proportional, kit = l.torque.integral, kpp = 4,
               kip = 8;
  const double eq[] = {j * tc,
                       j + j * kpt * br,
                       j * br * kit - ar2 * tc,
                       br * kpp * kpt - ar2,
                       br * (kpp * kit + kip * kpt),
                       br * kip * kit};
  const auto p = cascade_polynomial(l);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(p[i], eq[i], 1e-9 * std::abs(eq[i]));
  const double printed = br * kpp * kit + kip * kpp;
  EXPECT_GT(std::abs(p[4] / printed - 1), 0.15);
}

TEST(CascadeStability, the_seeds_entries_are_those_of_the_mended_form_with_its_own_gain) {
  // Table 5.12 holds 0.0015, 0.011, 1.66, 9.5, 100, 200. K_J = 0.3 as printed means B r = 2.54 and not 3.31; with it the
  // mended s¹ coefficient is 103.6, the printed one 133.6: the seed computed with the right one and misprinted it.
  CascadeLoop<double> l = testbed_loop();
  l.muscle.D = 0;
  const double stiffness = -l.muscle.A * l.wheel_radius * l.wheel_radius;
  l.muscle.B = 0.3 * stiffness / l.wheel_radius / kKg;
  const auto p = cascade_polynomial(l);
  const double entries[] = {0.0015, 0.011, 1.66, 9.5, 100, 200}, digits[] = {1e-4, 5e-4, 6e-3, 0.05, 5, 5};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(p[i], entries[i], digits[i]) << i;
  const double br = 0.3 * stiffness;
  EXPECT_GT(br * 4 * 10 + 8 * 4, 130);
}

TEST(CascadeStability, determinants_of_the_printed_entries) {
  // Row 2: 0.0015, 1.7, 100. Row 4 should repeat it. H2 = 0.0040 and H3 = 0.030 follow from 1.66.
  const auto h = hurwitz_minors(std::array<double, 6>{0.0015, 0.011, 1.66, 9.5, 100, 200});
  EXPECT_NEAR(h[1], 0.0040, 5e-5);
  EXPECT_NEAR(h[2], 0.030, 1e-3);
  EXPECT_NEAR(h[4], 200 * h[3], 1e-9 * std::abs(h[4]));
  EXPECT_NEAR(h[3], 1.84, 0.005);  // printed 5.4, and H5 1100: neither follows from the printed entries
  EXPECT_NEAR(h[4], 367.6, 0.5);
  // As printed, row 4 with 0.015: the determinant of the first four rows is another number, and negative.
  const double m[4][4] = {
      {0.011, 9.5, 200, 0}, {0.0015, 1.7, 100, 0}, {0, 0.011, 9.5, 200}, {0, 0.015, 1.66, 100}};
  const double minor_33 = m[2][2] * m[3][3] - m[2][3] * m[3][2];
  const double row_0 = m[1][1] * minor_33 - m[1][2] * (m[2][1] * m[3][3] - m[2][3] * m[3][1]);
  const double row_1 = m[1][0] * minor_33;
  const double cross = m[1][0] * (m[2][1] * m[3][3] - m[2][3] * m[3][1]);
  const double printed_h4 = m[0][0] * row_0 - m[0][1] * row_1 + m[0][2] * cross;
  EXPECT_GT(std::abs(printed_h4 - h[3]), 1.0);
}

TEST(CascadeStability, all_gains_of_the_testbed_are_stable_and_more_inertia_keeps_them_so) {
  for (const double inertia : {0.0085, 0.036}) {
    CascadeLoop<double> l = testbed_loop();
    l.inertia = inertia;
    const auto as_it_runs = model_based_polynomial(l);
    EXPECT_TRUE(is_hurwitz(as_it_runs));
    EXPECT_LT(largest_real_part(as_it_runs), 0);
    const auto measured = cascade_polynomial(l);
    EXPECT_EQ(is_hurwitz(measured), largest_real_part(measured) < 0);
  }
}

TEST(CascadeStability, four_times_the_inertia_increases_every_determinant_as_the_seed_says) {
  for (const bool as_it_runs : {false, true}) {
    CascadeLoop<double> l = testbed_loop();
    l.muscle.D = 0;
    const auto minors = [&](double inertia) {
      l.inertia = inertia;
      return hurwitz_minors(as_it_runs ? model_based_polynomial(l) : cascade_polynomial(l));
    };
    const auto light = minors(0.0085), heavy = minors(0.036);
    for (std::size_t i = 0; i < 5; ++i) EXPECT_GT(heavy[i], light[i]);
  }
}

TEST(CascadeStability, polynomials_and_roots_agree_over_random_gains) {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> factor(-1.5, 1.5);
  int stable = 0, unstable = 0;
  for (int k = 0; k < 300; ++k) {
    CascadeLoop<double> l = testbed_loop();
    for (double* gain : {&l.position.proportional, &l.position.integral, &l.torque.proportional,
                         &l.torque.integral, &l.inertia})
      *gain *= std::exp(factor(random));
    for (const auto& p : {cascade_polynomial(l), model_based_polynomial(l)}) {
      const double largest = largest_real_part(p);
      if (std::abs(largest) < 1e-3) continue;
      EXPECT_EQ(is_hurwitz(p), largest < 0);
      ++(largest < 0 ? stable : unstable);
    }
  }
  EXPECT_GT(stable, 50);
  EXPECT_GT(unstable, 50);
}

TEST(CascadeStability, model_based_polynomial_predicts_when_the_simulated_loop_swings_up) {
  // Outer gain raised until Hurwitz fails; the simulated PI-MBPI (linear plant, small motion) must turn there too.
  CascadeLoop<double> l = testbed_loop();
  l.position.integral = 0;
  const auto stable_with = [&l](double kp) {
    CascadeLoop<double> at = l;
    at.position.proportional = kp;
    // Without K_Ip the polynomial has a root at 0: divide it out.
    const auto p = model_based_polynomial(at);
    return is_hurwitz(std::array<double, 5>{p[0], p[1], p[2], p[3], p[4]});
  };
  double low = 1, high = 200;
  ASSERT_TRUE(stable_with(low));
  ASSERT_FALSE(stable_with(high));
  for (int k = 0; k < 60; ++k) (stable_with((low + high) / 2) ? low : high) = (low + high) / 2;
  const auto growth = [](double kp) {
    JointSettings<double> s = testbed_settings<double>();
    s.position = {.proportional = kp};
    s.outer_every = 1;  // the polynomial knows no sampling
    s.muscle.C = 0;
    isac::test::Rk4Joint rig;
    rig.C = 0;
    rig.rest_at(s.mean_pressure);
    JointController<double> controller;
    EXPECT_EQ(controller.configure(s), Status::kOk);
    EXPECT_EQ(controller.set_mode(Mode::kPosition), Status::kOk);
    constexpr double kStep = 5e-5;
    double early = 0, late = 0;
    for (int k = 0; k < 80000; ++k) {
      JointCommand<double> u;
      EXPECT_EQ(controller.step({.angle = rig.angle, .velocity = rig.velocity},
                                {.angle = k < 20 ? 0.0 : 1e-3}, kStep, u),
                Status::kOk);
      rig.step(u.pressure.muscle_1, u.pressure.muscle_2, kStep, 1);
      const double swing = std::abs(rig.velocity);
      if (k >= 10000 && k < 20000) early = std::max(early, swing);
      if (k >= 70000) late = std::max(late, swing);
    }
    return late / early;
  };
  EXPECT_LT(growth(0.93 * low), 0.8);
  EXPECT_GT(growth(1.07 * low), 1.25);
  RecordProperty("critical_outer_gain", std::to_string(low));
}

TEST(InnerLoop, sampled_limit_is_where_the_simulated_inner_loop_swings_up) {
  // z² − z (1 − a − b) − a: stable ⇔ a + b/2 < 1. The clamped joint in torque mode is that loop.
  const auto swings = [](double use) {
    JointSettings<double> s = testbed_settings<double>();
    const double br = s.muscle.B * s.wheel_radius, h = 5e-4;
    s.torque.integral = 10 * kKg;
    s.torque.proportional = use / br - s.torque.integral * h / 2;
    EXPECT_NEAR(
        inner_loop_use(
            CascadeLoop<double>{.muscle = s.muscle, .wheel_radius = s.wheel_radius, .torque = s.torque}, h),
        use, 1e-12);
    JointController<double> controller;
    EXPECT_EQ(controller.configure(s), Status::kOk);
    EXPECT_EQ(controller.set_mode(Mode::kTorque), Status::kOk);
    JointCommand<double> u;
    double last = 0, change = 0;
    for (int k = 0; k < 2000; ++k) {
      EXPECT_EQ(controller.step({}, {.torque = k < 2 ? 0.0 : 1.0}, h, u), Status::kOk);
      change = std::abs(u.delta_pressure - last);
      last = u.delta_pressure;
    }
    return change > 1e-3 * kKg;
  };
  EXPECT_FALSE(swings(0.98));
  EXPECT_TRUE(swings(1.02));
}

TEST(InnerLoop, the_arms_table_6_2_uses_two_fifths_of_that_limit_on_every_joint) {
  struct Row {
    double b, diameter, kp, ki;
  };
  const Row table[] = {{3200, 0.030, 0.0065, 10}, {970, 0.025, 0.03, 10}, {334, 0.020, 0.12, 5},
                       {329, 0.020, 0.12, 5},     {138, 0.015, 0.4, 10},  {134, 0.015, 0.4, 10}};
  for (const Row& row : table) {
    CascadeLoop<double> l;
    l.muscle.B = pressure_gain_from_reported(row.b);
    l.wheel_radius = row.diameter / 2;
    l.torque = {.proportional = row.kp * kKg, .integral = row.ki * kKg};
    const double use = inner_loop_use(l, 5e-4);
    EXPECT_GT(use, 0.39);
    EXPECT_LT(use, 0.44);
  }
}

}  // namespace
