// Several joints at once: gravity held, inertia fed forward, one bad joint vents all.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "isac/control/arm_controller.hpp"
#include "isac/models/arm/soft_arm.hpp"
#include "rk4_joint.hpp"

namespace {

using namespace isac::control;
using namespace isac::models;
using isac::Status;
using isac::test::Rk4Joint;

constexpr double kDt = 5e-4;

TEST(Compensation, is_what_gravity_takes_seen_through_the_coupling) {
  // Potential energy V(φ) = −Σ m g·x(K φ): the actuators must give ∂V/∂φ. Central differences of V, an independent way.
  const auto chain = soft_arm_chain(SoftArmGeometry<double>{});
  const auto coupling = soft_arm_coupling<double>();
  const auto potential = [&](const JointVector<double, 6>& phi) {
    const auto frames = chain_frames(chain, multiply<double, 6>(coupling, phi));
    double v = 0;
    for (int m = 0; m < chain.mass_count; ++m) {
      const auto& mass = chain.masses[static_cast<std::size_t>(m)];
      v -= mass.mass * dot(chain.gravity, frames[static_cast<std::size_t>(mass.link)].apply(mass.position));
    }
    return v;
  };
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> pose(-1.2, 1.2);
  for (int k = 0; k < 50; ++k) {
    JointVector<double, 6> phi;
    for (double& angle : phi) angle = pose(random);
    const auto torque = compensation_torque<double, 6>(chain, coupling, phi, {}, InertiaShare::kWhole);
    for (std::size_t i = 0; i < 6; ++i) {
      auto up = phi, down = phi;
      up[i] += 1e-5;
      down[i] -= 1e-5;
      EXPECT_NEAR(torque[i], (potential(up) - potential(down)) / 2e-5, 1e-8);  // h² and rounding/h
    }
  }
}

TEST(Compensation, gives_the_torques_of_the_45_degree_pose) {
  // Errata: −4.6117, −1.2581, −0.2197 N m of gravity on arm joints 2, 3 and 5.
  const auto chain = soft_arm_chain(SoftArmGeometry<double>{});
  Coupling<double, 6> direct{};
  for (std::size_t i = 0; i < 6; ++i) direct[i][i] = 1;
  const double q = isac::kPi / 4;
  const auto torque =
      compensation_torque<double, 6>(chain, direct, {0, -q, -q, 0, 2 * q, 0}, {}, InertiaShare::kNone);
  EXPECT_NEAR(torque[1], 4.6117, 5e-5);
  EXPECT_NEAR(torque[2], 1.2581, 5e-5);
  EXPECT_NEAR(torque[4], 0.2197, 5e-5);
}

TEST(Compensation, shares_of_inertia_are_none_the_first_joints_and_all) {
  auto chain = soft_arm_chain(SoftArmGeometry<double>{});
  chain.gravity = {0, 0, 0};
  const auto coupling = soft_arm_coupling<double>();
  const JointVector<double, 6> phi = {0.3, -0.4, 0.2, 0.5, -0.1, 0.6}, wanted = {1, 2, 3, 4, 5, 6};
  const auto of = [&](InertiaShare share) {
    return compensation_torque<double, 6>(chain, coupling, phi, wanted, share);
  };
  const auto mass = mass_matrix(chain, multiply<double, 6>(coupling, phi));
  for (const double entry : of(InertiaShare::kNone)) EXPECT_EQ(entry, 0.0);
  EXPECT_NEAR(of(InertiaShare::kFirstJoint)[0], mass[0][0] * 1, 1e-15);
  for (std::size_t i = 1; i < 6; ++i) EXPECT_EQ(of(InertiaShare::kFirstJoint)[i], 0.0);
  // All of it: twice the kinetic energy of φ̇ = φ̈ is φ̇ᵀ τ = θ̇ᵀ M θ̇.
  const auto theta = multiply<double, 6>(coupling, wanted);
  double power = 0, energy = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    power += wanted[i] * of(InertiaShare::kWhole)[i];
    for (std::size_t j = 0; j < 6; ++j) energy += theta[i] * mass[i][j] * theta[j];
  }
  EXPECT_NEAR(power, energy, 1e-12 * energy);
}

/// An arm nobody has built: any twists, masses on any links, any coupling.
Chain<double, 6> random_chain(std::mt19937_64& random) {
  std::uniform_real_distribution<double> number(-1, 1);
  Chain<double, 6> chain;
  for (auto& link : chain.links) link = {3 * number(random), number(random), number(random), number(random)};
  chain.mass_count = 5;
  for (int m = 0; m < chain.mass_count; ++m) {
    chain.masses[static_cast<std::size_t>(m)] = {
        static_cast<int>(random() % 6), {number(random), number(random), number(random)}, 1 + number(random)};
  }
  chain.gravity = {9.81 * number(random), 9.81 * number(random), 9.81 * number(random)};
  return chain;
}

TEST(Compensation, is_the_gravity_and_the_mass_matrix_of_the_models_for_any_arm) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> number(-3, 3);
  LinkTwists<double, 6> twists;  // kept from arm to arm: another arm must be noticed
  for (int k = 0; k < 200; ++k) {
    const Chain<double, 6> chain = random_chain(random);
    Coupling<double, 6> coupling{};
    JointVector<double, 6> phi, wanted;
    for (std::size_t i = 0; i < 6; ++i) {
      phi[i] = number(random);
      wanted[i] = number(random);
      for (double& entry : coupling[i]) entry = number(random);
    }
    const auto theta = multiply<double, 6>(coupling, phi), bend = multiply<double, 6>(coupling, wanted);
    const auto gravity = gravity_torque(chain, theta);
    const auto mass = mass_matrix(chain, theta);
    for (const InertiaShare share : {InertiaShare::kNone, InertiaShare::kFirstJoint, InertiaShare::kWhole}) {
      JointVector<double, 6> torque{};
      double size = 1;
      for (std::size_t i = 0; i < 6; ++i) {
        torque[i] = -gravity[i];
        for (std::size_t j = 0; j < 6; ++j) {
          const bool counts =
              share == InertiaShare::kWhole || (share == InertiaShare::kFirstJoint && i + j == 0);
          if (counts) torque[i] += mass[i][j] * bend[j];
          size += std::abs(mass[i][j] * bend[j]);
        }
      }
      const auto expected = multiply_transposed<double, 6>(coupling, torque);
      const auto found = compensation_torque<double, 6>(chain, coupling, phi, wanted, share, twists);
      for (std::size_t i = 0; i < 6; ++i)
        EXPECT_NEAR(found[i], expected[i], 1e-13 * size);  // some hundred roundings of 1e-16 each
    }
  }
}

// One joint with a weight on a lever: a pendulum about a level axis, in the arm's own words.
Chain<double, 1> pendulum(double mass, double lever) {
  Chain<double, 1> chain;
  chain.links = {{{0, 0, 0, 0}}};
  chain.masses[0] = {0, {lever, 0, 0}, mass};
  chain.mass_count = 1;
  chain.gravity = {0, -9.81, 0};  // turning about z, falling along −y: τ_g = −m g l cos φ
  return chain;
}

struct Pendulum {
  static constexpr double kMass = 0.3, kLever = 0.2;
  ArmController<double, 1> arm;
  Rk4Joint plant;
  std::array<JointCommand<double>, 1> u;
  std::array<ArmReference<double>, 1> wanted{};
  int failed = -1;

  explicit Pendulum(Mode mode, bool compensate) {
    JointSettings<double> s = testbed_settings<double>();
    s.limits.speed = std::numeric_limits<double>::infinity();
    EXPECT_EQ(arm.joints[0].configure(s), Status::kOk);
    EXPECT_EQ(arm.joints[0].set_mode(mode), Status::kOk);
    arm.chain = pendulum(kMass, kLever);
    arm.coupling = {{{1.0}}};
    arm.compensate = compensate;
    plant.rest_at(s.mean_pressure);
    plant.J += kMass * kLever * kLever;
    plant.load_of_angle = [](double angle) { return -kMass * 9.81 * kLever * std::cos(angle); };
  }
  void run(int ticks) {
    for (int k = 0; k < ticks; ++k) {
      ASSERT_EQ(arm.step({{{plant.angle, plant.velocity, 0}}}, wanted, kDt, u, failed), Status::kOk);
      plant.step(u[0].pressure.muscle_1, u[0].pressure.muscle_2, kDt);
    }
  }
};

TEST(HandGuiding, the_arm_stands_still_in_the_air_only_with_its_gravity_compensated) {
  // Seed 6.3, 6.4. Held by hand at 0.3 rad while the valves come to their pressures, then let go for two seconds.
  double moved[2] = {};
  for (const bool compensate : {false, true}) {
    Pendulum rig(Mode::kTorque, compensate);
    rig.plant.angle = 0.3;
    rig.plant.clamped = true;
    rig.run(4000);
    rig.plant.clamped = false;
    rig.run(4000);
    moved[compensate ? 1 : 0] = std::abs(rig.plant.angle - 0.3);
  }
  EXPECT_LT(moved[1], 0.01);  // what is left of the inner loop's approach after two seconds
  EXPECT_GT(moved[0], 0.5);   // falls: a weight of 0.59 N m with nothing to hold it
}

TEST(HandGuiding, it_goes_where_it_is_pushed_and_stays_there) {
  Pendulum rig(Mode::kTorque, true);
  rig.plant.clamped = true;
  rig.run(4000);
  rig.plant.angle = -0.4;  // led there by hand
  rig.run(4000);
  rig.plant.clamped = false;
  rig.run(4000);
  EXPECT_NEAR(rig.plant.angle, -0.4, 0.01);
}

TEST(Arm, compensation_keeps_a_weight_from_pulling_the_joint_down_at_the_start) {
  // PI-CMBPI against PI-MBPI: held at 0 with the weight on from the start of control. The valve lag leaves both a sag.
  double sag[2] = {};
  for (const bool compensate : {false, true}) {
    Pendulum rig(Mode::kHold, compensate);
    double lowest = 0;
    for (int k = 0; k < 6000; ++k) {
      rig.run(1);
      lowest = std::min(lowest, rig.plant.angle);
    }
    sag[compensate ? 1 : 0] = -lowest;
  }
  EXPECT_LT(sag[1], 0.85 * sag[0]);  // the valve's 0.17 s outlasts the fall; no more can be had of it
  RecordProperty("sag_without", std::to_string(sag[0]));
  RecordProperty("sag_with", std::to_string(sag[1]));
}

TEST(Arm, one_joint_that_fails_is_named_and_vents_all) {
  ArmController<double, 6> arm;
  arm.chain = soft_arm_chain(SoftArmGeometry<double>{});
  arm.coupling = soft_arm_coupling<double>();
  for (auto& joint : arm.joints) {
    ASSERT_EQ(joint.configure(testbed_settings<double>()), Status::kOk);
    ASSERT_EQ(joint.set_mode(Mode::kHold), Status::kOk);
  }
  std::array<JointMeasurement<double>, 6> now{};
  std::array<ArmReference<double>, 6> wanted{};
  std::array<JointCommand<double>, 6> command;
  int failed = -1;
  ASSERT_EQ(arm.step(now, wanted, kDt, command, failed), Status::kOk);
  for (const auto& u : command) EXPECT_FALSE(u.vented);

  now[3].angle = std::numeric_limits<double>::quiet_NaN();
  for (const bool compensated :
       {true, false}) {  // also where it would reach every joint through the compensation
    for (auto& joint : arm.joints) ASSERT_EQ(joint.set_mode(Mode::kHold), Status::kOk);
    arm.compensate = compensated;
    EXPECT_EQ(arm.step(now, wanted, kDt, command, failed), Status::kNotFinite);
    EXPECT_EQ(failed, 3);
    for (const auto& u : command) {
      EXPECT_TRUE(u.vented);
      EXPECT_EQ(u.pressure.muscle_1, 0.0);
    }
  }
  now[3].angle = 0;
  ASSERT_EQ(arm.step(now, wanted, kDt, command, failed), Status::kOk);
  for (const auto& u : command) EXPECT_TRUE(u.vented);  // until it is given a mode again
}

TEST(Arm, feed_forward_of_known_friction_halves_the_error_of_a_slow_sine) {
  double worst[2] = {};
  for (const bool fed : {false, true}) {
    ArmController<double, 1> arm;
    JointSettings<double> s = testbed_settings<double>();
    ASSERT_EQ(arm.joints[0].configure(s), Status::kOk);
    ASSERT_EQ(arm.joints[0].set_mode(Mode::kPosition), Status::kOk);
    arm.coupling = {{{1.0}}};
    const double friction[kMaxEffectParameters] = {0.3};
    if (fed) {
      ASSERT_EQ(arm.feed_forward[0].add(find_effect("coulomb_friction"), friction, 1), Status::kOk);
    }
    Rk4Joint plant;
    plant.lag = 0.02;  // a valve quick enough to bring the torque while it is wanted
    plant.coulomb = friction[0];
    plant.rest_at(s.mean_pressure);
    std::array<JointCommand<double>, 1> u;
    int failed = -1;
    for (int k = 0; k < 20000; ++k) {
      const double t = k * kDt;
      const std::array<ArmReference<double>, 1> wanted = {
          {{.angle = 0.3 * std::sin(t), .velocity = 0.3 * std::cos(t), .acceleration = -0.3 * std::sin(t)}}};
      ASSERT_EQ(arm.step({{{plant.angle, plant.velocity, 0}}}, wanted, kDt, u, failed), Status::kOk);
      plant.step(u[0].pressure.muscle_1, u[0].pressure.muscle_2, kDt, 20);
      if (t > 4) worst[fed ? 1 : 0] = std::max(worst[fed ? 1 : 0], std::abs(plant.angle - wanted[0].angle));
    }
  }
  EXPECT_LT(worst[1], 0.5 * worst[0]);
  RecordProperty("worst_without", std::to_string(worst[0]));
  RecordProperty("worst_with", std::to_string(worst[1]));
}

}  // namespace
