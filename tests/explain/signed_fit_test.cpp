// A few amplitudes within their signs: what is left meets the conditions of the least squares' own minimum, and nothing else does.
#include "isac/explain/signed_fit.hpp"

#include <gtest/gtest.h>

#include <random>

namespace isac::explain {
namespace {

constexpr Eigen::Index kRows = 40;

Eigen::MatrixXd drawn(Eigen::Index columns, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd x(kRows, columns);
  for (double& v : x.reshaped()) v = normal(random);
  return x;
}

TEST(SignedFit, meets_the_conditions_of_the_minimum_whatever_signs_are_allowed) {
  std::mt19937_64 random(3);
  int held_back = 0;
  for (int draw = 0; draw < 400; ++draw) {
    const Eigen::Index n = 1 + draw % 4;
    const Eigen::MatrixXd x = drawn(n, random);
    const Eigen::VectorXd r = drawn(1, random) + x.rowwise().sum() * (draw % 3 - 1) * 0.2;
    std::vector<bool> positive;
    for (Eigen::Index j = 0; j < n; ++j) positive.push_back(random() % 2 == 0);
    const SignedFit fit = signed_fit(x.transpose() * x, x.transpose() * r, positive);
    const Eigen::VectorXd left = r - x * fit.amplitude, slope = x.transpose() * left;
    EXPECT_NEAR(fit.gain, r.squaredNorm() - left.squaredNorm(), 1e-4 * r.squaredNorm());
    for (Eigen::Index j = 0; j < n; ++j) {
      const double scale = x.col(j).norm() * r.norm();
      if (!positive[static_cast<std::size_t>(j)] || fit.amplitude[j] != 0) {
        EXPECT_NEAR(slope[j], 0, 1e-5 * scale);
      } else {
        EXPECT_LE(slope[j], 1e-5 * scale);  // more of it would need the other sign
        ++held_back;
      }
      EXPECT_TRUE(!positive[static_cast<std::size_t>(j)] || fit.amplitude[j] >= 0);
    }
  }
  EXPECT_GT(held_back, 100);
}

TEST(SignedFit, gains_nothing_where_every_column_would_need_the_other_sign_or_is_not_there) {
  std::mt19937_64 random(4);
  const Eigen::MatrixXd x = drawn(2, random);
  const Eigen::VectorXd against = -x.rowwise().sum();
  EXPECT_EQ(signed_fit(x.transpose() * x, x.transpose() * against, {true, true}).gain, 0);
  Eigen::MatrixXd half = x;
  half.col(1).setZero();
  const SignedFit alone = signed_fit(half.transpose() * half, half.transpose() * against, {false, false});
  EXPECT_EQ(alone.amplitude[1], 0);
  EXPECT_GT(alone.gain, 0);
}

TEST(SignedFit, gives_what_two_columns_do_alike_to_both_of_them) {
  std::mt19937_64 random(5);
  Eigen::MatrixXd x = drawn(2, random);
  x.col(1) = x.col(0);
  const Eigen::VectorXd r = 3 * x.col(0);
  const SignedFit fit = signed_fit(x.transpose() * x, x.transpose() * r, {false, false});
  EXPECT_NEAR(fit.amplitude.sum(), 3, 1e-4);
  EXPECT_NEAR(fit.gain, r.squaredNorm(), 1e-4 * r.squaredNorm());
}

}  // namespace
}  // namespace isac::explain
