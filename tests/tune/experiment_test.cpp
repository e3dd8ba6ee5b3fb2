// Experiments as step objects, the fit's refusals, the simulated loop against the linear verdict, and the draws.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/simulate/random.hpp"
#include "isac/tune/assess.hpp"
#include "isac/tune/gain_ramp.hpp"
#include "isac/tune/optimise.hpp"
#include "isac/tune/plant_fit.hpp"
#include "isac/tune/procedure.hpp"
#include "isac/tune/relay.hpp"
#include "isac/tune/step_series.hpp"
#include "isac/tune/tuning.hpp"
#include "random_plants.hpp"

namespace isac::tune {
namespace {

constexpr double kKg = kPascalPerKgfCm2;

test::KnownPlant testbed_plant() {
  test::KnownPlant p;
  p.gain = 0.3911 / kKg;
  p.lags = {0.17};
  p.time_constant = 0.0317;
  p.damping = 0.261;
  return p;
}

TEST(Experiment, never_commands_beyond_its_reach_whatever_the_angle_does) {
  const ExperimentSettings settings{
      .centre = 2e4, .reach = 3e4, .settle = 0.1, .longest = 5, .interval = 0.001};
  RelayExperiment relay(settings, {.amplitude = 9e4});
  GainRamp ramp(settings, {.first_gain = 1e7, .kick = 0.1});
  StepSeries steps(settings, {.height = 9e4, .hold = 0.2});
  simulate::Random random(3, 1);
  for (Experiment* e : {static_cast<Experiment*>(&relay), static_cast<Experiment*>(&ramp),
                        static_cast<Experiment*>(&steps)}) {
    for (int k = 0; !e->finished(); ++k) {
      const double u = e->step(k * 0.001, random.uniform(-10, 10));
      ASSERT_LE(std::abs(u - 2e4), 3e4);
    }
    EXPECT_EQ(e->step(99, 0), 2e4);  // finished: back at the centre
  }
}

TEST(Experiment, an_angle_that_is_no_number_fails_it_with_a_reason) {
  RelayExperiment relay({.reach = 1e4, .settle = 0.1, .longest = 5}, {.amplitude = 1e4});
  EXPECT_EQ(relay.step(0, 0), 0);
  EXPECT_EQ(relay.step(0.001, std::numeric_limits<double>::quiet_NaN()), 0);
  EXPECT_EQ(relay.state(), Experiment::State::kFailed);
  EXPECT_NE(std::string(relay.failure()), "");
}

TEST(Experiment, a_joint_that_does_not_move_ends_the_relay_when_its_time_is_up) {
  RelayExperiment relay({.reach = 1e4, .settle = 0.1, .longest = 2, .interval = 0.001},
                        {.amplitude = 1e4, .least_hysteresis = 1e-3});
  for (int k = 0; !relay.finished(); ++k) relay.step(k * 0.001, 0.0);
  EXPECT_EQ(relay.state(), Experiment::State::kFailed);
  EXPECT_THROW(static_cast<void>(fit_plant(relay.excited())), Error);
}

TEST(Relay, describing_function_is_off_where_the_fitted_plant_is_not) {
  test::KnownPlant plant = testbed_plant();
  simulate::Random random(5, 1);
  RelayExperiment relay({.reach = 4e4, .settle = 0.5, .longest = 20, .interval = 0.001},
                        {.amplitude = 2e4, .least_hysteresis = 2e-3});
  test::play(relay, plant, 0.001, random);
  ASSERT_EQ(relay.state(), Experiment::State::kDone);
  const double gain = 1 / plant.size(plant.critical()), period = 2 * kPi / plant.critical();
  const PlantFit fit = fit_plant(relay.excited(), {.time_scale = relay.describing_function().period});
  ASSERT_EQ(fit.refusal, "");
  EXPECT_NEAR(value_of(fit, "K_crit").value * kKg, gain, 0.005 * gain);
  EXPECT_NEAR(value_of(fit, "T_crit").value, period, 0.005 * period);
  const DescribingFunction d = relay.describing_function();
  EXPECT_GT(std::abs(d.gain / gain - 1), 0.02);  // stated in docs/tuning.md
}

TEST(Relay, compensates_the_bias_of_a_load) {
  test::KnownPlant plant = testbed_plant();
  plant.load = 6e3;
  simulate::Random random(6, 1);
  RelayExperiment relay({.reach = 4e4, .settle = 0.5, .longest = 20, .interval = 0.001},
                        {.amplitude = 2e4, .least_hysteresis = 2e-3});
  test::play(relay, plant, 0.001, random);
  ASSERT_EQ(relay.state(), Experiment::State::kDone);
  EXPECT_NEAR(relay.bias(), -6e3, 1e3);  // a twentieth of the amplitude
}

TEST(GainRamp, finds_the_border_without_crossing_it) {
  test::KnownPlant plant = testbed_plant();
  simulate::Random random(7, 1);
  const double gain = 1 / plant.size(plant.critical());
  GainRamp ramp({.reach = 2e5, .settle = 0.5, .longest = 100, .interval = 0.001},
                {.first_gain = 0.2 * gain, .kick = 0.03});
  test::play(ramp, plant, 0.001, random);
  ASSERT_EQ(ramp.state(), Experiment::State::kDone);
  for (int i = 0; i < ramp.levels(); ++i) EXPECT_LT(ramp.level(i).gain, gain);
  EXPECT_NEAR(ramp.regressed()->gain, gain, 0.05 * gain);
  EXPECT_EQ(second_opinion(ramp, {gain, 2 * kPi / plant.critical()}), "");
  EXPECT_NE(second_opinion(ramp, {1.5 * gain, 2 * kPi / plant.critical()}), "");
}

TEST(PlantFit, refuses_a_joint_that_is_no_lag) {
  // Stick-slip: the angle follows only in jumps.
  RelayExperiment relay({.reach = 4e4, .settle = 0.5, .longest = 20, .interval = 0.001},
                        {.amplitude = 2e4, .least_hysteresis = 2e-3});
  double lag = 0, angle = 0, u = 0;
  for (int k = 0; !relay.finished(); ++k) {
    lag += 0.001 / 0.05 * (4e-6 * u - lag);
    if (std::abs(lag - angle) > 0.03) angle = lag;
    u = relay.step(k * 0.001, angle);
  }
  ASSERT_EQ(relay.state(), Experiment::State::kDone);
  EXPECT_NE(fit_plant(relay.excited(), {.time_scale = relay.describing_function().period}).refusal, "");
}

TEST(PlantFit, a_late_first_stamp_does_not_shift_angles_against_commands) {
  // Ticks of 1 ms stamped up to 0.2 ms late, the first and the last by the most; the angle is the time of the tick itself.
  simulate::Random random(10, 1);
  ExperimentRecord record;
  const int n = 2000;
  for (int k = 0; k < n; ++k) {
    const double late = k == 0 || k == n - 1 ? 2e-4 : 2e-4 * random.uniform();
    record.time.push_back(1e-3 * k + late);
    record.command.push_back(k);
    record.angle.push_back(1e-3 * k);
  }
  const ExperimentRecord even = even_record(record);
  ASSERT_EQ(even.angle.size(), record.angle.size());
  double shift = 0;
  for (std::size_t k = 0; k < even.angle.size(); ++k) {
    shift += (even.angle[k] - 1e-3 * even.command[k]) / n;
    ASSERT_EQ(even.command[k], k);
  }
  EXPECT_NEAR(shift, 0, 1e-5);  // laid from the first stamp it was 1e-4
}

/// Three rounds of steps on `plant`, fitted.
PlantFit stepped(const test::KnownPlant& plant, double interval, std::uint64_t seed) {
  simulate::Random random(seed, 1);
  const double period = 2 * kPi / plant.critical();
  StepSeries steps({.reach = 4e4, .settle = 0.5, .longest = 60, .interval = interval},
                   {.height = 3e4, .hold = 6 * period});
  test::play(steps, plant, interval, random);
  EXPECT_EQ(steps.state(), Experiment::State::kDone);
  return fit_plant(steps.excited(), {.time_scale = period, .noise = steps.noise()});
}

TEST(PlantFit, every_row_counts_however_many_there_are) {
  test::KnownPlant plant = testbed_plant();
  plant.dead_time = 0.012;  // whole parts of both ticks
  plant.noise = 0.01 * 3e4 * plant.gain;
  const PlantFit few = stepped(plant, 0.004, 11), many = stepped(plant, 0.0005, 12);
  ASSERT_EQ(few.refusal + many.refusal, "");
  // Eight times the rows of white noise: 0.35; a residual for every n-th row alone gave 0.7 to 0.8.
  for (const char* name : {"K_crit", "T_crit", "T_A"})
    EXPECT_LT(value_of(many, name).std_error, 0.55 * value_of(few, name).std_error) << name;
}

TEST(PlantFit, a_lead_beyond_all_lags_is_met_by_dead_time_below_zero) {
  test::KnownPlant plant = testbed_plant();
  plant.lags = {0.17, 0.006};
  plant.lead = 0.012;  // 6 ms more than the second lag, and no dead time that could take them up
  plant.damping = 0.5;
  plant.noise = 0.002 * 3e4 * plant.gain;
  const double gain = 1 / plant.size(plant.critical());
  const PlantFit fit = stepped(plant, 0.001, 13);
  ASSERT_EQ(fit.refusal, "");
  const Estimated& e = value_of(fit, "K_crit");
  EXPECT_NEAR(e.value * kKg, gain, 0.02 * gain);
  EXPECT_LT(e.ci_low * kKg, gain);
  EXPECT_GT(e.ci_high * kKg, gain);
  EXPECT_EQ(fit.plant.dead_time, 0);  // the joint's model knows no lead
}

TEST(ClosedLoop, simulated_loop_dies_away_inside_the_linear_gain_margin_and_swings_up_outside) {
  JointModel joint = testbed_model();
  joint.muscle.C = 0;
  joint.valve.dead_time = 0.008;
  joint.limits.delta_pressure = 1e9;
  joint.limits.pressure = 1e9;
  joint.mean_pressure = 5e8;  // no limit in the way: the linear loop
  Gains pid{.structure = control::Structure::kPid};
  pid.position = {.proportional = 2 * kKg, .integral = 10 * kKg, .derivative = 0.04 * kKg};
  Gains cascade;
  cascade.position = {.proportional = 12, .integral = 6};
  cascade.torque = {.proportional = 0.1 * kKg, .integral = 40 * kKg};
  for (Gains gains : {pid, cascade}) {
    const double border = margins(control_loop(joint, gains)).gain;
    ASSERT_GT(border, 1);
    for (const double factor : {0.94, 1.06}) {  // 6 %: sampling enters the linear loop as a delay only
      Gains g = gains;
      const bool direct = g.structure == control::Structure::kPid;
      // The whole loop's gain: for the cascade a weaker or stronger valve says the same.
      JointModel moving = joint;
      if (direct)
        g.position = {g.position.proportional * border * factor, g.position.integral * border * factor,
                      g.position.derivative * border * factor};
      else
        moving.valve.gain *= border * factor;
      ClosedLoopOptions options;
      options.encoder_step = 0;
      const Trace t = run_closed_loop(
          joint, moving, g, [](double time) { return time < 0.02 ? 0.01 : 0.0; }, 8, options);
      const auto swing = [&](double from, double to) {
        double most = 0;
        for (std::size_t k = 0; k < t.time.size(); ++k)
          if (t.time[k] >= from && t.time[k] < to)
            most = std::max(most, std::abs(t.angle[k] - t.angle.back()));
        return most;
      };
      if (factor < 1)
        EXPECT_LT(swing(5, 6), swing(2, 3)) << factor;
      else
        EXPECT_TRUE(!t.bounded || swing(5, 6) > swing(2, 3)) << factor;
    }
  }
}

TEST(Draws, have_the_covariance_they_were_asked_for) {
  RelativeCovariance covariance{};
  covariance[0] = 0.02 * 0.02;
  covariance[kDrawnParameters + 1] = 0.04 * 0.04;
  covariance[1] = covariance[kDrawnParameters] = 0.5 * 0.02 * 0.04;
  const JointModel model = testbed_model();
  double aa = 0, bb = 0, ab = 0;
  const int n = 4000;
  for (const JointModel& j : draw_joints(model, covariance, n, 3)) {
    const double a = j.muscle.A / model.muscle.A - 1, b = j.muscle.B / model.muscle.B - 1;
    aa += a * a / n, bb += b * b / n, ab += a * b / n;
    EXPECT_EQ(j.muscle.D, model.muscle.D);
  }
  EXPECT_NEAR(std::sqrt(aa), 0.02, 0.001);  // 4000 draws know a deviation to 1.1 %
  EXPECT_NEAR(std::sqrt(bb), 0.04, 0.002);
  EXPECT_NEAR(ab / std::sqrt(aa * bb), 0.5, 0.05);
}

TEST(Tuning, a_search_that_a_person_stops_changes_nothing_and_says_so) {
  Gains before;
  before.position = {.proportional = 4, .integral = 8};
  before.torque = {.proportional = 0.1 * kKg, .integral = 10 * kKg};
  int asked = 0;
  TuningOptions options{.draws = 4, .all_rules = false};
  options.stop = [&asked] { return ++asked > 10; };
  const Tuning tuning = tune_joint(testbed_model(), independent({}), before, options);
  EXPECT_EQ(tuning.refusal, "the search was stopped by hand");
  EXPECT_LE(tuning.evaluations, 10);
  ASSERT_TRUE(tuning.before);
  EXPECT_EQ(tuning.before->gains.position.integral, 8);
}

TEST(Search, never_tries_less_integral_than_it_was_told_and_its_gains_arrive) {
  OptimiseOptions options{.nominal_evaluations = 40, .round_evaluations = 20, .rounds = 1};
  options.least_integral = 0.3;
  const JointModel model = testbed_model();
  const auto start = tune_by_procedure(model);
  ASSERT_TRUE(start);
  const Optimised found = optimise(model, {}, {*start}, options);
  ASSERT_TRUE(found.found);
  EXPECT_GE(found.gains.position.integral, 0.3 * found.gains.position.proportional);
  EXPECT_LE(step_figures(run_step(model, model, found.gains), kStepHeight).rest, 0.05);
}

TEST(Procedure, inner_gains_leave_the_sampled_loop_its_room_and_reach_a_torque_within_one_outer_interval) {
  const JointModel model = testbed_model();
  const auto k = inner_gains(model);
  const double gain = model.muscle.B * model.wheel_radius, a = gain * k.proportional,
               b = gain * k.integral * 5e-4;
  EXPECT_NEAR(a + b / 2, 0.4, 1e-9);
  EXPECT_NEAR((1 + a) * 5e-4 / b, 0.005, 1e-6);
}

TEST(Procedure, position_loop_overshoots_by_the_seeds_ten_percent) {
  const JointModel model = testbed_model();
  const auto gains = tune_by_procedure(model);
  ASSERT_TRUE(gains);
  const StepFigures f = step_figures(run_step(model, model, *gains), kStepHeight);
  EXPECT_NEAR(f.overshoot, 0.10,
              0.003);  // the bisection ends within a ten-thousandth of the gain; encoder steps remain
}

}  // namespace
}  // namespace isac::tune
