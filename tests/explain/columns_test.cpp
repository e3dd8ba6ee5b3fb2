// What torques add to the rows, by columns that are kept, beside the same torques at every sample.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "isac/explain/filters.hpp"
#include "isac/explain/predict.hpp"
#include "prepared_day.hpp"

namespace isac::explain {
namespace {

constexpr double kOff = 1e-4;  // of the largest, for a smooth torque that is asked for at some samples only

/// By hand, and left free: rows of the torque and of the motion.
std::vector<PlannedRun> runs() {
  PlannedRun free = test::by_hand(10, 0.4, 2.0);
  free.experiment = "free";
  free.pressure_swing_kgcm2 = 0.4;
  free.pressure_period_s = 3;
  free.waveform = "sine";
  return {test::by_hand(10, 0.5, 1.5, 0.2), free};
}

Values twice(const Hypothesis& h, Values values) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (h.amplitude[i]) values[i] *= i == 0 ? 2.0 : 0.5;
  return values;
}

TEST(Columns, give_the_rows_that_every_sample_of_a_torque_gives) {
  const test::PreparedDay day({.dry = 0.03}, runs());
  const Prepared& data = day.data;
  const auto n = static_cast<Eigen::Index>(data.rows.size());
  const Hypothesis& zero = day.hypothesis("encoder_offset");
  int asked = 0;
  for (const Hypothesis& h : day.library.hypotheses) {
    if (h.info().hook != models::Hook::kTorque || has_fitted_states(h)) continue;
    SCOPED_TRACE(h.info().id);
    // Once, with other amplitudes of the same shape, beside an angle that is read otherwise, and the first once more.
    for (const int round : {0, 1, 2, 3}) {
      const Values values = round == 1 ? twice(h, h.shapes.front()) : h.shapes.front();
      ModelPoint base = day.baseline.model;
      if (round == 2) base.effects.push_back({&zero, {0.02}});
      ModelPoint with = base;
      with.effects.push_back({&h, values});
      Eigen::VectorXd there = Eigen::VectorXd::Zero(n), here = there;
      day.predictor.predict(with, kForceChains, there);
      day.predictor.predict(base, kForceChains, here);
      Eigen::VectorXd added = Eigen::VectorXd::Zero(n);
      day.predictor.predict_addition(base, with.effects.back(), added);
      for (std::size_t r = 0; r < data.runs.size(); ++r) {
        const Predictor::FullRate full = day.predictor.full_rate(with, r),
                                  none = day.predictor.full_rate(base, r);
        std::vector<double> torque = full.torque;
        for (std::size_t k = 0; k < torque.size(); ++k) torque[k] -= none.torque[k];
        torque = low_pass(torque, data.smoothing.torque / data.runs[r].interval);
        double largest = 0, off = 0;
        for (std::size_t i = data.run_begin[r]; i < data.run_begin[r + 1]; ++i) {
          const Row& row = data.rows[i];
          const bool motion = row.chain == Chain::kMotion;
          if (!motion && row.chain != Chain::kTorque) continue;
          const auto at = static_cast<Eigen::Index>(i);
          const double expected =
              motion ? full.motion[row.sample] - none.motion[row.sample] : torque[row.sample];
          largest = std::max(largest, std::abs(expected));
          off = std::max({off, std::abs(there[at] - here[at] - expected), std::abs(added[at] - expected)});
        }
        EXPECT_LE(off, kOff * largest + 1e-12) << "run " << r;
        asked += largest > 0 ? 1 : 0;
      }
    }
  }
  EXPECT_GE(asked, 80);
}

}  // namespace
}  // namespace isac::explain
