// Play and compliance: what the prediction makes of a joint that the encoder does not quite see.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "experiment_bench.hpp"

namespace isac::explain {
namespace {

using test::Bench;
using test::by_hand;
using test::TiedRig;

struct Fitted {
  Values values{};
  double gain = 0;  ///< drop of the loss
};

Fitted fitted(const Bench& bench, const std::string& form) {
  const Around place = around(bench.predictor, bench.stem, bench.weights);
  Fitted best;
  for (const Hypothesis& h : bench.library.hypotheses) {
    if (h.info().id != form) continue;
    for (const Values& shape : h.shapes) {
      const Refined now = refine(place, h, shape);
      const double gain = place.residual.squaredNorm() - now.loss;
      if (gain > best.gain) best = {now.values, gain};
    }
  }
  return best;
}

TEST(EncoderPlay, of_little_more_than_a_step_comes_back) {
  TiedRig rig;
  rig.encoder_play = 0.0011;  // 1.4 steps of the encoder
  const Bench bench(rig, {by_hand(30, 0.35, 0.3), by_hand(30, 0.3, 1.0), by_hand(30, 0.35, 3.0)});
  const Fitted play = fitted(bench, "encoder_play");
  EXPECT_NEAR(play.values[0], rig.encoder_play, 0.08 * rig.encoder_play);
  EXPECT_GT(play.gain, fitted(bench, "coulomb_friction").gain + 100);  // ten sigma
}

TEST(Compliance, within_the_known_inertia_comes_back_although_nobody_saw_its_far_side_begin) {
  TiedRig rig;
  rig.far_inertia = 0.0035;
  const auto free = [](double period, double swing) {
    return PlannedRun{.experiment = "free",
                      .seconds = 25,
                      .mean_pressure_kgcm2 = 3,
                      .pressure_swing_kgcm2 = swing,
                      .pressure_period_s = period,
                      .waveform = "steps"};
  };
  const Bench bench(
      rig, {by_hand(30, 0.35, 1.0), free(1.7, 0.6), free(2.9, 0.4), test::clamped(24, 0.1, 0.5, 12)});
  const Fitted within = fitted(bench, "series_elasticity_within");
  EXPECT_NEAR(within.values[0], rig.far_inertia, 0.15 * rig.far_inertia);
  EXPECT_NEAR(within.values[1], rig.far_hertz, 0.04 * rig.far_hertz);
  EXPECT_GT(within.gain, 1.05 * fitted(bench, "series_elasticity").gain);
  EXPECT_GT(within.gain, 1.2 * fitted(bench, "inertia_error").gain);
}

}  // namespace
}  // namespace isac::explain
