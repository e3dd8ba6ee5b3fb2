// Dense linear algebra of a fit's size (unknowns, not samples): Eigen's decompositions behind plain functions, so that their
// templates are compiled once and not in every file that solves a system (docs/decisions/0163).
// Shapes are asserted by Eigen; nothing throws. A singular system gives what Eigen gives: ask `positive` or the eigenvalues first.
// Source: Golub, Van Loan, Matrix Computations, 4th ed., sections 4.2 (Cholesky, L D Lᵀ), 5.2 and 5.4 (QR, rank), 8.3 (symmetric
// eigenvalues).
#pragma once

#include <Eigen/Core>

namespace isac::estimate {

/// A = L D Lᵀ of a symmetric positive (semi)definite n × n matrix, with pivots.
/// solve_symmetric: A x = b, b of n; solve_symmetric_each: A X = B, B n × k.
Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);
Eigen::MatrixXd solve_symmetric_each(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
/// A⁻¹ by the same factors.
Eigen::MatrixXd inverse_symmetric(const Eigen::MatrixXd& a);

/// XᵀX of an m × n matrix, by half of a product's work.
Eigen::MatrixXd gram_of(const Eigen::MatrixXd& x);

/// A⁻¹ of any square matrix (LU with partial pivots); what is not finite in it says that A is singular.
Eigen::MatrixXd inverse_square(const Eigen::MatrixXd& a);

/// A = L Lᵀ, no pivots: `positive` is false where A is not positive definite, and then nothing else holds.
struct Cholesky {
  bool positive = false;
  Eigen::MatrixXd lower;  ///< L, zeros above the diagonal

  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& b) const;              ///< A⁻¹ b
  [[nodiscard]] Eigen::VectorXd whiten(const Eigen::VectorXd& b) const;             ///< L⁻¹ b
  [[nodiscard]] Eigen::MatrixXd whiten_each(const Eigen::MatrixXd& columns) const;  ///< L⁻¹ B
};
Cholesky cholesky(const Eigen::MatrixXd& a);

/// A = V diag(λ) Vᵀ of a symmetric matrix, λ ascending, V's columns of unit length.
struct SymmetricEigen {
  bool converged = false;
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& a);

/// min |X β − y|, X m × n with m >= n, by QR with column pivots: no square of X's condition.
Eigen::VectorXd least_squares(const Eigen::MatrixXd& x, const Eigen::VectorXd& y);
/// An orthonormal basis of X's columns, m × rank; a pivot below `threshold` of the largest is none.
Eigen::MatrixXd column_basis(const Eigen::MatrixXd& x, double threshold);
/// Singular values, descending.
Eigen::VectorXd singular_values(const Eigen::MatrixXd& x);

}  // namespace isac::estimate
