// The card of the simulated rig: virtual time, jitter, drops, calibration experiments.
#include "isac/card/sim_card.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "isac/card/calibration.hpp"
#include "isac/card/card.hpp"
#include "isac/card/sim_options.hpp"
#include "isac/core/error.hpp"

namespace isac::card {
namespace {

constexpr std::int64_t kPeriod = 2'000'000;

/// Stamps of n reads, one a period.
std::vector<std::int64_t> stamps(const std::string& name, int n) {
  const Opened rig = open(name);
  std::vector<std::int64_t> times;
  Sample sample;
  for (int k = 1; k <= n; ++k) {
    EXPECT_EQ(rig.card->wait_until(k * kPeriod), Status::kOk);
    EXPECT_EQ(rig.card->read(sample), Status::kOk);
    times.push_back(sample.time_ns - k * kPeriod);
  }
  return times;
}

double physical(const Sample& sample, const char* signal) {
  for (const auto& c : default_calibration()) {
    if (c.signal != signal || c.channel.rfind("ai", 0) != 0) continue;
    return (sample.input[static_cast<std::size_t>(c.channel[2] - '0')] - c.offset) * c.gain;
  }
  ADD_FAILURE() << signal;
  return 0;
}

TEST(SimCard, without_jitter_time_is_exact) {
  for (const auto late : stamps("sim:jitter=off", 500)) ASSERT_EQ(late, 0);
}

TEST(SimCard, jitter_is_late_with_a_short_mean_and_a_rare_long_tail) {
  const auto late = stamps("sim:seed=9", 50000);
  double mean = 0;
  std::int64_t longest = 0;
  int beyond_200_us = 0;
  for (const auto x : late) {
    ASSERT_GE(x, 0);
    mean += static_cast<double>(x) / 50000;
    longest = std::max(longest, x);
    beyond_200_us += x > 200'000;
  }
  // 25 µs + 0.002 · 250 µs + 2 µs of stamp; scatter 35 µs/sqrt(50000) = 0.2 µs.
  EXPECT_NEAR(mean, 27'500, 800);
  EXPECT_GT(longest, 300'000);
  EXPECT_LT(longest, 1'000'000);
  EXPECT_NEAR(beyond_200_us, 0.002 * 50000 * 0.65, 30);  // 60 % of the tail and what the delay adds: 65 ± 8
}

TEST(SimCard, dropped_wake_up_comes_one_period_late) {
  const auto late = stamps("sim:jitter=off,drop=0.1", 5000);
  int dropped = 0;
  for (const auto x : late) {
    // After a drop the next target has passed: it is read at once, a microsecond or two after.
    if (x > kPeriod / 2) ++dropped;
    ASSERT_TRUE(x < 10'000 || x >= kPeriod - 10'000) << x;
  }
  EXPECT_NEAR(dropped, 500 / 1.1, 100);  // a wake-up already late is not drawn again
}

TEST(SimCard, same_seed_gives_the_same_run_and_noise_does_not_move_the_hand) {
  const auto encoders = [](const std::string& name) {
    const Opened rig = open(name);
    rig.person->ask({.kind = Task::Kind::kSweepByHand, .amplitude_rad = 0.4, .speed_rad_s = 3});
    std::vector<std::uint32_t> all;
    Sample sample;
    for (int k = 1; k < 2000; ++k) {
      EXPECT_EQ(rig.card->wait_until(k * kPeriod), Status::kOk);
      EXPECT_EQ(rig.card->read(sample), Status::kOk);
      all.push_back(sample.encoder[0]);
    }
    return all;
  };
  EXPECT_EQ(encoders("sim:seed=4"), encoders("sim:seed=4"));
  EXPECT_EQ(encoders("sim:seed=4"), encoders("sim:seed=4,noise=none"));
  EXPECT_NE(encoders("sim:seed=4"), encoders("sim:seed=5"));
}

TEST(SimCard, codes_become_the_rig_again_through_the_default_calibration) {
  auto rig = std::make_shared<simulate::Rig>(parse_sim("noise=none,jitter=off"));
  const Opened opened = open_sim(rig);
  Command command;
  command.output[0] = command.output[1] = 2457;
  ASSERT_EQ(opened.card->write(command), Status::kOk);
  opened.person->ask({.kind = Task::Kind::kSweepByHand, .amplitude_rad = 0.38, .speed_rad_s = 2});
  Sample sample;
  for (int k = 1500; k < 5000; ++k) {
    ASSERT_EQ(opened.card->wait_until(k * kPeriod), Status::kOk);
    const simulate::PlantState truth = rig->truth();
    ASSERT_EQ(opened.card->read(sample), Status::kOk);
    // Half a converter step, and the amplifier's lag of 0.16 ms on a force that moves with up to 600 N/s.
    ASSERT_NEAR(physical(sample, "F1"), truth.force[0], 0.5 * 200 / 4096 + 0.1);
    ASSERT_NEAR(physical(sample, "F2"), truth.force[1], 0.5 * 200 / 4096 + 0.1);
    ASSERT_NEAR(physical(sample, "p2"), truth.pressure[1], 0.5 * 10 * kPascalPerKgfCm2 / 4096 + 1);
    const auto count = static_cast<std::int32_t>(sample.encoder[0] << 8) / 256;
    ASSERT_LE(std::abs((count + 0.5) * 2 * kPi / 8000 - truth.joint.angle), 1.0001 * kPi / 8000);
  }
}

TEST(SimCard, calibration_experiments_show_what_is_off_in_a_miscalibrated_rig) {
  const auto config = parse_sim("noise=none,jitter=off,seed=8,miscalibrated");
  const simulate::Wiring wiring = simulate::wiring_of(config);
  auto rig = std::make_shared<simulate::Rig>(config);
  const Opened opened = open_sim(rig);
  Sample sample;
  std::int64_t t = 0;
  const auto settled = [&](const Task& task) {
    opened.person->ask(task);
    EXPECT_EQ(opened.card->wait_until(t += 3'000'000'000), Status::kOk);
    EXPECT_TRUE(opened.person->ready());
    EXPECT_EQ(opened.card->read(sample), Status::kOk);
    return sample;
  };
  using Kind = Task::Kind;
  const double zero = settled({.kind = Kind::kRemoveLoad}).input[2];
  const double loaded = settled({.kind = Kind::kHangWeight, .load_newton = 149.1}).input[2];
  EXPECT_NEAR(zero, wiring.force[1].offset, 0.5);
  EXPECT_NEAR(149.1 / (loaded - zero), wiring.force[1].gain,
              wiring.force[1].gain * 1.0 / 3000);  // a step in 3000
  const double none = settled({.kind = Kind::kConnectSupply}).input[4];
  const double five =
      settled({.kind = Kind::kConnectSupply, .pressure_pascal = 5 * kPascalPerKgfCm2}).input[4];
  EXPECT_NEAR(5 * kPascalPerKgfCm2 / (five - none), wiring.pressure[0].gain, wiring.pressure[0].gain / 2000);
  const auto middle = settled({.kind = Kind::kPose, .angle_rad = 0}).encoder[0];
  const auto count = static_cast<std::int32_t>(middle << 8) / 256;
  EXPECT_NEAR(count, wiring.encoder_middle, 2);  // the hand trembles by half a step
}

TEST(SimCard, person_takes_the_joint_up_and_lets_it_go) {
  auto rig = std::make_shared<simulate::Rig>();
  const Opened opened = open_sim(rig);
  Command command;
  command.output[0] = 1638, command.output[1] = 3276;  // Δp = 1 kg/cm²
  ASSERT_EQ(opened.card->write(command), Status::kOk);
  ASSERT_EQ(opened.card->wait_until(3'000'000'000), Status::kOk);
  opened.person->ask({.kind = Task::Kind::kClamp, .angle_rad = -0.1});
  EXPECT_FALSE(opened.person->ready());
  ASSERT_EQ(opened.card->wait_until(6'000'000'000), Status::kOk);
  EXPECT_TRUE(opened.person->ready());
  EXPECT_NEAR(rig->truth().joint.angle, -0.1, 1e-12);
  opened.person->ask({.kind = Task::Kind::kRelease});
  ASSERT_EQ(opened.card->wait_until(9'000'000'000), Status::kOk);
  EXPECT_NEAR(rig->truth().joint.angle, 0.391, 0.002);  // K_J Δp
  // A sweep without a middle goes about this rest angle.
  opened.person->ask({.kind = Task::Kind::kSweepByHand, .amplitude_rad = 0.3, .speed_rad_s = 3});
  double lowest = 9, highest = -9;
  for (int k = 0; k < 2000; ++k) {
    ASSERT_EQ(opened.card->wait_until(12'000'000'000 + k * kPeriod), Status::kOk);
    lowest = std::min(lowest, rig->truth().joint.angle);
    highest = std::max(highest, rig->truth().joint.angle);
  }
  EXPECT_NEAR(0.5 * (lowest + highest), 0.391, 0.02);
}

TEST(SimCard, person_refuses_what_nobody_can_do) {
  const Opened rig = open("sim:");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using Kind = Task::Kind;
  EXPECT_THROW(rig.person->ask({.kind = Kind::kSweepByHand, .amplitude_rad = 0.3, .speed_rad_s = 0}), Error);
  EXPECT_THROW(rig.person->ask({.kind = Kind::kSweepByHand, .amplitude_rad = nan, .speed_rad_s = 1}), Error);
  EXPECT_THROW(rig.person->ask({.kind = Kind::kClamp, .angle_rad = nan}), Error);
  EXPECT_NO_THROW(rig.person->ask({.kind = Kind::kRest}));
}

TEST(SimCard, vent_lets_the_air_out) {
  auto rig = std::make_shared<simulate::Rig>();
  const Opened opened = open_sim(rig);
  Command command;
  command.output[0] = command.output[1] = 4095;
  ASSERT_EQ(opened.card->write(command), Status::kOk);
  ASSERT_EQ(opened.card->wait_until(2'000'000'000), Status::kOk);
  EXPECT_GT(rig->truth().pressure[0], 4.9 * kPascalPerKgfCm2);
  ASSERT_EQ(opened.card->vent(), Status::kOk);
  ASSERT_EQ(opened.card->wait_until(4'000'000'000), Status::kOk);
  EXPECT_LT(rig->truth().pressure[0], 0.001 * kPascalPerKgfCm2);
}

}  // namespace
}  // namespace isac::card
