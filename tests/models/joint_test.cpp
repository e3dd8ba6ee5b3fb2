// Joint torque, its range, the joint as a second-order lag, and the valve unit.
#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "isac/models/joint_motion.hpp"
#include "isac/models/muscle_pair.hpp"
#include "isac/models/valve_unit.hpp"

namespace isac::models {
namespace {

constexpr double kR = kTestbedWheelRadius;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(JointTorque, is_the_seeds_sum_with_dissipation_negative) {
  const auto q = testbed_parameters<double>();
  EXPECT_NEAR(joint_torque(q, kR, 0.5, 0.0, 0.0), -23450 * kR * kR * 0.5, 1e-12);
  EXPECT_NEAR(joint_torque(q, kR, 0.0, kPascalPerKgfCm2, 0.0), 174.2 * kR, 1e-12);
  EXPECT_NEAR(joint_torque(q, kR, 0.0, 0.0, 2.0), -0.0026 * 8 - 0.14 * 2, 1e-15);
}

TEST(JointTorque, converts_b_from_and_to_the_reporting_unit) {
  EXPECT_NEAR(pressure_gain_from_reported(174.2) * kPascalPerKgfCm2, 174.2, 1e-12);
  EXPECT_NEAR(pressure_gain_to_reported(pressure_gain_from_reported(174.2)), 174.2, 1e-12);
  EXPECT_NEAR(pressure_gain_from_reported(1.0), 1e-4 / 9.80665, 1e-18);  // N cm²/kgf = 1e-4 m² · N/kgf
}

TEST(JointTorque, is_inverted_by_the_pressure_that_gives_it) {
  const auto q = testbed_parameters<double>();
  double dp = kNaN;
  ASSERT_EQ(delta_pressure_for_torque(q, kR, 1.3, 0.4, -2.0, dp), Status::kOk);
  EXPECT_NEAR(joint_torque(q, kR, 0.4, dp, -2.0), 1.3, 1e-12);
}

TEST(JointTorque, refuses_a_pressure_where_pressure_has_no_say) {
  auto q = testbed_parameters<double>();
  double dp = 7;
  EXPECT_EQ(delta_pressure_for_torque(q, kR, kNaN, 0.4, 0.0, dp), Status::kNotFinite);
  q.B = 0;
  EXPECT_EQ(delta_pressure_for_torque(q, kR, 1.3, 0.4, 0.0, dp), Status::kOutOfRange);
  EXPECT_EQ(dp, 7);
}

TEST(JointTorque, has_derivatives_that_are_its_coefficients) {
  using Jet = ceres::Jet<double, 4>;
  const JointCoefficients<Jet> q{
      .A = Jet(-23450.0, 0), .B = Jet(1.8e-3, 1), .C = Jet(0.0026, 2), .D = Jet(0.14, 3)};
  const Jet t = joint_torque(q, Jet(kR), Jet(0.4), Jet(1e5), Jet(-2.0));
  EXPECT_NEAR(t.v[0], kR * kR * 0.4, 1e-15);
  EXPECT_NEAR(t.v[1], kR * 1e5, 1e-9);
  EXPECT_NEAR(t.v[2], 8.0, 1e-12);
  EXPECT_NEAR(t.v[3], 2.0, 1e-12);
}

TEST(PressureSplit, raises_muscle_2_and_lowers_muscle_1) {
  const auto p = split_pressure(3e5, 0.5e5);
  EXPECT_EQ(p.muscle_1, 2.5e5);
  EXPECT_EQ(p.muscle_2, 3.5e5);
  EXPECT_EQ(delta_pressure_of(p), 0.5e5);
  EXPECT_EQ(mean_pressure_of(p), 3e5);
}

TEST(ValidityRange, is_the_seeds_by_default_and_holds_at_its_edge) {
  const ValidityRange<double> range;
  EXPECT_EQ(outside_validity(range, 2 * kPascalPerKgfCm2, 3 * kPi / 8, 0.0), 0);
  EXPECT_EQ(outside_validity(range, 2.001 * kPascalPerKgfCm2, 0.0, 0.0), kDeltaPressureOutside);
  EXPECT_EQ(outside_validity(range, -2.001 * kPascalPerKgfCm2, -1.2, 0.0),
            kDeltaPressureOutside | kAngleOutside);
  EXPECT_EQ(outside_validity(range, 0.0, 0.0, -7.0), kSpeedOutside);
  EXPECT_EQ(mounting_outside_validity(range, 3 * kPascalPerKgfCm2, 0.18), 0);
  EXPECT_EQ(mounting_outside_validity(range, 2.5 * kPascalPerKgfCm2, 0.19),
            kInitialPressureOutside | kPreTensionOutside);
}

TEST(ValidityRange, answers_with_a_status_and_never_lets_nan_pass) {
  const ValidityRange<double> range;
  EXPECT_EQ(validity_status(0), Status::kOk);
  EXPECT_EQ(validity_status(kAngleOutside), Status::kOutOfRange);
  EXPECT_EQ(validity_status(outside_validity(range, kNaN, 0.0, 0.0)), Status::kNotFinite);
  EXPECT_EQ(validity_status(outside_validity(range, 0.0, std::numeric_limits<double>::infinity(), 0.0)),
            Status::kNotFinite);
}

TEST(JointMotion, conserves_energy_without_damping) {
  // Symplectic Euler on I φ̈ = A r² φ: the energy of a harmonic oscillator swings by ω h and does not drift.
  auto q = testbed_parameters<double>();
  q.C = q.D = 0;
  const double inertia = 0.0085, h = 1e-5, k = -q.A * kR * kR;
  double phi = 0.5, omega = 0;
  const double start = 0.5 * k * phi * phi;
  for (int i = 0; i < 200000; ++i) {
    omega += h * joint_acceleration(inertia, joint_torque(q, kR, phi, 0.0, omega), 0.0);
    phi += h * omega;
  }
  const double end = 0.5 * inertia * omega * omega + 0.5 * k * phi * phi;
  EXPECT_NEAR(end / start, 1.0, std::sqrt(k / inertia) * h);
}

TEST(JointMotion, loses_energy_at_the_rate_of_its_damping) {
  const auto q = testbed_parameters<double>();
  for (double omega : {-5.0, -0.2, 0.3, 6.0}) EXPECT_LT((joint_torque(q, kR, 0.0, 0.0, omega)) * omega, 0.0);
}

TEST(SecondOrder, oscillates_as_the_equation_of_motion_says) {
  SecondOrder<double> joint;
  const auto q = testbed_parameters<double>();
  const double inertia = 0.0085;
  ASSERT_EQ(second_order(q, kR, inertia, joint), Status::kOk);
  // T_J² φ̈ + 2 ζ T_J φ̇ + φ = K_J Δp, at any state, is I φ̈ = T without the cubic part.
  const double phi = 0.3, omega = -1.1, dp = 0.7e5;
  JointCoefficients<double> linear = q;
  linear.C = 0;
  const double acceleration = joint_acceleration(inertia, joint_torque(linear, kR, phi, dp, omega), 0.0);
  EXPECT_NEAR(joint.time_constant * joint.time_constant * acceleration +
                  2 * joint.damping * joint.time_constant * omega + phi,
              joint.gain * dp, 1e-12);
}

TEST(SecondOrder, refuses_a_joint_without_stiffness_or_inertia) {
  SecondOrder<double> joint;
  auto q = testbed_parameters<double>();
  EXPECT_EQ(second_order(q, kR, 0.0, joint), Status::kOutOfRange);
  q.A = 100;
  EXPECT_EQ(second_order(q, kR, 0.0085, joint), Status::kOutOfRange);
}

TEST(StepShape, is_the_inflection_tangent_of_the_integrated_response) {
  const SecondOrder<double> joint{.time_constant = 0.0317, .damping = 0.26, .gain = 1};
  StepShape<double> shape;
  ASSERT_EQ(step_shape(joint, shape), Status::kOk);
  // Second method: integrate (RK4) and search for the steepest point.
  double y = 0, v = 0, steepest = 0, at_t = 0, at_y = 0;
  const double h = 1e-6, t2 = joint.time_constant * joint.time_constant;
  const auto acceleration = [&](double a, double b) {
    return (1 - a - 2 * joint.damping * joint.time_constant * b) / t2;
  };
  for (int i = 0; i < 100000; ++i) {
    const double k1y = v, k1v = acceleration(y, v);
    const double k2y = v + h / 2 * k1v, k2v = acceleration(y + h / 2 * k1y, v + h / 2 * k1v);
    const double k3y = v + h / 2 * k2v, k3v = acceleration(y + h / 2 * k2y, v + h / 2 * k2v);
    const double k4y = v + h * k3v, k4v = acceleration(y + h * k3y, v + h * k3v);
    y += h / 6 * (k1y + 2 * k2y + 2 * k3y + k4y);
    v += h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v);
    if (v > steepest) steepest = v, at_t = (i + 1) * h, at_y = y;
  }
  EXPECT_NEAR(shape.latency, at_t - at_y / steepest, 2 * h);  // the grid of the search
  EXPECT_NEAR(shape.adjustment, 1 / steepest, 1e-9);
}

TEST(StepShape, refuses_a_response_without_overshoot) {
  StepShape<double> shape;
  EXPECT_EQ(step_shape(SecondOrder<double>{.time_constant = 0.03, .damping = 1.2, .gain = 1}, shape),
            Status::kOutOfRange);
}

TEST(ValveUnit, reaches_63_percent_after_one_lag_and_the_dead_time) {
  const ValveUnit<double> unit{.gain = 1.0, .lag = 0.17, .dead_time = 0.02};
  EXPECT_EQ(valve_response(unit, 0.0, 5e5, 0.02), 0.0);
  EXPECT_NEAR(valve_response(unit, 0.0, 5e5, 0.19), 5e5 * (1 - std::exp(-1.0)), 1e-6);
}

TEST(ValveUnit, steps_exactly_however_long_the_steps_are) {
  const ValveUnit<double> unit{.gain = 0.98, .lag = 0.17};
  double p = 1e5;
  for (int i = 0; i < 100; ++i) p = valve_step(unit, p, 4e5, 0.003);
  EXPECT_NEAR(p, valve_step(unit, 1e5, 4e5, 0.3), 1e-6);  // 100 roundings of 4e5
}

TEST(ValveUnit, agrees_with_its_own_differential_equation) {
  const ValveUnit<double> unit{.gain = 0.98, .lag = 0.17};
  const double h = 1e-6;
  const double slope = (valve_step(unit, 1e5, 4e5, h) - valve_step(unit, 1e5, 4e5, -h)) / (2 * h);
  EXPECT_NEAR(slope, valve_rate(unit, 1e5, 4e5), 1e-8 * std::abs(slope) + 1e5 * 1e-16 / h * 100);
}

TEST(ValveUnit, follows_a_line_with_the_lag_behind_it) {
  const ValveUnit<double> unit{.gain = 1.0, .lag = 0.17};
  // From the steady ramp p = m (t − T_C), it stays on it.
  const double m = 2e5;
  EXPECT_NEAR(valve_ramp(unit, m * (1.0 - 0.17), m * 1.0, m * 1.5, 0.5), m * (1.5 - 0.17), 1e-6);
  EXPECT_NEAR(valve_ramp(unit, 1e5, 4e5, 4e5, 0.05), valve_step(unit, 1e5, 4e5, 0.05), 1e-9);
}

TEST(ValveUnit, without_lag_passes_the_command) {
  const ValveUnit<double> unit{.gain = 2.0, .lag = 0.0};
  EXPECT_EQ(valve_step(unit, 1.0, 3.0, 0.01), 6.0);
  EXPECT_EQ(valve_ramp(unit, 1.0, 3.0, 4.0, 0.01), 8.0);
}

}  // namespace
}  // namespace isac::models
