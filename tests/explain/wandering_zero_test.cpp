// Effects as slow or as rare as a zero of the force sensors that wanders by as much.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "isac/explain/explain.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

std::vector<PlannedRun> day() {
  return {test::by_hand(30, 0.5, 2.5), test::by_hand(30, 0.4, 1.2),       test::free_in_steps(20, 1.7, 0.6),
          test::by_hand(30, 0.3, 0.6), test::free_in_steps(20, 2.9, 0.4), test::clamped(30, 0.1, 1.2, 6)};
}

Explanation explained(const test::TiedRig& rig, std::uint32_t first) {
  const std::vector<PlannedRun> beyond = {test::by_hand(20, 0.35, 0.7), test::free_in_steps(20, 2.1, 0.5)};
  return explain(test::record_all(rig, day(), first), HeldOut(test::record_all(rig, beyond, first + 20)),
                 {.rig = rig.facts(), .traces = false, .next_experiment = false});
}

bool names(const Explanation& e, const std::string& id) {
  const auto is = [&](const Candidate& c) { return c.id == id; };
  return std::any_of(e.effects.begin(), e.effects.end(), is) ||
         std::any_of(e.alternatives.begin(), e.alternatives.end(), is);
}

TEST(WanderingZero, hides_no_constant_torque_where_a_free_joint_moves_by_it) {
  const test::TiedRig rig{.offset = 0.008, .zero_wander = 0.008};
  int found = 0;
  for (std::uint32_t first = 100; first < 400; first += 100) {
    const Explanation e = explained(rig, first);
    found += names(e, "torque_offset") && names(e, "encoder_offset") ? 1 : 0;
    EXPECT_TRUE(e.verdict != Verdict::kNamed || e.effects.front().id == "torque_offset") << e.summary;
  }
  EXPECT_GE(found, 2);  // short runs do not show every day that it wanders
}

TEST(WanderingZero, alone_is_no_constant_torque) {
  const test::TiedRig rig{.zero_wander = 0.008};
  for (std::uint32_t first = 100; first < 400; first += 100)
    EXPECT_TRUE(explained(rig, first).effects.empty()) << first;
}

TEST(WanderingZero, is_not_taken_for_a_reading_that_is_clipped_in_one_run) {
  const test::TiedRig rig{.force_most = 145, .zero_wander = 0.004};
  const Explanation e = explained(rig, 600);
  ASSERT_EQ(e.effects.size(), 1U) << e.summary;
  EXPECT_EQ(e.effects.front().id, "force_saturation") << e.summary;
  EXPECT_NEAR(e.effects.front().parameters.front().value, rig.force_most, 0.5);
}

// What relaxes within a minute is as slow as the zero, and passes for it until it is taken out.
TEST(WanderingZero, hides_no_creep) {
  const test::TiedRig rig{.spring = 0.15, .relaxes_in = 10, .zero_wander = 0.004};
  const Explanation e = explained(rig, 700);
  ASSERT_FALSE(e.effects.empty()) << e.summary;
  EXPECT_EQ(e.effects.front().id, "creep") << e.summary;
}

// Beside an effect that had hidden it, the zero is no second effect.
TEST(WanderingZero, that_a_threshold_had_hidden_is_no_second_effect) {
  const test::TiedRig rig{.threshold = 0.4 * kPascalPerKgfCm2, .zero_wander = 0.008};
  std::vector<PlannedRun> runs = day();
  runs.push_back(test::clamped(30, 0.1, 1.0, 10));
  runs.back().mean_pressure_kgcm2 = 1.1;
  for (std::uint32_t first = 800; first < 1100; first += 100) {
    const Explanation e = explain(test::record_all(rig, runs, first), HeldOut(),
                                  {.rig = rig.facts(), .traces = false, .next_experiment = false});
    ASSERT_EQ(e.effects.size(), 1U) << first << " " << e.summary;
    EXPECT_EQ(e.effects.front().id, "threshold_pressure") << e.summary;
  }
}

}  // namespace
}  // namespace isac::explain
