#include "isac/explain/taken_out.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "prepared_day.hpp"

namespace isac::explain {
namespace {

/// Friction of so many N m, refitted beside the baseline.
struct Rubbing {
  test::PreparedDay day;
  Found found;

  explicit Rubbing(double dry)
      : day({.dry = dry}, {test::by_hand(20, 0.35, 1.0), test::by_hand(20, 0.3, 0.4)}) {
    const Hypothesis& friction = day.hypothesis("coulomb_friction");
    found.baseline = day.baseline;
    found.weights = day.weights;
    found.model = refit(day.predictor, day.baseline, {{&friction, {0.01}}}, day.weights, 6);
    found.added = {static_cast<int>(&friction - day.library.hypotheses.data())};
  }
};

TEST(TakenOut, is_missed_in_proportion_to_its_size) {
  const Rubbing light(0.005), heavy(0.02);
  EXPECT_NEAR(missed_by(heavy.day.predictor, heavy.found, 0) / missed_by(light.day.predictor, light.found, 0),
              4, 0.2);
  // What it takes from the rows is all that the loss gains by it, and what the baseline had taken up of it.
  const TakenOut without = taken_out(heavy.day.predictor, heavy.found, 0);
  EXPECT_GT(without.gain.sum(), heavy.day.baseline.loss - heavy.found.model.loss);
  EXPECT_EQ(static_cast<std::size_t>(without.left.size()), heavy.day.predictor.rows());
}

TEST(TakenOut, of_few_sigma_is_told_with_a_doubt) {
  std::vector<Candidate> named(2);
  named[0].name = "Coulomb friction";
  named[1].name = "creep";
  named[0].missed_by = 210;
  named[1].missed_by = 33.5;
  EXPECT_EQ(told_by_few_sigma(named), "");
  named[1].missed_by = 18.53;
  EXPECT_NE(told_by_few_sigma(named).find("only 19 sigma of it: they cannot tell creep from"),
            std::string::npos)
      << told_by_few_sigma(named);
  EXPECT_EQ(told_by_few_sigma({}), "");
  EXPECT_EQ(told_by_few_sigma({Candidate{}}), "");  // of what was not added nobody asked
}

}  // namespace
}  // namespace isac::explain
