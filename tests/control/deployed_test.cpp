// The deployment table reaches the controller untranslated, or not at all.
#include "isac/control/deployed.hpp"

#include <gtest/gtest.h>

#include "isac/control/joint_controller.hpp"

namespace {

using namespace isac::control;
using namespace isac::models;
using isac::Status;
using enum isac::models::JointField;

ParameterTable table() {
  ParameterTable t;
  t.joint_count = 2;
  for (JointParameters& joint : t.joints) {
    double value = 1;
    for (const JointField field : {kB, kC, kD, kWheelRadius, kInertia, kValveGain, kValveLag, kValveDeadTime,
                                   kPositionP, kPositionI, kTorqueP, kTorqueI})
      joint.set(field, 0.001 * ++value);
    joint.set(kA, -23450);
    joint.set(kInitialPressure, 3e5);
  }
  for (std::size_t i = 2; i < t.joints.size(); ++i) t.joints[i] = JointParameters{};
  return t;
}

TEST(Deployed, settings_are_the_tables_values_bit_for_bit) {
  const ParameterTable t = table();
  const JointParameters& p = t.joints[1];
  JointSettings<double> s;
  ASSERT_EQ(settings_of(t, 1, s), Status::kOk);
  EXPECT_EQ(s.muscle.A, p[kA]);
  EXPECT_EQ(s.muscle.B, p[kB]);
  EXPECT_EQ(s.muscle.C, p[kC]);
  EXPECT_EQ(s.muscle.D, p[kD]);
  EXPECT_EQ(s.wheel_radius, p[kWheelRadius]);
  EXPECT_EQ(s.mean_pressure, p[kInitialPressure]);
  EXPECT_EQ(s.inertia, p[kInertia]);
  EXPECT_EQ(s.valve.gain, p[kValveGain]);
  EXPECT_EQ(s.valve.lag, p[kValveLag]);
  EXPECT_EQ(s.valve.dead_time, p[kValveDeadTime]);
  EXPECT_EQ(s.position.proportional, p[kPositionP]);
  EXPECT_EQ(s.position.integral, p[kPositionI]);
  EXPECT_EQ(s.torque.proportional, p[kTorqueP]);
  EXPECT_EQ(s.torque.integral, p[kTorqueI]);
  JointSettings<float> single;
  ASSERT_EQ(settings_of(t, 1, single), Status::kOk);
  EXPECT_EQ(single.muscle.B, static_cast<float>(p[kB]));
  JointController<float> controller;
  EXPECT_EQ(controller.configure(single), Status::kOk);
}

TEST(Deployed, the_box_of_validity_becomes_the_limits_and_only_narrows_delta_pressure) {
  ParameterTable t = table();
  t.joints[0].set(kDeltaPressureLow, -1.2e5);
  t.joints[0].set(kDeltaPressureHigh, 1.5e5);
  t.joints[0].set(kAngleLow, -0.5);
  t.joints[0].set(kAngleHigh, 0.6);
  t.joints[0].set(kSpeedHigh, 3.0);
  JointSettings<double> s;
  ASSERT_EQ(settings_of(t, 0, s), Status::kOk);
  EXPECT_EQ(s.limits.delta_pressure, 1.2e5);
  EXPECT_EQ(s.limits.angle_low, -0.5);
  EXPECT_EQ(s.limits.angle_high, 0.6);
  EXPECT_EQ(s.limits.speed, 3.0);
  t.joints[0].set(kDeltaPressureLow, -9e5);
  t.joints[0].set(kDeltaPressureHigh, 9e5);
  ASSERT_EQ(settings_of(t, 0, s), Status::kOk);
  EXPECT_EQ(s.limits.delta_pressure, JointLimits<double>{}.delta_pressure);
}

TEST(Deployed, filling_and_venting_give_their_mean_where_nothing_else_is_known) {
  ParameterTable t = table();
  JointParameters two = t.joints[0];
  t.joints[0] = JointParameters{};
  for (int i = 0; i < kJointFields; ++i) {
    const auto field = static_cast<JointField>(i);
    if (two.has(field) && field != kValveLag) t.joints[0].set(field, two[field]);
  }
  t.joints[0].set(kValveLagFill, 0.10);
  t.joints[0].set(kValveLagVent, 0.20);
  JointSettings<double> s;
  ASSERT_EQ(settings_of(t, 0, s), Status::kOk);
  EXPECT_NEAR(s.valve.lag, 0.15, 1e-15);
}

TEST(Deployed, a_joint_that_misses_what_it_needs_is_refused_and_nothing_is_changed) {
  for (const JointField needed :
       {kA, kB, kC, kD, kWheelRadius, kInitialPressure, kPositionP, kPositionI, kTorqueP, kTorqueI}) {
    ParameterTable t = table();
    JointParameters whole = t.joints[0], less;
    for (int i = 0; i < kJointFields; ++i) {
      const auto field = static_cast<JointField>(i);
      if (whole.has(field) && field != needed) less.set(field, whole[field]);
    }
    t.joints[0] = less;
    JointSettings<double> s;
    s.wheel_radius = 42;
    EXPECT_EQ(settings_of(t, 0, s), Status::kOutOfRange);
    EXPECT_EQ(s.wheel_radius, 42);
  }
  JointSettings<double> s;
  EXPECT_EQ(settings_of(table(), 2, s), Status::kOutOfRange);
  EXPECT_EQ(settings_of(table(), -1, s), Status::kOutOfRange);
}

TEST(Deployed, effects_go_to_their_joint_and_the_ones_that_cannot_are_counted) {
  ParameterTable t = table();
  t.effect_count = 3;
  t.effects[0] = {effect_id_hash("coulomb_friction"), 0, 1, {0.2}};
  t.effects[1] = {effect_id_hash("gravity_imbalance"), kAllJoints, 2, {0.3, 0.1}};
  t.effects[2] = {effect_id_hash("dead_time"), kAllJoints, 1, {0.005}};
  for (const int joint : {0, 1}) {
    FeedForward<double> ff;
    int left_out = -1;
    ASSERT_EQ(feed_forward_of(t, joint, ff, left_out), Status::kOk);
    EXPECT_EQ(ff.size(), joint == 0 ? 2 : 1);
    EXPECT_EQ(left_out, 1);
  }
  t.effects[2].id_hash = 12345;  // an effect this catalogue does not have: not the model that was identified
  FeedForward<double> ff;
  int left_out = -1;
  EXPECT_EQ(feed_forward_of(t, 0, ff, left_out), Status::kOutOfRange);
  EXPECT_EQ(ff.size(), 0);
  EXPECT_EQ(left_out, -1);
}

}  // namespace
