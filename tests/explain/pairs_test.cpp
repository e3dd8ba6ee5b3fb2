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

struct Both {
  double leak, deadband;  // 1/s, kg/cm2
};

class Pairs : public ::testing::TestWithParam<Both> {};

TEST_P(Pairs, of_a_leak_and_a_deaf_valve_are_both_named_whichever_stands_first) {
  test::TiedRig rig;
  rig.leak[0] = GetParam().leak;
  rig.deadband = GetParam().deadband * kPascalPerKgfCm2;
  std::vector<PlannedRun> day = {test::by_hand(30, 0.5, 2.5), test::clamped(30, 0.1, 1.2, 6),
                                 test::clamped(30, 0.0, 0.9, 11, "steps"), test::by_hand(30, 0.3, 0.6, 0.7),
                                 test::by_hand(30, 0.3, 1.0, -0.7)};
  const std::vector<PlannedRun> beyond = {test::clamped(20, -0.1, 1.0, 8)};
  constexpr std::uint32_t kFirst = 100;
  std::string lines;
  const Explanation e =
      explain(test::record_all(rig, day, kFirst), HeldOut(test::record_all(rig, beyond, kFirst + 20)),
              {.rig = rig.facts(),
               .traces = false,
               .next_experiment = false,
               .progress = [&](const std::string& line) { lines += line + "\n"; }});
  if (std::getenv("ISAC_SHOW") != nullptr) std::cout << lines;
  std::set<std::string> names;
  for (const Candidate& c : e.effects) names.insert(c.id);
  EXPECT_EQ(names, (std::set<std::string>{"leak", "valve_deadband"})) << e.summary << "\n" << lines;
}

INSTANTIATE_TEST_SUITE_P(Of, Pairs, ::testing::Values(Both{0.0084, 0.0067}, Both{0.012, 0.006}));

}  // namespace
}  // namespace isac::explain
