// What a loop in real time needs: no heap in ten thousand ticks, the same in float as in double, the same again.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "../runtime/counted_new.hpp"
#include "isac/control/arm_controller.hpp"
#include "isac/control/deployed.hpp"
#include "isac/control/fault_machine.hpp"
#include "isac/control/velocity_estimate.hpp"
#include "isac/control/watches.hpp"
#include "isac/models/arm/soft_arm.hpp"
#include "rk4_joint.hpp"

namespace {

using namespace isac::control;
using namespace isac::models;
using isac::kPascalPerKgfCm2;
using isac::Status;

/// Tables 6.1 and 6.2 of the seed, as a controller is handed them.
ParameterTable arm_table() {
  struct Row {
    double a, b, c, d, diameter, outer_p, outer_i, inner_p, inner_i;
  };
  const Row rows[] = {{-143000, 3200, 0.0351, 2.20, 0.030, 200, 80, 0.0065, 10},
                      {-108000, 970, 0.0184, 1.14, 0.025, 100, 25, 0.03, 10},
                      {-80600, 334, 0.0046, 0.286, 0.020, 25, 10, 0.12, 5},
                      {-80600, 329, 0.0046, 0.286, 0.020, 25, 10, 0.12, 5},
                      {-37600, 138, 0.0023, 0.143, 0.015, 8, 2, 0.4, 10},
                      {-37600, 134, 0.0023, 0.143, 0.015, 8, 2, 0.4, 10}};
  using enum JointField;
  ParameterTable table;
  table.joint_count = 6;
  for (std::size_t i = 0; i < 6; ++i) {
    const Row& row = rows[i];
    const double kg = kPascalPerKgfCm2;
    JointParameters& joint = table.joints[i];
    joint.set(kA, row.a);
    joint.set(kB, row.b / kg);
    joint.set(kC, row.c);
    joint.set(kD, row.d);
    joint.set(kWheelRadius, row.diameter / 2);
    joint.set(kInitialPressure, 3 * kg);
    joint.set(kInertia, 0.02);
    joint.set(kValveLag, 0.17);
    joint.set(kValveDeadTime, 0.004);
    joint.set(kPositionP, row.outer_p);
    joint.set(kPositionI, row.outer_i);
    joint.set(kTorqueP, row.inner_p * kg);
    joint.set(kTorqueI, row.inner_i * kg);
  }
  table.effect_count = 2;
  table.effects[0] = {effect_id_hash("coulomb_friction"), kAllJoints, 1, {0.2}};
  table.effects[1] = {effect_id_hash("gravity_imbalance"), 2, 2, {0.1, 0.05}};
  return table;
}

/// The seed's chain in the scalar of the controller, narrowed once.
template <class S>
Chain<S, 6> narrowed(const Chain<double, 6>& from) {
  const auto vec = [](const Vec3<double>& v) { return Vec3<S>{S(v.x), S(v.y), S(v.z)}; };
  Chain<S, 6> to;
  for (std::size_t i = 0; i < 6; ++i) {
    const DhLink<double>& l = from.links[i];
    to.links[i] = {S(l.alpha), S(l.a), S(l.d), S(l.theta_offset)};
  }
  for (std::size_t i = 0; i < to.masses.size(); ++i)
    to.masses[i] = {from.masses[i].link, vec(from.masses[i].position), S(from.masses[i].mass)};
  to.mass_count = from.mass_count;
  to.tool_link = from.tool_link;
  to.tool = vec(from.tool);
  to.gravity = vec(from.gravity);
  return to;
}

template <class S>
struct WholeArm {
  ArmController<S, 6> arm;
  std::array<VelocityEstimate<S>, 6> velocity;
  std::array<JointMeasurement<S>, 6> now{};
  std::array<ArmReference<S>, 6> wanted{};
  std::array<JointCommand<S>, 6> command{};
  int failed = -1;

  explicit WholeArm(bool predict = true) {
    const ParameterTable table = arm_table();
    for (int i = 0; i < 6; ++i) {
      const auto at = static_cast<std::size_t>(i);
      JointSettings<S> s;
      int left_out = 0;
      EXPECT_EQ(settings_of(table, i, s), Status::kOk);
      EXPECT_EQ(feed_forward_of(table, i, arm.feed_forward[at], left_out), Status::kOk);
      s.predict_dead_time = predict;
      EXPECT_EQ(arm.joints[at].configure(s), Status::kOk);
      EXPECT_EQ(arm.joints[at].set_mode(Mode::kPosition), Status::kOk);
    }
    arm.chain = narrowed<S>(soft_arm_chain(SoftArmGeometry<double>{}));
    arm.coupling = soft_arm_coupling<S>();
  }

  /// Tick k of a motion that is the same for every scalar.
  Status tick(int k) {
    for (std::size_t i = 0; i < 6; ++i) {
      const double rate = 0.002 * static_cast<double>(i + 1), phase = rate * k;
      now[i].angle = S(0.2 * std::sin(phase - 0.02));
      Status status = velocity[i].step(now[i].angle, S(5e-4), now[i].velocity);
      if (!isac::ok(status)) return status;
      wanted[i] = {.angle = S(0.2 * std::sin(phase)),
                   .velocity = S(0.2 * rate / 5e-4 * std::cos(phase)),
                   .acceleration = S(-0.2 * rate * rate / 25e-8 * std::sin(phase))};
    }
    return arm.step(now, wanted, S(5e-4), command, failed);
  }
};

TEST(RealTime, ten_thousand_ticks_of_the_whole_arm_ask_for_no_memory) {
  auto arm = std::make_unique<WholeArm<double>>();
  FaultMachine machine;
  std::array<JointWatch<double>, 6> watch;
  std::array<EncoderWatch<double>, 6> encoder;
  InputWatch input;
  std::uint8_t warnings = 0;
  isac::test::watch_allocations();
  Status status = Status::kOk;
  for (int k = 0; k < 10000 && isac::ok(status); ++k) {
    const std::int64_t now = 500'000LL * (k + 1);
    Finding found = input.check(2000, true, 0);
    for (std::size_t i = 0; i < 6; ++i) {
      const Finding here = watch[i].check({.angle = 0.1 * k / 10000}, 5e-4, warnings);
      if (here.found()) found = here;
      static_cast<void>(encoder[i].check(100, 0.0, 5e-4, warnings));
    }
    machine.begin({.now = now, .sampled = now - 1000, .arm = k > 200, .finding = found});
    status = arm->tick(k);
  }
  const long allocations = isac::test::watched_allocations();
  EXPECT_EQ(status, Status::kOk);
  EXPECT_EQ(machine.state(), RunState::kArmed);
  EXPECT_EQ(allocations, 0);
  // The counter does count.
  isac::test::watch_allocations();
  ::operator delete(::operator new(8));  // called by name, it may not be optimised away
  EXPECT_EQ(isac::test::watched_allocations(), 1);
}

TEST(RealTime, float_and_double_give_the_same_commands_to_float_precision) {
  auto wide = std::make_unique<WholeArm<double>>();
  auto narrow = std::make_unique<WholeArm<float>>();
  double worst = 0;
  int free = 0;
  for (int k = 0; k < 4000; ++k) {
    ASSERT_EQ(wide->tick(k), Status::kOk);
    ASSERT_EQ(narrow->tick(k), Status::kOk);
    for (std::size_t i = 0; i < 6; ++i) {
      const double command = wide->command[i].delta_pressure;
      worst = std::max(worst, std::abs(command - static_cast<double>(narrow->command[i].delta_pressure)));
      free += std::abs(command) < 1.99 * kPascalPerKgfCm2;
    }
  }
  // A float of 2e5 Pa has steps of 0.016 Pa, and the velocity from float angles steps of 1.4e-6 rad/s.
  EXPECT_LT(worst, 1.0);
  EXPECT_GT(worst, 0.0);
  EXPECT_GT(free, 12000);  // at least half of the commands are the controllers' and not the limits'
  RecordProperty("worst_pascal", std::to_string(worst));
  RecordProperty("worst_free", std::to_string(free));
}

TEST(RealTime, the_same_inputs_give_the_same_commands_bit_for_bit) {
  auto first = std::make_unique<WholeArm<float>>(), second = std::make_unique<WholeArm<float>>();
  for (int k = 0; k < 4000; ++k) {
    ASSERT_EQ(first->tick(k), Status::kOk);
    ASSERT_EQ(second->tick(k), Status::kOk);
    for (std::size_t i = 0; i < 6; ++i) {
      const auto& a = first->command[i].pressure;
      const auto& b = second->command[i].pressure;
      ASSERT_EQ(std::memcmp(&a, &b, sizeof a), 0) << k;
    }
  }
}

TEST(RealTime, float_and_double_agree_in_the_closed_loop) {
  const auto run = []<class S>(S) {
    isac::test::Rk4Joint rig;
    JointSettings<S> s = testbed_settings<S>();
    JointController<S> controller;
    EXPECT_EQ(controller.configure(s), Status::kOk);
    EXPECT_EQ(controller.set_mode(Mode::kPosition), Status::kOk);
    rig.rest_at(3 * kPascalPerKgfCm2);
    std::vector<double> angle;
    for (int k = 0; k < 6000; ++k) {
      JointCommand<S> u;
      EXPECT_EQ(controller.step({.angle = S(rig.angle), .velocity = S(rig.velocity)}, {.angle = S(0.3)},
                                S(5e-4), u),
                Status::kOk);
      rig.step(static_cast<double>(u.pressure.muscle_1), static_cast<double>(u.pressure.muscle_2), 5e-4);
      angle.push_back(rig.angle);
    }
    return angle;
  };
  const auto wide = run(1.0), narrow = run(1.0f);
  for (std::size_t k = 0; k < wide.size(); ++k)
    ASSERT_NEAR(wide[k], narrow[k],
                1e-5);  // float pressures of 3e5 Pa have steps of 0.03 Pa: 1e-7 rad, and the integrals
}

TEST(RealTime, one_arm_in_float_fits_a_small_microcontroller) {
  EXPECT_LT(sizeof(ArmController<float, 6>), 16u * 1024u);  // of the 192 KB that a common Cortex-M4F has
  EXPECT_LT(sizeof(FaultMachine), 256u);
}

}  // namespace
