// The baselines must do what their papers say, or beating them means nothing: known truth in, the same out.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "latent.hpp"
#include "network.hpp"
#include "sparse.hpp"

namespace baselines {
namespace {

struct Problem {
  Eigen::MatrixXf x;
  Eigen::VectorXd y;
  std::vector<unsigned> run;
  std::vector<Sums> blocks, runs;
};

/// Twenty columns of unit rms, every fifth like its neighbour; 0.5 of the third and −0.3 of the eighth, unit noise.
Problem problem(std::uint32_t seed, bool empty = false) {
  constexpr Eigen::Index kRows = 6000, kColumns = 20, kRuns = 6;
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss;
  Problem p;
  p.x = Eigen::MatrixXf::NullaryExpr(kRows, kColumns, [&] { return static_cast<float>(gauss(random)); });
  for (Eigen::Index j = 4; j < kColumns; j += 5)
    p.x.col(j) = 0.9F * p.x.col(j - 1) + std::sqrt(0.19F) * p.x.col(j);
  p.y = Eigen::VectorXd::NullaryExpr(kRows, [&] { return gauss(random); });
  if (!empty) p.y += 0.5 * p.x.col(2).cast<double>() - 0.3 * p.x.col(7).cast<double>();
  for (Eigen::Index i = 0; i < kRows; ++i) p.run.push_back(static_cast<unsigned>(i * kRuns / kRows));
  const auto cut = [&](Eigen::Index rows, std::vector<Sums>& parts) {
    for (Eigen::Index at = 0; at < kRows; at += rows) {
      const Eigen::MatrixXd part = p.x.middleRows(at, rows).cast<double>();
      const Eigen::VectorXd target = p.y.segment(at, rows);
      parts.push_back({part.transpose() * part, part.transpose() * target, target.squaredNorm(),
                       static_cast<double>(rows)});
    }
  };
  cut(200, p.blocks);
  cut(kRows / kRuns, p.runs);
  return p;
}

TEST(Baselines, stlsq_keeps_the_terms_that_are_there_first) {
  const Problem p = problem(1);
  const Terms t = stlsq(p.runs);
  ASSERT_GE(t.columns.size(), 2U);
  EXPECT_LT(t.columns.size(), 5U) << "one standard error leaves little to chance";
  EXPECT_EQ(t.columns[0], 2);
  EXPECT_EQ(t.columns[1], 7);
  EXPECT_NEAR(t.coefficients[0], 0.5, 0.04);  // three of its standard errors, 1/√6000
  EXPECT_NEAR(t.coefficients[1], -0.3, 0.04);
  EXPECT_TRUE(threshold(add(p.blocks), {.limit = 1.0}).columns.empty());
}

TEST(Baselines, the_ensemble_is_sure_of_what_is_there_and_drops_chance) {
  const Problem p = problem(2);
  const Terms t = ensemble(p.runs, p.blocks, 1);
  ASSERT_GE(t.columns.size(), 2U);
  EXPECT_EQ(t.columns[0], 2);
  EXPECT_EQ(t.columns[1], 7);
  EXPECT_GT(t.probability[1], 0.95);
}

TEST(Baselines, frols_takes_the_largest_error_reduction_and_stops_where_left_out_runs_get_worse) {
  const Problem p = problem(3);
  const Terms t = frols(p.x, p.y, p.run, 10);
  ASSERT_GE(t.columns.size(), 2U);
  EXPECT_LT(t.columns.size(), 5U);
  EXPECT_EQ(t.columns[0], 2);
  EXPECT_EQ(t.columns[1], 7);
  EXPECT_NEAR(t.coefficients[1], -0.3, 0.04);
  const Problem none = problem(4, true);
  EXPECT_LT(frols(none.x, none.y, none.run, 10).columns.size(), 3U);
}

TEST(Baselines, latent_force_is_smoothed_out_of_noise) {
  std::mt19937 random(5);
  std::normal_distribution<double> gauss;
  std::vector<Piece> pieces(2);
  double raw = 0, left = 0;
  for (Piece& piece : pieces) {
    piece.spacing = 0.008;
    for (int k = 0; k < 2500; ++k) piece.y.push_back(1.5 * std::sin(2.0 * k * piece.spacing) + gauss(random));
  }
  const Latent latent = latent_force(pieces);
  for (std::size_t p = 0; p < pieces.size(); ++p)
    for (std::size_t k = 0; k < pieces[p].y.size(); ++k) {
      const double truth = 1.5 * std::sin(2.0 * static_cast<double>(k) * 0.008);
      raw += std::pow(pieces[p].y[k] - truth, 2);
      left += std::pow(latent.mean[p][k] - truth, 2);
    }
  EXPECT_LT(left, 0.05 * raw);  // about 40 rows in one length
  EXPECT_GE(latent.length, 0.3);
}

TEST(Baselines, network_learns_a_shape_that_no_term_describes) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const Eigen::MatrixXd z = Eigen::MatrixXd::NullaryExpr(2, 8000, [&] { return uniform(random); });
  const auto shape = [](const Eigen::VectorXd& v) { return std::tanh(4 * v[0]) * v[1]; };
  Eigen::VectorXd y(z.cols());
  std::vector<unsigned> run;
  for (Eigen::Index i = 0; i < z.cols(); ++i) {
    y[i] = shape(z.col(i));
    run.push_back(static_cast<unsigned>(i / 800));
  }
  const Network network(z, y, run, 1);
  double left = 0, all = 0;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector2d at(uniform(random), uniform(random));
    left += std::pow(network(at) - shape(at), 2);
    all += std::pow(shape(at), 2);
  }
  EXPECT_LT(left, 0.05 * all);
}

}  // namespace
}  // namespace baselines
