#include "isac/estimate/linear_algebra.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace isac::estimate {

using Eigen::MatrixXd, Eigen::VectorXd;

VectorXd solve_symmetric(const MatrixXd& a, const VectorXd& b) {
  return a.ldlt().solve(b);
}

MatrixXd solve_symmetric_each(const MatrixXd& a, const MatrixXd& b) {
  return a.ldlt().solve(b);
}

MatrixXd inverse_symmetric(const MatrixXd& a) {
  return solve_symmetric_each(a, MatrixXd::Identity(a.rows(), a.cols()));
}

MatrixXd gram_of(const MatrixXd& x) {
  MatrixXd lower = MatrixXd::Zero(x.cols(), x.cols());
  lower.selfadjointView<Eigen::Lower>().rankUpdate(x.transpose());
  return lower.selfadjointView<Eigen::Lower>();
}

MatrixXd inverse_square(const MatrixXd& a) {
  return a.inverse();
}

VectorXd Cholesky::solve(const VectorXd& b) const {
  return lower.triangularView<Eigen::Lower>().transpose().solve(whiten(b));
}

VectorXd Cholesky::whiten(const VectorXd& b) const {
  return lower.triangularView<Eigen::Lower>().solve(b);
}

MatrixXd Cholesky::whiten_each(const MatrixXd& columns) const {
  return lower.triangularView<Eigen::Lower>().solve(columns);
}

Cholesky cholesky(const MatrixXd& a) {
  const Eigen::LLT<MatrixXd> factor(a);
  return {factor.info() == Eigen::Success, factor.matrixL()};
}

SymmetricEigen symmetric_eigen(const MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> found(a);
  return {found.info() == Eigen::Success, found.eigenvalues(), found.eigenvectors()};
}

VectorXd least_squares(const MatrixXd& x, const VectorXd& y) {
  return x.colPivHouseholderQr().solve(y);
}

MatrixXd column_basis(const MatrixXd& x, double threshold) {
  Eigen::ColPivHouseholderQR<MatrixXd> qr(x);
  qr.setThreshold(threshold);
  return qr.householderQ() * MatrixXd::Identity(x.rows(), qr.rank());
}

VectorXd singular_values(const MatrixXd& x) {
  return Eigen::JacobiSVD<MatrixXd>(x).singularValues();
}

}  // namespace isac::estimate
