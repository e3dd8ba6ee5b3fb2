// A muscle whose error shows only where the joint moves by itself.
#include "isac/explain/free_torque.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "isac/explain/explain.hpp"
#include "prepared_day.hpp"

namespace isac::explain {
namespace {

PlannedRun low_and_free(double seconds) {
  PlannedRun run = test::free_in_steps(seconds, 4.0, 0.9);
  run.mean_pressure_kgcm2 = 1.2;
  return run;
}

const std::vector<PlannedRun> kDay = {test::by_hand(40, 0.5, 1.5), test::by_hand(40, 0.4, 2.5),
                                      test::clamped(40, 0.1, 1.2, 6), low_and_free(30),
                                      test::free_in_steps(30, 2.6, 0.4)};

test::TiedRig lifting_off_at(double pressure_kgcm2) {
  test::TiedRig rig;
  rig.threshold = pressure_kgcm2 * kPascalPerKgfCm2;
  return rig;
}

bool is_off(const test::TiedRig& rig, std::uint32_t first = 1) {
  const test::PreparedDay day(rig, kDay, 2.0, first);
  return free_torque_is_off(day.predictor, day.baseline.model);
}

TEST(FreeTorque, is_off_where_only_free_runs_fall_below_a_threshold) {
  EXPECT_TRUE(is_off(lifting_off_at(0.6)));
}

TEST(FreeTorque, is_not_off_where_nothing_is_missing) {
  for (std::uint32_t first = 1; first < 100; first += 10) EXPECT_FALSE(is_off({}, first)) << first;
}

TEST(FreeTorque, tells_a_threshold_that_was_nothing_before) {
  const test::TiedRig rig = lifting_off_at(0.6);
  const Explanation e = explain(test::record_all(rig, kDay), HeldOut(), {.rig = rig.facts()});
  ASSERT_EQ(e.verdict, Verdict::kNamed) << e.summary;
  EXPECT_EQ(e.effects.front().id, "threshold_pressure");
  EXPECT_NEAR(e.effects.front().parameters.front().value, 0.6, 0.02);
}

}  // namespace
}  // namespace isac::explain
