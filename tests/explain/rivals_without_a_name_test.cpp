// What a name is held against that has none: functions of the signals, errors of what the force sensors read, valve units with
// a lag of any shape or a curve of any form.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "isac/explain/any_valve.hpp"
#include "isac/explain/generic_fit.hpp"
#include "isac/explain/refine.hpp"
#include "isac/explain/screen.hpp"
#include "prepared_day.hpp"

namespace isac::explain {
namespace {

std::vector<PlannedRun> day() {
  const PlannedRun steps = test::valve_steps(24, 3);
  return {test::by_hand(16, 0.4, 0.5),
          test::by_hand(14, 0.4, 3.0),
          test::clamped(16, 0.1, 1.2, 6),
          test::free_in_steps(16, 4, 0.8),
          steps,
          test::free_in_steps(16, 5, 0.6)};
}

/// The day as it was fitted, and what a screen finds in it.
struct Seen {
  explicit Seen(const test::TiedRig& rig)
      : fitted(rig, day(), 4.0, 0), place(around(fitted.predictor, fitted.baseline, fitted.weights)) {
    screened = screen(place, fitted.library, {.flips = 199, .dictionary = true});
  }
  /// The refit of a name from where the screen found it.
  [[nodiscard]] Eigen::VectorXd left_by(std::string_view form) const {
    for (const Screened& c : screened.candidates) {
      const Hypothesis& h = fitted.library.hypotheses[static_cast<std::size_t>(c.hypothesis)];
      if (h.info().id == form) return refine(place, h, c.start).residual;
    }
    throw std::out_of_range(std::string(form));
  }
  [[nodiscard]] int parameters(std::string_view form) const { return fitted.hypothesis(form).parameters(); }

  test::PreparedDay fitted;
  Around place;
  Screen screened;
};

TEST(GenericFit, stands_beside_a_name_that_is_right_and_before_one_that_is_not) {
  const Seen seen(test::TiedRig{.dry = 0.03});
  for (const GenericFit& generic :
       {fit_generic(seen.place, seen.screened), rival_without_a_name(seen.place, seen.screened)}) {
    ASSERT_FALSE(generic.functions.empty());
    EXPECT_EQ(generic.chain, Chain::kTorque);
    EXPECT_LE(generic.residual.squaredNorm(), seen.place.residual.squaredNorm() - generic.gain * (1 - 1e-6));
    const auto behind = [&](const char* id) {
      return behind_generic(seen.fitted.data, seen.left_by(id), seen.parameters(id), generic).t;
    };
    EXPECT_LT(behind("coulomb_friction"), 1.0);
    EXPECT_GT(behind("quadratic_damping"), 3.0);
  }
}

TEST(GenericFit, tells_an_error_of_the_force_sensors_by_torque_and_motion_together) {
  const Seen seen(test::TiedRig{.force_drift = 0.001});
  const GenericFit rival = rival_without_a_name(seen.place, seen.screened),
                   of_one_chain = fit_generic(seen.place, seen.screened);
  EXPECT_EQ(names_of(rival, seen.fitted.data), "force reading: day");
  EXPECT_LT(rival.residual.squaredNorm(), of_one_chain.residual.squaredNorm());
  const auto behind = [&](const char* id) {
    return behind_generic(seen.fitted.data, seen.left_by(id), seen.parameters(id), rival);
  };
  EXPECT_LT(behind("force_drift").separation, 3);  // they are one equation
  EXPECT_GT(behind("encoder_drift").t, 3);
}

TEST(Beside, leaves_of_two_directions_what_it_promised_with_the_tolerances_come_back) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const auto draw = [&](Eigen::Index cols) {
    Eigen::MatrixXd m(80, cols);
    for (double& v : m.reshaped()) v = normal(random);
    return m;
  };
  for (int i = 0; i < 20; ++i) {
    Around place;
    place.held.slopes = draw(2);
    place.held.low = Eigen::Vector2d(0, -0.4);
    place.held.high = Eigen::Vector2d(0.4, 0);
    place.held_gram = place.held.slopes.transpose() * place.held.slopes;
    const Eigen::VectorXd x = draw(1), y = draw(1);
    place.residual =
        draw(1) + 3 * x + 2 * y - 0.3 * place.held.slopes.col(0) + 0.2 * place.held.slopes.col(1);
    Beside beside(place);
    beside.take(x.normalized());
    EXPECT_NEAR(beside.left().squaredNorm(), place.left_beside(x).squaredNorm(), 1e-9);
    const Eigen::VectorXd unit = (y - x * (x.dot(y) / x.squaredNorm())).normalized();
    const double promised = beside.loss_with(unit);
    beside.take(unit);
    EXPECT_NEAR(beside.left().squaredNorm(), promised, 1e-9 * promised);
    EXPECT_LT(promised, beside.held().squaredNorm());
  }
}

/// The name refitted with everything free, and how far it is behind a valve unit of the rival's form beside it.
Comparison behind(AnyValve (*rival)(const Around&, int), const Seen& seen, std::string_view form) {
  const auto best =
      std::find_if(seen.screened.candidates.begin(), seen.screened.candidates.end(), [&](const Screened& c) {
        return seen.fitted.library.hypotheses[static_cast<std::size_t>(c.hypothesis)].info().id == form;
      });
  if (best == seen.screened.candidates.end()) throw std::out_of_range(std::string(form));
  const Hypothesis& h = seen.fitted.library.hypotheses[static_cast<std::size_t>(best->hypothesis)];
  const Fit fit = refit(seen.fitted.predictor, seen.fitted.baseline,
                        {{&h, refine(seen.place, h, best->start).values}}, seen.fitted.weights, 8);
  const Around place = around(seen.fitted.predictor, fit, seen.fitted.weights);
  const AnyValve any = rival(place, 1);
  EXPECT_EQ(any.columns, 6);
  return behind_any_valve(place, any);
}

TEST(AnyLag, tells_a_dead_time_from_a_second_lag_whichever_was_named) {
  for (const bool dead : {true, false}) {
    test::TiedRig rig;
    (dead ? rig.dead_time : rig.second_lag) = 0.008;
    const Seen seen(rig);
    const Comparison right = behind(any_lag, seen, dead ? "dead_time" : "second_order_lag"),
                     wrong = behind(any_lag, seen, dead ? "second_order_lag" : "dead_time");
    EXPECT_LT(right.t, 1.28 - 0.5 * right.separation);
    EXPECT_GT(wrong.t, 1.645);
    EXPECT_GT(wrong.separation, 3);
  }
}

TEST(AnyLag, takes_nothing_from_a_right_name_that_is_no_linear_lag) {
  const Comparison right =
      behind(any_lag, Seen(test::TiedRig{.deadband = 0.02 * kPascalPerKgfCm2}), "valve_deadband");
  EXPECT_LT(right.t, 0);
}

TEST(AnyCurve, tells_a_valve_that_does_not_answer_small_errors_from_a_spool_that_sticks) {
  const Seen seen(test::TiedRig{.deadband = 0.02 * kPascalPerKgfCm2});
  const Comparison right = behind(any_curve, seen, "valve_deadband"),
                   wrong = behind(any_curve, seen, "valve_hysteresis");
  EXPECT_LT(right.t, 1.28 - 0.5 * right.separation);
  EXPECT_GT(wrong.t, 1.645);
  EXPECT_GT(wrong.separation, 3);
}

TEST(AnyCurve, takes_nothing_from_a_right_name_that_is_a_lag) {
  for (const bool dead : {true, false}) {
    test::TiedRig rig;
    (dead ? rig.dead_time : rig.second_lag) = 0.008;
    const Comparison right = behind(any_curve, Seen(rig), dead ? "dead_time" : "second_order_lag");
    EXPECT_LT(right.t, 1.28 - 0.5 * right.separation) << dead;
  }
}

TEST(AnyValve, has_no_columns_where_nothing_was_commanded) {
  const test::TiedRig rig{.dry = 0.03};
  auto runs = test::record_all(rig, day());
  for (series::Recording& run : runs)
    std::erase_if(run.columns, [](const auto& c) { return c.name == "p1_cmd" || c.name == "p2_cmd"; });
  const Prepared data = prepare(runs, rig.facts(), {}, 4.0);
  const Library library = make_library(data);
  const Predictor predictor(data);
  const Weights weights;
  const Fit fit = fit_baseline(predictor, library.tolerances, weights);
  const Around place = around(predictor, fit, weights);
  for (const auto rival : {any_lag, any_curve}) {
    const AnyValve any = rival(place, 1);
    EXPECT_EQ(any.columns, 0);
    EXPECT_EQ(any.residual, place.residual);
  }
}

}  // namespace
}  // namespace isac::explain
