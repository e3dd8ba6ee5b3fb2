// What single effects are for: their limits, their memory, their signature.
#include <gtest/gtest.h>

#include <cmath>

#include "isac/models/effect_hooks.hpp"
#include "isac/models/joint_torque.hpp"

namespace isac::models {
namespace {

double torque(const char* id, std::initializer_list<double> q, const JointPoint<double>& x) {
  return effect_torque(find_effect(id), q.begin(), x);
}

TEST(TorqueTerms, sum_to_the_joint_model) {
  const auto q = testbed_parameters<double>();
  const JointPoint<double> x{.delta_pressure = 0.7e5, .angle = 0.4, .velocity = -2.5, .wheel_radius = 0.019};
  EXPECT_NEAR(torque("A", {q.A}, x) + torque("B", {q.B}, x) + torque("C", {q.C}, x) + torque("D", {q.D}, x),
              joint_torque(q, 0.019, 0.4, 0.7e5, -2.5), 1e-14);
}

TEST(TorqueTerms, of_a_driven_axis_turn_to_its_driving_force) {
  // F = M a + Fv v + Fc sgn v + offset = −Σ of the resistances + the offset (EMPS's form).
  const JointPoint<double> x{.velocity = 0.2, .acceleration = 1.5};
  const double resistances =
      torque("inertia", {95}, x) + torque("viscous_damping", {200}, x) + torque("coulomb_friction", {20}, x);
  EXPECT_NEAR(-resistances + torque("offset", {-3}, x), 95 * 1.5 + 200 * 0.2 + 20 - 3, 1e-12);
  for (const EffectInfo& e : effect_catalogue())
    EXPECT_EQ(e.added_to_output, std::string_view(e.id) == "offset");
}

TEST(CoulombFriction, is_zero_at_rest_and_turns_with_the_velocity) {
  EXPECT_EQ(torque("coulomb_friction", {0.2}, {.velocity = 0.0}), 0.0);
  EXPECT_EQ(torque("coulomb_friction", {0.2}, {.velocity = 1e-9}), -0.2);
  EXPECT_EQ(torque("coulomb_friction", {0.2}, {.velocity = -3.0}), 0.2);
}

TEST(StribeckFriction, falls_from_breakaway_to_coulomb) {
  EXPECT_NEAR(torque("stribeck_friction", {0.1, 0.3, 0.05}, {.velocity = 1e-9}), -0.3, 1e-12);
  EXPECT_NEAR(torque("stribeck_friction", {0.1, 0.3, 0.05}, {.velocity = 1.0}), -0.1, 1e-12);
}

TEST(PressureDependentFriction, is_coulomb_at_the_reference_pressure_and_nothing_without) {
  JointPoint<double> x{.mean_pressure = 3e5, .velocity = 1.0, .reference_pressure = 3e5};
  EXPECT_DOUBLE_EQ(torque("pressure_dependent_friction", {0.2, 1.7}, x), -0.2);
  x.mean_pressure = 0;
  EXPECT_EQ(torque("pressure_dependent_friction", {0.2, 1.7}, x), 0.0);
}

TEST(LeverArmVariation, is_the_pair_on_a_wheel_whose_radius_changes) {
  // Second method: T = r(φ)(A s(φ) + B Δp) with the travel s by Simpson's rule (exact for cubics).
  const double a = 0.07, b = -0.11, r = 0.019, A = -23450, B = 1.78e-3, dp = 0.8e5, phi = 0.9;
  const auto radius = [&](double angle) { return r * (1 + a * angle + b * angle * angle); };
  const double travel = phi / 6 * (radius(0) + 4 * radius(phi / 2) + radius(phi));
  const double baseline = A * r * r * phi + B * r * dp;
  const JointPoint<double> x{
      .delta_pressure = dp, .angle = phi, .wheel_radius = r, .stiffness = A, .pressure_gain = B};
  EXPECT_NEAR(torque("lever_arm_variation", {a, b}, x), radius(phi) * (A * travel + B * dp) - baseline,
              1e-13);
}

TEST(EndStop, presses_only_beyond_either_stop) {
  EXPECT_EQ(torque("end_stop", {50, 1.0, -0.8}, {.angle = 0.9}), 0.0);
  EXPECT_NEAR(torque("end_stop", {50, 1.0, -0.8}, {.angle = 1.1}), -5.0, 1e-12);
  EXPECT_NEAR(torque("end_stop", {50, 1.0, -0.8}, {.angle = -0.9}), 5.0, 1e-12);
}

TEST(TensionLoss, softens_beyond_its_angle_on_both_sides) {
  EXPECT_EQ(torque("tension_loss", {4, 0.9}, {.angle = -0.8}), 0.0);
  EXPECT_NEAR(torque("tension_loss", {4, 0.9}, {.angle = 1.1}), 0.8, 1e-12);
  EXPECT_NEAR(torque("tension_loss", {4, 0.9}, {.angle = -1.1}), -0.8, 1e-12);
}

TEST(GravityImbalance, is_a_pendulum_with_a_phase) {
  const double mgl = 0.4, phi0 = 0.3, phi = 0.7;
  EXPECT_NEAR(torque("gravity_imbalance", {mgl * std::cos(phi0), mgl * std::sin(phi0)}, {.angle = phi}),
              -mgl * std::sin(phi + phi0), 1e-15);
}

TEST(ThermalDrift, has_arrived_after_many_time_constants) {
  const JointPoint<double> x{.delta_pressure = 1e5, .angle = 0.5, .time = 1e5, .wheel_radius = 0.02};
  EXPECT_NEAR(torque("thermal_drift", {1000, 2e-4, 0.1, 100}, x), 1000 * 4e-4 * 0.5 + 2e-4 * 0.02 * 1e5 + 0.1,
              1e-12);
}

/// z after moving from 0 to `angle` at constant speed, by many explicit steps.
double moved(const char* id, const double* q, double z, double from, double to, double speed) {
  const int n = 200000;
  const double h = std::abs(to - from) / speed / n;
  JointPoint<double> x{.velocity = to > from ? speed : -speed};
  for (int i = 0; i < n; ++i) {
    x.angle = from + (to - from) * i / n;
    double dz = 0;
    effect_derivative(find_effect(id), q, x, &z, &dz);
    z += h * dz;
  }
  return z;
}

TEST(Hysteresis, depends_on_the_path_and_not_on_the_speed) {
  const double q[] = {0.2, 0.05};
  const double slow = moved("hysteresis", q, 0, 0, 0.04, 0.01),
               fast = moved("hysteresis", q, 0, 0, 0.04, 5.0);
  EXPECT_NEAR(slow, fast, 1e-9);
  EXPECT_NEAR(slow, 1 - std::exp(-0.04 / 0.05), 1e-5);  // the solution; step size 1e-6 of the path
  EXPECT_NEAR(moved("hysteresis", q, slow, 0.04, -1, 1.0), -1.0, 1e-6);
}

TEST(AsymmetricHysteresis, is_dahls_loop_where_both_directions_are_alike) {
  const double two[] = {0.2, 0.05}, four[] = {0.2, 0.2, 0.05, 0.05};
  const double z = moved("hysteresis", two, 0.3, 0, -0.03, 1.0);
  EXPECT_DOUBLE_EQ(moved("asymmetric_hysteresis", four, 0.3, 0, -0.03, 1.0), z);
  const JointPoint<double> x{.velocity = -1};
  EXPECT_DOUBLE_EQ(effect_torque(find_effect("asymmetric_hysteresis"), four, x, &z),
                   effect_torque(find_effect("hysteresis"), two, x, &z));
}

TEST(Creep, relaxes_to_nothing_in_its_time) {
  const double q[] = {0.5, 20};
  const JointPoint<double> x{.angle = 0.4};
  double z = 0;
  EXPECT_NEAR(effect_torque(find_effect("creep"), q, x, &z), -0.2, 1e-15);
  const double h = 1e-3;
  for (int i = 0; i < 20000; ++i) {
    double dz;
    effect_derivative(find_effect("creep"), q, x, &z, &dz);
    z += h * dz;
  }
  EXPECT_NEAR(effect_torque(find_effect("creep"), q, x, &z), -0.2 * std::exp(-1.0), 1e-5);
  effect_rest(find_effect("creep"), q, x, &z);
  EXPECT_EQ(effect_torque(find_effect("creep"), q, x, &z), 0.0);
}

TEST(Backlash, lets_the_wheel_stand_still_within_the_play) {
  const double b[] = {0.01};
  double z = moved("backlash", b, 0.0, 0, 0.009, 0.1);
  EXPECT_EQ(z, 0.0);
  z = moved("backlash", b, z, 0.009, 0.1, 0.1);
  EXPECT_NEAR(z, 0.09, 1e-6);
  z = moved("backlash", b, z, 0.1, 0.085, 0.1);
  EXPECT_NEAR(z, 0.09, 1e-6);  // the gap is twice the half-width
  JointPoint<double> x{.angle = 0.085, .wheel_radius = 0.019, .stiffness = -23450};
  EXPECT_NEAR(effect_torque(find_effect("backlash"), b, x, &z), -23450 * 0.019 * 0.019 * (z - 0.085), 1e-12);
}

TEST(SeriesElasticity, is_added_inertia_far_below_its_resonance) {
  const double q[] = {0.002, 200, 0.05};
  const double w = 2 * kPi * 1.0, h = 1e-5;
  double z[2], dz[2], worst = 0;
  const auto at = [&](double t) {
    return JointPoint<double>{
        .angle = std::sin(w * t), .velocity = w * std::cos(w * t), .acceleration = -w * w * std::sin(w * t)};
  };
  effect_rest(find_effect("series_elasticity"), q, at(0), z);
  for (int i = 0; i < 100000; ++i) {
    const auto x = at(i * h);
    effect_derivative(find_effect("series_elasticity"), q, x, z, dz);
    z[1] += h * dz[1];
    z[0] += h * z[1];
    if (i > 50000)
      worst =
          std::max(worst, std::abs(effect_torque(find_effect("series_elasticity"), q, at((i + 1) * h), z) -
                                   0.002 * w * w * std::sin(w * (i + 1) * h)));
  }
  EXPECT_LT(worst, 0.002 * w * w * 0.02);  // explicit steps at 200 Hz resonance: about one per cent
}

TEST(SecondOrderLag, filters_the_command) {
  const double q[] = {0.05};
  const int lag = find_effect("second_order_lag");
  const ValvePoint<double> x{.command = {4e5, 1e5}};
  double z[2] = {0, 0}, dz[2], u[2] = {4e5, 1e5}, v[2] = {0, 0};
  effect_command(lag, q, x, z, u);
  EXPECT_EQ(u[0], 0.0);
  effect_valve_derivative(lag, q, x, u, v, z, dz);
  EXPECT_NEAR(dz[0], 4e5 / 0.05, 1e-6);
  effect_valve_rest(lag, q, x, z);
  effect_command(lag, q, x, z, u);
  EXPECT_EQ(u[1], 1e5);
}

TEST(AsymmetricFillVent, slows_only_the_falling_pressure) {
  const double q[] = {1.6};
  double v[2] = {1e6, -1e6};
  effect_pressure_rate<double>(find_effect("asymmetric_fill_vent"), q, {}, nullptr, v);
  EXPECT_EQ(v[0], 1e6);
  EXPECT_NEAR(v[1], -1e6 / 1.6, 1e-6);
}

TEST(FlowLimit, cuts_the_rate_either_way) {
  const double q[] = {5e5};
  double v[2] = {1e6, -1e6};
  effect_pressure_rate<double>(find_effect("flow_limit"), q, {}, nullptr, v);
  EXPECT_EQ(v[0], 5e5);
  EXPECT_EQ(v[1], -5e5);
}

TEST(ValveDeadband, holds_the_pressure_within_the_band) {
  const double q[] = {3e3};
  const ValvePoint<double> x{.command = {3.02e5, 3.2e5}, .pressure = {3e5, 3e5}};
  double u[2] = {3.02e5, 3.2e5};
  effect_command<double>(find_effect("valve_deadband"), q, x, nullptr, u);
  EXPECT_EQ(u[0], 3e5);
  EXPECT_EQ(u[1], 3.17e5);
}

TEST(ValveHysteresis, remembers_the_direction) {
  const double q[] = {2e3};
  const int play = find_effect("valve_hysteresis");
  ValvePoint<double> x{.command = {3e5, 3e5}};
  double z[2];
  effect_valve_rest(play, q, x, z);
  const auto answer = [&](double command) {
    x.command[0] = x.command[1] = command;
    effect_valve_step(play, q, x, z);
    double u[2] = {command, command};
    effect_command(play, q, x, z, u);
    return u[0];
  };
  EXPECT_EQ(answer(3.1e5), 3.08e5);   // from below
  EXPECT_EQ(answer(3.09e5), 3.08e5);  // within the play
  EXPECT_EQ(answer(3e5), 3.02e5);     // from above
}

TEST(SupplyDroop, sags_with_filling_and_recovers) {
  const double q[] = {5e5, 0.2, 1.0};
  const int droop = find_effect("supply_droop");
  double z = 0, dz = 0;
  const double u[2] = {0, 0}, filling[2] = {2e6, -1e6}, still[2] = {0, 0};
  effect_valve_derivative<double>(droop, q, {}, u, filling, &z, &dz);
  EXPECT_NEAR(dz, 4e5, 1e-6);
  z = 1e5;
  effect_valve_derivative<double>(droop, q, {}, u, still, &z, &dz);
  EXPECT_NEAR(dz, -1e5, 1e-6);
  double command[2] = {4.5e5, 3e5};
  effect_command<double>(droop, q, {}, &z, command);
  EXPECT_EQ(command[0], 4e5);
  EXPECT_EQ(command[1], 3e5);
}

TEST(VolumeCoupling, pumps_both_muscles_with_opposite_signs) {
  const double q[] = {2e4};
  double v[2] = {0, 0};
  effect_pressure_rate<double>(find_effect("volume_coupling"), q, {.velocity = 3}, nullptr, v);
  EXPECT_EQ(v[0], -6e4);
  EXPECT_EQ(v[1], 6e4);
}

TEST(Leak, follows_the_pressure_and_crosstalk_the_other_one) {
  const double k[] = {0.1}, share[] = {0.02};
  const ValvePoint<double> x{.pressure = {2e5, 4e5}};
  double v[2] = {0, 0}, u[2] = {0, 0};
  effect_pressure_rate<double>(find_effect("leak"), k, x, nullptr, v);
  EXPECT_NEAR(v[0], -2e4, 1e-9);
  effect_command<double>(find_effect("crosstalk"), share, x, nullptr, u);
  EXPECT_NEAR(u[0], 8e3, 1e-9);
  EXPECT_NEAR(u[1], 4e3, 1e-9);
  const double either[] = {0.02, 0.01};
  double p[2] = {2e5, 4e5};
  effect_outlet_pressure(find_effect("crosstalk_direct"), either, p);
  EXPECT_NEAR(p[0], 2.08e5, 1e-9);
  EXPECT_NEAR(p[1], 4.02e5, 1e-9);
}

TEST(ThresholdPressure, takes_its_part_of_either_pressure) {
  const double q[] = {3e4};
  double p[2] = {2e4, 3e5};
  effect_muscle_pressure(find_effect("threshold_pressure"), q, p);
  EXPECT_EQ(p[0], 0.0);
  EXPECT_EQ(p[1], 2.7e5);
}

TEST(SensorEffects, change_only_their_own_signal) {
  const Readings<double> truth{.force = {80, 120}, .pressure = {2e5, 4e5}, .angle = 0.5};
  const auto seen = [&](const char* id, std::initializer_list<double> q, double time = 0,
                        const double* z = nullptr) {
    Readings<double> y = truth;
    effect_reading(find_effect(id), q.begin(), time, z, y);
    return y;
  };
  EXPECT_EQ(seen("force_offset", {1, 2}).force[1], 122.0);
  EXPECT_EQ(seen("force_gain_error", {0.5, 0}).force[0], 120.0);
  EXPECT_EQ(seen("force_drift", {0, 0.1}, 50).force[1], 125.0);
  EXPECT_EQ(seen("force_saturation", {100}).force[1], 100.0);
  EXPECT_EQ(seen("force_saturation", {100}).force[0], 80.0);
  EXPECT_EQ(seen("pressure_offset", {1e3, 0}).pressure[0], 2.01e5);
  EXPECT_EQ(seen("pressure_sensor_gain", {0, 0.5}).pressure[1], 6e5);
  EXPECT_EQ(seen("encoder_offset", {0.25}).angle, 0.75);
  EXPECT_EQ(seen("encoder_gain", {1.0}).angle, 1.0);
  EXPECT_EQ(seen("encoder_drift", {0.01}, 25).angle, 0.75);
  EXPECT_EQ(seen("encoder_slip", {0.25, 10}, 9.9).angle, 0.5);
  EXPECT_EQ(seen("encoder_slip", {0.25, 10}, 10).angle, 0.75);
  const auto hum = seen("mains_hum", {0, 4, 50}, 0);
  EXPECT_EQ(hum.force[1] - hum.force[0], 44.0);
  EXPECT_EQ(hum.force[0] + hum.force[1], 200.0);
}

TEST(SensorLag, follows_a_force_within_its_time) {
  const double q[] = {0.01};
  const Readings<double> y{.force = {100, 50}};
  double z[2] = {0, 0}, dz[2];
  effect_reading_derivative(find_effect("sensor_lag"), q, y, z, dz);
  EXPECT_NEAR(dz[0], 1e4, 1e-9);
  Readings<double> seen = y;
  effect_reading(find_effect("sensor_lag"), q, 0.0, z, seen);
  EXPECT_EQ(seen.force[0], 0.0);
}

TEST(EncoderPlay, keeps_the_reading_within_its_gap) {
  const double b[] = {0.01};
  const int play = find_effect("encoder_play");
  double z = 0.5;
  const auto seen = [&](double angle) {
    Readings<double> y{.angle = angle};
    effect_reading_step(play, b, y, &z);
    effect_reading(play, b, 0.0, &z, y);
    return y.angle;
  };
  EXPECT_EQ(seen(0.505), 0.5);
  EXPECT_NEAR(seen(0.53), 0.52, 1e-15);
  EXPECT_NEAR(seen(0.515), 0.52, 1e-15);
}

TEST(Delays, are_told_in_seconds) {
  const double q[] = {0.02};
  EXPECT_EQ(effect_delay(find_effect("dead_time"), q), 0.02);
  EXPECT_EQ(effect_delay(find_effect("time_skew"), q), 0.02);
  EXPECT_EQ(effect_delay(find_effect("leak"), q), 0.0);
}

}  // namespace
}  // namespace isac::models
