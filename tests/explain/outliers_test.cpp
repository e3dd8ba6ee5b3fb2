#include "isac/explain/outliers.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace isac::explain {
namespace {

Outliers find_in(const std::vector<double>& x, double quantum = 0) {
  const std::vector<double>* const one[] = {&x};
  return find_outliers(one, quantum);
}
Outliers count_in(const std::vector<double>& x, double limit) {
  const std::vector<double>* const one[] = {&x};
  return count_outliers(one, limit);
}

TEST(Outliers, raises_no_false_alarm_in_white_coloured_heavy_or_quantised_noise) {
  std::normal_distribution<double> gauss;
  std::exponential_distribution<double> decay;
  for (int kind = 0; kind < 4; ++kind) {
    std::mt19937 random(21);
    int alarms = 0;
    for (int trial = 0; trial < 300; ++trial) {
      std::vector<double> x;
      double slow = 0;
      for (int k = 0; k < 4000; ++k) {
        slow = 0.98 * slow + 0.2 * gauss(random);
        const double v = gauss(random), laplace = (v > 0 ? 1 : -1) * decay(random);
        x.push_back(kind == 0   ? v
                    : kind == 1 ? slow + 0.2 * v
                    : kind == 2 ? laplace
                                : std::round(0.25 * v + 0.2 * slow));  // mostly rests, a last bit flickers
      }
      alarms += find_in(x, kind == 3 ? 1.0 : 0.0).count > 0 ? 1 : 0;
    }
    EXPECT_LE(alarms, 3) << kind;  // 1 % of 300; 0.1 % is what the limit is made for
  }
}

TEST(Outliers, counts_spikes_and_measures_their_height) {
  std::mt19937 random(22);
  std::normal_distribution<double> gauss;
  std::vector<double> x;
  for (int k = 0; k < 20000; ++k) x.push_back(gauss(random));
  for (int k = 0; k < 40; ++k) x[static_cast<std::size_t>(250 + 480 * k)] += k % 2 == 0 ? 30.0 : -30.0;
  const Outliers o = find_in(x);
  EXPECT_EQ(o.count, 40U);
  EXPECT_EQ(o.samples, 19994U);
  EXPECT_NEAR(o.height, 30,
              0.8);  // median of 40 heights of standard deviation 1.22: four errors of 0.24, less a bit
  EXPECT_NEAR(o.rms, 30 * std::sqrt(40.0 / 19994), 0.05);
  EXPECT_EQ(count_in(x, o.limit).count, 40U);
}

TEST(Outliers, are_found_below_the_end_of_the_tail_where_many_are) {
  std::mt19937 random(26);
  std::normal_distribution<double> gauss;
  std::vector<double> x;
  for (int k = 0; k < 200000; ++k) x.push_back(gauss(random));
  std::vector<double> with = x;
  for (int k = 0; k < 200; ++k) with[static_cast<std::size_t>(500 + 990 * k)] += k % 2 == 0 ? 7.5 : -7.5;
  EXPECT_EQ(find_in(x).count, 0U);
  const Outliers o = find_in(with);
  EXPECT_GT(o.count, 120U);  // Φ((7.5 − 6.5)/1.22) = 0.79 of 200
  EXPECT_LE(o.count, 200U);
}

TEST(Outliers, are_not_their_own_yardstick_where_one_sample_in_140_is_one) {
  std::mt19937 random(24);
  std::normal_distribution<double> gauss;
  std::vector<double> x;
  for (int k = 0; k < 140 * 150; ++k) x.push_back(gauss(random) + (k % 140 == 70 ? 15.0 : 0.0));
  const Outliers o = find_in(x);
  EXPECT_GE(o.count, 140U);
  EXPECT_LE(o.count, 150U);
  EXPECT_NEAR(o.height, 15, 0.5);  // median of 150 of standard deviation 1.22: four errors of 0.12
}

TEST(Outliers, are_found_where_many_are_hardly_beyond_the_tail) {
  std::mt19937 random(25);
  std::normal_distribution<double> gauss;
  std::vector<double> x;
  for (int k = 0; k < 90000; ++k) x.push_back(gauss(random) + (k % 1000 == 500 ? 8.5 : 0.0));
  const Outliers o = find_in(x);
  EXPECT_GE(o.count, 80U);  // of ninety
  EXPECT_LE(o.count, 90U);
  EXPECT_NEAR(o.rms, 8.5 * std::sqrt(90.0 / 90000), 0.02);
}

TEST(Outliers, does_not_take_a_step_or_a_gap_for_a_spike) {
  std::mt19937 random(23);
  std::normal_distribution<double> gauss;
  std::vector<double> x;
  for (int k = 0; k < 10000; ++k) x.push_back(gauss(random) + ((k / 500) % 2 == 0 ? 0.0 : 50.0));
  for (int k = 3000; k < 3100; ++k) x[static_cast<std::size_t>(k)] = std::nan("");
  EXPECT_EQ(find_in(x).count, 0U);
}

// A command jumps, the pressure begins to move from one sample to the next, and a prediction of a smoothed pressure rounds that corner.
TEST(Outliers, are_not_the_corners_that_a_smoothed_signal_rounds) {
  std::mt19937 random(26);
  std::normal_distribution<double> gauss;
  std::vector<double> x;
  for (int k = 0; k < 90000; ++k) {
    const int from_corner = std::abs(k % 1000 - 500);
    x.push_back(gauss(random) + 60 * std::exp(-0.3 * from_corner));
  }
  EXPECT_EQ(find_in(x).count, 0U);
  for (std::size_t k = 250; k < x.size(); k += 1000) x[k] += 20;
  EXPECT_GE(find_in(x).count, 90U);
  EXPECT_LE(find_in(x).count, 92U);  // one of 90000 is noise of 4.5 deviations
}

TEST(Outliers, of_a_few_deviations_are_found_where_they_are_many) {
  std::mt19937 random(27);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform(0.5, 1.5);
  std::vector<double> x;
  for (int k = 0; k < 400000; ++k) x.push_back(gauss(random));
  std::vector<double> with = x;
  for (std::size_t k = 125; k < with.size(); k += 256)
    with[k] += (k % 512 == 125 ? 3.6 : -3.6) * uniform(random);
  EXPECT_EQ(find_in(x).count, 0U);
  EXPECT_GT(find_in(with).count, 40U);
}

// A joint that swings, and noise that is seven times louder for a third of the time: neither is a spike, and those of twenty of the loud noise's
// deviations are.
TEST(Outliers, are_told_from_a_swing_and_from_noise_that_is_louder_at_times) {
  std::mt19937 random(28);
  std::normal_distribution<double> gauss;
  std::vector<double> x;
  for (int k = 0; k < 400000; ++k)
    x.push_back((k % 3000 < 1000 ? 1.0 : 0.14) * gauss(random) + 300 * std::sin(0.03 * k));
  EXPECT_EQ(find_in(x).count, 0U);
  for (std::size_t k = 125; k < x.size(); k += 1600) x[k] += k % 3200 == 125 ? 20.0 : -20.0;
  EXPECT_EQ(find_in(x).count, 250U);
}

}  // namespace
}  // namespace isac::explain
