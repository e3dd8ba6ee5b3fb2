#include "isac/series/recording.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "isac/core/error.hpp"
#include "isac/series/derive.hpp"

namespace {

using isac::Error;
using isac::series::Recording;

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

Recording forces() {
  Recording run;
  run.source = "slow.csv";
  run.metadata["experiment"] = "free";
  run.columns = {{"time", "s", {0, 1, 2}}, {"F1", "N", {100, kMissing, 90}}, {"F2", "N", {150, 120, 90}}};
  return run;
}

std::string code_and_text(const Recording& run, const char* name) {
  try {
    (void)run.column(name);
  } catch (const Error& error) {
    EXPECT_EQ(error.place().file, run.source);
    return error.code() + " " + error.text();
  }
  return "";
}

TEST(Recording, finds_columns_by_name_and_says_what_it_has_otherwise) {
  const Recording run = forces();
  EXPECT_EQ(run.rows(), 3U);
  EXPECT_EQ(run.find("F2")->values[0], 150);
  EXPECT_EQ(run.find("f2"), nullptr);
  EXPECT_EQ(run.meta("experiment"), "free");
  EXPECT_EQ(run.meta("started", "unknown"), "unknown");
  const std::string sentence = code_and_text(run, "angle");
  EXPECT_NE(sentence.find("column_missing"), std::string::npos);
  EXPECT_NE(sentence.find("time, F1, F2"), std::string::npos);
  EXPECT_NE(sentence.find("--map angle="), std::string::npos);
}

TEST(Recording, points_to_a_name_that_differs_only_in_capitals) {
  EXPECT_NE(code_and_text(forces(), "f1").find("did you mean 'F1'"), std::string::npos);
}

TEST(Recording, without_columns_has_no_rows_and_says_so) {
  Recording empty;
  EXPECT_EQ(empty.rows(), 0U);
  EXPECT_NE(code_and_text(empty, "time").find("has none"), std::string::npos);
}

TEST(Derive, gives_the_torque_of_the_pair_with_the_sign_of_muscle_two) {
  Recording run = forces();
  isac::series::add_torque(run, 0.019);
  const auto& torque = run.column("torque");
  EXPECT_EQ(torque.unit, "N m");
  EXPECT_EQ(torque.values[0], 50 * 0.019);
  EXPECT_TRUE(std::isnan(torque.values[1]));
  EXPECT_EQ(torque.values[2], 0.0);
}

TEST(Derive, leaves_a_measured_torque_alone) {
  Recording run = forces();
  run.columns.push_back({"torque", "N m", {1, 2, 3}});
  isac::series::add_torque(run, kMissing);
  EXPECT_EQ(run.columns.size(), 4U);
  EXPECT_EQ(run.column("torque").values[0], 1);
}

TEST(Derive, refuses_a_torque_without_radius_or_force_and_changes_nothing) {
  Recording run = forces();
  for (const double radius : {kMissing, 0.0, -0.019, std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(isac::series::add_torque(run, radius), Error);
  }
  run.columns.pop_back();
  EXPECT_THROW(isac::series::add_torque(run, 0.019), Error);
  EXPECT_EQ(run.columns.size(), 2U);
}

TEST(Derive, gives_pressure_difference_and_mean_as_the_joint_model_defines_them) {
  const std::vector<double> p1{1, 2, kMissing};
  const std::vector<double> p2{4, 2, 1};
  const auto difference = isac::series::pressure_difference(p1, p2);
  const auto mean = isac::series::mean_pressure(p1, p2);
  EXPECT_EQ(difference[0], 1.5);
  EXPECT_EQ(mean[0], 2.5);
  EXPECT_EQ(difference[1], 0.0);
  EXPECT_TRUE(std::isnan(difference[2]) && std::isnan(mean[2]));
  // p1 = mean − difference, p2 = mean + difference
  EXPECT_EQ(mean[0] - difference[0], p1[0]);
  EXPECT_EQ(mean[0] + difference[0], p2[0]);
}

}  // namespace
