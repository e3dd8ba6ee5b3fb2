// Columns without what the model's own parameters make of them.
#include "isac/explain/projection.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>

#include "isac/explain/screen.hpp"

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

}  // namespace
}  // namespace isac::explain
