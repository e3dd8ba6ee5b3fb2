#include "isac/explain/two_zeros.hpp"

#include <gtest/gtest.h>

namespace isac::explain {
namespace {

Explanation zeros_of_both(double first, double second) {
  Explanation e;
  e.verdict = Verdict::kNamed;
  Candidate sensors;
  sensors.id = "pressure_offset";
  sensors.confidence = 0.99;
  sensors.parameters.resize(2);
  sensors.parameters[0].value = first;
  sensors.parameters[1].value = second;
  for (Estimated& p : sensors.parameters) p.unit = "kg/cm2";
  e.effects = {sensors};
  return e;
}

TEST(TwoZeros, are_a_valves_zero_and_one_of_a_sensor) {
  Explanation e = zeros_of_both(0.0084, 0.0119);
  Candidate valve;
  valve.id = "pressure_gain_error";
  valve.parameters.resize(2);
  e.rejected = {valve};
  const std::string sentence = tell_a_valves_zero({}, e);
  EXPECT_NE(sentence.find("0.00840 kg/cm2, with one of sensor 2, 0.00350 kg/cm2"), std::string::npos)
      << sentence;
  EXPECT_EQ(e.verdict, Verdict::kNotSeparable);
  ASSERT_EQ(e.alternatives.size(), 1u);
  EXPECT_EQ(e.alternatives.front().id, "pressure_gain_error");
  EXPECT_DOUBLE_EQ(e.alternatives.front().parameters[1].value, 0.0084);
  EXPECT_DOUBLE_EQ(e.alternatives.front().confidence + e.effects.front().confidence, 0.99);
  EXPECT_TRUE(e.rejected.empty());
}

TEST(TwoZeros, of_which_the_first_is_larger_leave_the_rest_to_the_first_sensor) {
  Explanation e = zeros_of_both(-0.02, -0.01);  // and nothing was ruled out: the catalogue's own entry
  EXPECT_NE(tell_a_valves_zero({}, e).find("-0.0100 kg/cm2, with one of sensor 1, -0.0100"),
            std::string::npos);
  ASSERT_EQ(e.alternatives.size(), 1u);
  EXPECT_EQ(e.alternatives.front().subsystem, "pcu");
}

TEST(TwoZeros, are_none_where_one_is_small_or_they_have_other_signs) {
  for (const double second : {0.001, -0.0084, 0.0}) {
    Explanation e = zeros_of_both(0.0084, second);
    EXPECT_EQ(tell_a_valves_zero({}, e), "");
    EXPECT_EQ(e.verdict, Verdict::kNamed);
    EXPECT_TRUE(e.alternatives.empty());
  }
}

TEST(TwoZeros, do_not_bring_a_name_back_that_was_left_out) {
  Explanation e = zeros_of_both(0.0084, 0.0119);
  EXPECT_EQ(tell_a_valves_zero({"pressure_gain_error"}, e), "");
  EXPECT_TRUE(e.alternatives.empty());
}

}  // namespace
}  // namespace isac::explain
