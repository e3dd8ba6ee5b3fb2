// The PID against its equation, its integral at the limits, and its transfer.
#include "isac/control/pid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace {

using isac::Status;
using isac::control::AntiWindup;
using isac::control::Pid;
using isac::control::PidSettings;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kExact = 1e-12;  // rounding of a few operations on numbers of order 1

TEST(Pid, follows_its_equation_on_a_ramp_at_changing_intervals) {
  // e = 1 + 2 t at t_k: u = K_P e_k + K_I Σ e_k h_k + K_D de/dt, with T_f = 0 the exact slope.
  Pid<double> pid(
      {.gains = {.proportional = 3, .integral = 5, .derivative = 0.7}, .derivative_on_measurement = false});
  double t = 0, sum = 0, u = 0;
  for (int k = 0; k < 50; ++k) {
    const double h = k % 3 == 0 ? 0.001 : 0.0025;
    t += h;
    const double e = 1 + 2 * t;
    sum += e * h;
    ASSERT_EQ(pid.step(e, 0.0, h, u), Status::kOk);
    EXPECT_NEAR(u, 3 * e + 5 * sum + (k == 0 ? 0 : 0.7 * 2), 1e-10);  // slopes are differences over 1 ms
  }
}

TEST(Pid, derivative_on_measurement_is_not_kicked_by_the_reference) {
  for (const bool on_measurement : {true, false}) {
    Pid<double> pid({.gains = {.derivative = 1}, .derivative_on_measurement = on_measurement});
    double u = 0;
    ASSERT_EQ(pid.step(0.0, 0.0, 0.01, u), Status::kOk);
    ASSERT_EQ(pid.step(1.0, 0.0, 0.01, u), Status::kOk);
    EXPECT_NEAR(u, on_measurement ? 0.0 : 100.0, kExact);
    ASSERT_EQ(pid.step(1.0, 0.1, 0.01, u), Status::kOk);
    EXPECT_NEAR(u, -10.0, 1e-10);  // both brake the motion: −0.1/0.01
  }
}

TEST(Pid, derivative_filter_has_the_time_constant_it_says) {
  // Measurement −t from 0 on: slope 1 through T_f = 0.1 s; after T_f the filter has reached 1 − 1/e.
  Pid<double> pid({.gains = {.derivative = 1}, .derivative_filter = 0.1});
  double u = 0;
  for (int k = 0; k <= 1000; ++k) ASSERT_EQ(pid.step(0.0, -1e-4 * k, 1e-4, u), Status::kOk);
  EXPECT_NEAR(u, 1 - std::exp(-1.0), 5e-4);  // backward Euler at h/T_f = 1e-3 is off by about h/(2 T_f) · 1/e
}

TEST(Pid, integral_stops_at_the_limit_exactly_as_the_seed_does_it) {
  // D.2.1 line by line, in the seed's own order, beside ours.
  const double kp = 2, ki = 3, low = -1, high = 1, h = 0.01;
  Pid<double> pid({.gains = {.proportional = kp, .integral = ki}, .low = low, .high = high});
  double int_error = 0, u = 0;
  for (int k = 0; k < 3000; ++k) {
    const double e = std::sin(0.013 * k) + 0.3 * std::sin(0.11 * k);
    int_error += e * h;
    double seed = kp * e + ki * int_error;
    if (seed >= high || seed <= low) int_error -= e * h;  // the increment is taken back
    seed = std::min(std::max(seed, low), high);
    ASSERT_EQ(pid.step(e, 0.0, h, u), Status::kOk);
    ASSERT_NEAR(u, seed, 1e-10) << k;  // K_I Σ e h against Σ K_I e h over 3000 additions
  }
}

TEST(Pid, integral_does_not_wind_up_while_the_output_is_limited) {
  for (const AntiWindup kind :
       {AntiWindup::kTakeBack, AntiWindup::kConditional, AntiWindup::kBackCalculation}) {
    Pid<double> pid(
        {.gains = {.proportional = 1, .integral = 10}, .low = -1, .high = 1, .anti_windup = kind});
    double u = 0;
    for (int k = 0; k < 5000; ++k) ASSERT_EQ(pid.step(5.0, 0.0, 0.001, u), Status::kOk);
    EXPECT_EQ(u, 1.0);
    EXPECT_TRUE(pid.limited());
    EXPECT_LE(pid.integral_term(), 1.0);
    // The error turns round: the output leaves the limit within a few steps, not after five seconds of unwinding.
    int steps = 0;
    while (u >= 1.0 && steps < 1000) {
      ASSERT_EQ(pid.step(-0.5, 0.0, 0.001, u), Status::kOk);
      ++steps;
    }
    EXPECT_LT(steps, 300) << static_cast<int>(kind);  // T_t = 0.1 s is 100 steps; the others need 1
  }
}

TEST(Pid, the_seeds_rule_can_stay_at_the_limit_and_the_conditional_one_comes_back) {
  // An integral above the limit (here by a transfer) with a small error of the other sign: u stays ≥ high, so the increment
  // that would lead out is taken back too.
  const auto after_ten_seconds = [](AntiWindup kind) {
    Pid<double> pid(
        {.gains = {.proportional = 0.1, .integral = 1}, .low = -1, .high = 1, .anti_windup = kind});
    pid.transfer(1.5, 0.0, 0.0);
    double u = 0;
    for (int k = 0; k < 10000; ++k) EXPECT_EQ(pid.step(-0.2, 0.0, 0.001, u), Status::kOk);
    return u;
  };
  EXPECT_EQ(after_ten_seconds(AntiWindup::kTakeBack), 1.0);
  EXPECT_LT(after_ten_seconds(AntiWindup::kConditional), 0.0);
  EXPECT_LT(after_ten_seconds(AntiWindup::kBackCalculation), 0.0);
}

TEST(Pid, back_calculation_comes_to_rest_where_increment_and_tracking_balance) {
  // Ī: K_I e + (high − (K_P e + I))/T_t = 0 up to the increment inside u: I = high − K_P e + K_I e (T_t − h).
  const double kp = 1, ki = 4, e = 2, h = 0.001, tt = 0.05;
  Pid<double> pid({.gains = {.proportional = kp, .integral = ki},
                   .low = -1,
                   .high = 1,
                   .anti_windup = AntiWindup::kBackCalculation,
                   .tracking_time = tt});
  double u = 0;
  for (int k = 0; k < 5000; ++k) ASSERT_EQ(pid.step(e, 0.0, h, u), Status::kOk);
  EXPECT_NEAR(pid.integral_term(), 1 - kp * e + ki * e * (tt - h),
              1e-9);  // 100 time constants of a geometric series
}

TEST(Pid, transfer_makes_the_next_output_the_one_asked_for) {
  Pid<double> pid({.gains = {.proportional = 2, .integral = 5, .derivative = 0.1}});
  pid.transfer(7.0, 1.0, 0.25);
  EXPECT_NEAR(pid.output_now(1.0, 0.25), 7.0, kExact);
  double u = 0;
  ASSERT_EQ(pid.step(1.0, 0.25, 0.001, u), Status::kOk);
  EXPECT_NEAR(u, 7.0 + 5 * 0.75 * 0.001, kExact);  // one increment
}

TEST(Pid, gains_may_change_while_running_without_a_jump_of_the_integral) {
  PidSettings<double> settings{.gains = {.integral = 5}};
  Pid<double> pid(settings);
  double before = 0, after = 0;
  for (int k = 0; k < 100; ++k) ASSERT_EQ(pid.step(1.0, 0.0, 0.001, before), Status::kOk);
  settings.gains.integral = 50;
  pid.configure(settings);
  ASSERT_EQ(pid.step(1.0, 0.0, 0.001, after), Status::kOk);
  EXPECT_NEAR(after - before, 50 * 0.001, kExact);
}

TEST(Pid, refuses_what_is_not_a_number_and_intervals_that_do_not_run_forward) {
  Pid<double> pid({.gains = {.proportional = 2, .integral = 5}});
  double u = 0;
  ASSERT_EQ(pid.step(1.0, 0.0, 0.01, u), Status::kOk);
  const double kept_output = u, kept_integral = pid.integral_term();
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    EXPECT_EQ(pid.step(bad, 0.0, 0.01, u), Status::kNotFinite);
    EXPECT_EQ(pid.step(0.0, bad, 0.01, u), Status::kNotFinite);
    EXPECT_EQ(pid.step(1.0, 0.0, bad, u), Status::kNotFinite);
  }
  EXPECT_EQ(pid.step(1.0, 0.0, 0.0, u), Status::kOutOfRange);
  EXPECT_EQ(pid.step(1.0, 0.0, -0.01, u), Status::kOutOfRange);
  EXPECT_EQ(pid.step(1e308, -1e308, 0.01, u), Status::kNotFinite);  // the result overflows
  EXPECT_EQ(u, kept_output);
  EXPECT_EQ(pid.integral_term(), kept_integral);
  pid.reset();
  EXPECT_EQ(pid.integral_term(), 0.0);
}

TEST(Pid, settings_that_cannot_work_are_named) {
  using isac::control::check;
  EXPECT_EQ(check(PidSettings<double>{}), Status::kOk);
  EXPECT_EQ(check(PidSettings<double>{.gains = {.proportional = kNan}}), Status::kNotFinite);
  EXPECT_EQ(check(PidSettings<double>{.gains = {.integral = -1}}), Status::kOutOfRange);
  EXPECT_EQ(check(PidSettings<double>{.low = 1, .high = -1}), Status::kOutOfRange);
  EXPECT_EQ(check(PidSettings<double>{.tracking_time = 0}), Status::kOutOfRange);
  EXPECT_EQ(check(PidSettings<double>{.derivative_filter = -1}), Status::kOutOfRange);
}

}  // namespace
