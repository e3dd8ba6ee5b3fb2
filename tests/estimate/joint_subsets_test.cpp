// Every subset of six experiments: a parameter is recovered, or refused with a reason; never wrong.
#include <gtest/gtest.h>

#include <cmath>

#include "joint_data.hpp"

using namespace isac;
using namespace isac::test;

TEST(JointSubsets, every_subset_of_the_experiments_recovers_or_rightly_refuses) {
  const Truth truth;
  Sensors sensors;
  sensors.coloured = 0.01;
  std::vector<estimate::JointRun> all{
      record(slow(0), truth, sensors, 1),      record(slow(1), truth, sensors, 2),
      record(fast(0), truth, sensors, 3),      record(fast(-1), truth, sensors, 4),
      record(clamped(0.0), truth, sensors, 5), record(clamped(0.5), truth, sensors, 6)};
  const char* names[4] = {"A", "B", "C", "D"};
  const double values[4] = {truth.A, truth.B, truth.C, truth.D};
  for (unsigned subset = 1; subset < 64; ++subset) {
    std::vector<estimate::JointRun> runs;
    for (unsigned k = 0; k < 6; ++k)
      if (subset & (1u << k)) runs.push_back(all[k]);
    const auto fit = estimate::fit_joint(runs, {}, options_for(truth));
    const bool has_fast = subset & 0b001100u, moved_or_turned = subset & 0b101111u,
               pressured = subset & 0b111010u;
    const bool expected[4] = {moved_or_turned, pressured, has_fast, has_fast};
    for (int k = 0; k < 4; ++k) {
      SCOPED_TRACE("subset " + std::to_string(subset) + ", " + names[k]);
      const Estimated& e = find(fit.parameters, names[k]);
      if (!e.identifiable) {
        EXPECT_TRUE(std::isnan(e.value));
        EXPECT_GT(e.reason.size(), 40u);
      } else {
        // Five standard errors: some 150 estimates are looked at, with t of a dozen blocks.
        EXPECT_NEAR(e.value, values[k], std::max(5.0 * e.std_error, 1e-3 * std::abs(values[k])));
        EXPECT_NEAR(e.value, values[k], 0.25 * std::abs(values[k]));
      }
      if (k >= 2) {
        EXPECT_EQ(e.identifiable, expected[k]) << e.reason;
      }
      if (!expected[k]) {
        EXPECT_FALSE(e.identifiable);
      }
    }
  }
}
