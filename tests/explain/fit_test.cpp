// A refit of several effects at once: what shares no parameter is fitted as if the other were not there.
#include "isac/explain/fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "isac/core/units.hpp"
#include "prepared_day.hpp"

namespace isac::explain {
namespace {

constexpr double kThreshold = 0.3 * kPascalPerKgfCm2, kDeadTime = 0.008;

std::vector<PlannedRun> day() {
  const PlannedRun steps = test::valve_steps(24, 1.5);
  return {test::by_hand(16, 0.4, 0.5), test::clamped(16, 0.1, 1.2, 6), steps,
          test::free_in_steps(16, 4, 0.8)};
}

struct Day {
  test::PreparedDay fitted{test::TiedRig{.dead_time = kDeadTime, .threshold = kThreshold}, day(), 4.0, 0};
  [[nodiscard]] Active effect(const char* form, double value) const {
    Active a;
    a.hypothesis = &fitted.hypothesis(form);
    a.values[0] = value;
    return a;
  }
  [[nodiscard]] Fit with(const std::vector<Active>& effects) const {
    return refit(fitted.predictor, fitted.baseline, effects, fitted.weights, 12);
  }
};

TEST(Refit, fits_the_pressures_as_if_the_torque_had_no_effect_of_its_own) {
  const Day day;
  const Active delay = day.effect("dead_time", 0.005),
               threshold = day.effect("threshold_pressure", kThreshold);
  const Fit alone = day.with({delay}), both = day.with({delay, threshold});
  for (std::size_t j = 0; j < both.model.base.size(); ++j)
    if ((day.fitted.predictor.base()[j].chains & kPressureChains) != 0) {
      EXPECT_DOUBLE_EQ(both.model.base[j], alone.model.base[j]) << day.fitted.predictor.base()[j].name;
    }
  const double delay_beside = both.model.effects[both.tolerances].values[0];
  EXPECT_DOUBLE_EQ(delay_beside, alone.model.effects.back().values[0]);
  EXPECT_NEAR(delay_beside, kDeadTime, 2e-4);
  EXPECT_EQ(both.coordinates.size(), alone.coordinates.size() + day.with({threshold}).coordinates.size());
  EXPECT_DOUBLE_EQ(both.loss, both.residual.squaredNorm());
}

TEST(Response, as_known_beforehand_owes_nothing_to_the_torque_that_was_read) {
  test::PreparedDay day{
      test::TiedRig{}, {test::by_hand(16, 0.4, 0.5), test::free_in_steps(16, 4, 0.8)}, 4.0, 0};
  const Hypothesis& ring = day.hypothesis("series_elasticity_within");
  const Eigen::VectorXd here = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(day.data.rows.size()));
  const auto responses = [&] {
    Active a;
    a.hypothesis = &ring;
    a.values = {1e-3, 9, 0.05};
    const Eigen::VectorXd fitted = change(day.predictor, day.baseline, here, a);
    a.as_known_beforehand = true;
    return std::pair(fitted, change(day.predictor, day.baseline, here, a));
  };
  const auto [fitted, known] = responses();
  for (PreparedRun& run : day.data.runs)
    for (std::size_t k = 0; k < run.smooth_torque.size(); ++k)
      run.smooth_torque[k] += 0.01 * std::sin(6.283185307179586 * 9 * run.interval * static_cast<double>(k));
  const auto [fitted_again, known_again] = responses();
  EXPECT_GT(known.norm(), 0);
  EXPECT_EQ(known_again, known);
  EXPECT_GT((fitted_again - fitted).norm(), 1e-3 * known.norm());
}

TEST(Predictor, fills_a_muscle_whatever_it_makes_force_of) {
  const Day day;
  const Prepared& data = day.fitted.data;
  ModelPoint with = day.fitted.baseline.model;
  with.effects.push_back(day.effect("threshold_pressure", kThreshold));
  Eigen::VectorXd before = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.rows.size())), after = before;
  day.fitted.predictor.predict(day.fitted.baseline.model, kAllChains, before);
  day.fitted.predictor.predict(with, kAllChains, after);
  double torque_moved = 0;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if ((bit(data.rows[i].chain) & kPressureChains) != 0)
      ASSERT_EQ(after[k], before[k]) << "row " << i;
    else
      torque_moved = std::max(torque_moved, std::abs(after[k] - before[k]));
  }
  EXPECT_GT(torque_moved, 0.003);  // N m
}

}  // namespace
}  // namespace isac::explain
