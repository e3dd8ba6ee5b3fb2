// Muscle models M1 to M7 against limit cases, a numeric −p dV/dl, each other, and finite differences of their
// derivatives.
#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "isac/models/muscle_pair.hpp"

namespace isac::models {
namespace {

using Jet = ceres::Jet<double, 3>;
constexpr double kRounding = 1e-12;  // relative: a dozen operations on doubles

constexpr double kRestAngle = 0.42;
constexpr double kPressure = 2.5e5;

ThickWallMuscle<double> thick(double wall) {
  return {.thread_length = 0.33, .turns = 2.1, .rest_angle = kRestAngle, .wall = wall};
}
double diameter_90() {
  return 0.33 / (2.1 * kPi);
}

TEST(SchulteMuscle, has_no_force_at_a_thread_angle_of_54_7_degrees) {
  const double magic = std::acos(1.0 / std::sqrt(3.0));
  EXPECT_NEAR(magic * 180 / kPi, 54.7, 0.05);  // the printed figure has one decimal
  EXPECT_NEAR(schulte_force(0.02, kPressure, magic), 0.0, 1e-12 * schulte_force(0.02, kPressure, 0.0));
  EXPECT_GT(schulte_force(0.02, kPressure, magic - 0.01), 0.0);
  EXPECT_LT(schulte_force(0.02, kPressure, magic + 0.01), 0.0);
  const SchulteMuscle<double> m{.diameter = 0.02, .rest_angle = kRestAngle};
  const double contraction = 1 - std::cos(magic) / std::cos(kRestAngle);
  EXPECT_NEAR(force(m, kPressure, contraction), 0.0, 1e-12 * force(m, kPressure, 0.0));
}

TEST(BridgestoneMuscle, equals_schulte_under_the_substitution_of_the_seed) {
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    std::uniform_real_distribution<double> angle(0.1, 0.8), eps(-0.05, 0.35), p(0, 5e5);
    const SchulteMuscle<double> m{.diameter = 0.03, .rest_angle = angle(random)};
    const double pressure = p(random), contraction = eps(random);
    const double expected = force(m, pressure, contraction);
    EXPECT_NEAR(force(bridgestone_of(m), pressure, contraction), expected, kRounding * 1000);
    // M1 by its own variable, the thread's angle: l = b cos Θ.
    const double cosine = (1 - contraction) * std::cos(m.rest_angle);
    if (cosine < 1) {
      EXPECT_NEAR(schulte_force(m.diameter, pressure, std::acos(cosine)), expected, kRounding * 1000);
    }
  }
}

TEST(ThinWallMuscle, is_schulte_with_the_diameter_at_90_degrees) {
  const ThinWallMuscle<double> thin{.thread_length = 0.33, .turns = 2.1, .rest_angle = kRestAngle};
  const SchulteMuscle<double> schulte{.diameter = diameter_90(), .rest_angle = kRestAngle};
  for (double e = -0.05; e < 0.4; e += 0.03)
    EXPECT_NEAR(force(thin, kPressure, e), force(schulte, kPressure, e), kRounding * 1e3);
}

/// −p dV/dl by a central difference over the length.
double minus_p_dv_dl(const ThickWallMuscle<double>& m, double contraction) {
  const double h = 1e-5;
  const double rest_length = m.thread_length * std::cos(m.rest_angle);
  return kPressure * (volume(m, contraction + h) - volume(m, contraction - h)) / (2 * h * rest_length);
}

TEST(ThickWallMuscle, is_minus_p_dv_dl_of_its_volume) {
  for (double wall : {0.0, 0.0005, 0.002})
    for (double e = -0.03; e < 0.4; e += 0.03) {
      const double expected = minus_p_dv_dl(thick(wall), e);
      // h² V‴/6 is about 1e-10 of the force, cancellation 1e-16/1e-5: 1e-8 covers both.
      EXPECT_NEAR(force(thick(wall), kPressure, e), expected,
                  1e-8 * std::abs(force(thick(0), kPressure, 0.0)))
          << "wall " << wall << " contraction " << e;
    }
}

TEST(ThickWallMuscle, loses_force_to_its_wall_and_is_thin_without_one) {
  const ThinWallMuscle<double> thin{.thread_length = 0.33, .turns = 2.1, .rest_angle = kRestAngle};
  EXPECT_DOUBLE_EQ(force(thick(0), kPressure, 0.1), force(thin, kPressure, 0.1));
  EXPECT_LT(force(thick(0.001), kPressure, 0.1), force(thin, kPressure, 0.1));
}

TEST(CaiYamauraMuscle, reduces_to_bridgestone_without_gamma_and_omega) {
  const BridgestoneMuscle<double> m{.diameter = 0.015, .a = 18, .b = 11};
  for (double e = -0.1; e < 0.4; e += 0.05)
    EXPECT_NEAR(force(cai_yamaura_of(m), kPressure, e, 0.7), force(m, kPressure, e), kRounding * 1e4);
}

TEST(CaiYamauraMuscle, resists_shortening_by_omega_and_is_static_at_rest) {
  const CaiYamauraMuscle<double> m{.alpha = 1e-3, .beta = -6e-4, .gamma = 4, .omega = 30};
  EXPECT_NEAR(force(m, kPressure, 0.1, 0.5) - force(m, kPressure, 0.1), -15.0, 1e-12);
  EXPECT_NEAR(force(m, 0.0, 0.1), 4.0, 1e-15);
}

KerscherMuscle<double> kerscher() {
  return {.radius = 0.01, .a = 6, .b = 3.5, .a_epsilon = 1.2, .b_epsilon = -1.1, .stretch_stiffness = 900};
}

TEST(KerscherMuscle, is_continuous_at_no_contraction_with_the_kink_of_its_stretch_term) {
  const auto m = kerscher();
  const double h = 1e-9;
  const double at = force(m, kPressure, 0.0);
  EXPECT_NEAR(force(m, kPressure, h), at, 1e-4);  // slope 1e4 N over 1e-9
  EXPECT_NEAR(force(m, kPressure, -h), at, 1e-4);
  const double step = 1e-6;
  const double right = (force(m, kPressure, step) - at) / step,
               left = (at - force(m, kPressure, -step)) / step;
  EXPECT_NEAR(left - right, -m.stretch_stiffness, 0.05);  // curvature · step = 0.02
}

TEST(KerscherMuscle, pulls_when_stretched_without_pressure_and_only_then) {
  const auto m = kerscher();
  EXPECT_NEAR(force(m, 0.0, -0.05), 45.0, 1e-12);  // −f0 κ
  EXPECT_EQ(force(m, 0.0, 0.05), 0.0);
}

TEST(KerscherMuscle, is_bridgestone_for_a_constant_epsilon_of_one) {
  KerscherMuscle<double> m = kerscher();
  m.a_epsilon = 0;
  m.b_epsilon = -1;
  m.stretch_stiffness = 0;
  const BridgestoneMuscle<double> same{.diameter = std::sqrt(kPi) * m.radius, .a = m.a, .b = m.b};
  for (double e = -0.05; e < 0.3; e += 0.05)
    EXPECT_NEAR(force(m, kPressure, e), force(same, kPressure, e), kRounding * 1e3);
}

TEST(PolynomialMuscle, holds_bridgestone_and_cai_yamaura_as_special_cases) {
  const CaiYamauraMuscle<double> m{.alpha = 1e-3, .beta = -6e-4, .gamma = 4, .omega = 0};
  PolynomialMuscle<double> same;  // α p (1 − 2ε + ε²) + β p + γ with p in bar
  same.c[0] = 4;
  same.c[1] = (1e-3 - 6e-4) * 1e5;
  same.c[4] = -2e-3 * 1e5;
  same.c[8] = 1e-3 * 1e5;
  for (double e = -0.1; e < 0.4; e += 0.05)
    EXPECT_NEAR(force(same, kPressure, e), force(m, kPressure, e), kRounding * 1e3);
}

TEST(PolynomialMuscle, evaluates_its_ten_terms_in_the_order_it_states) {
  const double p = 1.7, e = 0.23;
  const double terms[] = {1, p, e, p * p, p * e, e * e, p * p * p, p * p * e, p * e * e, e * e * e};
  for (int i = 0; i < PolynomialMuscle<double>::kTerms; ++i) {
    PolynomialMuscle<double> m;
    m.c[i] = 2.0;
    EXPECT_NEAR(force(m, p * 1e5, e), 2 * terms[i], 1e-13) << i;
  }
}

TEST(SecondOrderMuscle, is_a_spring_and_damper_that_pressure_stiffens) {
  const SecondOrderMuscle<double> m{.force_0 = 3,
                                    .force_per_pressure = 1e-3,
                                    .stiffness_0 = 100,
                                    .stiffness_per_pressure = 2e-3,
                                    .damping_0 = 5,
                                    .damping_per_pressure = 1e-5};
  EXPECT_NEAR(force(m, 2e5, 0.1, 0.4), 3 + 200 - (100 + 400) * 0.1 - (5 + 2) * 0.4, 1e-12);
}

/// Jet derivatives by pressure, contraction and rate against central differences.
template <class Double, class Dual>
void expect_derivatives(const Double& m, const Dual& dual) {
  for (double e : {-0.04, 0.03, 0.2}) {
    const double point[] = {kPressure, e, 0.3};
    const double step[] = {10.0, 1e-6, 1e-4};
    const Jet f = force(dual, Jet(point[0], 0), Jet(point[1], 1), Jet(point[2], 2));
    const double scale = std::abs(force(m, kPressure, 0.0));
    EXPECT_NEAR(f.a, force(m, point[0], point[1], point[2]), kRounding * scale);
    for (int i = 0; i < 3; ++i) {
      double high[3], low[3];
      for (int k = 0; k < 3; ++k) high[k] = low[k] = point[k];
      high[i] += step[i];
      low[i] -= step[i];
      const double slope =
          (force(m, high[0], high[1], high[2]) - force(m, low[0], low[1], low[2])) / (2 * step[i]);
      // Cancellation: 1e-16 of the force over the step; truncation is far below.
      EXPECT_NEAR(f.v[i], slope, 1e-15 * scale / step[i] * 10 + 1e-7 * std::abs(slope)) << "variable " << i;
    }
  }
}

TEST(MuscleModels, have_derivatives_that_agree_with_finite_differences) {
  expect_derivatives(SchulteMuscle<double>{.diameter = 0.02, .rest_angle = kRestAngle},
                     SchulteMuscle<Jet>{.diameter = Jet(0.02), .rest_angle = Jet(kRestAngle)});
  expect_derivatives(
      ThinWallMuscle<double>{.thread_length = 0.33, .turns = 2.1, .rest_angle = kRestAngle},
      ThinWallMuscle<Jet>{.thread_length = Jet(0.33), .turns = Jet(2.1), .rest_angle = Jet(kRestAngle)});
  expect_derivatives(
      thick(0.001),
      ThickWallMuscle<Jet>{
          .thread_length = Jet(0.33), .turns = Jet(2.1), .rest_angle = Jet(kRestAngle), .wall = Jet(0.001)});
  expect_derivatives(BridgestoneMuscle<double>{.diameter = 0.015, .a = 18, .b = 11},
                     BridgestoneMuscle<Jet>{.diameter = Jet(0.015), .a = Jet(18.0), .b = Jet(11.0)});
  expect_derivatives(
      CaiYamauraMuscle<double>{.alpha = 1e-3, .beta = -6e-4, .gamma = 4, .omega = 30},
      CaiYamauraMuscle<Jet>{.alpha = Jet(1e-3), .beta = Jet(-6e-4), .gamma = Jet(4.0), .omega = Jet(30.0)});
  expect_derivatives(kerscher(), KerscherMuscle<Jet>{.radius = Jet(0.01),
                                                     .a = Jet(6.0),
                                                     .b = Jet(3.5),
                                                     .a_epsilon = Jet(1.2),
                                                     .b_epsilon = Jet(-1.1),
                                                     .stretch_stiffness = Jet(900.0)});
  PolynomialMuscle<double> polynomial;
  PolynomialMuscle<Jet> dual;
  for (int i = 0; i < 10; ++i) {
    polynomial.c[i] = 10.0 - 3 * i;
    dual.c[i] = Jet(polynomial.c[i]);
  }
  expect_derivatives(polynomial, dual);
  expect_derivatives(SecondOrderMuscle<double>{.force_0 = 3,
                                               .force_per_pressure = 1e-3,
                                               .stiffness_0 = 100,
                                               .stiffness_per_pressure = 2e-3,
                                               .damping_0 = 5,
                                               .damping_per_pressure = 1e-5},
                     SecondOrderMuscle<Jet>{.force_0 = Jet(3.0),
                                            .force_per_pressure = Jet(1e-3),
                                            .stiffness_0 = Jet(100.0),
                                            .stiffness_per_pressure = Jet(2e-3),
                                            .damping_0 = Jet(5.0),
                                            .damping_per_pressure = Jet(1e-5)});
}

TEST(MuscleModels, give_the_same_in_float_to_its_own_accuracy) {
  const ThickWallMuscle<float> single{
      .thread_length = 0.33f, .turns = 2.1f, .rest_angle = 0.42f, .wall = 0.001f};
  const double expected = force(thick(0.001), kPressure, 0.1);
  EXPECT_NEAR(force(single, 2.5e5f, 0.1f), expected, 1e-5 * std::abs(expected));  // 100 ulp of float
}

MusclePair<BridgestoneMuscle, double> bridgestone_pair(double pre_contraction) {
  MusclePair<BridgestoneMuscle, double> pair;
  pair.muscle_1 = pair.muscle_2 = {.diameter = 0.015, .a = 18, .b = 11};
  pair.maximal_length = 0.29;
  pair.middle_length = (1 - pre_contraction) * pair.maximal_length;
  pair.wheel_radius = 0.019;
  return pair;
}

TEST(MusclePair, of_bridgestone_muscles_is_equation_3_4_without_remainder) {
  const auto pair = bridgestone_pair(0.0);
  const double d0 = 0.015, a = 18, b = 11, l0 = pair.middle_length, r = pair.wheel_radius;
  for (double phi = -1.2; phi < 1.3; phi += 0.3)
    for (double dp = -2e5; dp < 2.1e5; dp += 1e5) {
      const double p1 = 3e5 - dp, p2 = 3e5 + dp;
      const double printed = 2 * d0 * d0 * a * r * r * r / (l0 * l0) * dp * phi * phi -
                             2 * d0 * d0 * (p1 + p2) * a * r * r / l0 * phi +
                             d0 * d0 * r * (2 * a - 2 * b) * dp;
      EXPECT_NEAR(pair_torque(pair, p1, p2, phi), printed, 1e-12 * 100);
      const auto k = pair_coefficients(pair.muscle_1, l0, pair.maximal_length, (p1 + p2) / 2);
      EXPECT_NEAR(pair_torque(k, dp, phi, r), printed, 1e-12 * 100);
    }
}

TEST(MusclePair, mounted_with_pre_contraction_takes_a_times_the_square_of_the_length_ratio) {
  const auto pair = bridgestone_pair(0.15);
  const auto k = pair_coefficients(pair.muscle_1, pair.middle_length, pair.maximal_length, 3e5);
  for (double phi = -1.2; phi < 1.3; phi += 0.3)
    for (double dp = -2e5; dp < 2.1e5; dp += 1e5)
      EXPECT_NEAR(pair_torque(pair, 3e5 - dp, 3e5 + dp, phi), pair_torque(k, dp, phi, 0.019), 1e-12 * 100);
}

TEST(MusclePair, has_the_signs_of_the_joint_model) {
  const auto pair = bridgestone_pair(0.15);
  EXPECT_LT(pair_torque(pair, 3e5, 3e5, 0.5), 0.0);  // drives back to the middle: A < 0
  EXPECT_GT(pair_torque(pair, 2e5, 4e5, 0.0), 0.0);  // Δp > 0 moves φ positive: B > 0
  EXPECT_NEAR(pair_torque(pair, 3e5, 3e5, 0.0), 0.0, 1e-12);
}

TEST(MusclePair, of_cai_yamaura_muscles_is_damped_by_both) {
  MusclePair<CaiYamauraMuscle, double> pair;
  pair.muscle_1 = pair.muscle_2 = {.alpha = 4e-3, .beta = -2.5e-3, .gamma = 0, .omega = 40};
  pair.maximal_length = 0.29;
  pair.middle_length = 0.25;
  pair.wheel_radius = 0.019;
  const double damping =
      -(pair_torque(pair, 3e5, 3e5, 0.0, 2.0) - pair_torque(pair, 3e5, 3e5, 0.0, 0.0)) / 2.0;
  EXPECT_NEAR(damping, 2 * 40 * 0.019 * 0.019 / 0.29, 1e-12);  // D = 2 ω r²/l_max
}

TEST(MusclePair, of_kerscher_muscles_is_of_third_order_beyond_its_expansion) {
  MusclePair<KerscherMuscle, double> pair;
  pair.muscle_1 = pair.muscle_2 = kerscher();
  pair.maximal_length = 0.29;
  pair.middle_length = 0.9 * 0.29;
  pair.wheel_radius = 0.019;
  MusclePair<KerscherMuscle, Jet> dual;
  dual.muscle_1 = dual.muscle_2 = {.radius = Jet(0.01),
                                   .a = Jet(6.0),
                                   .b = Jet(3.5),
                                   .a_epsilon = Jet(1.2),
                                   .b_epsilon = Jet(-1.1),
                                   .stretch_stiffness = Jet(900.0)};
  dual.maximal_length = Jet(0.29);
  dual.middle_length = Jet(0.9 * 0.29);
  dual.wheel_radius = Jet(0.019);
  const Jet t = pair_torque(dual, Jet(3e5) - Jet(0.0, 0), Jet(3e5) + Jet(0.0, 0), Jet(0.0, 1));
  EXPECT_GT(t.v[0], 0.0);
  EXPECT_LT(t.v[1], 0.0);
  const auto remainder = [&](double h) {
    return std::abs(pair_torque(pair, 3e5 - 1e5 * h, 3e5 + 1e5 * h, h) - t.v[0] * 1e5 * h - t.v[1] * h);
  };
  // A pair of equal muscles is odd in (Δp, φ): what the linear model leaves is of third order.
  EXPECT_NEAR(std::log2(remainder(0.2) / remainder(0.1)), 3.0, 0.1);
}

TEST(MusclePair, lets_a_slack_muscle_go_when_asked) {
  auto pair = bridgestone_pair(0.15);
  EXPECT_LT(pair_forces(pair, 3e5, 3e5, -2.2).force_1, 0.0);
  pair.slack = true;
  EXPECT_EQ(pair_forces(pair, 3e5, 3e5, -2.2).force_1, 0.0);
  EXPECT_GT(pair_forces(pair, 3e5, 3e5, -2.2).force_2, 0.0);
}

}  // namespace
}  // namespace isac::models
