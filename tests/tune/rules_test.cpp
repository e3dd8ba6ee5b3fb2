// Row C1, P2: the rules with the seed's numbers (after docs/errata.md), and the tangent of a step.
#include "isac/tune/rules.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "isac/core/units.hpp"
#include "isac/simulate/random.hpp"
#include "isac/tune/linear_step.hpp"

namespace isac::tune {
namespace {

constexpr double kKg = kPascalPerKgfCm2;

TEST(Rules, ziegler_nichols_gives_the_seeds_gains_after_the_errata) {
  const auto k = ziegler_nichols({.gain = 1.25, .period = 0.175}, Form::kPid);
  EXPECT_NEAR(k.proportional, 0.75, 1e-12);
  EXPECT_NEAR(k.integral, 8.571, 1e-3);  // printed 14.3 is K_P,crit/(0.5 T_crit)
  EXPECT_NEAR(1.25 / (0.5 * 0.175), 14.3, 0.02);
  EXPECT_NEAR(k.derivative, 0.01575, 1e-12);  // printed 0.016
}

TEST(Rules, chien_hrones_reswick_gives_the_seeds_gains_after_the_errata) {
  // Errata: 6, 133.3, 0.045 from the printed T_L = 0.015, T_A = 0.045, K_J = 0.3.
  const auto k = chien_hrones_reswick({.latency = 0.015, .adjustment = 0.045}, 0.3, Form::kPid,
                                      Aim::kReference, Overshoot::kNone);
  EXPECT_NEAR(k.proportional, 6.0, 1e-12);
  EXPECT_NEAR(k.integral, 133.33, 0.01);
  EXPECT_NEAR(k.derivative, 0.045, 1e-12);
}

TEST(Rules, all_four_variants_follow_the_published_table) {
  const models::StepShape<double> step{.latency = 1, .adjustment = 10};
  struct {
    Aim aim;
    Overshoot overshoot;
    double p, pi, ti, pid, tpid, td;
  } rows[] = {{Aim::kReference, Overshoot::kNone, 3, 3.5, 12, 6, 10, 0.5},
              {Aim::kReference, Overshoot::kTwentyPercent, 7, 6, 10, 9.5, 13.5, 0.47},
              {Aim::kDisturbance, Overshoot::kNone, 3, 6, 4, 9.5, 2.4, 0.42},
              {Aim::kDisturbance, Overshoot::kTwentyPercent, 7, 7, 2.3, 12, 2.0, 0.42}};
  for (const auto& r : rows) {
    const auto p = chien_hrones_reswick(step, 1, Form::kP, r.aim, r.overshoot);
    EXPECT_NEAR(p.proportional, r.p, 1e-12);
    EXPECT_EQ(p.integral, 0);
    const auto pi = chien_hrones_reswick(step, 1, Form::kPi, r.aim, r.overshoot);
    EXPECT_NEAR(pi.proportional, r.pi, 1e-12);
    EXPECT_NEAR(pi.integral, r.pi / r.ti, 1e-12);
    const auto pid = chien_hrones_reswick(step, 1, Form::kPid, r.aim, r.overshoot);
    EXPECT_NEAR(pid.proportional, r.pid, 1e-12);
    EXPECT_NEAR(pid.integral, r.pid / r.tpid, 1e-12);
    EXPECT_NEAR(pid.derivative, r.pid * r.td, 1e-12);
  }
}

TEST(Rules, tangent_of_the_seeds_joint_has_the_latency_of_the_errata) {
  // Coefficients as printed in eq 4.7, 0.001 and 0.018; printed are 0.015, 0.045, 0.36.
  const double tj = std::sqrt(0.001);
  const auto printed =
      joint_step_shape({.gain = 0.3, .lag = 0.17, .time_constant = tj, .damping = 0.018 / (2 * tj)});
  EXPECT_NEAR(printed.latency, 0.0140, 5e-5);
  EXPECT_NEAR(printed.adjustment, 0.0463, 5e-5);
  EXPECT_NEAR(printed.latency / printed.adjustment, 0.303, 5e-4);
  EXPECT_EQ(controllability(printed), Controllability::kFair);
  // From A, D, r and I as they stand: T_J 0.0317 s, ζ 0.261.
  LagPlant plant;
  ASSERT_TRUE(ok(lag_plant(testbed_model(), plant)));
  const auto joint = joint_step_shape(plant), whole = step_shape(plant);
  EXPECT_NEAR(joint.latency, 0.01432, 5e-6);
  EXPECT_NEAR(joint.adjustment, 0.04511, 5e-6);
  // With the valve unit in front, what a step of Δp commanded shows: T_L/T_A 0.265, easier than the joint alone.
  EXPECT_NEAR(whole.latency, 0.04164, 5e-6);
  EXPECT_NEAR(whole.adjustment, 0.15722, 5e-6);
}

TEST(Rules, tangent_of_the_whole_plant_touches_a_finely_simulated_step) {
  for (const double damping : {0.1, 0.5, 1.0, 2.5}) {
    const LagPlant plant{
        .gain = 2, .lag = 0.17, .time_constant = 0.04, .damping = damping, .dead_time = 0.013};
    const double h = 1e-5;
    std::vector<double> command(100000, 1.0);
    command[0] = 0;
    const std::vector<double> y = simulate(plant, h, command);
    std::size_t at = 1;
    for (std::size_t k = 1; k + 1 < y.size(); ++k)
      if (y[k + 1] - y[k] > y[at + 1] - y[at]) at = k;
    const double slope = (y[at + 1] - y[at]) / h,
                 t = (static_cast<double>(at) - 0.5) * h;  // the step acts from sample 1
    const auto shape = step_shape(plant);
    EXPECT_NEAR(shape.adjustment, 2 / slope, 1e-5 * shape.adjustment) << damping;
    EXPECT_NEAR(shape.latency, t - y[at] / slope, 2e-5) << damping;  // two samples
  }
}

TEST(LinearStep, a_dead_time_below_zero_continues_the_answer_and_reads_nothing_past_the_command) {
  const LagPlant plant{.gain = 2, .lag = 0.1, .time_constant = 0.04, .damping = 0.5};
  std::vector<double> command(300, 1.0);  // exactly filled: the sanitizers see a read behind it
  command.shrink_to_fit();
  command[0] = 0;
  for (std::size_t k = 150; k < command.size(); ++k) command[k] = -1.0;
  const double interval = 0.001, h = 1e-5;
  const auto at = [&](double dead_time) {
    LagPlant moved = plant;
    moved.dead_time = dead_time;
    return simulate(moved, interval, command);
  };
  const std::vector<double> before = at(-h), here = at(0), after = at(h), ahead = at(-2.5 * interval);
  // Exact answers: both one-sided slopes are −ẏ; they differ by ÿ h, and ÿ is at most 2 · 2/T_C T_J = 1e3 rad/s².
  for (std::size_t k = 1; k + 1 < here.size(); ++k)
    EXPECT_NEAR((after[k] - here[k]) / h, (here[k] - before[k]) / h, 1e3 * h) << k;
  for (const double y : ahead) EXPECT_TRUE(std::isfinite(y));
}

TEST(Rules, joint_latency_goes_over_smoothly_from_swinging_to_creeping) {
  const auto below = joint_step_shape({1, 0.1, 0.04, 0.9999, 0}),
             above = joint_step_shape({1, 0.1, 0.04, 1.0001, 0});
  EXPECT_NEAR(below.latency, above.latency, 2e-4 * below.latency);  // ζ itself differs by 2e-4
  EXPECT_NEAR(below.adjustment, above.adjustment, 5e-4 * below.adjustment);
}

TEST(LinearStep, means_over_rows_are_those_of_the_answer_for_every_dead_time_and_number_of_rows) {
  simulate::Random random(11, 1);
  std::vector<double> command(1003);
  for (double& u : command) u = random.normal();
  std::vector<double> mean;
  for (const double dead_time : {-0.0123, -0.001, 0.0, 0.0005, 0.003, 0.0217, 2.0})
    for (const std::size_t rows : {1, 2, 7, 40}) {
      const LagPlant plant{.gain = 2,
                           .lag = 0.05,
                           .time_constant = 0.02,
                           .damping = 0.3,
                           .dead_time = dead_time,
                           .bend = 1e-4};
      const std::vector<double> angle = simulate(plant, 0.001, command);
      simulate_means_into(plant, 0.001, command, rows, mean);
      ASSERT_EQ(mean.size(), command.size() / rows);
      for (std::size_t b = 0; b < mean.size(); ++b) {
        double sum = 0;
        for (std::size_t k = b * rows; k < (b + 1) * rows; ++k) sum += angle[k];
        ASSERT_NEAR(mean[b], sum / static_cast<double>(rows), 1e-12)
            << dead_time << " s, " << rows << " rows";
      }
    }
}

TEST(LinearStep, answers_are_those_of_the_closed_form_for_a_dead_time_between_samples) {
  // A joint so fast that it vanishes: 1 − e^(−(t − L)/T).
  const LagPlant plant{.gain = 1, .lag = 0.2, .time_constant = 1e-5, .damping = 1, .dead_time = 0.0137};
  std::vector<double> command(300, 1.0);
  command[0] = 0;
  const auto y = simulate(plant, 0.01, command);
  for (std::size_t k = 0; k < y.size(); ++k) {
    const double t = (static_cast<double>(k) - 1) * 0.01 - plant.dead_time;
    EXPECT_NEAR(y[k], t > 0 ? 1 - std::exp(-t / 0.2) : 0.0, 2e-4);  // 2 T_J/T: the joint's own lag
  }
}

}  // namespace
}  // namespace isac::tune
