// The gate before the valves, and the velocity from encoder steps.
#include "isac/control/limits.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "isac/control/velocity_estimate.hpp"

namespace {

using namespace isac::control;
using isac::kPascalPerKgfCm2;
using isac::kPi;
using isac::Status;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kBias = 3 * kPascalPerKgfCm2, kTwo = 2 * kPascalPerKgfCm2;

TEST(Gate, holds_delta_pressure_within_two_kilograms) {
  Conditioned<double> out;
  for (const double sign : {1.0, -1.0}) {
    ASSERT_EQ(condition(JointLimits<double>{}, kBias, 0.0, sign * 5 * kPascalPerKgfCm2, 5e-4, out),
              Status::kOk);
    EXPECT_EQ(out.delta_pressure, sign * kTwo);
    EXPECT_EQ(out.pressure.muscle_1, kBias - sign * kTwo);
    EXPECT_EQ(out.pressure.muscle_2, kBias + sign * kTwo);
    EXPECT_EQ(out.limited, kDeltaPressureLimited);
  }
}

TEST(Gate, never_asks_for_less_than_nothing_or_more_than_the_valve_has) {
  JointLimits<double> limits;
  Conditioned<double> out;
  // p0 of 1 kg/cm²: muscle 1 would be at −1; it stays at 0, and Δp is that of the pair that is really asked for.
  ASSERT_EQ(condition(limits, kPascalPerKgfCm2, 0.0, kTwo, 5e-4, out), Status::kOk);
  EXPECT_EQ(out.pressure.muscle_1, 0.0);
  EXPECT_EQ(out.pressure.muscle_2, 3 * kPascalPerKgfCm2);
  EXPECT_EQ(out.delta_pressure, 1.5 * kPascalPerKgfCm2);
  EXPECT_EQ(out.limited, kPressureLimited);
  limits.pressure = 4 * kPascalPerKgfCm2;
  ASSERT_EQ(condition(limits, kBias, 0.0, kTwo, 5e-4, out), Status::kOk);
  EXPECT_EQ(out.pressure.muscle_2, limits.pressure);
}

TEST(Gate, any_finite_command_ends_inside_all_limits) {
  std::mt19937_64 random(20261121);
  std::uniform_real_distribution<double> wide(-1e7, 1e7), bias(0, 6 * kPascalPerKgfCm2);
  JointLimits<double> limits;
  limits.delta_pressure_rate = 1e6;
  for (int k = 0; k < 20000; ++k) {
    Conditioned<double> out;
    const double last = wide(random) / 1e7 * kTwo;
    ASSERT_EQ(condition(limits, bias(random), last, wide(random), 5e-4, out), Status::kOk);
    for (const double p : {out.pressure.muscle_1, out.pressure.muscle_2}) {
      ASSERT_GE(p, 0.0);
      ASSERT_LE(p, limits.pressure);
    }
    ASSERT_LE(std::abs(out.delta_pressure), kTwo);
  }
}

TEST(Gate, limits_the_rate_before_all_else) {
  JointLimits<double> limits;
  limits.delta_pressure_rate = 1e6;
  Conditioned<double> out;
  ASSERT_EQ(condition(limits, kBias, 1000.0, kTwo, 5e-4, out), Status::kOk);
  EXPECT_NEAR(out.delta_pressure, 1500.0, 1e-9);  // 1 MPa/s · 0.5 ms; rounding of 1e3
  EXPECT_EQ(out.limited, kRateLimited);
}

TEST(Gate, a_command_that_is_not_finite_is_a_fault_and_is_never_clamped) {
  // Infinity is what a rate limit or a clamp would hide; with and without a rate limit it must come out as a fault.
  for (const double rate : {1e6, kInfinity}) {
    JointLimits<double> limits;
    limits.delta_pressure_rate = rate;
    for (const double bad : {kNan, kInfinity, -kInfinity}) {
      Conditioned<double> out;
      out.delta_pressure = 42;
      EXPECT_EQ(condition(limits, kBias, 0.0, bad, 5e-4, out), Status::kNotFinite);
      EXPECT_EQ(out.delta_pressure, 42);  // untouched
      EXPECT_EQ(condition(limits, bad, 0.0, 0.0, 5e-4, out), Status::kNotFinite);
    }
  }
}

TEST(Gate, limits_that_exclude_everything_are_refused) {
  EXPECT_EQ(check(JointLimits<double>{}), Status::kOk);
  JointLimits<double> limits;
  limits.angle_low = limits.angle_high;
  EXPECT_EQ(check(limits), Status::kOutOfRange);
  for (double JointLimits<double>::*member :
       {&JointLimits<double>::delta_pressure, &JointLimits<double>::delta_pressure_rate,
        &JointLimits<double>::pressure, &JointLimits<double>::torque, &JointLimits<double>::speed}) {
    for (const double bad : {0.0, -1.0, kNan}) {
      JointLimits<double> broken;
      broken.*member = bad;
      EXPECT_EQ(check(broken), Status::kOutOfRange);
    }
  }
}

TEST(Velocity, of_a_ramp_is_its_slope_at_any_intervals) {
  VelocityEstimate<double> estimate(0.01);
  double t = 0, speed = 0;
  for (int k = 0; k < 2000; ++k) {
    const double h = k % 7 == 0 ? 0.002 : 0.0005;
    t += h;
    ASSERT_EQ(estimate.step(1.5 * t, h, speed), Status::kOk);
  }
  EXPECT_NEAR(speed, 1.5, 1e-9);  // 100 time constants
}

TEST(Velocity, one_encoder_step_makes_the_pulse_that_the_header_says) {
  const double count = 2 * kPi / 8000;
  for (const double filter : {0.0, 0.010}) {
    VelocityEstimate<double> estimate(filter);
    double speed = 0;
    ASSERT_EQ(estimate.step(0.0, 5e-4, speed), Status::kOk);
    ASSERT_EQ(estimate.step(count, 5e-4, speed), Status::kOk);
    EXPECT_NEAR(speed, filter > 0 ? 0.0748 : 1.571, 5e-4);  // figures of the header, rounded
  }
}

TEST(Velocity, refuses_bad_samples_and_goes_on_from_the_last_good_one) {
  VelocityEstimate<double> estimate(0.0);
  double speed = 0;
  ASSERT_EQ(estimate.step(1.0, 0.001, speed), Status::kOk);
  EXPECT_EQ(estimate.step(kNan, 0.001, speed), Status::kNotFinite);
  EXPECT_EQ(estimate.step(2.0, 0.0, speed), Status::kOutOfRange);
  ASSERT_EQ(estimate.step(1.001, 0.001, speed), Status::kOk);
  EXPECT_NEAR(speed, 1.0, 1e-9);  // difference of numbers near 1 over 1 ms
}

}  // namespace
