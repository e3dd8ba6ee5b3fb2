// An effect's size from one second to the next, and what it does by itself.
#include "isac/explain/constancy.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "prepared_day.hpp"

namespace isac::explain {
namespace {

/// A day by hand, and where its baseline stands.
struct Day : test::PreparedDay {
  Around place;
  explicit Day(const test::TiedRig& rig)
      : PreparedDay(rig, {test::by_hand(40, 0.5, 1.5), test::by_hand(40, 0.4, 2.5)}, 4.0),
        place(around(predictor, baseline, weights)) {}
  [[nodiscard]] Fit fitted(const char* id) const {
    const Hypothesis& h = hypothesis(id);
    return refit(predictor, baseline, {{&h, h.shapes.front()}}, weights);
  }
};

TEST(Constancy, of_a_friction_that_is_always_there_varies_by_a_tenth_of_itself_at_most) {
  const Day day({.dry = 0.03});
  const Fit fit = day.fitted("coulomb_friction");
  const Constancy size = constancy_of(day.place, fit, fit.tolerances);
  EXPECT_LT(std::abs(size.variation), 0.01);
  EXPECT_GT(size.error, 0);
  EXPECT_LT(size.error, 0.01);
}

// There in a share s of all pieces, it varies about its mean by (1 − s)/s of its square; pieces of a second hold two or three halves, and
// halve that.
TEST(Constancy, of_a_friction_that_comes_and_goes_varies_by_more_than_itself) {
  for (const double share : {0.1, 0.2}) {
    const Day day({.dry = 0.06, .dry_share = share});
    const Fit fit = day.fitted("coulomb_friction");
    const Constancy size = constancy_of(day.place, fit, fit.tolerances);
    const double expected = 0.5 * (1 - share) / share;
    EXPECT_GT(size.variation, 0.4 * expected) << share;
    EXPECT_LT(size.variation, 4 * expected) << share;
    EXPECT_GT(size.variation, 10 * size.error);
  }
}

TEST(Constancy, of_what_rests_or_has_no_amplitude_is_not_known) {
  const Day day({.offset = 0.02});
  const Fit fit = day.fitted("torque_offset");
  EXPECT_TRUE(std::isnan(constancy_of(day.place, fit, fit.tolerances).variation));
}

TEST(Share, of_all_of_an_effect_is_what_its_fit_closes) {
  const Day day({.dry = 0.03});
  const Fit fit = day.fitted("coulomb_friction");
  const double alone = share_of(day.place, fit, fit.tolerances, -1).squaredNorm();
  EXPECT_NEAR(alone, day.baseline.loss - fit.loss, 0.02 * alone);
  const double tenth = share_of(day.place, fit, fit.tolerances, 0.1).squaredNorm();
  EXPECT_NEAR(tenth, 0.01 * alone, 1e-4 * alone);
}

TEST(Share, of_giants_that_cancel_is_many_times_what_they_close_together) {
  const test::TiedRig rig{.dry = 0.01};
  const Day day(rig);
  Fit fit = day.baseline;
  const double torque = 0.5, angle = torque / (rig.A * rig.radius * rig.radius);
  fit.model.effects.push_back({&day.hypothesis("torque_offset"), {torque}});
  fit.model.effects.push_back({&day.hypothesis("encoder_offset"), {angle}});
  Eigen::VectorXd both = Eigen::VectorXd::Zero(day.place.here.size());
  day.predictor.predict(fit.model, kAllChains, both);
  both -= day.place.here;
  weigh(day.data, day.weights, both);
  const double together = day.place.project(both).norm();
  const double alone = share_of(day.place, fit, fit.tolerances, -1).norm();
  EXPECT_GT(alone, 8 * together);
}

}  // namespace
}  // namespace isac::explain
