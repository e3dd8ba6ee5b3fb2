#include "isac/series/statistics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

using namespace isac::series;

TEST(Statistics, orders_and_spreads_skip_missing_samples) {
  const std::vector<double> x{3, std::nan(""), 1, 2, 100};
  EXPECT_DOUBLE_EQ(median(x), 2.5);
  EXPECT_DOUBLE_EQ(quantile(x, 1.0), 100);
  EXPECT_NEAR(robust_deviation(x), 1.482602218505602 * 1.0, 1e-15);
  EXPECT_TRUE(std::isnan(median({})));
}

TEST(Statistics, tail_probabilities_are_those_of_the_tables) {
  EXPECT_NEAR(student_t_limit(0.95, 10), 2.228139, 1e-6);
  EXPECT_NEAR(student_t_limit(0.95, 1e9), 1.959964, 1e-6);
  EXPECT_NEAR(normal_two_sided_limit(0.05), 1.959964, 1e-6);
  EXPECT_NEAR(normal_two_sided_limit(1e-20), 9.3363, 1e-3);  // 1 − p is 1 there
  EXPECT_TRUE(std::isnan(normal_two_sided_limit(0)));
  EXPECT_NEAR(student_t_two_sided(2.228139, 10), 0.05, 1e-7);
  EXPECT_NEAR(chi_square_upper(18.307038, 10), 0.05, 1e-8);
}

TEST(Statistics, correlation_time_of_a_first_order_process_is_that_of_theory) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<std::vector<double>> pieces(4, std::vector<double>(20000));
  const double a = 0.9;
  for (auto& piece : pieces) {
    double x = 0;
    for (double& v : piece) v = x = a * x + normal(random);
  }
  // 1/2 + Σ a^k = 1/2 + a/(1 − a) = 9.5; 80 000 samples leave about 5 %.
  EXPECT_NEAR(correlation_time(pieces), 9.5, 1.5);
}

TEST(Statistics, correlation_time_sums_every_lag_of_pieces_of_any_length) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<std::vector<double>> pieces;
  for (const std::size_t length : {0, 1, 2, 7, 9, 40, 400}) {
    double x = 0;
    pieces.emplace_back(length);
    for (double& v : pieces.back()) v = x = 0.8 * x + normal(random) + 3;
  }
  // As it is written: a lag after another, until the window is five times what it has found.
  double mean = 0, count = 0;
  for (const auto& piece : pieces)
    for (const double v : piece) mean += v, ++count;
  mean /= count;
  const auto covariance = [&](std::size_t lag) {
    double sum = 0;
    for (const auto& piece : pieces)
      for (std::size_t i = lag; i < piece.size(); ++i) sum += (piece[i] - mean) * (piece[i - lag] - mean);
    return sum;
  };
  double tau = 0.5;
  for (std::size_t lag = 1; lag < 200; ++lag) {
    tau += covariance(lag) / covariance(0);
    if (static_cast<double>(lag) >= 5 * std::max(tau, 0.5)) break;
  }
  EXPECT_DOUBLE_EQ(correlation_time(pieces), tau);
}

TEST(Statistics, ljung_box_passes_white_noise_and_refuses_coloured) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  int rejected = 0;
  for (int run = 0; run < 400; ++run) {
    std::vector<std::vector<double>> pieces(2, std::vector<double>(300));
    for (auto& piece : pieces)
      for (double& v : piece) v = normal(random);
    if (ljung_box(pieces, 20).p_value < 0.05) ++rejected;
  }
  // 20 expected of 400, standard deviation 4.4; four of them.
  EXPECT_NEAR(rejected, 20, 18);
  std::vector<std::vector<double>> coloured(1, std::vector<double>(600));
  double x = 0;
  for (double& v : coloured[0]) v = x = 0.5 * x + normal(random);
  EXPECT_LT(ljung_box(coloured, 20).p_value, 1e-6);
}
