// Columns without what the model's own parameters make of them.
#include "isac/explain/projection.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/estimate/linear_algebra.hpp"

namespace isac::explain {
namespace {

Eigen::MatrixXd basis(Eigen::Index rows, Eigen::Index columns) {
  return basis_of(Eigen::MatrixXd::Random(rows, columns));
}

// Rows that do and do not fill a block or a step of four, columns that do and do not fill a group.
TEST(Projection, agrees_with_the_products_whatever_the_shape) {
  std::srand(1);
  for (const Eigen::Index rows : {17, 512, 1027, 3000})
    for (const Eigen::Index parameters : {0, 1, 2, 3, 5, 8, 15})
      for (const Eigen::Index columns : {1, 2, 4, 7, 16}) {
        SCOPED_TRACE(testing::Message() << rows << " rows, " << parameters << ", " << columns);
        const Eigen::MatrixXd b = basis(rows, parameters), x = Eigen::MatrixXd::Random(rows, columns);
        Eigen::MatrixXd left = x;
        take_out(b, left);
        const Eigen::MatrixXd expected = x - b * (b.transpose() * x);
        EXPECT_LT((left - expected).cwiseAbs().maxCoeff(), 1e-13);
        EXPECT_LT((b.transpose() * left).norm(), 1e-12);
      }
}

TEST(Projection, leaves_nothing_of_what_lies_in_the_basis_and_all_of_what_does_not) {
  std::srand(2);
  const Eigen::MatrixXd all = basis(900, 9), b = all.leftCols(6);
  Eigen::MatrixXd inside = b * Eigen::MatrixXd::Random(6, 5), beside = all.rightCols(3);
  take_out(b, inside);
  EXPECT_LT(inside.cwiseAbs().maxCoeff(), 1e-13);
  take_out(b, beside);
  EXPECT_LT((beside - all.rightCols(3)).cwiseAbs().maxCoeff(), 1e-13);
}

TEST(Projection, spoils_no_column_but_the_one_that_is_not_finite) {
  std::srand(3);
  const Eigen::MatrixXd b = basis(600, 4);
  Eigen::MatrixXd x = Eigen::MatrixXd::Random(600, 5);
  x(77, 2) = std::numeric_limits<double>::quiet_NaN();
  take_out(b, x);
  for (Eigen::Index q = 0; q < x.cols(); ++q) EXPECT_EQ(x.col(q).allFinite(), q != 2);
}

// What the fit took of each block's noise comes back: (1 − B_b B_bᵀ)^½ r′_b = r_b, by a matrix as large as the block.
TEST(ShareOfFit, comes_back_block_by_block) {
  std::srand(4);
  constexpr Eigen::Index kRows = 240, kBlocks = 8;
  const Eigen::MatrixXd b = basis(kRows, 5);
  Eigen::MatrixXd noise = Eigen::MatrixXd::Random(kRows, 1);
  take_out(b, noise);
  std::vector<Eigen::Index> block;  // rows of different chains lie apart
  for (Eigen::Index i = 0; i < kRows; ++i) block.push_back(i % kBlocks);
  const Eigen::VectorXd scaled = with_share_of_fit(b, noise, block, kBlocks);
  for (Eigen::Index of = 0; of < kBlocks; ++of) {
    std::vector<Eigen::Index> rows;
    for (Eigen::Index i = of; i < kRows; i += kBlocks) rows.push_back(i);
    const Eigen::MatrixXd part = b(rows, Eigen::all),
                          left =
                              Eigen::MatrixXd::Identity(part.rows(), part.rows()) - part * part.transpose();
    const Eigen::VectorXd r = noise(rows, Eigen::all), more = scaled(rows);
    EXPECT_NEAR((estimate::symmetric_eigen(left).vectors *
                     estimate::symmetric_eigen(left).values.cwiseMax(0).cwiseSqrt().asDiagonal() *
                     estimate::symmetric_eigen(left).vectors.transpose() * more -
                 r)
                    .norm(),
                0, 1e-10)
        << of;
  }
}

// Slow functions of which each block holds a large part, beside slow parameters: blocks of what a fit left scatter less than its scores do.
TEST(ShareOfFit, lets_blocks_scatter_as_their_sum_does) {
  constexpr Eigen::Index kRows = 400, kBlocks = 10;
  Eigen::MatrixXd slow(kRows, 6), x(kRows, 1);
  for (Eigen::Index i = 0; i < kRows; ++i) {
    const double t = (static_cast<double>(i) + 0.5) / kRows;
    for (Eigen::Index p = 0; p < slow.cols(); ++p) slow(i, p) = std::cos(kPi * static_cast<double>(p) * t);
    x(i, 0) = std::abs(t - 0.4);
  }
  const Eigen::MatrixXd b = basis_of(slow);
  take_out(b, x);
  std::vector<Eigen::Index> block;
  for (Eigen::Index i = 0; i < kRows; ++i) block.push_back(i * kBlocks / kRows);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  double of_residual = 0, of_noise = 0, of_sum = 0;
  for (int draw = 0; draw < 2000; ++draw) {
    Eigen::MatrixXd r(kRows, 1);
    for (Eigen::Index i = 0; i < kRows; ++i) r(i, 0) = normal(random);
    take_out(b, r);
    const Eigen::VectorXd scaled = with_share_of_fit(b, r, block, kBlocks);
    of_sum += std::pow(x.col(0).dot(r.col(0)), 2);
    for (Eigen::Index of = 0; of < kBlocks; ++of) {
      const Eigen::Index from = of * kRows / kBlocks, count = kRows / kBlocks;
      of_residual += std::pow(x.col(0).segment(from, count).dot(r.col(0).segment(from, count)), 2);
      of_noise += std::pow(x.col(0).segment(from, count).dot(scaled.segment(from, count)), 2);
    }
  }
  EXPECT_GT(of_sum / of_residual, 1.3);
  EXPECT_NEAR(of_sum / of_noise, 1, 0.1);
}

}  // namespace
}  // namespace isac::explain
