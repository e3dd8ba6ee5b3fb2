// Two effects at once, of which one alone looks like a third.
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <set>
#include <string>
#include <vector>

#include "isac/explain/explain.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

std::set<std::string> named_on(const test::TiedRig& rig, const std::vector<PlannedRun>& day,
                               const std::vector<PlannedRun>& beyond, std::string& told) {
  constexpr std::uint32_t kFirst = 100;
  const Explanation e =
      explain(test::record_all(rig, day, kFirst), HeldOut(test::record_all(rig, beyond, kFirst + 20)),
              {.rig = rig.facts(),
               .traces = false,
               .next_experiment = false,
               .progress = [&](const std::string& line) { told += line + "\n"; }});
  if (std::getenv("ISAC_SHOW") != nullptr) std::cout << told;
  told += e.summary;
  std::set<std::string> names;
  for (const Candidate& c : e.effects) names.insert(c.id);
  return names;
}

struct Both {
  double leak, deadband;  // 1/s, kg/cm2
};

class Pairs : public ::testing::TestWithParam<Both> {};

TEST_P(Pairs, of_a_leak_and_a_deaf_valve_are_both_named_whichever_stands_first) {
  test::TiedRig rig;
  rig.leak[0] = GetParam().leak;
  rig.deadband = GetParam().deadband * kPascalPerKgfCm2;
  const std::vector<PlannedRun> day = {test::by_hand(30, 0.5, 2.5), test::clamped(30, 0.1, 1.2, 6),
                                       test::clamped(30, 0.0, 0.9, 11, "steps"),
                                       test::by_hand(30, 0.3, 0.6, 0.7), test::by_hand(30, 0.3, 1.0, -0.7)};
  const std::vector<PlannedRun> beyond = {test::clamped(20, -0.1, 1.0, 8)};
  std::string told;
  EXPECT_EQ(named_on(rig, day, beyond, told), (std::set<std::string>{"leak", "valve_deadband"})) << told;
}

INSTANTIATE_TEST_SUITE_P(Of, Pairs, ::testing::Values(Both{0.0084, 0.0067}, Both{0.012, 0.006}));

// The offset closes less than 1 % of the units that the friction does, because the zero wanders as much; it is as large over the floor.
TEST(Pair, of_a_friction_and_an_offset_is_named_though_the_zero_wanders) {
  const test::TiedRig rig{.dry = 0.05, .offset = 0.03, .zero_wander = 0.012};
  std::string told;
  const std::set<std::string> names = named_on(
      rig,
      {test::by_hand(30, 0.5, 2.5), test::by_hand(30, 0.4, 1.2), test::free_in_steps(20, 1.7, 0.6),
       test::by_hand(30, 0.3, 0.6), test::free_in_steps(20, 2.9, 0.4), test::clamped(30, 0.1, 1.2, 6)},
      {test::by_hand(20, 0.35, 0.7), test::free_in_steps(20, 2.1, 0.5)}, told);
  EXPECT_EQ(names.size(), 2U) << told;
  EXPECT_EQ(names.count("coulomb_friction"), 1U) << told;
  EXPECT_EQ(names.count("torque_offset") + names.count("encoder_offset"), 1U) << told;  // twins
}

// Alone, the friction is led by a more general one that takes up some of the skew; half a sample of which is tolerated.
TEST(Pair, of_a_bearing_and_a_skew_is_named_though_another_friction_leads_alone) {
  const test::TiedRig rig{.bearing = 0.01, .skew = 0.0026};
  std::string told;
  const std::set<std::string> names = named_on(
      rig,
      {test::by_hand(30, 0.5, 2.5), test::by_hand(30, 0.4, 4.0), test::free_in_steps(20, 1.7, 0.6),
       test::by_hand(30, 0.3, 0.6), test::free_in_steps(20, 2.9, 0.4), test::clamped(30, 0.1, 1.2, 6)},
      {test::by_hand(20, 0.35, 0.7), test::free_in_steps(20, 2.1, 0.5)}, told);
  EXPECT_EQ(names, (std::set<std::string>{"bearing_friction", "time_skew"})) << told;
}

}  // namespace
}  // namespace isac::explain
