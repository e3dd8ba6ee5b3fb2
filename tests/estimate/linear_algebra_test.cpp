// The functions behind which Eigen's decompositions are compiled once: each against what defines it, not against the decomposition.
#include "isac/estimate/linear_algebra.hpp"

#include <gtest/gtest.h>

#include <random>

namespace isac::estimate {
namespace {

using Eigen::MatrixXd, Eigen::VectorXd;

MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  MatrixXd out(rows, columns);
  for (Eigen::Index c = 0; c < columns; ++c)
    for (Eigen::Index r = 0; r < rows; ++r) out(r, c) = normal(generator);
  return out;
}

MatrixXd positive_definite(Eigen::Index n, unsigned seed) {
  const MatrixXd x = random_matrix(3 * n, n, seed);
  return x.transpose() * x;
}

TEST(LinearAlgebra, solves_and_inverts_what_it_is_given) {
  const MatrixXd a = positive_definite(7, 1), b = random_matrix(7, 3, 2);
  const VectorXd first = b.col(0);
  EXPECT_LT((a * solve_symmetric(a, first) - first).norm(), 1e-12 * a.norm());
  EXPECT_LT((a * solve_symmetric_each(a, b) - b).norm(), 1e-12 * a.norm());
  EXPECT_LT((a * inverse_symmetric(a) - MatrixXd::Identity(7, 7)).norm(), 1e-11);
  const MatrixXd skew = random_matrix(5, 5, 3);
  EXPECT_LT((skew * inverse_square(skew) - MatrixXd::Identity(5, 5)).norm(), 1e-11);
  EXPECT_FALSE(inverse_square(MatrixXd::Zero(3, 3)).allFinite());
}

TEST(LinearAlgebra, gram_is_the_product_in_both_halves) {
  const MatrixXd x = random_matrix(50, 7, 4), gram = gram_of(x);
  EXPECT_LT((gram - x.transpose() * x).norm(), 1e-13 * gram.norm());
  EXPECT_EQ(gram, gram.transpose());
}

TEST(LinearAlgebra, root_is_triangular_whitens_and_says_where_there_is_none) {
  const MatrixXd a = positive_definite(6, 4), b = random_matrix(6, 2, 5);
  const Cholesky root = cholesky(a);
  ASSERT_TRUE(root.positive);
  EXPECT_LT((root.lower * root.lower.transpose() - a).norm(), 1e-12 * a.norm());
  for (Eigen::Index r = 0; r < 6; ++r)
    for (Eigen::Index c = r + 1; c < 6; ++c) EXPECT_EQ(root.lower(r, c), 0.0);
  const VectorXd first = b.col(0);
  EXPECT_LT((root.lower * root.whiten(first) - first).norm(), 1e-12);
  EXPECT_LT((root.lower * root.whiten_each(b) - b).norm(), 1e-12);
  EXPECT_LT((a * root.solve(first) - first).norm(), 1e-11);
  EXPECT_FALSE(cholesky(a - 2 * a.norm() * MatrixXd::Identity(6, 6)).positive);
}

TEST(LinearAlgebra, eigenvalues_ascend_and_make_the_matrix_again) {
  const MatrixXd a = positive_definite(9, 6);
  const SymmetricEigen eigen = symmetric_eigen(a);
  ASSERT_TRUE(eigen.converged);
  for (Eigen::Index k = 1; k < 9; ++k) EXPECT_LE(eigen.values[k - 1], eigen.values[k]);
  EXPECT_LT((eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose() - a).norm(),
            1e-12 * a.norm());
  EXPECT_LT((eigen.vectors.transpose() * eigen.vectors - MatrixXd::Identity(9, 9)).norm(), 1e-12);
}

TEST(LinearAlgebra, least_squares_leave_what_no_column_can_take) {
  const MatrixXd x = random_matrix(40, 5, 7);
  const VectorXd y = random_matrix(40, 1, 8);
  EXPECT_LT((x.transpose() * (y - x * least_squares(x, y))).norm(), 1e-12 * x.norm());
}

TEST(LinearAlgebra, basis_spans_the_columns_and_leaves_out_those_that_others_make_up) {
  MatrixXd x = random_matrix(30, 4, 9);
  x.col(3) = 2 * x.col(0) - x.col(1);
  const MatrixXd basis = column_basis(x, 1e-6);
  ASSERT_EQ(basis.cols(), 3);
  EXPECT_LT((basis.transpose() * basis - MatrixXd::Identity(3, 3)).norm(), 1e-12);
  EXPECT_LT((x - basis * (basis.transpose() * x)).norm(), 1e-12 * x.norm());
}

TEST(LinearAlgebra, singular_values_descend_and_their_squares_are_the_grams_eigenvalues) {
  const MatrixXd x = random_matrix(20, 4, 10);
  const VectorXd singular = singular_values(x), squared = symmetric_eigen(x.transpose() * x).values.reverse();
  EXPECT_LT((singular.array().square().matrix() - squared).norm(), 1e-11 * squared.norm());
  EXPECT_GE(singular[0], singular[3]);
}

}  // namespace
}  // namespace isac::estimate
