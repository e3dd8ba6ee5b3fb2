// The watches over limits, following error, encoder and analogue inputs.
#include "isac/control/watches.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace {

using namespace isac::control;

constexpr double kDt = 5e-4;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

JointWatchSettings<double> limits() {
  return {.pressure = {4.5e5, 5e5},
          .delta_pressure = {1.9e5, 2e5},
          .angle = {1.1, 1.2},
          .speed = {6, 7},
          .force = {180, 200},
          .torque = {4, 5},
          .following = 0.2};
}

/// The finding after `ticks` of the same sample.
Finding after(const WatchedJoint<double>& now, int ticks, std::uint8_t& warnings) {
  JointWatch<double> watch(limits(), 4);
  Finding found;
  for (int k = 0; k < ticks && !found.found(); ++k) found = watch.check(now, kDt, warnings);
  return found;
}

TEST(JointWatch, names_each_limit_that_stays_broken_and_lets_one_sample_pass) {
  struct Case {
    FaultCode code;
    WatchedJoint<double> soft, hard;
  };
  const Case cases[] = {
      {FaultCode::kPressureLimit,
       {.pressure_1 = 4.7e5, .pressure_2 = 4.7e5},
       {.pressure_1 = 5.1e5, .pressure_2 = 4e5}},
      {FaultCode::kDeltaPressureLimit, {.pressure_2 = 3.9e5}, {.pressure_2 = 4.2e5}},
      {FaultCode::kAngleLimit, {.angle = -1.15}, {.angle = -1.25}},
      {FaultCode::kSpeedLimit, {.speed = 6.5}, {.speed = -7.5}},
      {FaultCode::kForceLimit, {.force_2 = 190}, {.force_1 = -210}},
      {FaultCode::kTorqueLimit, {.torque = -4.5}, {.torque = 5.5}},
  };
  for (const Case& c : cases) {
    std::uint8_t warnings = 0;
    EXPECT_FALSE(after(c.soft, 1000, warnings).found()) << describe(c.code);
    EXPECT_NE(warnings & kNearLimit, 0) << describe(c.code);
    EXPECT_FALSE(after(c.hard, 10, warnings).found()) << describe(c.code);  // 5 ms of 10
    const Finding found = after(c.hard, 25, warnings);
    EXPECT_EQ(found.code, c.code);
    EXPECT_EQ(found.joint, 4);
    EXPECT_GT(std::abs(found.value), found.limit);
  }
  std::uint8_t warnings = 0;
  EXPECT_FALSE(after({.pressure_1 = 3e5, .pressure_2 = 3e5, .angle = 0.5}, 1000, warnings).found());
  EXPECT_EQ(warnings, 0);
}

TEST(JointWatch, a_pause_starts_the_time_anew) {
  JointWatch<double> watch(limits(), 0);
  std::uint8_t warnings = 0;
  for (int k = 0; k < 1000; ++k)
    ASSERT_FALSE(watch.check({.speed = k % 15 == 14 ? 0.0 : 8.0}, kDt, warnings).found());
}

TEST(JointWatch, following_error_counts_only_while_a_position_is_followed) {
  for (const bool follows : {true, false}) {
    JointWatch<double> watch(limits(), 1);
    std::uint8_t warnings = 0;
    Finding found;
    int ticks = 0;
    while (!found.found() && ticks < 1000) {
      found = watch.check({.angle = 0.1, .desired_angle = 0.4, .follows = follows}, kDt, warnings);
      ++ticks;
    }
    EXPECT_EQ(found.code, follows ? FaultCode::kFollowingError : FaultCode::kNone);
    if (follows) {
      EXPECT_NEAR(ticks * kDt, 0.1, 3 * kDt);
      EXPECT_EQ(found.joint, 1);
      EXPECT_NEAR(found.value, 0.3, 1e-6);
    }
  }
}

TEST(JointWatch, a_value_that_is_no_number_is_a_fault_at_once) {
  std::uint8_t warnings = 0;
  for (double WatchedJoint<double>::*member :
       {&WatchedJoint<double>::pressure_1, &WatchedJoint<double>::pressure_2, &WatchedJoint<double>::angle,
        &WatchedJoint<double>::speed, &WatchedJoint<double>::force_1, &WatchedJoint<double>::force_2,
        &WatchedJoint<double>::torque}) {
    WatchedJoint<double> now;
    now.*member = kNan;
    EXPECT_EQ(after(now, 1, warnings).code, FaultCode::kSensorNotFinite);
  }
  EXPECT_EQ(after({.desired_angle = kNan}, 1, warnings).code, FaultCode::kCommandNotFinite);
}

EncoderWatchSettings<double> encoder() {
  return {.modulus = 1u << 16,
          .counts_per_radian = 8000 / (2 * 3.14159265358979),
          .largest_speed = 7,
          .margin = 2,
          .frozen_time = 0.2,
          .frozen_pressure = 2e4};
}

TEST(EncoderWatch, unwraps_over_many_turns_of_the_counter_both_ways) {
  EncoderWatch<double> watch(encoder(), 0);
  std::uint8_t warnings = 0;
  const std::int64_t modulus = 1 << 16;
  std::int64_t truth = 60000;
  ASSERT_FALSE(watch.check(static_cast<std::uint32_t>(truth), 0, kDt, warnings).found());
  for (int k = 0; k < 100000; ++k) {
    truth += k < 40000 ? 9 : -9;  // the largest speed is 8.9 counts a tick with its margin, and one
    const auto count = static_cast<std::uint32_t>(((truth % modulus) + modulus) % modulus);
    ASSERT_FALSE(watch.check(count, 0, kDt, warnings).found());
    ASSERT_EQ(watch.position(), truth - 60000);
  }
}

TEST(EncoderWatch, a_jump_is_a_fault_until_the_count_is_trusted_again) {
  EncoderWatch<double> watch(encoder(), 3);
  std::uint8_t warnings = 0;
  ASSERT_FALSE(watch.check(100, 0, kDt, warnings).found());
  ASSERT_FALSE(watch.check(109, 0, kDt, warnings).found());
  const Finding found = watch.check(200, 0, kDt, warnings);
  EXPECT_EQ(found.code, FaultCode::kEncoderJump);
  EXPECT_EQ(found.joint, 3);
  EXPECT_EQ(found.value, 91);
  EXPECT_EQ(watch.position(), 9);
  EXPECT_TRUE(watch.check(200, 0, kDt, warnings).found());
  watch.restart();
  EXPECT_FALSE(watch.check(200, 0, kDt, warnings).found());
  EXPECT_EQ(watch.position(), 0);
}

TEST(EncoderWatch, a_longer_interval_allows_a_longer_way) {
  EncoderWatch<double> watch(encoder(), 0);
  std::uint8_t warnings = 0;
  ASSERT_FALSE(watch.check(100, 0, kDt, warnings).found());
  EXPECT_TRUE(watch.check(160, 0, kDt, warnings).found());
  EXPECT_FALSE(watch.check(160, 0, 10 * kDt, warnings).found());
}

TEST(EncoderWatch, a_count_beyond_the_counter_is_nobody_answering) {
  EncoderWatch<double> watch(encoder(), 0);
  std::uint8_t warnings = 0;
  EXPECT_EQ(watch.check(1u << 16, 0, kDt, warnings).code, FaultCode::kInputCode);
}

TEST(EncoderWatch, warns_when_the_pressure_moves_and_the_encoder_does_not) {
  const auto warned = [](double swing, bool moves) {
    EncoderWatch<double> watch(encoder(), 0);
    std::uint8_t warnings = 0;
    for (int k = 0; k < 2000; ++k)
      EXPECT_FALSE(
          watch.check(100u + (moves ? (k / 100) % 2 : 0), swing * std::sin(0.01 * k), kDt, warnings).found());
    return (warnings & kEncoderFrozen) != 0;
  };
  EXPECT_TRUE(warned(5e4, false));
  EXPECT_FALSE(warned(5e4, true));   // one count to and fro is alive
  EXPECT_FALSE(warned(5e3, false));  // nothing to follow
}

TEST(InputWatch, tells_an_empty_slot_a_dead_card_and_a_stuck_channel_apart) {
  InputWatch watch(4095, 5);
  EXPECT_FALSE(watch.check(2000, true, 1).found());
  const Finding empty = watch.check(65535, true, 1);
  EXPECT_EQ(empty.code, FaultCode::kInputCode);
  EXPECT_EQ(empty.joint, 1);
  EXPECT_EQ(watch.check(2000, false, 1).code, FaultCode::kReadFailed);
  for (const std::uint32_t end : {0u, 4095u}) {
    EXPECT_FALSE(watch.check(2000, true, 1).found());
    for (int k = 0; k < 4; ++k) EXPECT_FALSE(watch.check(end, true, 1).found());
    for (int k = 0; k < 3; ++k) EXPECT_EQ(watch.check(end, true, 1).code, FaultCode::kInputAtEnd);
  }
  EXPECT_FALSE(watch.check(1, true, 1).found());
}

TEST(InputWatch, zero_may_be_a_reading) {
  InputWatch watch(4095, 5, false);
  for (int k = 0; k < 100; ++k) EXPECT_FALSE(watch.check(0, true, 0).found());
}

}  // namespace
