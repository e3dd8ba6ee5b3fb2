#include "isac/explain/experiment.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>

#include "isac/explain/experiment_words.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

using test::by_hand;
using test::clamped;
using test::TiedRig;

/// Recordings, the baseline fitted to them, and effects in its surroundings.
struct Bench {
  Prepared data;
  Library library;
  Predictor predictor;
  Weights weights;
  Fit stem;

  Bench(const TiedRig& rig, const std::vector<PlannedRun>& runs)
      : data(prepare(test::record_all(rig, runs), rig.facts(), {}, 4.0)),
        library(make_library(data)),
        predictor(data) {
    // Of a low-passed row: 0.3 N in both sensors at 19 mm, and 0.004 kg/cm2, through a Gaussian of 6 ms at 500 Hz.
    weights = {{0.0025, 120, 120, 0.005}};
    stem = fit_baseline(predictor, library.tolerances, weights);
  }

  Active fitted(const std::string& id) const {
    const Around place = around(predictor, stem, weights);
    for (const Hypothesis& h : library.hypotheses)
      if (h.id() == id) {
        Refined best;
        best.loss = std::numeric_limits<double>::infinity();
        for (const Values& shape : h.shapes) {
          Refined now = refine(place, h, shape);
          if (now.loss < best.loss) best = std::move(now);
        }
        return {&h, best.values};
      }
    ADD_FAILURE() << id << " is not in the library";
    return {};
  }

  Designer designer(const std::vector<std::string>& ids, const ExperimentOptions& options = {}) const {
    Tie tie;
    tie.predictor = &predictor;
    tie.stem = stem;
    tie.weights = weights;
    for (const std::string& id : ids) tie.models.push_back(fitted(id));
    return Designer(std::move(tie), options);
  }
};

std::vector<PlannedRun> constant_mean_pressure() {
  return {by_hand(20, 0.35, 0.3), by_hand(20, 0.3, 0.3, 0.8), by_hand(20, 0.4, 3.0),
          by_hand(20, 0.3, 3.0, -0.8), clamped(16, 0.1, 1.0, 8)};
}

TEST(NextExperiment, tells_load_dependent_friction_by_another_mean_pressure) {
  TiedRig rig;
  rig.dry = 0.06;
  rig.load_exponent = 1;
  const Bench bench(rig, constant_mean_pressure());
  const auto start = std::chrono::steady_clock::now();
  const Designer designer = bench.designer({"pressure_dependent_friction", "coulomb_friction"});
  const NextExperiment next = designer.design();
  std::printf("%s\n%.2f s, %zu candidates\n", next.sentence.c_str(),
              std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
              designer.candidates().size());
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
  const NextExperiment next = bench.designer({"dead_time", "second_order_lag"}).design();
  std::printf("%s\n", next.sentence.c_str());
  EXPECT_GT(next.separation_expected, 5);
  ASSERT_FALSE(next.runs.empty());
  EXPECT_GT(next.runs.front().pressure_swing_kgcm2, 0.05);
  EXPECT_TRUE(next.runs.front().waveform == "steps" || next.runs.front().pressure_period_s < 1)
      << next.sentence;
}

TEST(NextExperiment, asks_for_another_rig_where_no_run_helps) {
  TiedRig rig;
  rig.offset = 0.05;
  const Bench bench(rig, constant_mean_pressure());
  const NextExperiment next = bench.designer({"torque_offset", "encoder_offset"}).design();
  std::printf("%s\n", next.sentence.c_str());
  EXPECT_TRUE(next.runs.empty());
  EXPECT_LT(next.separation_expected, 3);
  EXPECT_NE(next.sentence.find("unloaded"), std::string::npos) << next.sentence;
}

}  // namespace
}  // namespace isac::explain
