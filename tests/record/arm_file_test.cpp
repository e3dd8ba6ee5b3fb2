// arm.toml: the shipped arms are the seed's, the documented example is read, and what is wrong is answered with its place and the mend.
#include "isac/record/arm_file.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>

#include "isac/core/error.hpp"

namespace isac::record {
namespace {

const std::string kData = std::string(ISAC_SOURCE_DIR) + "/data/arms/";

std::string documented_example() {
  std::ifstream file(std::string(ISAC_SOURCE_DIR) + "/docs/formats.md");
  std::string out;
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line == "```toml title=\"arm.toml\"") {
      inside = true;
    } else if (line == "```") {
      inside = false;
    } else if (inside) {
      out += line + "\n";
    }
  }
  return out;
}

TEST(ArmFile, the_shipped_arms_are_the_seeds) {
  for (const bool left : {false, true}) {
    const ArmFile arm = read_arm(kData + (left ? "left_soft_arm.toml" : "right_soft_arm.toml"));
    const models::SoftArmGeometry<double> right;
    const auto chain = models::soft_arm_chain(left ? models::left_soft_arm(right) : right);
    ASSERT_EQ(arm.joints, 6);
    for (int k = 0; k < 20; ++k) {
      models::JointVector<double, 6> theta{};
      for (std::size_t j = 0; j < 6; ++j) theta[j] = std::sin(1.7 * k + 2.3 * static_cast<double>(j));
      const auto ours = models::tool_position(arm.chain, theta), seeds = models::tool_position(chain, theta);
      EXPECT_NEAR(ours.x, seeds.x, 1e-12);
      EXPECT_NEAR(ours.y, seeds.y, 1e-12);
      EXPECT_NEAR(ours.z, seeds.z, 1e-12);
      const auto torque = models::gravity_torque(arm.chain, theta),
                 expected = models::gravity_torque(chain, theta);
      for (std::size_t j = 0; j < 6; ++j) EXPECT_NEAR(torque[j], expected[j], 1e-12);
    }
    EXPECT_EQ(arm.coupling, (models::soft_arm_coupling<double>()));
    EXPECT_EQ(arm.mass_names, (std::vector<std::string>{"m1", "m2", "m3"}));
    ASSERT_EQ(arm.actuators.size(), 6u);
    EXPECT_DOUBLE_EQ(arm.actuators[1].A, -108000);
    EXPECT_DOUBLE_EQ(arm.actuators[1].B, 970 / 98066.5);
    EXPECT_DOUBLE_EQ(arm.actuators[1].wheel_radius, 0.0125);
    EXPECT_TRUE(std::isnan(arm.actuators[1].A_error)) << "the seed gives no errors";
  }
}

TEST(ArmFile, the_documented_example_is_read) {
  const ArmFile arm = parse_arm(documented_example(), "formats.md");
  EXPECT_EQ(arm.joints, 2);
  EXPECT_EQ(arm.name, "a wrist");
  EXPECT_DOUBLE_EQ(arm.chain.links[0].d, 0.05);
  EXPECT_DOUBLE_EQ(arm.chain.masses[0].mass, 0.14);
  EXPECT_DOUBLE_EQ(arm.chain.masses[0].position.x, -0.16);
  EXPECT_DOUBLE_EQ(arm.coupling[1][1], -0.5);
  EXPECT_DOUBLE_EQ(arm.coupling[4][4], 1) << "joints that are not there are left alone";
  EXPECT_DOUBLE_EQ(arm.actuators[0].B_error, 1.1 / 98066.5);
  EXPECT_DOUBLE_EQ(arm.chain.gravity.z, -9.81);
}

TEST(ArmFile, an_arm_of_fewer_joints_ends_where_its_last_joint_does) {
  const ArmFile arm = parse_arm(
      "format = \"isac.arm/1\"\n[[joint]]\nalpha = \"90 deg\"\n[[mass]]\nname = \"m\"\nlink = 1\n"
      "position = [\"0.5 m\", \"0 m\", \"0 m\"]\nvalue = \"2 kg\"\n",
      "pendulum.toml");
  // A pendulum about a horizontal axis: τ = −m g l cos θ for θ from the horizontal.
  for (const double theta : {0.0, 0.4, -1.2, 3.0}) {
    const auto torque = models::gravity_torque(arm.chain, {theta, 0, 0, 0, 0, 0});
    EXPECT_NEAR(torque[0], -2 * 9.81 * 0.5 * std::cos(theta), 1e-12);
    for (std::size_t j = 1; j < 6; ++j) EXPECT_EQ(torque[j], 0);
  }
}

struct Bad {
  const char *what, *from, *to, *code, *says;
};

TEST(ArmFile, what_is_wrong_is_answered_with_place_and_mend) {
  const std::string good = documented_example();
  const Bad cases[] = {
      {"a bare number", "d = \"50 mm\"", "d = 50", "unit_missing", "bare number"},
      {"a wrong dimension", "d = \"50 mm\"", "d = \"50 deg\"", "dimension_wrong", "length"},
      {"an unknown key", "theta_offset", "theta_ofset", "unknown_key", "theta_offset"},
      {"another format", "isac.arm/1", "isac.rig/1", "format_wrong", "isac.arm/1"},
      {"a link that is not there", "link = 2  ", "link = 3  ", "value_out_of_range", "1 to 2"},
      {"a position of two lengths", "position = [\"-160 mm\", \"0 mm\", \"0 mm\"] #",
       "position = [\"-160 mm\", \"0 mm\"] #", "length_wrong", "three lengths"},
      {"a position in kilograms", "position = [\"-160 mm\", \"0 mm\", \"0 mm\"] #",
       "position = [\"-160 mm\", \"0 kg\", \"0 mm\"] #", "dimension_wrong", "not a length"},
      {"a singular coupling", "[0.5, -0.5]]", "[0.5, 0.5]]", "value_out_of_range", "inverted"},
      {"a coupling row too short", "[0.5, -0.5]]", "[0.5]]", "length_wrong", "2 plain numbers"},
      {"muscles that push away", "A = \"-37600 N/m\"", "A = \"37600 N/m\"", "value_out_of_range",
       "below zero"},
      {"limits the wrong way round", "upper = \"90 deg\"\nA", "upper = \"-120 deg\"\nA", "value_out_of_range",
       "lower"},
      {"gravity without direction", "direction = [0, 0, -1]", "direction = [0, 0, 0]", "value_out_of_range",
       "fall"},
      {"a mass without a name", "name = \"m1\"", "name = \"\"", "value_missing", "name = \"m1\""},
      {"a negative mass", "value = \"140 g\"", "value = \"-140 g\"", "value_out_of_range",
       "greater than zero"},
  };
  for (const Bad& bad : cases) {
    SCOPED_TRACE(bad.what);
    std::string text = good;
    const std::size_t at = text.find(bad.from);
    ASSERT_NE(at, std::string::npos);
    text.replace(at, std::string(bad.from).size(), bad.to);
    try {
      (void)parse_arm(text, "arm.toml");
      ADD_FAILURE() << "was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kBadInput);
      EXPECT_EQ(error.code(), bad.code) << error.text();
      EXPECT_EQ(error.place().file, "arm.toml");
      EXPECT_GT(error.place().line, 0);
      EXPECT_GT(error.place().column, 0);
      EXPECT_NE(error.text().find(bad.says), std::string::npos) << error.text();
    }
  }
}

TEST(ArmFile, lists_of_unequal_length_and_too_many_joints_are_refused) {
  std::string six_and_one = "format = \"isac.arm/1\"\n";
  for (int i = 0; i < 7; ++i) six_and_one += "[[joint]]\nd = \"1 m\"\n";
  EXPECT_THROW((void)parse_arm(six_and_one, "arm.toml"), Error);
  std::string one_actuator = documented_example();
  one_actuator.resize(one_actuator.rfind("[[actuator]]"));
  EXPECT_THROW((void)parse_arm(one_actuator, "arm.toml"), Error);
  EXPECT_THROW((void)parse_arm("format = \"isac.arm/1\"\n", "arm.toml"), Error);
}

}  // namespace
}  // namespace isac::record
