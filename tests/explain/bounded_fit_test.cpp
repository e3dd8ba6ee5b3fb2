#include "isac/explain/bounded_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

using namespace isac::explain;

namespace {

TEST(BoundedQuadratic, is_where_no_point_of_a_fine_grid_is_lower) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (int round = 0; round < 200; ++round) {
    Eigen::Matrix2d root;
    for (int i = 0; i < 4; ++i) root(i / 2, i % 2) = normal(random);
    const Eigen::MatrixXd H = root.transpose() * root + 0.1 * Eigen::Matrix2d::Identity();
    Eigen::VectorXd g(2), lower(2), upper(2);
    for (int i = 0; i < 2; ++i) {
      g[i] = normal(random);
      lower[i] = -std::abs(normal(random));
      upper[i] = std::abs(normal(random));
    }
    const auto value = [&](const Eigen::VectorXd& d) { return 0.5 * d.dot(H * d) + g.dot(d); };
    const Eigen::VectorXd best = bounded_quadratic(H, g, lower, upper);
    ASSERT_TRUE((best.array() >= lower.array()).all() && (best.array() <= upper.array()).all());
    for (int i = 0; i <= 60; ++i)
      for (int j = 0; j <= 60; ++j) {
        Eigen::VectorXd d(2);
        d << lower[0] + (upper[0] - lower[0]) * i / 60, lower[1] + (upper[1] - lower[1]) * j / 60;
        ASSERT_GE(value(d), value(best) - 1e-12);
      }
  }
}

/// r = J x − y with columns that lean on each other; the best point lies on a bound.
TEST(BoundedFit, finds_a_linear_best_point_on_a_bound_in_one_step) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd J(400, 3);
  Eigen::VectorXd y(400);
  for (int i = 0; i < 400; ++i) {
    const double common = normal(random);
    for (int j = 0; j < 3; ++j) J(i, j) = common + 0.1 * normal(random);
    y[i] = 3 * J(i, 0) - 2 * J(i, 1) + J(i, 2);
  }
  const Evaluate linear = [&](const Eigen::VectorXd& x, Eigen::VectorXd& r, Eigen::MatrixXd* jacobian) {
    r = J * x - y;
    if (jacobian != nullptr) *jacobian = J;
    return true;
  };
  const Eigen::Vector3d lower(-0.5, -0.5, -0.5), upper(0.5, 5, 5);
  int slopes = 0;
  const Evaluate counted = [&](const Eigen::VectorXd& x, Eigen::VectorXd& r, Eigen::MatrixXd* jacobian) {
    slopes += jacobian != nullptr;
    return linear(x, r, jacobian);
  };
  const BoundedFit fit = bounded_fit(counted, Eigen::Vector3d(0, 0, 0), lower, upper);
  EXPECT_TRUE(fit.converged);
  EXPECT_EQ(fit.rounds, 1);
  EXPECT_EQ(slopes, 1);  // the step closed what it promised: no others are asked for
  EXPECT_TRUE(fit.curvature.isApprox(J.transpose() * J));
  EXPECT_EQ(fit.x[0], 0.5);
  // Against a second method: slope towards the inside nowhere.
  const Eigen::VectorXd slope = J.transpose() * fit.residual;
  for (int j = 0; j < 3; ++j) {
    const double scale = J.col(j).squaredNorm();
    if (fit.x[j] > lower[j] && fit.x[j] < upper[j]) {
      EXPECT_NEAR(slope[j] / scale, 0, 1e-9);
    }
    if (fit.x[j] == lower[j]) {
      EXPECT_GE(slope[j], 0);
    }
    if (fit.x[j] == upper[j]) {
      EXPECT_LE(slope[j], 0);
    }
  }
}

TEST(BoundedFit, follows_a_bent_valley) {
  const Evaluate rosenbrock = [](const Eigen::VectorXd& x, Eigen::VectorXd& r, Eigen::MatrixXd* jacobian) {
    r.resize(2);
    r << 10 * (x[1] - x[0] * x[0]), 1 - x[0];
    if (jacobian != nullptr) {
      jacobian->resize(2, 2);
      *jacobian << -20 * x[0], 10, -1, 0;
    }
    return true;
  };
  const Eigen::Vector2d wide(9, 9);
  const BoundedFit free =
      bounded_fit(rosenbrock, Eigen::Vector2d(-1.2, 1), -wide, wide, {.rounds = 200, .tolerance = 1e-12});
  EXPECT_NEAR(free.x[0], 1, 1e-5);
  EXPECT_NEAR(free.x[1], 1, 1e-5);
  // Held below a half, the best point is on the bound and in the valley.
  const BoundedFit held = bounded_fit(rosenbrock, Eigen::Vector2d(-1.2, 1), -wide, Eigen::Vector2d(0.5, 9),
                                      {.rounds = 200, .tolerance = 1e-12});
  EXPECT_NEAR(held.x[0], 0.5, 1e-9);
  EXPECT_NEAR(held.x[1], 0.25, 1e-6);
}

TEST(BoundedFit, leaves_alone_what_the_data_do_not_feel) {
  // Within the second's reach nothing changes but by the rounding of its slope; beyond, the loss is a wall.
  const Evaluate line_before_a_wall = [](const Eigen::VectorXd& x, Eigen::VectorXd& r,
                                         Eigen::MatrixXd* jacobian) {
    r = Eigen::VectorXd::Constant(100, 30 * (x[0] - 1)) + Eigen::VectorXd::LinSpaced(100, -1, 1);
    if (x[1] < 0.5) r.array() += 1e3 * (0.5 - x[1]);
    if (jacobian != nullptr) {
      jacobian->resize(100, 2);
      jacobian->col(0).setConstant(30);
      jacobian->col(1) = Eigen::VectorXd::LinSpaced(100, -1e-7, 1e-7);
    }
    return true;
  };
  const BoundedFit fit = bounded_fit(line_before_a_wall, Eigen::Vector2d(3, 0.6), Eigen::Vector2d(-9, 0),
                                     Eigen::Vector2d(9, 2), {.rounds = 6});
  EXPECT_NEAR(fit.x[0], 1, 1e-6);
  EXPECT_EQ(fit.x[1], 0.6);
}

TEST(BoundedFit, says_that_it_stopped_where_nothing_is_defined) {
  const Evaluate nowhere = [](const Eigen::VectorXd&, Eigen::VectorXd&, Eigen::MatrixXd*) { return false; };
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(1);
  EXPECT_FALSE(bounded_fit(nowhere, 0 * one, -one, one).converged);
}

}  // namespace
