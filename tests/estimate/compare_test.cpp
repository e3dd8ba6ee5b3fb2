#include "isac/estimate/compare.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace isac::estimate {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// value ± std_error with the 95 % interval of a t law of `quantile` (1.96: normal).
Estimated known(std::string name, std::string unit, double value, double std_error,
                double quantile = 1.959963984540054) {
  Estimated out;
  out.name = std::move(name);
  out.unit = std::move(unit);
  out.value = value;
  out.std_error = std_error;
  out.ci_low = value - quantile * std_error;
  out.ci_high = value + quantile * std_error;
  return out;
}

TEST(Compare, one_pair_gives_the_normal_two_sided_p) {
  const std::vector before = {known("T_C", "s", 0.170, 0.003)}, after = {known("T_C", "s", 0.180, 0.004)};
  const auto change = compare(before, after).at(0);
  EXPECT_NEAR(change.z, 2.0, 1e-12);                // 0.010 / hypot(0.003, 0.004)
  EXPECT_NEAR(change.p_value, 0.0455002639, 1e-9);  // 2 Φ(−2), from tables
  EXPECT_TRUE(change.significant);
  EXPECT_EQ(change.sentence, "T_C rose by 5.88 %, more than its uncertainty (p = 0.05).");
}

TEST(Compare, few_degrees_of_freedom_are_read_off_the_interval) {
  // Both with ν = 10 (t quantile 2.228139) and equal errors: Welch–Satterthwaite gives ν = 20.
  const std::vector before = {known("C", "N m s3", 1.0, 0.1, 2.228138852)},
                    after = {known("C", "N m s3", 1.3, 0.1, 2.228138852)};
  const auto change = compare(before, after).at(0);
  EXPECT_NEAR(change.freedom, 20.0, 1e-4);  // digits of the quantile above
  EXPECT_NEAR(change.z, 3.0 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(change.p_raw, 0.0465838, 5e-8);  // 2 P(t₂₀ > 2.12132), Simpson integration of the density
}

TEST(Compare, converts_units_of_one_dimension_and_refuses_others) {
  const std::vector before = {known("T_C", "s", 0.170, 0.003), known("A", "N/m", -23450, 10)};
  const std::vector after = {known("T_C", "ms", 180, 4), known("A", "N m", -23450, 10)};
  const auto changes = compare(before, after);
  EXPECT_NEAR(changes[0].z, 2.0, 1e-9);
  EXPECT_EQ(changes[0].unit, "s");
  EXPECT_FALSE(changes[1].comparable);
  EXPECT_TRUE(std::isnan(changes[1].p_value));
  EXPECT_NE(changes[1].sentence.find("different kinds"), std::string::npos);
}

TEST(Compare, holm_multiplies_by_what_is_left_and_never_falls) {
  // z = 3, 2.5, 2.45, 0.1: p = 0.00270, 0.01242, 0.01429, 0.920; times 4, 3, 2, 1, then made monotone.
  std::vector<Estimated> before, after;
  for (const double z : {2.5, 0.1, 3.0, 2.45}) {
    before.push_back(known("p" + std::to_string(before.size()), "-", 0, 0.6));
    after.push_back(known("p" + std::to_string(after.size()), "-", z, 0.8));
  }
  const auto changes = compare(before, after);
  EXPECT_NEAR(changes[2].p_value, 4 * changes[2].p_raw, 1e-15);
  EXPECT_NEAR(changes[0].p_value, 3 * changes[0].p_raw, 1e-15);
  EXPECT_NEAR(changes[3].p_value, changes[0].p_value, 1e-15)
      << "2 × 0.01429 would be less than its predecessor's";
  EXPECT_NEAR(changes[1].p_value, changes[1].p_raw, 1e-15);
  EXPECT_TRUE(changes[2].significant);
  EXPECT_TRUE(changes[0].significant);
  EXPECT_FALSE(changes[1].significant);
}

TEST(Compare, without_a_change_some_parameter_is_called_changed_in_at_most_5_percent_of_comparisons) {
  std::mt19937_64 random(20260103);
  std::normal_distribution<double> normal;
  int alarms = 0;
  constexpr int kTrials = 4000;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<Estimated> before, after;
    for (int i = 0; i < 6; ++i) {
      before.push_back(known("p" + std::to_string(i), "-", 5 + 0.3 * normal(random), 0.3));
      after.push_back(known("p" + std::to_string(i), "-", 5 + 0.2 * normal(random), 0.2));
    }
    bool any = false;
    for (const auto& change : compare(before, after)) any = any || change.significant;
    alarms += any ? 1 : 0;
  }
  // Six independent true nulls: 1 − (1 − 0.05/6)⁶ = 4.9 %; four standard errors of 4000 trials are 1.4 %.
  EXPECT_NEAR(alarms / double(kTrials), 0.049, 0.014);
}

TEST(Compare, sentences_say_direction_size_and_what_to_think_of_it) {
  const std::vector before = {known("A", "N/m", -23450, 12), known("B", "N cm2/kg", 174.2, 0.1),
                              known("C", "N m s3", 0.0026, 0.001), known("D", "N m s", 0.14, 0.002),
                              known("m", "kg", 1, 0.1)};
  const std::vector after = {known("A", "N/m", -24177, 12), known("B", "N cm2/kg", 170.0, 0.1),
                             known("C", "N m s3", 0.0027, 0.001), known("D", "N m s", -0.01, 0.002),
                             known("m", "kg", 1, 0.1)};
  const auto changes = compare(before, after);
  EXPECT_EQ(changes[0].sentence, "A grew in size by 3.1 %, far more than its uncertainty (p < 1e-15).");
  EXPECT_EQ(changes[1].sentence, "B fell by 2.41 %, far more than its uncertainty (p < 1e-15).");
  EXPECT_EQ(changes[2].sentence, "C rose by 3.85 %, which is within its uncertainty (p = 1).");
  EXPECT_EQ(changes[3].sentence,
            "D went from 0.14 to -0.01 N m s, far more than its uncertainty (p < 1e-15).");
  EXPECT_EQ(changes[4].sentence, "m is the same in both files.");
}

TEST(Compare, what_is_not_known_is_said_and_not_judged) {
  const std::vector before = {known("A", "N/m", -23450, 12), known("B", "N cm2/kg", 174, kNaN),
                              known("gone", "-", 1, 1)};
  const std::vector after = {known("A", "N/m", kNaN, 12), known("B", "N cm2/kg", 180, kNaN),
                             known("fresh", "-", 1, 1)};
  const auto changes = compare(before, after);
  ASSERT_EQ(changes.size(), 4u);
  for (const auto& change : changes) {
    EXPECT_FALSE(change.comparable) << change.name;
    EXPECT_FALSE(change.significant) << change.name;
  }
  EXPECT_EQ(changes[0].sentence, "A cannot be compared: it is not known in the second file.");
  EXPECT_EQ(changes[1].sentence, "B cannot be compared: neither file gives its standard error.");
  EXPECT_EQ(changes[2].sentence, "gone stands only in the first file.");
  EXPECT_EQ(changes[3].sentence, "fresh stands only in the second file.");
}

}  // namespace
}  // namespace isac::estimate
