// Margins and stability against closed forms, Hurwitz's criterion, and a sampled simulation.
#include "isac/tune/loop.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "isac/control/stability.hpp"
#include "isac/core/units.hpp"
#include "isac/simulate/random.hpp"

namespace isac::tune {
namespace {

constexpr double kKg = kPascalPerKgfCm2;
const Sampling kContinuous{.interval = 0, .outer_every = 0, .velocity_filter = 0, .derivative_filter = 0};

/// k e^(−L s)/s: everything about it is known.
Loop integrator(double k, double delay) {
  return {.numerator = {{{k}, delay}}, .denominator = {{{1.0, 0.0}}}};
}

TEST(Loop, margins_of_an_integrator_with_dead_time_are_those_of_the_closed_form) {
  const double k = 3, delay = 0.1;
  const Margins m = margins(integrator(k, delay));
  EXPECT_TRUE(m.stable);
  EXPECT_NEAR(m.gain, kPi / 2 / (k * delay), 1e-9);  // |L| = k/ω at ω = π/(2 L)
  EXPECT_NEAR(m.phase, kPi / 2 - k * delay, 1e-9);   // at ω = k
  EXPECT_NEAR(m.delay, (kPi / 2 - k * delay) / k, 1e-9);
  EXPECT_EQ(m.gain_down, 0);
  // The modulus margin bounds the others.
  EXPECT_GE(m.gain, 1 / (1 - m.modulus) - 1e-9);
  EXPECT_GE(m.phase, 2 * std::asin(m.modulus / 2) - 1e-9);
}

TEST(Loop, an_integrator_with_dead_time_is_stable_up_to_a_quarter_turn) {
  EXPECT_TRUE(is_stable(integrator(15.70, 0.1)));  // π/2/0.1 = 15.708
  EXPECT_FALSE(is_stable(integrator(15.72, 0.1)));
  const auto u = ultimate(integrator(1, 0.1));
  ASSERT_TRUE(u);
  EXPECT_NEAR(u->gain, kPi / 2 / 0.1, 1e-8);
  EXPECT_NEAR(u->period, 0.4, 1e-9);
}

TEST(Loop, a_pole_in_the_right_half_needs_gain_and_has_a_lower_gain_margin) {
  const Loop loop{.numerator = {{{4.0}}},
                  .denominator = {{{1.0, -1.0}}}};  // 4/(s − 1): stable for more than 1
  const Margins m = margins(loop);
  EXPECT_TRUE(m.stable);
  EXPECT_FALSE(is_stable({.numerator = {{{0.9}}}, .denominator = {{{1.0, -1.0}}}}));
  EXPECT_NEAR(m.modulus, 1.0, 1e-3);  // |1 + L| = |s + 3|/|s − 1| falls to 1 at ω → ∞
}

TEST(Loop, ultimate_gain_of_the_testbed_is_that_of_the_hurwitz_border) {
  const auto u = ultimate(plant_loop(testbed_model()));
  ASSERT_TRUE(u);
  EXPECT_NEAR(u->gain / kKg, 8.11, 0.01);  // docs/derivations/stability.md
  EXPECT_NEAR(u->period, 0.190, 0.001);
}

TEST(Loop, verdict_agrees_with_hurwitz_on_loops_of_random_gains) {
  simulate::Random random(11, 1);
  int stable = 0;
  for (int i = 0; i < 600; ++i) {
    JointModel j = testbed_model();
    j.inertia *= std::exp(random.uniform(-1, 1.5));
    j.valve.lag *= std::exp(random.uniform(-2, 1));
    Gains g;
    g.position = {.proportional = std::exp(random.uniform(-1, 6)),
                  .integral = std::exp(random.uniform(-2, 7)),
                  .derivative = 0};
    g.torque = {.proportional = kKg * std::exp(random.uniform(-5, 0)),
                .integral = kKg * std::exp(random.uniform(-2, 4)),
                .derivative = 0};
    const control::CascadeLoop<double> l{j.muscle, j.wheel_radius, j.inertia, j.valve, g.position, g.torque};
    const bool mbpi = control::is_hurwitz(control::model_based_polynomial(l));
    EXPECT_EQ(is_stable(control_loop(j, g, kContinuous)), mbpi) << "loop " << i;
    g.structure = control::Structure::kCascade;
    EXPECT_EQ(is_stable(control_loop(j, g, kContinuous)), control::is_hurwitz(control::cascade_polynomial(l)))
        << "loop " << i;
    g.structure = control::Structure::kPid;
    g.position = {.proportional = kKg * std::exp(random.uniform(-3, 3)),
                  .integral = kKg * std::exp(random.uniform(-2, 5)),
                  .derivative = kKg * std::exp(random.uniform(-6, 0))};
    models::SecondOrder<double> motion;
    ASSERT_TRUE(ok(models::second_order(j.muscle, j.wheel_radius, j.inertia, motion)));
    EXPECT_EQ(is_stable(control_loop(j, g, kContinuous)),
              control::is_hurwitz(control::pid_polynomial(motion, j.valve, g.position)))
        << "loop " << i;
    stable += mbpi ? 1 : 0;
  }
  EXPECT_GT(stable, 100);  // both verdicts were asked for often
  EXPECT_LT(stable, 500);
}

TEST(Loop, delay_margin_is_the_dead_time_at_which_the_verdict_changes) {
  JointModel j = testbed_model();
  Gains g;
  g.position = {.proportional = 4, .integral = 8, .derivative = 0};
  g.torque = {.proportional = 0.1 * kKg, .integral = 10 * kKg, .derivative = 0};
  const Margins m = margins(control_loop(j, g));
  ASSERT_TRUE(m.stable);
  ASSERT_TRUE(std::isfinite(m.delay));
  j.valve.dead_time = 0.99 * m.delay;
  EXPECT_TRUE(is_stable(control_loop(j, g)));
  j.valve.dead_time = 1.01 * m.delay;
  EXPECT_FALSE(is_stable(control_loop(j, g)));
}

TEST(Loop, gain_margin_is_the_factor_at_which_the_verdict_changes) {
  JointModel j = testbed_model();
  j.valve.dead_time = 0.01;
  Gains g{.structure = control::Structure::kPid};
  g.position = {.proportional = 2 * kKg, .integral = 10 * kKg, .derivative = 0.05 * kKg};
  const Margins m = margins(control_loop(j, g));
  ASSERT_TRUE(m.stable);
  for (const double factor : {0.99, 1.01}) {
    Gains scaled = g;
    for (double* k : {&scaled.position.proportional, &scaled.position.integral, &scaled.position.derivative})
      *k *= m.gain * factor;
    EXPECT_EQ(is_stable(control_loop(j, scaled)), factor < 1);
  }
}

}  // namespace
}  // namespace isac::tune
