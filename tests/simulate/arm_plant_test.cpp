// The simulated arm against what must hold: energy, the testbed's own plant, rest, Newton's third law at the hand.
#include "isac/simulate/arm_plant.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "isac/core/error.hpp"
#include "isac/simulate/plant.hpp"
#include "soft_arm.hpp"

namespace {

using namespace isac;
using namespace isac::simulate;
using isac::test::soft_arm_config;

constexpr double kKg = kPascalPerKgfCm2;

ArmPlantConfig lossless() {
  ArmPlantConfig config = soft_arm_config();
  config.load = 0.34;
  config.touch_damping = 0;
  for (ArmJointConfig& joint : config.joints) joint.muscle.C = joint.muscle.D = 0;
  return config;
}

constexpr ArmVector kPose = {0.3, -0.2, 0.4, 0.1, -0.3, 0.2}, kSpeed = {1.0, -0.8, 1.5, 0.7, -2.0, 3.0};

/// Largest change of the sum over `seconds`, as a share of the largest kinetic energy.
double drift(const ArmPlantConfig& config, double seconds) {
  ArmPlant arm(config);
  arm.rest_at(kPose, 3 * kKg);
  arm.set_velocity(kSpeed);
  const double start = arm.energy().sum();
  double worst = 0, kinetic = 0;
  for (double t = 0; t < seconds; t += 0.01) {
    EXPECT_EQ(arm.run(0.01), Status::kOk);
    worst = std::max(worst, std::abs(arm.energy().sum() - start));
    kinetic = std::max(kinetic, arm.energy().kinetic);
  }
  return worst / kinetic;
}

TEST(ArmPlant, keeps_its_energy_when_nothing_takes_any) {
  // All of mass matrix, Coriolis, gravity, coupling and springs is in this sum. What is left is the integrator's: the fastest
  // swing (a wrist joint's own inertia on its muscles) has 33 rad/s, h ω = 0.003, and 1e-9 holds a hundredfold of h⁴ ω⁴ · t ω.
  EXPECT_LT(drift(lossless(), 2), 1e-9);
}

TEST(ArmPlant, is_integrated_to_the_fourth_order) {
  ArmPlantConfig config = lossless();
  config.step = 4e-3;
  const double coarse = drift(config, 1);
  config.step = 2e-3;
  EXPECT_GT(coarse / drift(config, 1),
            15);  // 16 of a fourth order; of swings that go on the energy falls by 32
}

TEST(ArmPlant, keeps_its_energy_through_elastic_slack) {
  ArmPlantConfig config = lossless();
  config.joints[0].play = 0.01;
  // The wheel rattles at 3200 rad/s: at 0.1 ms, h ω = 0.3, the method itself takes (h ω)⁶/72 of it per step, and each touch
  // begins inside a step. A fifth of the step is left with the touches.
  const double coarse = drift(config, 1);
  config.step = 2e-5;
  const double fine = drift(config, 1);
  EXPECT_LT(fine, 5e-4);
  EXPECT_LT(fine, coarse / 5);
}

TEST(ArmPlant, loses_what_the_dampers_take_and_no_more) {
  ArmPlantConfig config = soft_arm_config();
  ArmPlant arm(config);
  arm.rest_at(kPose, 3 * kKg);
  arm.set_velocity(kSpeed);
  const double start = arm.energy().sum();
  const auto power = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < kArmJoints; ++i) {
      const double w = arm.velocity()[i];
      sum += config.joints[i].muscle.D * w * w + config.joints[i].muscle.C * w * w * w * w;
    }
    return sum;
  };
  double taken = 0, before = power();
  for (int k = 0; k < 5000; ++k) {
    ASSERT_EQ(arm.run(1e-4), Status::kOk);
    const double now = power();
    taken += 0.5e-4 * (before + now);
    before = now;
  }
  // The trapezia of the sum: h²/12 of the power's curvature, at D/I up to 145 1/s: 2e-5 of the energy.
  EXPECT_NEAR(start - arm.energy().sum(), taken, 1e-4 * taken);
  EXPECT_GT(taken, 0.05);
}

TEST(ArmPlant, without_masses_is_six_testbeds) {
  // Every joint beside the testbed's plant (another integrator, other code): step of a command with dead time and unequal lags.
  ArmPlantConfig config = soft_arm_config();
  for (auto& mass : config.chain.masses) mass.mass = 0;
  for (ArmJointConfig& joint : config.joints) {
    joint.inertia = 0.05;
    joint.valve[0] =
        joint.valve[1] = {.gain = 0.98, .offset = 100, .fill_lag = 0.17, .vent_lag = 0.11, .dead_time = 0.02};
  }
  ArmPlant arm(config);
  arm.rest_at({}, 3 * kKg);
  ArmPressures u;
  for (std::size_t i = 0; i < kArmJoints; ++i) u[i] = {2.5 * kKg, 3.6 * kKg};
  arm.command(u);
  ASSERT_EQ(arm.run(0.3), Status::kOk);
  for (std::size_t i = 0; i < kArmJoints; ++i) {
    const ArmJointConfig& joint = config.joints[i];
    RigConfig rig;
    rig.valves = joint.valve;
    rig.pressure = {(3 * kKg - 100) / 0.98, (3 * kKg - 100) / 0.98};
    rig.joint.A = joint.muscle.A, rig.joint.B = joint.muscle.B, rig.joint.C = joint.muscle.C,
    rig.joint.D = joint.muscle.D;
    rig.joint.wheel_radius = joint.wheel_radius;
    rig.joint.inertia = joint.inertia;
    rig.joint.stop_angle = 10;
    rig.relative_tolerance = 1e-10;
    Plant one(rig);
    // The rig's plant starts with muscles at the commanded pressure; let it settle at 3 kg/cm² under its valves' gain first.
    while (one.time() < 5) ASSERT_EQ(one.step_to(5), Status::kOk);
    one.command({2.5 * kKg, 3.6 * kKg});
    while (one.time() < 5.3) ASSERT_EQ(one.step_to(5.3), Status::kOk);
    EXPECT_NEAR(arm.angle()[i], one.state().joint.angle, 1e-7) << i;
    EXPECT_NEAR(arm.velocity()[i], one.state().joint.velocity, 1e-6) << i;
    EXPECT_NEAR(arm.pressure()[i].muscle_2, one.state().pressure[1], 0.1) << i;
    EXPECT_GT(std::abs(arm.angle()[i]), 0.05) << i;
  }
}

TEST(ArmPlant, stays_at_rest_where_its_muscles_carry_it) {
  ArmPlantConfig config = soft_arm_config();
  config.load = 0.34;
  config.joints[0].play = config.joints[1].play = 0.01;
  for (auto& valve : config.joints[2].valve) valve.dead_time = 0.01;
  ArmPlant arm(config);
  arm.rest_at(kPose, 3 * kKg);
  ASSERT_EQ(arm.run(1), Status::kOk);
  for (std::size_t i = 0; i < kArmJoints; ++i) EXPECT_NEAR(arm.angle()[i], kPose[i], 1e-9) << i;
}

TEST(ArmPlant, a_hand_that_carries_the_load_makes_it_vanish) {
  // Force m g upwards on a mass m at rest at the same point: held pressures of the empty arm carry both.
  ArmPlantConfig config = soft_arm_config();
  ArmPlant empty(config);
  empty.rest_at(kPose, 3 * kKg);
  config.load = 0.34;
  ArmPlant loaded(config);
  loaded.rest_at(kPose, 3 * kKg);
  ArmPressures u = empty.pressure();
  loaded.command(u);
  loaded.push({0, 0, 0.34 * 9.81});
  ASSERT_EQ(loaded.run(15), Status::kOk);  // until the least damped swing has died away
  for (std::size_t i = 0; i < kArmJoints; ++i) EXPECT_NEAR(loaded.angle()[i], kPose[i], 1e-6) << i;
  loaded.push({});
  ASSERT_EQ(loaded.run(3), Status::kOk);
  EXPECT_LT(loaded.tool().z, empty.tool().z - 0.01);  // and without it the load is there
}

TEST(ArmPlant, friction_holds_a_joint_against_less_than_itself) {
  for (const double torque : {0.4, 0.8}) {
    ArmPlantConfig config = soft_arm_config();
    config.joints[1].friction = 0.6;
    ArmPlant arm(config);
    arm.rest_at({}, 3 * kKg);
    ArmPressures u = arm.pressure();
    const double delta = torque / (config.joints[1].muscle.B * config.joints[1].wheel_radius);
    u[1] = {u[1].muscle_1 - delta, u[1].muscle_2 + delta};
    arm.command(u);
    ASSERT_EQ(arm.run(3), Status::kOk);
    // Dahl: 1 − e^(−φ/φ_s) = 0.4/0.6 at φ = 2.2 mrad; with 0.8 N m it gives way and the muscles' stiffness stops it.
    if (torque < 0.6) {
      EXPECT_LT(arm.angle()[1], 2.3e-3);
    } else {
      EXPECT_GT(arm.angle()[1], 5e-3);
    }
    EXPECT_NEAR(arm.velocity()[1], 0, 1e-6);
  }
}

TEST(ArmPlant, slack_lets_the_joint_swing_freely_between_its_ends) {
  ArmPlantConfig config = soft_arm_config();
  config.chain.gravity = {};
  config.joints[0].play = 0.02;
  ArmPlant arm(config);
  arm.rest_at({}, 3 * kKg);
  arm.set_velocity({0.1, 0, 0, 0, 0, 0});
  // The wheel, damped by D/I = 1100 1/s, stops at once; the joint goes on alone until the slack is used up.
  ASSERT_EQ(arm.run(0.15), Status::kOk);
  EXPECT_NEAR(arm.velocity()[0], 0.1, 0.002);
  ASSERT_EQ(arm.run(0.2), Status::kOk);
  EXPECT_LT(arm.velocity()[0], 0.05);
}

TEST(ArmPlant, refuses_what_is_no_arm) {
  const auto refused = [](const std::function<void(ArmPlantConfig&)>& spoil) {
    ArmPlantConfig config = soft_arm_config();
    spoil(config);
    EXPECT_THROW(ArmPlant{config}, Error);
  };
  refused([](auto& c) { c.step = 0; });
  refused([](auto& c) { c.load = -1; });
  refused([](auto& c) { c.joints[3].inertia = 0; });
  refused([](auto& c) { c.joints[3].wheel_radius = 0; });
  refused([](auto& c) { c.joints[2].muscle.A = std::nan(""); });
  refused([](auto& c) { c.joints[5].valve[1].fill_lag = -0.1; });
  refused([](auto& c) { c.chain.mass_count = models::kMaxMasses; });
}

TEST(ArmPlant, says_when_its_numbers_are_lost) {
  ArmPlantConfig config = soft_arm_config();
  config.step = 0.5;  // far beyond what the method holds for these dampers
  ArmPlant arm(config);
  arm.rest_at({}, 3 * kKg);
  arm.set_velocity(kSpeed);
  EXPECT_EQ(arm.run(200), Status::kDeviceError);
}

}  // namespace
