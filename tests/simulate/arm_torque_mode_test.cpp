// The check of 6.4 on the simulated arm, and where the gains of table 6.2 can be stable at all. ISAC_SHOW=1 prints the numbers.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "arm_loop.hpp"
#include "isac/control/stability.hpp"

namespace {

using namespace isac;
using namespace isac::simulate;
using namespace isac::test;
using models::Vec3;
using Samples = std::vector<ArmSample>;

/// The hand's way in 3 s after it is let go, in torque mode; the controller believes `masses` times the true ones.
Vec3<double> let_go(const ArmVector& pose, double masses, bool exact_angles = false) {
  const Arm bare{"", 1, 0};
  ArmPlantConfig known = build(bare);
  for (auto& mass : known.chain.masses) mass.mass *= masses;
  ArmLoop loop(build(bare), known, control::Mode::kTorque);
  if (exact_angles) loop.encoder_step = 0;
  loop.start(pose, 3);
  const Vec3<double> from = loop.plant().tool();
  loop.run(3, [&](double) { return loop.rest(); });
  return loop.plant().tool() - from;
}

TEST(ArmTorqueMode, in_torque_mode_the_arm_stays_where_it_is_put_with_its_masses_and_falls_without) {
  // 6.4: the pose of the identification, and three into which the arm is led by hand. No friction helps here. What is left
  // with the right masses is half an encoder step (0.4 mrad) of every angle in the model: 8.06 N m/rad · 0.4 mrad = 3 mN m, which
  // turns joint 3 by τ/(T_C k) = 2.4 mrad/s.
  const ArmVector poses[] = {
      {}, {0.4, 0.3, -0.2, 0.2, 0.1, 0}, {-0.3, -0.3, 0.2, 0.1, 0, 0.2}, {0, 0.5, 0.3, 0.3, -0.3, -0.2}};
  for (const ArmVector& pose : poses) {
    const Vec3<double> kept = let_go(pose, 1), exact = let_go(pose, 1, true), fallen = let_go(pose, 0);
    show("6.4: with masses %.1f mm, by exact angles %.3f mm, without masses %.0f mm, %.0f mm down\n",
         1e3 * length(kept), 1e3 * length(exact), 1e3 * length(fallen), -1e3 * fallen.z);
    EXPECT_LT(length(kept), 0.015);
    EXPECT_LT(length(exact), 0.0005);
    EXPECT_LT(fallen.z, -0.1);
  }
}

TEST(ArmTorqueMode, in_torque_mode_the_arm_goes_where_a_hand_leads_it_and_stays_there) {
  const Arm bare{"", 1, 0};
  ArmLoop loop(build(bare), build(bare), control::Mode::kTorque);
  loop.encoder_step = 0;
  loop.start({}, 3);
  const Vec3<double> from = loop.plant().tool();
  const auto rest = [&](double) { return loop.rest(); };
  const auto hand = [](double t, ArmPlant& p) { p.push(t < 1 ? Vec3<double>{0, 0.8, 0.8} : Vec3<double>{}); };
  loop.run(3, rest, hand);
  const Vec3<double> led = loop.plant().tool();
  loop.run(3, rest);
  const Vec3<double> later = loop.plant().tool();
  show("6.4: led %.0f mm by 1.1 N in 1 s, then moved %.1f mm in 3 s\n", 1e3 * length(led - from),
       1e3 * length(later - led));
  EXPECT_GT(length(led - from), 0.1);
  EXPECT_LT(length(later - led), 0.02 * length(led - from));
}

TEST(ArmStability, table_6_2_is_stable_on_the_arm_only_if_the_wheels_are_as_large_as_its_radius) {
  // Joint by joint at the middle pose, without friction, inertia of the whole arm behind it.
  for (const double radius : {1.0, 2.0}) {
    for (const double gains : {0.25, 1.0}) {
      const Arm arm{"", radius, 0, gains};
      const ArmPlantConfig config = build(arm);
      const auto mass = models::mass_matrix(config.chain, ArmVector{});
      const bool expected = radius == 2.0 || gains == 0.25;
      int stable = 0;
      for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
        const ArmJointConfig& joint = config.joints[i];
        const control::CascadeLoop<double> loop{
            .muscle = joint.muscle,
            .wheel_radius = joint.wheel_radius,
            .inertia = mass[i][i] + joint.inertia,
            .position = {.proportional = gains * test::kGains[i][0], .integral = gains * test::kGains[i][1]},
            .torque = {.proportional = test::kGains[i][2] * kPascalPerKgfCm2,
                       .integral = test::kGains[i][3] * kPascalPerKgfCm2}};
        const bool hurwitz = control::is_hurwitz(control::model_based_polynomial(loop));
        const double k = -joint.muscle.A * joint.wheel_radius * joint.wheel_radius;
        show("stability r*%.0f gains %.2f joint %zu: J %.3f, K_P/k %.2f against %.2f: %s\n", radius, gains,
             i + 1, loop.inertia, gains * test::kGains[i][0] / k, 1 + 0.17 * joint.muscle.D / loop.inertia,
             hurwitz ? "stable" : "unstable");
        stable += hurwitz ? 1 : 0;
      }
      EXPECT_EQ(stable, expected ? 2 : 0);
      // And the simulated arm: pushed for 0.3 s and watched.
      ArmLoop loop = loop_of(config, arm);
      loop.start({});
      const Samples s = loop.run(
          6, [&](double) { return loop.rest(); },
          [&](double t, ArmPlant& p) {
            p.push(t < 0.3 ? Vec3<double>{0, 3, 3} : Vec3<double>{});
          });
      double late = 0;
      for (const ArmSample& x : s)
        if (x.time > 4) late = std::max({late, std::abs(x.angle[0]), std::abs(x.angle[1])});
      show("stability r*%.0f gains %.2f: %.3f rad 4 to 6 s after a push\n", radius, gains, late);
      if (expected) {
        EXPECT_LT(late, 0.05);
      } else {
        EXPECT_GT(late, 0.3);
      }
    }
  }
}

}  // namespace
