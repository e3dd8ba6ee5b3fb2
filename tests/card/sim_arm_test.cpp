// The simulated arm behind the card: what its codes mean, and its words.
#include "isac/card/sim_arm.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::card {
namespace {

const std::string kArm = "arm=" + std::string(ISAC_SOURCE_DIR) + "/data/arms/right_soft_arm.toml";

std::string code_of(const std::string& words) {
  try {
    static_cast<void>(parse_sim_arm(words));
  } catch (const Error& error) {
    return error.code();
  }
  return "";
}

TEST(SimArm, codes_are_pressures_and_encoder_steps) {
  const SimArmConfig config = parse_sim_arm(kArm + ",friction=0,zero=2:0.1");
  const auto plant = std::make_shared<simulate::ArmPlant>(config.plant);
  SimArmCard card(plant, config.encoder_zero);
  Command command;
  command.output.fill(2457);  // 3 kg/cm2 of 5
  command.output[5] = 2867;   // muscle 2 of joint 3: half a kg/cm2 more
  ASSERT_EQ(card.write(command), Status::kOk);
  ASSERT_EQ(card.wait_until(20'000'000'000), Status::kOk);
  EXPECT_NEAR(plant->pressure()[0].muscle_1, 3 * kPascalPerKgfCm2,
              1e-6 * kPascalPerKgfCm2 + 5e-4 * kPascalPerKgfCm2);
  Sample sample;
  ASSERT_EQ(card.read(sample), Status::kOk);
  EXPECT_EQ(sample.time_ns, 20'000'000'000);
  for (std::size_t j = 0; j < 6; ++j) {
    auto count = static_cast<std::int64_t>(sample.encoder[j]);
    if (count >= SimArmCard::kEncoderModulus / 2) count -= SimArmCard::kEncoderModulus;
    const double zero = j == 1 ? 0.1 : 0, steps = (plant->angle()[j] + zero) * 8000 / (2 * kPi);
    EXPECT_GE(steps, static_cast<double>(count)) << j;  // rounded down
    EXPECT_LT(steps, static_cast<double>(count) + 1) << j;
  }
  // At rest the muscles carry gravity: joint 3 stands where A r² φ + B r Δp + τ is nothing.
  const simulate::ArmVector gravity = models::multiply_transposed<double, 6>(
      config.plant.coupling,
      models::gravity_torque(config.plant.chain,
                             models::multiply<double, 6>(config.plant.coupling, plant->angle())));
  EXPECT_NEAR(plant->muscle_torque()[2] + gravity[2], 0, 1e-6);
}

TEST(SimArm, a_hose_is_borne_by_the_muscles) {
  const SimArmConfig config = parse_sim_arm(kArm + ",pull=4:0.5,spring=2:3");
  simulate::ArmPlant plant(config.plant);
  const simulate::ArmVector angle = {0.1, 0.3, -0.2, 0.2, 0.1, 0.3};
  plant.rest_at(angle, 3 * kPascalPerKgfCm2);
  ASSERT_EQ(plant.run(2), Status::kOk);
  const simulate::ArmVector gravity = models::multiply_transposed<double, 6>(
      config.plant.coupling,
      models::gravity_torque(config.plant.chain, models::multiply<double, 6>(config.plant.coupling, angle)));
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_NEAR(plant.angle()[j], angle[j], 1e-9) << j;
    const double hose = j == 3 ? 0.5 : j == 1 ? -3 * angle[1] : 0;
    EXPECT_NEAR(plant.muscle_torque()[j] + gravity[j] + hose, 0, 1e-6) << j;
  }
}

TEST(SimArm, energy_is_kept_with_a_hose_that_springs) {
  SimArmConfig config = parse_sim_arm(kArm + ",friction=0,pull=2:1,spring=2:5");
  for (simulate::ArmJointConfig& joint : config.plant.joints) joint.muscle.C = joint.muscle.D = 0;
  config.plant.step = 1e-4;
  simulate::ArmPlant plant(config.plant);
  plant.rest_at({0, 0.2, 0.1, 0, 0.2, 0}, 3 * kPascalPerKgfCm2);
  plant.set_velocity({0.5, -1, 0.4, 0.3, -0.2, 0.1});
  const simulate::ArmEnergy before = plant.energy();
  ASSERT_EQ(plant.run(1), Status::kOk);
  EXPECT_NEAR(plant.energy().sum(), before.sum(),
              1e-8 * before.kinetic);  // Runge-Kutta's own, as of the arm without a hose
}

TEST(SimArm, wrong_words_are_named) {
  EXPECT_EQ(code_of(kArm + ",pull=7:1"), "sim_option_value");
  EXPECT_EQ(code_of(kArm + ",pull=2"), "sim_option_value");
  EXPECT_EQ(code_of(kArm + ",load=-1"), "sim_option_value");
  EXPECT_EQ(code_of(kArm + ",friction=nan"), "sim_option_value");
  EXPECT_EQ(code_of(kArm + ",seed=x"), "sim_option_value");
  EXPECT_EQ(code_of(kArm + ",colour=red"), "sim_option_unknown");
  EXPECT_EQ(code_of("arm=/nowhere.toml"), "file_unreadable");
  EXPECT_TRUE(names_an_arm("seed=1,arm=x"));
  EXPECT_FALSE(names_an_arm("params=alarm=1"));
}

}  // namespace
}  // namespace isac::card
