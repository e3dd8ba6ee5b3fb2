// The plant against closed forms, conserved quantities and a second integrator.
#include "isac/simulate/plant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "isac/core/error.hpp"

namespace isac::simulate {
namespace {

constexpr double kP = kPascalPerKgfCm2;

void run_to(Plant& plant, double t) {
  while (plant.time() < t) ASSERT_EQ(plant.step_to(t), Status::kOk) << "at " << plant.time() << " s";
}

/// Both muscles at p0, so that the pressures stay where they are.
RigConfig at_initial_pressure() {
  RigConfig config;
  config.pressure = {config.joint.initial_pressure, config.joint.initial_pressure};
  return config;
}

TEST(Plant, valve_unit_follows_the_closed_form_of_a_lag_behind_a_dead_time) {
  RigConfig config;
  config.valves[0] = {
      .gain = 0.97, .offset = 0.1 * kP, .fill_lag = 0.17, .vent_lag = 0.3, .dead_time = 0.032};
  Plant plant(config);
  plant.command({5 * kP, 0});
  const double full = 0.97 * 5 * kP + 0.1 * kP;
  // At u = 0 the offset alone is the target before the command arrives.
  const double before = 0.1 * kP * (1 - std::exp(-0.032 / 0.17));
  run_to(plant, 0.0319);
  EXPECT_NEAR(plant.state().pressure[0], 0.1 * kP * (1 - std::exp(-0.0319 / 0.17)), 1e-3);
  for (const double t : {0.1, 0.202, 0.5, 1.0}) {
    run_to(plant, t);
    // 1e-6 of the step: a hundred times the integrator's tolerance.
    EXPECT_NEAR(plant.state().pressure[0], full + (before - full) * std::exp(-(t - 0.032) / 0.17),
                1e-6 * full)
        << t;
  }
  const double high = plant.state().pressure[0];
  plant.command({0, 0});
  run_to(plant, 1.4);
  const double at_vent = full + (high - full) * std::exp(-0.032 / 0.17);
  const double low = 0.1 * kP;
  EXPECT_NEAR(plant.state().pressure[0], low + (at_vent - low) * std::exp(-(0.4 - 0.032) / 0.3), 1e-6 * full);
}

TEST(Plant, commands_inside_the_dead_time_arrive_in_order_and_unchanged) {
  RigConfig config;
  for (auto& valve : config.valves) valve.dead_time = 0.1;
  Plant plant(config);
  RigConfig direct;
  Plant reference(direct);
  // The same train of 40 commands, given 0.1 s later to a rig without tubes.
  for (int k = 0; k < 40; ++k) {
    run_to(plant, 0.002 * k);
    plant.command({(k % 7) * 0.5 * kP, (k % 5) * 0.7 * kP});
  }
  run_to(plant, 0.3);
  for (int k = 0; k < 40; ++k) {
    run_to(reference, 0.1 + 0.002 * k);
    reference.command({(k % 7) * 0.5 * kP, (k % 5) * 0.7 * kP});
  }
  run_to(reference, 0.3);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(plant.state().pressure[i], reference.state().pressure[i], 1e-6 * kP);
  }
}

TEST(Plant, free_oscillation_has_the_period_and_damping_of_the_errata) {
  RigConfig config = at_initial_pressure();
  config.joint.C = 0;
  config.angle = 0.3;
  Plant plant(config);
  const double stiffness = 23450 * 0.019 * 0.019;
  const double T_J = std::sqrt(0.0085 / stiffness), zeta = 0.14 / (2 * std::sqrt(stiffness * 0.0085));
  EXPECT_NEAR(T_J, 0.032, 0.0005);  // the errata's two printed digits
  EXPECT_NEAR(zeta, 0.26, 0.005);
  const double omega_d = std::sqrt(1 - zeta * zeta) / T_J;
  for (double t = 0.01; t < 0.5; t += 0.01) {
    run_to(plant, t);
    const double envelope = std::exp(-zeta * t / T_J);
    const double exact =
        0.3 * envelope * (std::cos(omega_d * t) + zeta / (omega_d * T_J) * std::sin(omega_d * t));
    EXPECT_NEAR(plant.state().joint.angle, exact, 1e-7)
        << t;  // ten times tolerance · amplitude, over 3 periods
  }
}

TEST(Plant, joint_comes_to_rest_at_the_static_gain) {
  Plant plant(at_initial_pressure());
  plant.command({2 * kP, 4 * kP});  // Δp = 1 kg/cm²
  run_to(plant, 6.0);
  const double K_J = 174.2 / (23450 * 0.019);  // rad per kg/cm² = 0.39 (errata)
  EXPECT_NEAR(K_J, 0.39, 0.005);
  EXPECT_NEAR(plant.state().joint.angle, K_J, 1e-7);  // 6 s are 35 lags: e^-35 is nothing
}

TEST(Plant, undamped_joint_keeps_its_energy) {
  RigConfig config = at_initial_pressure();
  config.joint.C = config.joint.D = 0;
  config.angle = 0.4;
  Plant plant(config);
  const double stiffness = 23450 * 0.019 * 0.019;
  const double start = 0.5 * stiffness * 0.16;
  run_to(plant, 10.0);  // 50 periods
  const PlantState s = plant.state();
  const double end =
      0.5 * stiffness * s.joint.angle * s.joint.angle + 0.5 * 0.0085 * s.joint.velocity * s.joint.velocity;
  EXPECT_NEAR(end, start, 1e-5 * start);  // local error 1e-8, some 2000 steps, of one sign at worst
}

TEST(Plant, energy_lost_is_the_work_of_the_damping) {
  RigConfig config = at_initial_pressure();
  config.angle = 0.4;
  Plant plant(config);
  const double stiffness = 23450 * 0.019 * 0.019;
  const auto energy = [&](const PlantState& s) {
    return 0.5 * stiffness * s.joint.angle * s.joint.angle +
           0.5 * 0.0085 * s.joint.velocity * s.joint.velocity;
  };
  const double start = energy(plant.state());
  // ∫ (C φ̇⁴ + D φ̇²) dt by Simpson's rule on a grid of 0.1 ms.
  double work = 0;
  const double h = 1e-4;
  const auto power = [&] {
    const double w = plant.state().joint.velocity;
    return 0.0026 * w * w * w * w + 0.14 * w * w;
  };
  double left = power();
  for (int k = 0; k < 2000; ++k) {
    run_to(plant, (k + 0.5) * h);
    const double middle = power();
    run_to(plant, (k + 1) * h);
    const double right = power();
    work += h / 6 * (left + 4 * middle + right);
    left = right;
  }
  EXPECT_GT(work, 0.9 * start);  // the swing is nearly over: the test has a subject
  EXPECT_NEAR(start - energy(plant.state()), work,
              1e-6 * start);  // the integrator's tolerance times a hundred
}

/// The same rig, written down again and stepped by the classical Runge-Kutta method at a fixed small step.
struct Reference {
  double p1 = 3, p2 = 3, phi = 0, omega = 0;  // kg/cm², rad
  double u1 = 3, u2 = 3;
  void rate(const double* x, double* d) const {
    d[0] = (u1 - x[0]) / (u1 > x[0] ? 0.17 : 0.25);
    d[1] = (u2 - x[1]) / (u2 > x[1] ? 0.17 : 0.25);
    d[2] = x[3];
    const double torque = -23450 * 0.019 * 0.019 * x[2] + 174.2 * 0.019 * (x[1] - x[0]) / 2 -
                          0.0026 * x[3] * x[3] * x[3] - 0.14 * x[3];
    d[3] = torque / 0.0085;
  }
  void step(double h) {
    double x[4] = {p1, p2, phi, omega}, k[4][4], y[4];
    for (int s = 0; s < 4; ++s) {
      const double a = s == 0 ? 0 : s == 3 ? h : h / 2;
      for (int i = 0; i < 4; ++i) y[i] = x[i] + (s == 0 ? 0 : a * k[s - 1][i]);
      rate(y, k[s]);
    }
    for (int i = 0; i < 4; ++i) x[i] += h / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
    p1 = x[0], p2 = x[1], phi = x[2], omega = x[3];
  }
};

TEST(Plant, agrees_with_a_fixed_step_runge_kutta_of_its_own_making) {
  RigConfig config = at_initial_pressure();
  for (auto& valve : config.valves) valve.vent_lag = 0.25;
  Plant plant(config);
  Reference reference;
  for (int k = 0; k < 100; ++k) {  // a new command every 20 ms, 2 s
    const double u1 = 3 + 1.5 * std::sin(0.7 * k), u2 = 3 + 1.5 * std::cos(1.1 * k);
    plant.command({u1 * kP, u2 * kP});
    reference.u1 = u1, reference.u2 = u2;
    for (int j = 0; j < 400; ++j) reference.step(5e-5);
    run_to(plant, 0.02 * (k + 1));
    const PlantState s = plant.state();
    // RK4 at 50 µs: h⁴ ω⁴ is 1e-11 per period; what is left is the plant's own tolerance of 1e-8.
    ASSERT_NEAR(s.joint.angle, reference.phi, 2e-7) << k;
    ASSERT_NEAR(s.joint.velocity, reference.omega, 5e-6) << k;
    ASSERT_NEAR(s.pressure[0] / kP, reference.p1, 2e-7) << k;
  }
}

TEST(Plant, error_shrinks_with_the_tolerance) {
  const auto angle_at_end = [](double tolerance) {
    RigConfig config = at_initial_pressure();
    config.angle = 0.5;
    config.relative_tolerance = tolerance;
    Plant plant(config);
    while (plant.time() < 0.3) EXPECT_EQ(plant.step_to(0.3), Status::kOk);
    return plant.state().joint.angle;
  };
  const double best = angle_at_end(1e-12);
  const double coarse = std::abs(angle_at_end(1e-4) - best), fine = std::abs(angle_at_end(1e-7) - best);
  EXPECT_GT(coarse, 10 * fine);
  EXPECT_LT(fine, 1e-6);
}

TEST(Plant, dry_friction_stops_the_joint_and_holds_it) {
  RigConfig config = at_initial_pressure();
  config.effects = {{"coulomb_friction", {0.5}}};
  config.joint.C = config.joint.D = 0;
  config.angle = 0.4;
  Plant plant(config);
  const double stiffness = 23450 * 0.019 * 0.019;
  const double lost_per_half_swing = 2 * 0.5 / stiffness;  // Δφ = 2 T_c/K, a classical result
  const double half_period = kPi * std::sqrt(0.0085 / stiffness);
  double expected = 0.4;
  for (int k = 1; k <= 3; ++k) {
    expected -= lost_per_half_swing;
    run_to(plant, k * half_period);
    EXPECT_NEAR(plant.state().joint.angle, (k % 2 == 1 ? -1 : 1) * expected, 1e-7) << k;
    EXPECT_NEAR(plant.state().joint.velocity, 0, 1e-5);
  }
  run_to(plant, 2.0);
  EXPECT_TRUE(plant.stuck());
  const double rest = plant.state().joint.angle;
  EXPECT_LT(std::abs(rest), 0.5 / stiffness);
  run_to(plant, 5.0);
  EXPECT_EQ(plant.state().joint.angle, rest);
  EXPECT_EQ(plant.state().torque, 0);  // the muscles' friction balances their own stiffness
}

TEST(Plant, stuck_joint_breaks_away_when_pressure_overcomes_the_friction) {
  RigConfig config = at_initial_pressure();
  config.effects = {{"bearing_friction", {0.5}}};
  Plant plant(config);
  plant.command({2.5 * kP, 3.5 * kP});  // T = B r Δp → 1.65 N m, passes 0.5 N m on its way
  // B r Δp (1 − e^(−t/T)) = 0.5 N m
  const double breakaway = -0.17 * std::log(1 - 0.5 / (174.2 * 0.019 * 0.5));
  run_to(plant, breakaway - 1e-6);
  EXPECT_TRUE(plant.stuck());
  EXPECT_NEAR(plant.state().torque, 0.5, 1e-4);  // the force sensors see the muscles pull against the bearing
  run_to(plant, breakaway + 1e-6);
  EXPECT_FALSE(plant.stuck());
  // The bar follows the rising pressure, held back by the bearing, and does not follow the first of its fall.
  run_to(plant, 4.0);
  const double stiffness = 23450 * 0.019 * 0.019;
  EXPECT_NEAR(plant.state().joint.angle, (174.2 * 0.019 * 0.5 - 0.5) / stiffness, 1e-7);
  plant.command({2.6 * kP, 3.4 * kP});
  run_to(plant, 6.0);
  EXPECT_TRUE(plant.stuck());
  EXPECT_NEAR(plant.state().joint.angle, (174.2 * 0.019 * 0.5 - 0.5) / stiffness, 1e-6);
}

TEST(Plant, stop_holds_the_bar_and_gives_no_energy) {
  RigConfig config = at_initial_pressure();
  config.joint.stop_angle = 0.5;
  config.joint.C = config.joint.D = 0;
  config.velocity = 20;
  Plant plant(config);
  double deepest = 0;
  for (int k = 1; k <= 2000; ++k) {
    run_to(plant, 1e-3 * k);
    deepest = std::max(deepest, std::abs(plant.state().joint.angle));
    const PlantState s = plant.state();
    const double energy =
        0.5 * 8.46545 * s.joint.angle * s.joint.angle + 0.5 * 0.0085 * s.joint.velocity * s.joint.velocity;
    ASSERT_LT(energy, 0.5 * 0.0085 * 400 + 1e-6);
  }
  EXPECT_GT(deepest, 0.5);
  // Without losses the rubber would give ½ k d² + … = ½ I ω²: d < ω sqrt(I/k).
  EXPECT_LT(deepest, 0.5 + 20 * std::sqrt(0.0085 / 200));
}

TEST(Plant, forces_give_the_torque_back_and_no_muscle_pushes_when_vented) {
  RigConfig config = at_initial_pressure();
  config.angle = 0.2;
  Plant plant(config);
  const PlantState s = plant.state();
  EXPECT_NEAR((s.force[1] - s.force[0]) * 0.019, s.torque, 1e-12);
  EXPECT_NEAR(0.5 * (s.force[0] + s.force[1]), config.joint.pretension, 1e-9);
  Plant vented((RigConfig()));
  EXPECT_EQ(vented.state().force[0], 0);
  EXPECT_EQ(vented.state().force[1], 0);
}

TEST(Plant, inertia_effect_lengthens_the_period_and_stays_out_of_the_force_sensors) {
  RigConfig config = at_initial_pressure();
  config.joint.C = config.joint.D = 0;
  config.effects = {{"inertia_error", {0.0085}}};
  config.angle = 0.3;
  Plant plant(config);
  const double half_period = kPi * std::sqrt(2 * 0.0085 / (23450 * 0.019 * 0.019));
  run_to(plant, half_period);
  EXPECT_NEAR(plant.state().joint.angle, -0.3, 1e-7);
  EXPECT_NEAR(plant.state().torque, 23450 * 0.019 * 0.019 * 0.3, 1e-5);
}

TEST(Plant, hysteresis_takes_the_area_of_its_loop_out_of_every_swing) {
  RigConfig config = at_initial_pressure();
  config.effects = {{"hysteresis", {0.3, 0.01}}};
  config.joint.C = config.joint.D = 0;
  config.angle = 0.4;
  Plant plant(config);
  // Dahl's loop with φ_s far below the swing is Coulomb friction: 2 T_h/K less per half swing, within about φ_s.
  const double stiffness = 23450 * 0.019 * 0.019;
  double highest = 0;
  for (int k = 0; k < 300; ++k) {
    run_to(plant, 1e-3 * k);
    if (k > 50) highest = std::max(highest, -plant.state().joint.angle);
  }
  EXPECT_NEAR(highest, 0.4 - 2 * 0.3 / stiffness, 0.01);
}

TEST(Plant, refuses_impossible_rigs_and_unknown_effects_by_name) {
  RigConfig config;
  config.joint.inertia = 0;
  EXPECT_THROW(Plant{config}, Error);
  config = {};
  config.effects = {{"inertia_error", {-0.0085}}};  // nothing left to move
  EXPECT_THROW(Plant{config}, Error);
  config.effects = {{"stiction", {}}};
  try {
    Plant plant(config);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), "effect_unknown");
    EXPECT_NE(error.text().find("stribeck_friction"), std::string::npos);
  }
  config.effects = {{"coulomb_friction", {0.1, 0.2}}};
  try {
    Plant plant(config);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), "effect_parameters");
  }
}

}  // namespace
}  // namespace isac::simulate
