#include "isac/series/differentiate.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

using namespace isac::series;

namespace {

struct Cubic {
  double value(double t) const { return 0.3 - 1.2 * t + 0.7 * t * t + 2.1 * t * t * t; }
  double first(double t) const { return -1.2 + 1.4 * t + 6.3 * t * t; }
  double second(double t) const { return 1.4 + 12.6 * t; }
};

std::vector<double> even_time(std::size_t rows, double interval) {
  std::vector<double> t(rows);
  for (std::size_t i = 0; i < rows; ++i) t[i] = static_cast<double>(i) * interval;
  return t;
}

std::vector<double> jittered_time(std::size_t rows, double interval, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  std::vector<double> t = even_time(rows, interval);
  for (double& v : t) v += jitter(random) * interval;
  return t;
}

}  // namespace

TEST(Differentiate, is_exact_on_cubics_for_even_and_jittered_stamps) {
  const Cubic cubic;
  for (const bool jitter : {false, true}) {
    const auto time = jitter ? jittered_time(400, 0.002, 7) : even_time(400, 0.002);
    std::vector<double> x;
    for (const double t : time) x.push_back(cubic.value(t));
    const Derivatives d = differentiate(time, x, {.window = 21, .order = 3});
    EXPECT_EQ(d.even, !jitter);
    for (std::size_t i = 10; i + 10 < time.size(); ++i) {
      // Rounding of the samples, 1e-16, over the half window of 0.02 s to the first and second power, with
      // noise gain.
      EXPECT_NEAR(d.value[i], cubic.value(time[i]), 1e-13);
      EXPECT_NEAR(d.first[i], cubic.first(time[i]), 1e-11);
      EXPECT_NEAR(d.second[i], cubic.second(time[i]), 1e-8);
    }
  }
}

TEST(Differentiate, leaves_half_a_window_at_every_edge_unknown) {
  const auto time = even_time(100, 0.001);
  const Derivatives d = differentiate(time, std::vector<double>(100, 1.0), {.window = 41, .order = 3});
  for (std::size_t i = 0; i < 100; ++i) EXPECT_EQ(std::isnan(d.first[i]), i < 20 || i >= 80) << i;
}

TEST(Differentiate, splits_at_missing_samples_and_at_gaps_in_time) {
  auto time = even_time(120, 0.001);
  for (std::size_t i = 60; i < 120; ++i) time[i] += 0.01;
  std::vector<double> x(120, 2.0);
  x[30] = std::nan("");
  const Derivatives d = differentiate(time, x, {.window = 5, .order = 2});
  ASSERT_EQ(d.segments.size(), 3u);
  EXPECT_EQ(d.segments[0].end, 30u);
  EXPECT_EQ(d.segments[1].begin, 31u);
  EXPECT_EQ(d.segments[1].end, 60u);
  for (const std::size_t i : {28u, 29u, 30u, 31u, 32u, 58u, 59u, 60u, 61u})
    EXPECT_TRUE(std::isnan(d.first[i])) << i;
  for (const std::size_t i : {27u, 33u, 57u, 62u}) EXPECT_NEAR(d.first[i], 0.0, 1e-12) << i;
}

TEST(Differentiate, agrees_between_the_even_and_the_uneven_path) {
  auto time = even_time(300, 0.002);
  std::vector<double> x;
  for (const double t : time) x.push_back(std::sin(9 * t));
  const auto fast = differentiate(time, x, {.window = 31, .order = 4});
  time[299] += 1e-7;  // not even any more, but only for the last window, which is skipped below
  const auto slow = differentiate(time, x, {.window = 31, .order = 4});
  EXPECT_FALSE(slow.even);
  for (std::size_t i = 15; i < 284; ++i) {
    EXPECT_NEAR(fast.first[i], slow.first[i], 1e-10);   // two ways to round sums of 31 terms over 0.03 s
    EXPECT_NEAR(fast.second[i], slow.second[i], 1e-7);  // the same over 0.03² s²
  }
}

TEST(Differentiate, fills_segments_shorter_than_the_lanes_of_the_uneven_path) {
  const Cubic cubic;
  const auto time = jittered_time(12, 0.01, 3);
  std::vector<double> x;
  for (const double t : time) x.push_back(cubic.value(t));
  const auto d = differentiate(time, x, {.window = 9, .order = 3});
  for (std::size_t i = 4; i < 8; ++i) EXPECT_NEAR(d.first[i], cubic.first(time[i]), 1e-10);
  EXPECT_TRUE(std::isnan(d.first[3]));
  EXPECT_TRUE(std::isnan(d.first[8]));
}

TEST(Differentiate, has_the_textbook_weights_and_frequency_response) {
  // Savitzky and Golay's published first-derivative weights of five points, order 3: (1, −8, 0, 8, −1)/12.
  const auto five = kernel({.window = 5, .order = 3}, 1, 1.0);
  const double published[] = {1.0 / 12, -8.0 / 12, 0, 8.0 / 12, -1.0 / 12};
  for (int k = 0; k < 5; ++k) EXPECT_NEAR(five[static_cast<std::size_t>(k)], published[k], 1e-14);
  // Response of those weights: i (16 sin x − 2 sin 2x)/12 with x = 2π f.
  for (const double f : {0.01, 0.1, 0.3, 0.45}) {
    const double x = 2 * M_PI * f;
    EXPECT_NEAR(frequency_response(five, 1.0, f).imag(), (16 * std::sin(x) - 2 * std::sin(2 * x)) / 12,
                1e-13);
    EXPECT_NEAR(frequency_response(five, 1.0, f).real(), 0.0, 1e-14);
  }
}

TEST(Differentiate, measures_a_sine_with_the_gain_that_its_frequency_response_says) {
  const LocalPolynomial polynomial{.window = 41, .order = 3};
  const double dt = 0.002, f = 9.0, w = 2 * M_PI * f;
  const auto time = even_time(2000, dt);
  std::vector<double> x;
  for (const double t : time) x.push_back(std::sin(w * t));
  const double gain = frequency_response(kernel(polynomial, 1, dt), dt, f).imag();
  const auto d = differentiate(time, x, polynomial);
  for (std::size_t i = 20; i < 1980; ++i) EXPECT_NEAR(d.first[i], gain * std::cos(w * time[i]), 1e-9 * w);
}

TEST(Differentiate, low_pass_and_difference_give_the_derivative) {
  const LocalPolynomial polynomial{.window = 21, .order = 3};
  const auto low_pass = implied_low_pass(polynomial);
  double sum = 0;
  for (const double w : low_pass) sum += w;
  EXPECT_NEAR(sum, 1.0, 1e-13);
  const auto first = kernel(polynomial, 1, 1.0);
  for (const double f : {0.002, 0.01, 0.03, 0.06}) {
    // L acts on interval means; cos² of the averaging over the sinc of the difference is (x/2)/tan(x/2) to be
    // undone.
    const double x = M_PI * f;
    const double expected = frequency_response(first, 1.0, f).imag() / (2 * std::sin(x)) * std::cos(x);
    EXPECT_NEAR(frequency_response(low_pass, 1.0, f).real(), expected, 1e-12);
  }
}

TEST(Differentiate, noise_gain_is_that_of_simulated_noise) {
  const LocalPolynomial polynomial{.window = 25, .order = 3};
  const double dt = 0.002;
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const auto time = even_time(60000, dt);
  std::vector<double> x(time.size());
  for (double& v : x) v = 0.01 * normal(random);
  const auto d = differentiate(time, x, polynomial);
  const NoiseGain gain = noise_gain(polynomial, dt);
  double s0 = 0, s1 = 0, s2 = 0, n = 0;
  for (std::size_t i = 12; i + 12 < time.size(); ++i, ++n) {
    s0 += d.value[i] * d.value[i];
    s1 += d.first[i] * d.first[i];
    s2 += d.second[i] * d.second[i];
  }
  // 60 000 rows correlated over 25 are worth some 5000: the standard deviation is known to 1 %, four of them
  // are allowed.
  EXPECT_NEAR(std::sqrt(s0 / n), 0.01 * gain.value, 0.04 * 0.01 * gain.value);
  EXPECT_NEAR(std::sqrt(s1 / n), 0.01 * gain.first, 0.04 * 0.01 * gain.first);
  EXPECT_NEAR(std::sqrt(s2 / n), 0.01 * gain.second, 0.04 * 0.01 * gain.second);
}

TEST(Differentiate, quantised_motion_has_the_noise_of_its_step) {
  const LocalPolynomial polynomial{.window = 25, .order = 3};
  const double dt = 0.002, step = 2 * M_PI / 8000;
  const auto time = even_time(40000, dt);
  std::vector<double> x;
  for (const double t : time) x.push_back(step * std::floor(std::sin(2.3 * t) / step));
  const auto d = differentiate(time, x, polynomial);
  double sum = 0, n = 0;
  for (std::size_t i = 12; i + 12 < time.size(); ++i, ++n) {
    const double e = d.first[i] - 2.3 * std::cos(2.3 * time[i]);
    sum += e * e;
  }
  const double expected = step / std::sqrt(12.0) * noise_gain(polynomial, dt).first;
  EXPECT_NEAR(std::sqrt(sum / n), expected,
              0.15 * expected);  // the white model of a quantiser is an approximation
}

TEST(ChooseWindow, is_wide_for_slow_noisy_motion_and_narrow_for_fast_motion) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto time = even_time(20000, 0.001);
  std::vector<double> slow, fast;
  for (const double t : time) {
    slow.push_back(std::sin(2 * t) + 1e-3 * normal(random));
    fast.push_back(std::sin(2 * M_PI * 25 * t) + 1e-3 * normal(random));
  }
  const WindowChoice wide = choose_window(time, slow), narrow = choose_window(time, fast);
  EXPECT_GE(wide.polynomial.window, 101);
  EXPECT_LT(narrow.polynomial.window, 20);
  EXPECT_NEAR(wide.noise, 1e-3, 1e-4);
  EXPECT_EQ(wide.step, 0);
  // At 25 Hz the derivative must not lose more than a percent.
  EXPECT_GT(narrow.pass_band, 25);
}

TEST(ChooseWindow, sees_the_steps_of_an_encoder) {
  const double step = 2 * M_PI / 8000;
  const auto time = even_time(20000, 0.002);
  std::vector<double> x;
  for (const double t : time) x.push_back(step * std::floor(1.1 * std::sin(1.3 * t) / step));
  const WindowChoice choice = choose_window(time, x);
  EXPECT_NEAR(choice.step, step, 1e-9);
  EXPECT_GE(choice.noise, 0.99 * step / std::sqrt(12.0));
}

TEST(Differentiate, refuses_an_even_window) {
  const auto time = even_time(50, 0.001);
  EXPECT_THROW((void)differentiate(time, time, {.window = 10, .order = 3}), std::invalid_argument);
  EXPECT_THROW((void)differentiate(time, time, {.window = 3, .order = 3}), std::invalid_argument);
}
