#include "isac/explain/experiment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

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

// A vented muscle hangs slack: what forces do there says neither how they follow the pressure nor that a slack one may be led.
TEST(RigRange, is_not_told_by_slack_muscles) {
  TiedRig rig;
  rig.pretension = -100;
  rig.common = 200;
  rig.pushes = false;
  std::vector<PlannedRun> runs = test::constant_mean_pressure();
  runs.push_back({.experiment = "pcu-step",
                  .seconds = 20,
                  .mean_pressure_kgcm2 = 1.7,
                  .pressure_swing_kgcm2 = 1,
                  .pressure_period_s = 4,
                  .waveform = "steps"});
  const Bench bench(rig, runs);
  double least = 100;
  for (const PreparedRun& run : bench.data.runs)
    least = std::min(least, *std::min_element(run.force[0].begin(), run.force[0].end()));
  ASSERT_LT(least, 2);
  const RigRange range = range_of(bench.predictor, bench.stem.model, {});
  EXPECT_GT(range.least_force, 4);
  EXPECT_NEAR(range.common_force(rig.p0), 100, 3);
  EXPECT_NEAR(range.force_slope * kPascalPerKgfCm2, 200.0 / 3, 3);
}

TEST(WouldBeRun, is_not_slower_than_the_encoder_tells_nor_faster_than_an_arm) {
  const Bench bench(TiedRig{}, test::constant_mean_pressure());
  const RigRange range = range_of(bench.predictor, bench.stem.model, {});
  const auto rows_at = [&](double speed) {
    const std::optional<Prepared> data =
        would_record(bench.predictor, bench.stem.model, range, by_hand(20, 0.1, speed));
    return data ? static_cast<double>(std::count_if(data->rows.begin(), data->rows.end(),
                                                    [](const Row& r) { return r.chain == Chain::kTorque; }))
                : 0.0;
  };
  const double told = told_speed(bench.data.rig.angle_step);
  EXPECT_NEAR(told, 5 * 2 * kPi / 8000 / 0.1, 1e-6);
  EXPECT_EQ(rows_at(1.2 * told), 0);
  // As long as a sine stays above it: 1 − (2/π) asin(told/v).
  const double all = rows_at(40 * told);
  EXPECT_NEAR(rows_at(2 * told) / all, 2.0 / 3, 0.06);
  EXPECT_GT(all, 1000);
  EXPECT_EQ(rows_at(1.1 * fastest_by_hand(0.1)), 0);
}

// Of a drift of the encoder and one of a force a clamped bar tells nothing, for the reading drifts on; a free one does.
TEST(NextExperiment, tells_a_drifting_encoder_from_a_drifting_force_by_a_free_run) {
  TiedRig rig;
  rig.encoder_drift = 1e-4;
  const Bench bench(rig, {by_hand(20, 0.35, 0.3), by_hand(20, 0.3, 0.3, 0.8), by_hand(20, 0.4, 3.0)});
  Tie tie = bench.tie({});
  const Around place = around(bench.predictor, bench.stem, bench.weights);
  for (const char* id : {"encoder_drift", "force_drift"})
    for (const Hypothesis& h : bench.library.hypotheses)
      if (h.id() == id && h.clock == Clock::kDay) tie.models.push_back(Bench::fitted(place, h));
  ASSERT_EQ(tie.models.size(), 2U);
  const Designer designer(std::move(tie), {});
  const NextExperiment next = designer.design();
  EXPECT_LT(next.separation_now, 1);
  ASSERT_EQ(next.runs.size(), 1U);
  EXPECT_EQ(next.runs.front().experiment, "free") << next.sentence;
  const auto clamped_run = designer.information(clamped(40, 0.0, 0.4, 8));
  ASSERT_TRUE(clamped_run.has_value());
  EXPECT_LT(designer.separation(designer.recorded() + *clamped_run, 0, 1), 2);
}

// By the scatter of few blocks a difference is as sure as what one recording has of its own.
TEST(NextExperiment, is_long_enough_to_show_its_own_scatter) {
  TiedRig rig;
  rig.asymmetry = 0.05;
  const Bench bench(rig, test::constant_mean_pressure());
  const NextExperiment next = Designer(bench.tie({"muscle_asymmetry", "torque_offset"}), {}).design();
  ASSERT_FALSE(next.runs.empty());
  for (const PlannedRun& run : next.runs) EXPECT_GE(run.seconds, 40);
}

TEST(PlanRun, asks_for_pressures_as_a_person_would_write_them) {
  const PlannedRun planned{.seconds = 20, .mean_pressure_kgcm2 = 17 * 0.1, .pressure_swing_kgcm2 = 3 * 0.1};
  ASSERT_NE(planned.mean_pressure_kgcm2, 1.7);
  EXPECT_EQ(plan_run(planned).mean_pressure, 1.7 * kPascalPerKgfCm2);
  EXPECT_EQ(plan_run(planned).pressure_swing, 0.3 * kPascalPerKgfCm2);
}

}  // namespace
}  // namespace isac::explain
