// What is proved on held-out runs uses nothing that was fitted to other runs alone.
#include "isac/explain/proof.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "isac/explain/fit.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

using test::by_hand;
using test::clamped;

TEST(Proof, does_not_move_a_held_out_clamp_by_where_another_clamp_stood) {
  const test::TiedRig rig;
  const std::vector<PlannedRun> runs = {clamped(12, 0.2, 0.5, 6), by_hand(15, 0.4, 1.0)};
  const Prepared fitted = prepare(test::record_all(rig, runs), rig.facts(), {}, 2.0);
  const auto others = test::record_all(rig, runs, 50);
  const Proof proof{HeldOut(others), fitted};
  ASSERT_EQ(proof.runs(), 2U);

  const Predictor predictor(fitted);
  Weights weights;
  for (const Chain chain : {Chain::kPressure1, Chain::kPressure2})
    weights.sigma[static_cast<std::size_t>(chain)] = 100;
  for (const Chain chain : {Chain::kTorque, Chain::kMotion})
    weights.sigma[static_cast<std::size_t>(chain)] = 0.005;
  ModelPoint model = fit_baseline(predictor, {}, weights, false).model, moved = model;
  ASSERT_EQ(predictor.resting_runs(), std::vector<std::size_t>{0});
  model.rest.assign(runs.size(), 0.0);
  moved.rest = {fitted.rig.angle_step, 0.0};
  // It matters where it was fitted, …
  EXPECT_NE(raw_residual(predictor, moved, Chain::kTorque).squares,
            raw_residual(predictor, model, Chain::kTorque).squares);
  // … and nowhere else.
  EXPECT_EQ(proof.residual(moved, Chain::kTorque).squares, proof.residual(model, Chain::kTorque).squares);
  const std::vector<RunTrace> traces = proof.traces(model, moved, Chain::kTorque, 500);
  ASSERT_FALSE(traces.empty());
  EXPECT_EQ(traces.front().before, traces.front().after);
}

}  // namespace
}  // namespace isac::explain
