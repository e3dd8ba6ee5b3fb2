#include "isac/report/reduce.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "isac/report/figure.hpp"
#include "isac/report/text.hpp"

namespace {
using namespace isac::report;

std::vector<double> ramp(std::size_t n) {
  std::vector<double> out(n);
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<double>(i);
  return out;
}

TEST(Envelope, keeps_a_spike_of_a_single_row_in_a_million) {
  const auto x = ramp(1'000'000);
  std::vector<double> y(x.size(), 0.0);
  y[437'123] = 60;
  y[812'345] = -60;
  const Series small = envelope(x, y, 680);
  EXPECT_LE(small.x.size(), 2 * 680U);
  EXPECT_EQ(*std::max_element(small.y.begin(), small.y.end()), 60);
  EXPECT_EQ(*std::min_element(small.y.begin(), small.y.end()), -60);
  EXPECT_TRUE(std::is_sorted(small.x.begin(), small.x.end()));
}

TEST(Envelope, leaves_a_gap_where_samples_are_missing) {
  const auto x = ramp(100'000);
  std::vector<double> y(x.size(), 1.0);
  std::fill(y.begin() + 40'000, y.begin() + 50'000, std::nan(""));
  const Series small = envelope(x, y, 500);
  EXPECT_EQ(std::count_if(small.y.begin(), small.y.end(), [](double v) { return std::isnan(v); }), 1);
}

TEST(Envelope, returns_short_series_as_they_are) {
  const std::vector<double> x = {1, 2, 3}, y = {4, 5, 6};
  EXPECT_EQ(envelope(x, y, 680).y, y);
}

TEST(Cloud, keeps_at_most_the_points_asked_for_and_only_points_of_the_data) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<double> x(50'000), y(50'000);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = normal(random), y[i] = normal(random);
  const Series small = cloud(x, y, 300, 200, 1000);
  EXPECT_LE(small.x.size(), 1000U);
  EXPECT_GT(small.x.size(), 300U);  // coarsened no further than one step of 1.2² needs, many times over
  for (const double v : small.x) EXPECT_NE(std::find(x.begin(), x.end(), v), x.end());
}

TEST(Density, counts_every_row_inside_the_ranges_once) {
  const std::vector<double> x = {0.1, 0.1, 0.1, 0.9, 5.0}, y = {0.1, 0.1, 0.1, 0.9, 0.5};
  const auto levels = density(x, y, {0, 1}, {0, 1}, 2, 2, 3);
  std::size_t cells = 0;
  for (const auto& level : levels) cells += level.y.size();
  EXPECT_EQ(cells, 2U);  // two occupied cells; the row at x = 5 lies outside
  EXPECT_EQ(levels.back().y.size(), 1U);
  EXPECT_EQ(levels.back().y.front(), 0.25);
}

TEST(BinnedMean, gives_mean_and_standard_error_of_each_bin) {
  const std::vector<double> x = {0, 0, 0, 0, 1, 1, 1, 1}, y = {1, 3, 1, 3, 10, 10, 10, 10};
  const BinnedMean bins = binned_mean(x, y, 2, 2);
  ASSERT_EQ(bins.mean.size(), 2U);
  EXPECT_DOUBLE_EQ(bins.mean[0], 2);
  EXPECT_DOUBLE_EQ(bins.std_error[0], std::sqrt(4.0 / 3.0 / 4.0));  // variance 4/3 of four values
  EXPECT_DOUBLE_EQ(bins.std_error[1], 0);
}

TEST(Range, of_equal_values_is_widened_so_that_it_can_be_drawn) {
  const std::vector<double> same = {3, 3, 3};
  EXPECT_LT(range_of(same).low, 3);
  EXPECT_GT(range_of(same).high, 3);
}

TEST(Loop, falls_back_to_dots_when_a_line_would_be_too_long) {
  const auto t = ramp(200'000);
  std::vector<double> x(t.size()), y(t.size());
  for (std::size_t i = 0; i < t.size(); ++i) x[i] = std::sin(0.01 * t[i]), y[i] = std::cos(0.0137 * t[i]);
  EXPECT_EQ(loop("", "", x, y).mark, Mark::kPoints);
  EXPECT_EQ(loop("", "", std::span(x).first(600), std::span(y).first(600)).mark, Mark::kLine);
}

TEST(Text, shows_two_digits_of_the_standard_error) {
  EXPECT_EQ(with_error(-23441.7, 12.3).value, "−23442");
  EXPECT_EQ(with_error(-23441.7, 12.3).error, "12");
  EXPECT_EQ(with_error(0.002584123, 0.0000314).value, "0.002584");
  EXPECT_EQ(with_error(1.0, 0.0996).error, "0.10");  // rounding carries into the next digit
  EXPECT_EQ(with_error(123456, 4321).value, "123500");
  EXPECT_EQ(with_error(174.2, std::nan("")).error, "–");
}

TEST(Text, writes_units_and_names_for_people) {
  EXPECT_EQ(pretty_unit("N cm2/kg"), "N\u00A0cm²/kg");
  EXPECT_EQ(pretty_unit("N m s3"), "N\u00A0m\u00A0s³");
  EXPECT_EQ(pretty_unit("-"), "");
  EXPECT_EQ(pretty_sentence("k3 = 0.401 N m/rad3, 3 kg/cm2; m2, s2x, J2 and cm22 stay"),
            "k3 = 0.401 N m/rad³, 3 kg/cm²; m2, s2x, J2 and cm22 stay");
  EXPECT_EQ(pretty_sentence("0.02 kg m2"), "0.02 kg m²");
  EXPECT_EQ(pretty_sentence("-0.4 rad (-3 to 1), slow_dp-1.5.csv, half-open"),
            "−0.4 rad (−3 to 1), slow_dp-1.5.csv, half-open");
  EXPECT_EQ(number(-0.00004), "−4.000 · 10⁻⁵");
  EXPECT_EQ(fixed_decimals(-0.001, 2), "0.00");
  EXPECT_EQ(whole(1234567), "1\u202F234\u202F567");
  EXPECT_EQ(probability(0.0002), "< 0.001");
}

TEST(Text, makes_foreign_names_safe) {
  EXPECT_EQ(escape("<b a=\"1\">&'"), "&lt;b a=&quot;1&quot;&gt;&amp;&#39;");
  EXPECT_EQ(clean_utf8("Dr\xFC"
                       "ck\x01"),
            "Dr\uFFFDck ");
  EXPECT_EQ(clean_utf8("φ̇"), "φ̇");
  EXPECT_EQ(clean_utf8("\xE2\x82"), "\uFFFD\uFFFD");  // cut in the middle
}

}  // namespace
