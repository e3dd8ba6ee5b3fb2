// Moments in which a residual is larger than noise is anywhere else, and the answer where nothing else shows.
#include "isac/explain/moments.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "isac/explain/explain.hpp"
#include "prepared_day.hpp"

namespace isac::explain {
namespace {

constexpr double kKnock = 20;  // s
const std::vector<PlannedRun> kDay = {test::by_hand(40, 0.5, 1.5), test::by_hand(40, 0.4, 2.5)};

/// The residual of a day's baseline, `times` as large between two moments of one run, in torque.
Eigen::VectorXd louder(const test::PreparedDay& day, unsigned run, double from, double to, double times) {
  Eigen::VectorXd r = day.baseline.residual;
  for (std::size_t i = 0; i < day.data.rows.size(); ++i) {
    const Row& row = day.data.rows[i];
    const double t = day.data.runs[row.run].time[row.sample];
    if (row.run == run && row.chain == Chain::kTorque && t >= from && t < to)
      r[static_cast<Eigen::Index>(i)] *= times;
  }
  return r;
}

/// Someone knocks at the rig: the second muscle's force swings for some tenths of a second, once.
std::vector<series::Recording> knocked(std::vector<series::Recording> runs, double newton) {
  series::Recording& run = runs[1];
  std::vector<double>* force = nullptr;
  const std::vector<double>* time = nullptr;
  for (series::Column& column : run.columns) {
    if (column.name == "F2") force = &column.values;
    if (column.name == "time") time = &column.values;
  }
  for (std::size_t k = 0; k < time->size(); ++k) {
    const double t = (*time)[k] - kKnock;
    if (t >= 0 && t < 0.6) (*force)[k] += newton * std::sin(6.283185307179586 * 5 * t);
  }
  return runs;
}

TEST(Moments, of_noise_hold_next_to_nothing_beyond_its_usual_power) {
  const test::PreparedDay day(test::TiedRig{}, kDay);
  const Moments m = moments_of(day.data, day.baseline.residual);
  EXPECT_LT(m.share, 0.01);
  EXPECT_FALSE(m.stand_out());
}

TEST(Moments, of_one_second_are_found_where_they_are) {
  const test::PreparedDay day(test::TiedRig{}, kDay);
  const Moments m = moments_of(day.data, louder(day, 1, 20, 21, 6));
  EXPECT_TRUE(m.stand_out()) << m.share;
  EXPECT_EQ(m.chain, Chain::kTorque);
  EXPECT_EQ(m.run, 1U);
  EXPECT_NEAR(m.time, 20.5, 0.6);
  EXPECT_GT(m.times_usual, 10);
}

TEST(Moments, of_a_free_joints_motion_are_bursts_of_noise_below_ten_times_the_usual) {
  Moments burst{.share = 0.1, .chain = Chain::kMotion, .times_usual = 9};
  EXPECT_FALSE(burst.stand_out());
  burst.times_usual = 11;
  EXPECT_TRUE(burst.stand_out());
  EXPECT_TRUE((Moments{.share = 0.1, .chain = Chain::kTorque, .times_usual = 9}.stand_out()));
}

TEST(Moments, are_not_a_run_that_is_noisier_throughout) {
  const test::PreparedDay day(test::TiedRig{}, kDay);
  EXPECT_FALSE(moments_of(day.data, louder(day, 1, 0, 1e9, 6)).stand_out());
}

// No effect of the catalogue happens once, and no function of the signals knows when.
TEST(Moments, that_no_name_fits_are_unknown_and_not_nothing) {
  const test::TiedRig rig;
  const auto answer = [&](double newton) {
    return explain(knocked(test::record_all(rig, kDay), newton), {},
                   {.rig = rig.facts(), .traces = false, .next_experiment = false});
  };
  const Explanation none = answer(0), knock = answer(5);
  EXPECT_EQ(none.verdict, Verdict::kNone) << none.summary;
  EXPECT_EQ(knock.verdict, Verdict::kUnknown) << knock.summary;
  EXPECT_TRUE(knock.detected);
  EXPECT_TRUE(knock.effects.empty());
  ASSERT_TRUE(knock.unknown.has_value());
  EXPECT_EQ(knock.unknown->signal, "torque");
  EXPECT_NE(knock.summary.find("In a few moments the torque"), std::string::npos) << knock.summary;
}

}  // namespace
}  // namespace isac::explain
