#include "isac/record/rig.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::record {
namespace {

const std::filesystem::path kFixtures = std::filesystem::path(ISAC_SOURCE_DIR) / "fixtures/rig";

// One multiplication by the unit's scale, itself rounded once: two roundings.
constexpr double kTwoRoundings = 4e-16;
#define EXPECT_CLOSE(value, expected) EXPECT_NEAR(value, expected, kTwoRoundings* std::abs(expected))

TEST(Rig, reads_every_section_in_si) {
  const Rig rig = read_rig(kFixtures / "testbed.toml");
  EXPECT_EQ(rig.name, "testbed");
  EXPECT_CLOSE(rig.joint.wheel_radius, 0.019);
  EXPECT_CLOSE(rig.joint.initial_pressure, 3.0 * 98066.5);
  EXPECT_CLOSE(rig.joint.inertia, 0.0085);
  EXPECT_EQ(rig.encoder.steps_per_turn, 8000);
  EXPECT_EQ(rig.encoder.middle_count, 1234);
  EXPECT_CLOSE(rig.sensors.force_noise, 0.3);
  EXPECT_CLOSE(rig.sensors.pressure_noise, 0.004 * 98066.5);
  EXPECT_CLOSE(rig.sensors.angle_noise, 0.02 * kPi / 180);
  EXPECT_CLOSE(rig.sensors.torque_noise, 0.01);
  EXPECT_CLOSE(rig.limits.delta_pressure, 2.0 * 98066.5);
  EXPECT_CLOSE(rig.limits.pressure, 5.0 * 98066.5);
  EXPECT_CLOSE(rig.limits.angle, 0.375 * kPi);
  EXPECT_CLOSE(rig.limits.speed, 2 * kPi);
  EXPECT_CLOSE(rig.limits.force, 200.0);
  EXPECT_EQ(rig.card.device, "sim:");
  EXPECT_CLOSE(rig.card.sample_rate, 500.0);
  ASSERT_EQ(rig.calibration.size(), 3u);
  EXPECT_EQ(rig.calibration[0].signal, "F1");
  EXPECT_EQ(rig.calibration[0].channel, "ai0");
  EXPECT_EQ(rig.calibration[0].offset, 41);
  EXPECT_CLOSE(rig.calibration[0].gain, 0.0488);
  EXPECT_CLOSE(rig.calibration[1].gain, 0.00122 * 98066.5);
  EXPECT_EQ(rig.calibration[2].offset, 0);
  EXPECT_CLOSE(rig.calibration[2].gain, 119.7);
}

TEST(Rig, needs_only_the_joint_and_knows_the_seeds_limits) {
  const Rig rig = read_rig(kFixtures / "smallest.toml");
  EXPECT_TRUE(std::isnan(rig.joint.wheel_radius));
  EXPECT_TRUE(std::isnan(rig.sensors.force_noise));
  EXPECT_EQ(rig.encoder.steps_per_turn, 8000);
  EXPECT_NEAR(rig.limits.angle, 3.0 / 8.0 * kPi, 1e-15);  // seed 3.5
  EXPECT_TRUE(rig.calibration.empty());
}

TEST(Rig, reads_the_lag_of_the_force_amplifiers_as_a_time) {
  const std::string head = "format = \"isac.rig/1\"\n[joint]\n[sensors]\nforce_lag = ";
  EXPECT_CLOSE(parse_rig(head + "\"0.16 ms\"\n", "x").sensors.force_lag, 0.16e-3);
  EXPECT_THROW((void)parse_rig(head + "\"0.16 N\"\n", "x"), Error);
  EXPECT_THROW((void)parse_rig(head + "\"-1 ms\"\n", "x"), Error);
}

TEST(Rig, the_same_length_in_any_unit_is_the_same_radius) {
  for (const char* diameter : {"38 mm", "3.8 cm", "0.038 m", " 38  mm ", "+38 mm", "3.8e-2 m", "38mm"}) {
    const Rig rig = parse_rig(
        "format = \"isac.rig/1\"\n[joint]\nchain_wheel_diameter = \"" + std::string(diameter) + "\"\n", "x");
    EXPECT_CLOSE(rig.joint.wheel_radius, 0.019) << diameter;
  }
}

bool same(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b) ||
         (std::isnan(a) && std::isnan(b));
}

TEST(Rig, what_is_written_reads_back_to_the_same_bits) {
  std::mt19937_64 random(20260101);
  const auto positive = [&random] {  // over nine decades, all digits of the mantissa in use
    return std::exp(std::uniform_real_distribution<double>(-10, 10)(random));
  };
  for (int i = 0; i < 300; ++i) {
    Rig rig;
    rig.name = i % 3 == 0 ? "" : "rig \"" + std::to_string(i) + "\" \\ µ\n";
    if (i % 2 == 0) rig.joint = {positive(), positive(), positive()};
    rig.encoder = {positive(), static_cast<int>(random() % 100000) - 50000};
    if (i % 5 != 0) rig.sensors = {positive(), positive(), positive(), positive(), positive()};
    rig.limits = {positive(), positive(), positive(), positive(), positive()};
    rig.card = {i % 4 == 0 ? "" : "sim:seed=3", i % 4 == 0 ? kNotGiven : positive()};
    if (i % 7 == 0) {
      rig.calibration = {{"F1", "ai0", positive(), positive()},
                         {"p2", "ai6", -positive(), -positive()},
                         {"angle", "enc0", 0, positive()},
                         {"lamp", "ao11", 1, positive()}};
    }
    const Rig back = parse_rig(format_rig(rig), "written.toml");
    ASSERT_EQ(back.name, rig.name);
    ASSERT_TRUE(same(back.joint.wheel_radius, rig.joint.wheel_radius));
    ASSERT_TRUE(same(back.joint.initial_pressure, rig.joint.initial_pressure));
    ASSERT_TRUE(same(back.joint.inertia, rig.joint.inertia));
    ASSERT_TRUE(same(back.encoder.steps_per_turn, rig.encoder.steps_per_turn));
    ASSERT_EQ(back.encoder.middle_count, rig.encoder.middle_count);
    ASSERT_TRUE(same(back.sensors.force_noise, rig.sensors.force_noise));
    ASSERT_TRUE(same(back.sensors.pressure_noise, rig.sensors.pressure_noise));
    ASSERT_TRUE(same(back.sensors.angle_noise, rig.sensors.angle_noise));
    ASSERT_TRUE(same(back.sensors.torque_noise, rig.sensors.torque_noise));
    ASSERT_TRUE(same(back.sensors.force_lag, rig.sensors.force_lag));
    ASSERT_TRUE(same(back.limits.delta_pressure, rig.limits.delta_pressure));
    ASSERT_TRUE(same(back.limits.pressure, rig.limits.pressure));
    ASSERT_TRUE(same(back.limits.angle, rig.limits.angle));
    ASSERT_TRUE(same(back.limits.speed, rig.limits.speed));
    ASSERT_TRUE(same(back.limits.force, rig.limits.force));
    ASSERT_EQ(back.card.device, rig.card.device);
    ASSERT_TRUE(same(back.card.sample_rate, rig.card.sample_rate));
    ASSERT_EQ(back.calibration.size(), rig.calibration.size());
    for (std::size_t c = 0; c < rig.calibration.size(); ++c) {
      ASSERT_EQ(back.calibration[c].signal, rig.calibration[c].signal);
      ASSERT_EQ(back.calibration[c].channel, rig.calibration[c].channel);
      ASSERT_TRUE(same(back.calibration[c].offset, rig.calibration[c].offset));
      ASSERT_TRUE(same(back.calibration[c].gain, rig.calibration[c].gain));
    }
  }
}

}  // namespace
}  // namespace isac::record
