#include "isac/explain/experiment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "experiment_bench.hpp"
#include "isac/core/units.hpp"
#include "isac/explain/experiment_runs.hpp"
#include "isac/explain/experiment_words.hpp"

namespace isac::explain {
namespace {

using test::Bench;
using test::by_hand;
using test::clamped;
using test::TiedRig;

TEST(NextExperiment, tells_load_dependent_friction_by_another_mean_pressure) {
  TiedRig rig;
  rig.dry = 0.06;
  rig.load_exponent = 1;
  const Bench bench(rig, test::constant_mean_pressure());
  const Designer designer(bench.tie({"pressure_dependent_friction", "coulomb_friction"}), {});
  const NextExperiment next = designer.design();
  EXPECT_GE(designer.candidates().size(), 100U);
  EXPECT_LT(next.separation_now, 3);
  EXPECT_GT(next.separation_expected, 5);
  ASSERT_FALSE(next.runs.empty());
  bool other = false;
  for (const PlannedRun& run : next.runs)
    other = other || std::abs(run.mean_pressure_kgcm2 - 3) > 0.3 ||
            (run.experiment == "constant-pressure" && run.pressure_swing_kgcm2 > 0.3);
  EXPECT_TRUE(other) << next.sentence;
}

TEST(NextExperiment, tells_a_dead_time_from_a_second_lag_by_moving_the_commands) {
  TiedRig rig;
  rig.dead_time = 0.02;
  const Bench bench(rig, {by_hand(20, 0.35, 0.3), by_hand(20, 0.4, 3.0), clamped(24, 0.1, 0.5, 12)});
  const NextExperiment next = Designer(bench.tie({"dead_time", "second_order_lag"}), {}).design();
  EXPECT_GT(next.separation_expected, 5);
  ASSERT_FALSE(next.runs.empty());
  EXPECT_GT(next.runs.front().pressure_swing_kgcm2, 0.05);
  EXPECT_TRUE(next.runs.front().waveform == "steps" || next.runs.front().pressure_period_s < 1)
      << next.sentence;
}

TEST(NextExperiment, asks_for_another_rig_where_no_run_helps) {
  TiedRig rig;
  rig.offset = 0.05;
  const Bench bench(rig, test::constant_mean_pressure());
  const NextExperiment next = Designer(bench.tie({"torque_offset", "encoder_offset"}), {}).design();
  EXPECT_TRUE(next.runs.empty());
  EXPECT_LT(next.separation_expected, 3);
  EXPECT_NE(next.sentence.find("unloaded"), std::string::npos) << next.sentence;
}

TEST(PlanRun, asks_for_pressures_as_a_person_would_write_them) {
  const PlannedRun planned{.seconds = 20, .mean_pressure_kgcm2 = 17 * 0.1, .pressure_swing_kgcm2 = 3 * 0.1};
  ASSERT_NE(planned.mean_pressure_kgcm2, 1.7);
  EXPECT_EQ(plan_run(planned).mean_pressure, 1.7 * kPascalPerKgfCm2);
  EXPECT_EQ(plan_run(planned).pressure_swing, 0.3 * kPascalPerKgfCm2);
}

}  // namespace
}  // namespace isac::explain
