#include "oracle.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace blind {
namespace {

TEST(Oracle, ties_added_inertia_with_the_gain_of_the_encoder_and_with_nothing_of_the_valves) {
  const Verdict v = judge(make_dataset({.seed = 1, .ids = {"inertia_error"}, .ratio = 0.25}));
  EXPECT_LT(v.self, 1.0);  // an oracle that cannot see its own truth is blind
  EXPECT_GT(v.none, 10.0);
  EXPECT_LT(v.rivals.at("encoder_gain"), 3.0);
  for (const char* id : {"dead_time", "leak", "pressure_gain_error"})
    EXPECT_GT(v.rivals.at(id), 0.9 * v.none) << id;
  for (const std::string& id : v.equals) EXPECT_LT(v.rivals.at(id), 3.0);
}

TEST(Oracle, knows_that_added_inertia_and_a_gain_of_the_encoder_are_one_equation) {
  // With φ' = (1 + g) φ: I/(1 + g) φ̈' = A/(1 + g) r² φ' + B r Δp − C/(1 + g)³ φ̇'³ − D/(1 + g) φ̇'. A free joint goes elsewhere with each of
  // the four, so that as a sum of small responses a gain of 11 % was 20 sigma from it. Here g < 0, as if the joint were heavier.
  const Verdict v =
      judge(make_dataset({.seed = 6, .ids = {"encoder_gain"}, .ratio = 0.75, .noise = "coloured"}));
  EXPECT_GT(v.none, 10.0);
  EXPECT_LT(v.rivals.at("inertia_error"), 1.0);
  EXPECT_GT(v.rivals.at("bearing_friction"), 10.0);
}

TEST(Oracle, weighs_by_the_noise_that_the_data_has) {
  for (const char* kind : {"white", "coloured", "quantised"}) {
    const Dataset d = make_dataset({.seed = 17, .noise = kind});
    Random random(3);
    std::vector<Signals> noisy;
    for (const Signals& clean : d.clean) noisy.push_back(add_noise(clean, d.noise, d.rig, random));
    // 1e5 whitened values; the model takes two slow parts as one and a converter's step as white: a tenth of sigma².
    EXPECT_NEAR(whitened_noise(d, noisy), 1.0, 0.1) << kind;
  }
}

TEST(Oracle, tells_friction_from_its_rivals_when_it_is_clear) {
  const Verdict v = judge(make_dataset({.seed = 1, .ids = {"coulomb_friction"}}));
  EXPECT_LT(v.self, 1.0);
  EXPECT_TRUE(v.equals.empty());
  EXPECT_EQ(v.rivals.count("coulomb_friction"), 0u) << "the truth is no rival of itself";
  // Friction that grows with pressure is nearer than anything that is no friction.
  EXPECT_LT(v.rivals.at("pressure_dependent_friction"), v.rivals.at("hysteresis"));
  EXPECT_LT(v.rivals.at("hysteresis"), v.rivals.at("cubic_stiffness"));
}

TEST(Oracle, of_two_effects_says_what_either_leaves_by_itself) {
  // A leak shows in the pressures and friction in the torque: squares of what they leave of each other add up.
  const Verdict v = judge(make_dataset({.seed = 4, .ids = {"leak", "coulomb_friction"}}));
  ASSERT_EQ(v.alone.size(), 2u);
  EXPECT_NEAR(std::hypot(v.alone.at("leak"), v.alone.at("coulomb_friction")), v.none, 0.05 * v.none);
  EXPECT_GT(v.alone.at("leak"), 10.0);
  EXPECT_GT(v.alone.at("coulomb_friction"), 10.0);
  // An added inertia and a gain of the encoder are one equation: by itself either is all, and beside it any rival would do.
  const Verdict one = judge(make_dataset({.seed = 4, .ids = {"inertia_error", "encoder_gain"}}));
  EXPECT_LT(std::min(one.alone.at("inertia_error"), one.alone.at("encoder_gain")), 3.0);
  for (const std::string& id : one.equals) EXPECT_NE(id, "mains_hum");
  // Zeros of both pressure sensors are all that a valve's zero and one of one sensor are.
  const Verdict zeros = judge(make_dataset({.seed = 4, .ids = {"pressure_offset", "pressure_gain_error"}}));
  EXPECT_LT(zeros.alone.at("pressure_offset"), 1e-3);
  EXPECT_GT(zeros.alone.at("pressure_gain_error"), 10.0);
  // A joint's end is met at another angle beside the other name of a gain of the encoder: what stays may move.
  const Verdict stop =
      judge(make_dataset({.seed = 11, .ids = {"encoder_gain", "end_stop"}, .noise = "coloured"}));
  EXPECT_LT(stop.rivals.at("inertia_error"), 3.0);
  EXPECT_GT(stop.rivals.at("bearing_friction"), 10.0);
  // Of one there is nothing to be left.
  EXPECT_TRUE(judge(make_dataset({.seed = 2, .ids = {"torque_offset"}})).alone.empty());
}

TEST(Oracle, counts_more_sigma_the_stronger_the_effect) {
  const auto at = [](double ratio) {
    return judge(make_dataset({.seed = 2, .ids = {"torque_offset"}, .ratio = ratio, .noise = "coloured"}));
  };
  const Verdict faint = at(0.25), clear = at(0.75);
  EXPECT_NEAR(clear.none / faint.none, 3.0, 0.3);  // the ratios hold within 3 % each, the effect is linear
  EXPECT_LT(faint.rivals.at("encoder_offset"), faint.none);
}

}  // namespace
}  // namespace blind
