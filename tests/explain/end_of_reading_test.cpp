// An effect that acts only while a force reading stands at its largest, and one that acts near the end of a stroke.
#include "isac/explain/end_of_reading.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "prepared_day.hpp"

namespace isac::explain {
namespace {

constexpr double kNoise = 0.003;  // N m
const std::vector<PlannedRun> kDay = {test::by_hand(40, 0.5, 1.5), test::by_hand(40, 0.4, 2.5)};

/// The day's second muscle read no higher than a share of its largest force; what that takes away in the torque's rows.
struct Clipped {
  Prepared data;
  Eigen::VectorXd missing;
};

Clipped clipped(double share) {
  const test::TiedRig rig;
  std::vector<series::Recording> runs = test::record_all(rig, kDay);
  const Prepared whole = prepare(runs, rig.facts(), {}, 2.0);
  double largest = 0;
  for (const PreparedRun& run : whole.runs)
    largest = std::max(largest, *std::max_element(run.force[1].begin(), run.force[1].end()));
  for (series::Recording& run : runs)
    for (series::Column& column : run.columns)
      if (column.name == "F2")
        for (double& f : column.values) f = std::min(f, share * largest);
  Clipped c{prepare(runs, rig.facts(), {}, 2.0), {}};
  c.missing.setZero(static_cast<Eigen::Index>(c.data.rows.size()));
  for (std::size_t i = 0; i < c.data.rows.size(); ++i) {
    const Row& row = c.data.rows[i];
    if (row.chain == Chain::kTorque)
      c.missing[static_cast<Eigen::Index>(i)] =
          whole.runs[row.run].force[1][row.sample] - c.data.runs[row.run].force[1][row.sample];
  }
  return c;
}

TEST(EndOfReading, holds_all_that_a_clipped_one_lacks) {
  for (const double share : {0.85, 0.95}) {
    const Clipped c = clipped(share);
    ASSERT_GT(c.missing.squaredNorm(), 0);
    const EndOfReading end = acts_at_the_end_of_a_reading(c.data, c.missing, kNoise);
    EXPECT_GT(end.share, 0.95);
    double largest = 0;
    for (const PreparedRun& run : c.data.runs)
      largest = std::max(largest, *std::max_element(run.force[1].begin(), run.force[1].end()));
    EXPECT_NEAR(end.force, largest, 0.01 * largest);
  }
}

TEST(EndOfReading, holds_little_of_what_acts_on_the_way_to_the_end_of_a_stroke) {
  const test::PreparedDay day(test::TiedRig{}, kDay);
  double turn = 0;
  for (const PreparedRun& run : day.data.runs)
    for (const double angle : run.angle) turn = std::max(turn, std::abs(angle));
  Eigen::VectorXd stop = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(day.data.rows.size()));
  for (std::size_t i = 0; i < day.data.rows.size(); ++i) {
    const Row& row = day.data.rows[i];
    const double beyond = std::abs(day.data.runs[row.run].angle[row.sample]) - 0.8 * turn;
    if (row.chain == Chain::kTorque && beyond > 0) stop[static_cast<Eigen::Index>(i)] = beyond;
  }
  ASSERT_GT(stop.squaredNorm(), 0);
  EXPECT_LT(acts_at_the_end_of_a_reading(day.data, stop, kNoise).share, 0.4);
}

TEST(EndOfReading, says_nothing_where_no_force_was_read) {
  test::PreparedDay day(test::TiedRig{}, kDay);
  for (PreparedRun& run : day.data.runs)
    for (std::vector<double>& force : run.force) force.clear();
  EXPECT_EQ(acts_at_the_end_of_a_reading(day.data, day.baseline.residual, kNoise).share, 0);
}

}  // namespace
}  // namespace isac::explain
