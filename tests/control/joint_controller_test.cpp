// One joint's controller: its equations tick by tick, its limits, and that no switch is felt.
#include "isac/control/joint_controller.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "rk4_joint.hpp"

namespace {

using namespace isac::control;
using isac::kPascalPerKgfCm2;
using isac::Status;
using isac::test::Rk4Joint;

constexpr double kDt = 5e-4, kKg = kPascalPerKgfCm2;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

JointSettings<double> testbed() {
  JointSettings<double> s = testbed_settings<double>();
  s.limits.speed = std::numeric_limits<double>::infinity();
  return s;
}

struct Loop {
  Rk4Joint plant;
  JointController<double> controller;
  JointCommand<double> u;
  JointReference<double> wanted;

  explicit Loop(const JointSettings<double>& s, Mode mode = Mode::kPosition) {
    plant.rest_at(s.mean_pressure);
    EXPECT_EQ(controller.configure(s), Status::kOk);
    EXPECT_EQ(controller.set_mode(mode), Status::kOk);
  }
  void run(int ticks) {
    for (int k = 0; k < ticks; ++k) {
      ASSERT_EQ(controller.step({plant.angle, plant.velocity, plant.torque()}, wanted, kDt, u), Status::kOk);
      plant.step(u.pressure.muscle_1, u.pressure.muscle_2, kDt);
    }
  }
};

TEST(JointController, steps_through_the_seeds_loop_in_the_order_of_figure_6_1) {
  // The seed's two functions of D.2.1 and its torque model, written down by hand, beside ours: torque loop each tick with
  // the Δp sent last, then the position loop each tenth tick, whose result the next tick uses.
  const JointSettings<double> s = testbed();
  JointController<double> controller;
  ASSERT_EQ(controller.configure(s), Status::kOk);
  ASSERT_EQ(controller.set_mode(Mode::kPosition), Status::kOk);
  const double br = 174.2 / kKg * 0.019, ar2 = -23450 * 0.019 * 0.019, limit = 2 * kKg;
  double torque_integral = 0, position_integral = 0, sent = 0, target = 0, elapsed = 0;
  for (int k = 0; k < 4000; ++k) {
    const double angle = 0.2 * (1 - std::cos(0.004 * k)), speed = 0.2 * 8 * std::sin(0.004 * k);
    const double wanted = k == 0 ? 0.0 : 0.3;  // a desired angle starts at the joint's own
    const double torque = ar2 * angle + br * sent - 0.0026 * speed * speed * speed - 0.14 * speed;
    const double error = target - torque;
    torque_integral += error * kDt;
    double out = 0.1 * kKg * error + 10 * kKg * torque_integral;
    if (out >= limit || out <= -limit) torque_integral -= error * kDt;
    out = std::min(std::max(out, -limit), limit);
    elapsed += kDt;
    if (k % 10 == 0) {
      const double e = wanted - angle, base = ar2 * angle - 0.0026 * speed * speed * speed - 0.14 * speed;
      position_integral += e * elapsed;
      const double raw = 4 * e + 8 * position_integral;
      if (raw >= base + br * limit || raw <= base - br * limit) position_integral -= e * elapsed;
      target = std::min(std::max(raw, base - br * limit), base + br * limit);
      elapsed = 0;
    }
    sent = out;
    JointCommand<double> u;
    ASSERT_EQ(controller.step({.angle = angle, .velocity = speed}, {.angle = 0.3}, kDt, u), Status::kOk);
    ASSERT_NEAR(u.delta_pressure, sent, 1e-6 * kKg) << k;  // 4000 additions in another order
    ASSERT_NEAR(u.pressure.muscle_2 - u.pressure.muscle_1, 2 * u.delta_pressure, 1e-9);
  }
}

TEST(JointController, the_outer_loop_takes_the_time_that_really_passed) {
  // The same trajectory of error over time at other intervals: ∫ e dt and with it the asked-for torque must agree.
  const auto asked_after_a_second = [](double dt) {
    JointController<double> controller;
    JointSettings<double> s = testbed();
    EXPECT_EQ(controller.configure(s), Status::kOk);
    EXPECT_EQ(controller.set_mode(Mode::kPosition), Status::kOk);
    JointCommand<double> u;
    const int ticks = static_cast<int>(std::lround(1 / dt));
    for (int k = 0; k < ticks; ++k) EXPECT_EQ(controller.step({}, {.angle = 0.1}, dt, u), Status::kOk);
    return u.wanted_torque;
  };
  const double at_2khz = asked_after_a_second(5e-4);
  EXPECT_NEAR(at_2khz, 4 * 0.1 + 8 * 0.1, 0.02);  // K_P e + K_I e t, to one outer interval or two
  EXPECT_NEAR(asked_after_a_second(2e-3), at_2khz,
              8 * 0.1 * 0.03);  // an outer interval of 20 ms instead of 5
}

TEST(JointController, is_vented_until_it_has_settings_and_a_mode) {
  JointController<double> controller;
  JointCommand<double> u;
  u.pressure = {1, 1};
  EXPECT_EQ(controller.step({}, {}, kDt, u), Status::kOk);
  EXPECT_TRUE(u.vented);
  EXPECT_EQ(u.pressure.muscle_1, 0.0);
  EXPECT_EQ(controller.set_mode(Mode::kPosition), Status::kNotPermitted);
  ASSERT_EQ(controller.configure(testbed()), Status::kOk);
  EXPECT_EQ(controller.step({}, {}, kDt, u), Status::kOk);
  EXPECT_TRUE(u.vented);
  ASSERT_EQ(controller.set_mode(Mode::kPosition), Status::kOk);
  EXPECT_EQ(controller.step({}, {}, kDt, u), Status::kOk);
  EXPECT_FALSE(u.vented);
  EXPECT_EQ(u.pressure.muscle_1, 3 * kKg);
}

TEST(JointController, every_error_vents_and_stays_vented_until_a_mode_is_set_again) {
  for (int which = 0; which < 7; ++which) {
    Loop loop(testbed());
    loop.wanted.angle = 0.2;
    loop.run(100);
    JointMeasurement<double> now{loop.plant.angle, loop.plant.velocity, 0};
    JointReference<double> wanted = loop.wanted;
    double dt = kDt;
    double* const places[] = {&now.angle, &now.velocity, &wanted.angle, &wanted.torque, &wanted.load, &dt};
    if (which < 6) *places[which] = which % 2 == 0 ? kNan : std::numeric_limits<double>::infinity();
    if (which == 6) dt = 0;
    EXPECT_EQ(loop.controller.step(now, wanted, dt, loop.u),
              which == 6 ? Status::kOutOfRange : Status::kNotFinite);
    EXPECT_TRUE(loop.u.vented);
    EXPECT_EQ(loop.u.pressure.muscle_2, 0.0);
    EXPECT_EQ(loop.controller.mode(), Mode::kVented);
    loop.run(10);
    EXPECT_TRUE(loop.u.vented);
    ASSERT_EQ(loop.controller.set_mode(Mode::kHold), Status::kOk);
    loop.run(1);
    EXPECT_FALSE(loop.u.vented);
    EXPECT_LT(std::abs(loop.u.delta_pressure), 0.01 * kKg);  // and starts from nothing
  }
}

TEST(JointController, a_command_that_overflows_is_a_fault_and_not_a_full_valve) {
  JointSettings<double> s = testbed();
  s.torque.proportional = 1e308;
  Loop loop(s, Mode::kTorque);
  loop.run(1);
  EXPECT_EQ(loop.controller.step({}, {.torque = 1e10}, kDt, loop.u), Status::kNotFinite);
  EXPECT_TRUE(loop.u.vented);
}

TEST(JointController, measured_torque_must_be_a_number_only_where_it_is_used) {
  for (const Structure structure : {Structure::kPid, Structure::kCascade, Structure::kModelBased}) {
    JointSettings<double> s = testbed();
    s.structure = structure;
    Loop loop(s);
    EXPECT_EQ(loop.controller.step({.torque = kNan}, {}, kDt, loop.u),
              structure == Structure::kCascade ? Status::kNotFinite : Status::kOk);
  }
}

// Largest change of Δp from one tick to the next that is no bump: what the loops themselves do in a tick. Inner increment
// K_I e h for an error of some 2 N m: 10 · 2 · 0.0005 = 0.01 kg/cm²; the P part on the model's motion adds as much.
constexpr double kBump = 0.03 * kKg;

TEST(JointController, no_switch_between_modes_is_felt) {
  const Mode modes[] = {Mode::kPosition, Mode::kHold, Mode::kTorque};
  for (const Structure structure : {Structure::kCascade, Structure::kModelBased}) {
    for (const Mode from : modes) {
      for (const Mode to : modes) {
        JointSettings<double> s = testbed_settings<double>();  // with its limit of the desired speed
        s.structure = structure;
        // A loop that is calm with the torque measured behind the valve's lag as well.
        if (structure == Structure::kCascade) s.torque = {.proportional = 0.5 * kKg, .integral = 3 * kKg};
        Loop loop(s, from);
        loop.wanted = {.angle = 0.3, .torque = -1.0, .load = 0.4};
        loop.run(1500);
        const double before = loop.u.delta_pressure;
        ASSERT_EQ(loop.controller.set_mode(to), Status::kOk);
        loop.wanted.torque = 1.5;  // even if the new mode asks for something else
        loop.run(1);
        const double jump = std::abs(loop.u.delta_pressure - before);
        if (from == Mode::kTorque && to == from) {
          EXPECT_GT(jump,
                    5 * kBump);  // no switch, but a new torque asked for: what the same step is untransferred
        } else {
          EXPECT_LT(jump, kBump) << static_cast<int>(structure) << static_cast<int>(from)
                                 << static_cast<int>(to);
        }
      }
    }
  }
}

TEST(JointController, no_change_of_structure_or_gains_is_felt) {
  for (const Structure from : {Structure::kPid, Structure::kCascade, Structure::kModelBased}) {
    for (const Structure to : {Structure::kPid, Structure::kCascade, Structure::kModelBased}) {
      const auto settings = [](Structure structure, double factor) {
        JointSettings<double> s = testbed_settings<double>();
        s.structure = structure;
        if (structure == Structure::kPid)
          s.position = {.proportional = 0.2 * kKg, .integral = 4 * kKg, .derivative = 0.0014 * kKg};
        s.position.proportional *= factor;
        s.torque.proportional *= factor;
        return s;
      };
      Loop loop(settings(from, 1.0));
      loop.wanted.angle = 0.3;
      loop.run(1500);
      const double before = loop.u.delta_pressure;
      ASSERT_EQ(loop.controller.configure(settings(to, 2.0)), Status::kOk);
      loop.run(1);
      EXPECT_LT(std::abs(loop.u.delta_pressure - before), kBump)
          << static_cast<int>(from) << static_cast<int>(to);
    }
  }
}

TEST(JointController, a_cascade_takes_over_the_torque_that_a_pid_was_giving) {
  JointSettings<double> s = testbed();
  s.structure = Structure::kPid;
  s.position = {.proportional = 0.2 * kKg, .integral = 4 * kKg};
  Loop loop(s);
  loop.plant.external = -1.5;
  loop.wanted.angle = 0.2;
  loop.run(12000);
  ASSERT_EQ(loop.controller.configure(testbed()), Status::kOk);
  loop.run(1);
  EXPECT_NEAR(loop.u.wanted_torque, 1.5, 0.01);  // at rest the pair gives what the load takes
}

TEST(JointController, hold_keeps_the_angle_at_which_it_was_entered) {
  Loop loop(testbed());
  loop.wanted.angle = 0.25;
  loop.run(12000);
  const double entered = loop.plant.angle;
  ASSERT_EQ(loop.controller.set_mode(Mode::kHold), Status::kOk);
  loop.wanted.angle = -0.5;
  loop.plant.external = 0.5;
  loop.run(20000);
  EXPECT_NEAR(loop.plant.angle, entered, 2e-3);  // the slowest pole of these gains is about 0.4 1/s
}

TEST(JointController, a_set_torque_is_reached_on_the_clamped_joint_and_zero_lets_it_be_led) {
  Loop clamped(testbed(), Mode::kTorque);
  clamped.plant.clamped = true;
  clamped.wanted.torque = 2.0;
  clamped.run(4000);
  EXPECT_NEAR(clamped.plant.torque(), 2.0,
              0.01);  // e^(−2 s/0.17 s) of 2 N m is far less; the integral's tail is it

  Loop led(testbed(), Mode::kTorque);
  led.run(100);
  led.plant.angle = 0.4;  // led there; let go without speed
  led.plant.clamped = true;
  led.run(4000);
  led.plant.clamped = false;
  led.run(2000);
  EXPECT_NEAR(led.plant.angle, 0.4,
              0.01);  // stays; without control its spring of 8.5 N m/rad would throw it back
}

TEST(JointController, desired_angle_is_held_within_its_range_and_speed) {
  JointSettings<double> s = testbed();
  s.limits.angle_high = 0.2;
  s.limits.speed = 0.5;
  Loop loop(s);
  loop.wanted.angle = 1.0;
  loop.run(100);
  EXPECT_EQ(loop.u.limited & (kAngleLimited | kSpeedLimited), kAngleLimited | kSpeedLimited);
  EXPECT_LT(loop.plant.angle, 0.05);
  loop.run(30000);
  EXPECT_NEAR(loop.plant.angle, 0.2, 1e-3);
  EXPECT_EQ(loop.u.limited & kSpeedLimited, 0);
}

TEST(JointController, torque_asked_for_stays_within_its_limit) {
  JointSettings<double> s = testbed();
  s.limits.torque = 1.0;
  Loop loop(s, Mode::kTorque);
  loop.plant.clamped = true;
  loop.wanted.torque = 5.0;
  for (int k = 0; k < 500; ++k) {
    loop.run(1);
    ASSERT_LE(loop.u.wanted_torque, 1.0);
  }
  EXPECT_NE(loop.u.limited & kTorqueLimited, 0);
}

TEST(JointController, neither_integral_runs_away_at_the_limit_of_pressure) {
  // Asked for an angle that 2 kg/cm² cannot reach (0.78 rad at most), for ten seconds; then back.
  Loop loop(testbed());
  loop.wanted.angle = 1.1;
  loop.run(20000);
  EXPECT_NEAR(loop.u.delta_pressure, 2 * kKg, 1e-6 * kKg);
  EXPECT_NEAR(loop.plant.angle, 0.782, 2e-3);
  loop.wanted.angle = 0.3;
  int ticks = 0;
  while (loop.u.delta_pressure > 1.9 * kKg && ticks < 4000) {
    loop.run(1);
    ++ticks;
  }
  EXPECT_LT(ticks, 400);  // 0.2 s; the error of ten seconds would have been 3.2 rad s: 25 N m to unwind
}

TEST(JointController, settings_that_cannot_drive_a_joint_are_refused_and_the_old_ones_stay) {
  JointController<double> controller;
  ASSERT_EQ(controller.configure(testbed()), Status::kOk);
  const auto refused = [&](auto spoil, Status status) {
    JointSettings<double> s = testbed();
    spoil(s);
    EXPECT_EQ(controller.configure(s), status);
    EXPECT_EQ(controller.settings().muscle.B, testbed().muscle.B);
  };
  refused([](auto& s) { s.muscle.B = 0; }, Status::kOutOfRange);
  refused([](auto& s) { s.muscle.A = kNan; }, Status::kNotFinite);
  refused([](auto& s) { s.wheel_radius = -1; }, Status::kOutOfRange);
  refused([](auto& s) { s.outer_every = 0; }, Status::kOutOfRange);
  refused([](auto& s) { s.torque.integral = -1; }, Status::kOutOfRange);
  refused([](auto& s) { s.position.proportional = kNan; }, Status::kNotFinite);
  refused([](auto& s) { s.limits.delta_pressure = 0; }, Status::kOutOfRange);
  refused([](auto& s) { s.predict_dead_time = true, s.inertia = 0; }, Status::kOutOfRange);
  refused([](auto& s) { s.valve.lag = -0.1; }, Status::kOutOfRange);
}

TEST(JointController, a_plain_pid_has_no_torque_mode) {
  JointSettings<double> s = testbed();
  s.structure = Structure::kPid;
  JointController<double> controller;
  ASSERT_EQ(controller.configure(s), Status::kOk);
  EXPECT_EQ(controller.set_mode(Mode::kTorque), Status::kNotPermitted);
  ASSERT_EQ(controller.configure(testbed()), Status::kOk);
  ASSERT_EQ(controller.set_mode(Mode::kTorque), Status::kOk);
  EXPECT_EQ(controller.configure(s), Status::kNotPermitted);
}

}  // namespace
