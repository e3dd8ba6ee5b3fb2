// The dead-time predictor against its promise: the loop as if the dead time were behind it.
#include "isac/control/predictor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "isac/control/joint_controller.hpp"
#include "rk4_joint.hpp"

namespace {

using namespace isac::control;
using isac::Status;
using isac::test::Rk4Joint;

constexpr double kDt = 5e-4;

TEST(DelayLine, gives_back_the_value_of_then_at_changing_intervals) {
  DelayLine<double, 64> line;
  line.fill(0);
  double t = 0;
  for (int k = 0; k < 500; ++k) {
    const double h = k % 5 == 0 ? 0.002 : 0.0005;
    t += h;
    line.push(3 * t, h);
    for (const double delay : {0.0, 0.0001, 0.0037, 0.02}) {
      if (t < 0.06) continue;
      ASSERT_NEAR(line.at(delay), 3 * (t - delay), 1e-12);  // straight lines of a straight line
    }
  }
  EXPECT_GT(line.reach(), 0.04);
  EXPECT_NEAR(line.at(10.0), 3 * (t - line.reach()), 1e-12);  // cut to its length
}

JointSettings<double> fast_pid() {
  JointSettings<double> s = testbed_settings<double>();
  s.structure = Structure::kPid;
  s.position = {.proportional = 8e5, .integral = 2e6, .derivative = 2e4};
  s.limits.speed = std::numeric_limits<double>::infinity();
  s.derivative_filter = 0.002;
  return s;
}

/// Angle under a step of 0.2 rad after 0.1 s. The plant is linear (C = 0), as the comparison needs no more.
std::vector<double> response(JointSettings<double> s, int dead_steps, double seconds = 2.0) {
  Rk4Joint plant;
  plant.C = s.muscle.C = 0;
  plant.dead_steps = dead_steps;
  plant.rest_at(s.mean_pressure);
  for (int k = 0; k < dead_steps; ++k) plant.tube.push_back({s.mean_pressure, s.mean_pressure});
  JointController<double> controller;
  EXPECT_EQ(controller.configure(s), Status::kOk);
  EXPECT_EQ(controller.set_mode(Mode::kPosition), Status::kOk);
  std::vector<double> angle;
  for (int k = 0; k * kDt < seconds; ++k) {
    JointCommand<double> u;
    EXPECT_EQ(controller.step({.angle = plant.angle, .velocity = plant.velocity},
                              {.angle = k < 200 ? 0.0 : 0.2}, kDt, u),
              Status::kOk);
    plant.step(u.pressure.muscle_1, u.pressure.muscle_2, kDt);
    angle.push_back(plant.angle);
  }
  return angle;
}

TEST(Predictor, makes_the_loop_act_as_if_the_dead_time_were_behind_it) {
  constexpr int kDead = 40;  // 20 ms
  JointSettings<double> s = fast_pid();
  const auto free = response(s, 0);
  const auto without = response(s, kDead);
  s.valve.dead_time = kDead * kDt;
  s.predict_dead_time = true;
  const auto with = response(s, kDead);

  double worst = 0, worst_without = 0;
  for (std::size_t k = 0; k + kDead < free.size(); ++k) {
    worst = std::max(worst, std::abs(with[k + kDead] - free[k]));
    worst_without = std::max(worst_without, std::abs(without[k + kDead] - free[k]));
  }
  EXPECT_LT(worst, 0.004);         // 2 % of the step: the model's Euler steps, h/T_J = 1.6 %
  EXPECT_GT(worst_without, 0.04);  // without it the same gains ring
  RecordProperty("worst_with", std::to_string(worst));
  RecordProperty("worst_without", std::to_string(worst_without));
}

TEST(Predictor, leaves_no_error_at_rest_under_a_load_it_does_not_know) {
  JointSettings<double> s = fast_pid();
  s.valve.dead_time = 40 * kDt;
  s.predict_dead_time = true;
  Rk4Joint plant;
  plant.dead_steps = 40;
  plant.external = 0.8;
  plant.rest_at(s.mean_pressure);
  for (int k = 0; k < 40; ++k) plant.tube.push_back({s.mean_pressure, s.mean_pressure});
  JointController<double> controller;
  ASSERT_EQ(controller.configure(s), Status::kOk);
  ASSERT_EQ(controller.set_mode(Mode::kPosition), Status::kOk);
  JointCommand<double> u;
  for (int k = 0; k < 12000; ++k) {
    ASSERT_EQ(controller.step({.angle = plant.angle, .velocity = plant.velocity}, {.angle = 0.2}, kDt, u),
              Status::kOk);
    plant.step(u.pressure.muscle_1, u.pressure.muscle_2, kDt);
  }
  EXPECT_NEAR(plant.angle, 0.2, 1e-6);  // six seconds of an integral
}

TEST(Predictor, corrects_by_exactly_nothing_without_dead_time_and_at_rest) {
  JointPredictor<double> none({isac::models::testbed_parameters<double>(), 0.019, 0.0085, {}});
  none.reset(0.1, 2e4);
  double correction = 1;
  for (int k = 0; k < 100; ++k) {
    ASSERT_EQ(none.step(1e5, 0.3, kDt, correction), Status::kOk);
    EXPECT_EQ(correction, 0.0);
  }
  JointPredictor<double> resting(
      {isac::models::testbed_parameters<double>(), 0.019, 0.0085, {.dead_time = 0.01}});
  resting.reset(0.0, 0.0);
  for (int k = 0; k < 100; ++k) {
    ASSERT_EQ(resting.step(0.0, 0.0, kDt, correction), Status::kOk);
    EXPECT_EQ(correction, 0.0);
  }
}

TEST(Predictor, its_model_comes_to_rest_where_pressure_spring_and_load_balance) {
  const auto muscle = isac::models::testbed_parameters<double>();
  JointPredictor<double> predictor({muscle, 0.019, 0.0085, {}});
  predictor.reset(0.0, 0.0);
  double correction = 0;
  for (int k = 0; k < 8000; ++k) ASSERT_EQ(predictor.step(5e4, -0.7, kDt, correction), Status::kOk);
  const double stiffness = 23450 * 0.019 * 0.019;
  EXPECT_NEAR(predictor.angle(), (muscle.B * 0.019 * 5e4 - 0.7) / stiffness, 1e-6);  // e^(−4 s/0.17 s)
}

TEST(Predictor, refuses_bad_numbers) {
  JointPredictor<double> predictor({isac::models::testbed_parameters<double>(), 0.019, 0.0085, {}});
  double correction = 7;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(predictor.step(nan, 0, kDt, correction), Status::kNotFinite);
  EXPECT_EQ(predictor.step(0, 0, 0, correction), Status::kOutOfRange);
  EXPECT_EQ(JointPredictor<double>{}.step(0, 0, kDt, correction), Status::kOutOfRange);  // no inertia
  EXPECT_EQ(correction, 7);
}

}  // namespace
