// What the numbers of a named effect say against its name.
#include "isac/explain/number_doubts.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace isac::explain {
namespace {

const models::EffectInfo& info(const char* id) {
  return models::effect_catalogue()[static_cast<std::size_t>(models::find_effect(id))];
}

/// In the units of the catalogue, in its order.
std::vector<Estimated> numbers(const models::EffectInfo& effect,
                               const std::vector<std::pair<double, double>>& of) {
  std::vector<Estimated> all;
  for (std::size_t i = 0; i < of.size(); ++i) {
    Estimated& e = all.emplace_back();
    e.name = effect.parameters[i].name;
    e.value = of[i].first;
    e.std_error = of[i].second;
  }
  return all;
}

TEST(NumberDoubts, both_ways_alike_is_something_simpler) {
  const models::EffectInfo& loop = info("asymmetric_hysteresis");
  const auto doubts = [&](double down, double error) {
    return doubts_of_numbers(loop,
                             numbers(loop, {{0.20, error}, {down, error}, {0.05, 0.002}, {0.05, 0.002}}));
  };
  ASSERT_EQ(doubts(0.19, 0.01).size(), 1U);
  EXPECT_NE(doubts(0.19, 0.01).front().find("direction"), std::string::npos);
  EXPECT_TRUE(doubts(0.15, 0.01).empty()) << "3.5 standard errors apart";
  EXPECT_TRUE(doubts(0.19, 0.003).empty()) << "2.4 standard errors apart";
  // It is the loop's height or its width that differs.
  EXPECT_TRUE(doubts_of_numbers(loop, numbers(loop, {{0.2, 0.01}, {0.2, 0.01}, {0.05, 0.002}, {0.06, 0.002}}))
                  .empty());
}

TEST(NumberDoubts, amplitudes_that_are_told_only_together) {
  const models::EffectInfo& gains = info("force_gain_error");
  const double one = gains.parameters[0].null_value / gains.parameters[0].si_per_unit;
  const auto doubts = [&](double first, double second) {
    return doubts_of_numbers(gains, numbers(gains, {{one + first, 0.01}, {one + second, 0.01}}));
  };
  EXPECT_EQ(doubts(0.016, -0.016).size(), 1U);
  EXPECT_TRUE(doubts(0.017, -0.003).empty()) << "one of them is told";
  EXPECT_TRUE(doubts(0.0, 0.03).empty());
}

TEST(NumberDoubts, a_warm_up_that_changes_a_constant_torque_only_may_be_a_zero_that_drifts) {
  const models::EffectInfo& drift = info("thermal_drift");
  ASSERT_STREQ(drift.parameters[0].name, "a");
  ASSERT_STREQ(drift.parameters[2].name, "T_0");
  const auto doubts = [&](double stiffness, double gain, double constant) {
    return doubts_of_numbers(drift,
                             numbers(drift, {{stiffness, 20}, {gain, 0.1}, {constant, 0.01}, {1000, 1100}}));
  };
  ASSERT_EQ(doubts(18, -0.1, -0.019).size(), 1U);
  EXPECT_NE(doubts(18, -0.1, -0.019).front().find("zero that drifts"), std::string::npos);
  EXPECT_TRUE(doubts(-350, -0.1, -0.019).empty()) << "the stiffness is told";
  EXPECT_TRUE(doubts(18, 0.3, -0.019).empty()) << "the gain is told";
  ASSERT_EQ(doubts(18, -0.1, -0.009).size(), 1U);
  EXPECT_NE(doubts(18, -0.1, -0.009).front().find("told by itself"), std::string::npos) << "nothing is told";
}

TEST(NumberDoubts, an_amplitude_that_no_run_tells_is_not_told_by_the_other) {
  const models::EffectInfo& gains = info("force_gain_error");
  const double one = gains.parameters[0].null_value / gains.parameters[0].si_per_unit,
               none = std::numeric_limits<double>::quiet_NaN();
  const auto doubts = [&](double first, double error) {
    return doubts_of_numbers(gains, numbers(gains, {{one + first, error}, {one - 0.05, none}}));
  };
  EXPECT_EQ(doubts(0.01, 0.01).size(), 1U);
  EXPECT_TRUE(doubts(0.03, 0.01).empty()) << "the one with an error is told";
}

TEST(NumberDoubts, friction_that_does_not_fall_from_rest_is_something_simpler) {
  const models::EffectInfo& stribeck = info("stribeck_friction");
  const auto doubts = [&](double sliding) {
    return doubts_of_numbers(stribeck, numbers(stribeck, {{sliding, 0.0019}, {0.0109, 0.0003}, {0.6, 0.1}}));
  };
  ASSERT_EQ(doubts(0.0079).size(), 1U);
  EXPECT_NE(doubts(0.0079).front().find("rest"), std::string::npos);
  EXPECT_TRUE(doubts(0.0065).empty()) << "2.3 standard errors apart";
}

TEST(NumberDoubts, an_unbalanced_mass_that_is_level_with_the_axis_is_a_constant_torque) {
  const models::EffectInfo& mass = info("gravity_imbalance");
  const auto doubts = [&](double with_angle, double error) {
    return doubts_of_numbers(mass, numbers(mass, {{with_angle, error}, {-0.00788, 0.00006}}));
  };
  ASSERT_EQ(doubts(-0.0003, 0.0004).size(), 1U);
  EXPECT_NE(doubts(-0.0003, 0.0004).front().find("constant torque"), std::string::npos);
  EXPECT_TRUE(doubts(-0.0008, 0.0004).empty()) << "two standard errors";
  EXPECT_TRUE(doubts(0.0003, 0.0013).empty()) << "not known well enough to be a coincidence";
}

TEST(NumberDoubts, one_amplitude_or_no_error_says_nothing) {
  const models::EffectInfo& friction = info("coulomb_friction");
  EXPECT_TRUE(doubts_of_numbers(friction, numbers(friction, {{0.01, 0.1}})).empty());
  const double none = std::numeric_limits<double>::quiet_NaN();
  const models::EffectInfo& loop = info("asymmetric_hysteresis");
  EXPECT_TRUE(
      doubts_of_numbers(loop, numbers(loop, {{0.2, none}, {0.2, none}, {0.05, none}, {0.05, none}})).empty());
  const models::EffectInfo& gains = info("force_gain_error");
  EXPECT_TRUE(doubts_of_numbers(gains, numbers(gains, {{1.0, none}, {1.0, none}})).empty());
  EXPECT_TRUE(doubts_of_numbers(gains, {}).empty());
}

// One right name in so many is doubted: where directions do differ, by three standard errors of their difference, seldom.
TEST(NumberDoubts, doubt_few_that_differ_and_most_that_do_not) {
  const models::EffectInfo& loop = info("asymmetric_hysteresis");
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  int of_alike = 0, of_different = 0;
  const auto doubted = [&](double apart) {
    return !doubts_of_numbers(loop,
                              numbers(loop, {{0.2 + 0.01 * normal(random), 0.01},
                                             {0.2 - apart * 0.01 * 1.41421356 + 0.01 * normal(random), 0.01},
                                             {0.05 + 0.002 * normal(random), 0.002},
                                             {0.05 + 0.002 * normal(random), 0.002}}))
                .empty();
  };
  constexpr int kSeeds = 2000;
  for (int i = 0; i < kSeeds; ++i) {
    of_alike += doubted(0) ? 1 : 0;
    of_different += doubted(4) ? 1 : 0;
  }
  EXPECT_NEAR(of_alike, 0.9545 * 0.9545 * kSeeds, 3 * 13);  // both within two of their errors
  EXPECT_NEAR(of_different, 0.9545 * 0.02275 * kSeeds, 3 * 7);
}

}  // namespace
}  // namespace isac::explain
