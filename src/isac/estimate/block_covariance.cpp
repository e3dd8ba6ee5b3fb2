#include "isac/estimate/block_covariance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/estimate/linear_algebra.hpp"

namespace isac::estimate {

BlockCovariance block_covariance(const std::vector<BlockSums>& blocks, const Prior& prior) {
  BlockCovariance out;
  if (blocks.empty()) return out;
  const Eigen::Index n = blocks.front().score.size();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  out.covariance = Eigen::MatrixXd::Constant(n, n, kNan);
  out.degrees_of_freedom = Eigen::VectorXd::Constant(n, kNan);
  Eigen::MatrixXd bread = Eigen::MatrixXd::Zero(n, n);
  for (const BlockSums& block : blocks) bread += block.curvature;
  if (prior.curvature.size() == n) bread.diagonal() += prior.curvature;
  const SymmetricEigen eigen = symmetric_eigen(bread);
  if (!eigen.converged || !(eigen.values.minCoeff() > 0)) return out;
  const Eigen::VectorXd sizes = eigen.values.cwiseSqrt();
  const Eigen::MatrixXd root = eigen.vectors * sizes.asDiagonal() * eigen.vectors.transpose();
  const Eigen::MatrixXd inverse_root =
      eigen.vectors * sizes.cwiseInverse().asDiagonal() * eigen.vectors.transpose();
  const Eigen::MatrixXd inverse = inverse_root * inverse_root;

  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd trace = Eigen::VectorXd::Zero(n), square = Eigen::VectorXd::Zero(n);
  std::vector<Eigen::MatrixXd> cross(static_cast<std::size_t>(n), Eigen::MatrixXd::Zero(n, n));
  for (const BlockSums& block : blocks) {
    const Eigen::MatrixXd share = inverse_root * block.curvature * inverse_root;
    const SymmetricEigen own = symmetric_eigen(share);
    // A block that alone carries a direction leaves nothing to estimate its error from; the cap keeps the sum finite and the
    // degrees of freedom then say how little is known.
    const Eigen::VectorXd stretch = (1.0 - own.values.array()).max(1e-3).rsqrt();
    const Eigen::MatrixXd adjust =
        root * own.vectors * stretch.asDiagonal() * own.vectors.transpose() * inverse_root;
    const Eigen::VectorXd score = adjust * block.score;
    meat += score * score.transpose();
    // Bell–McCaffrey: with white noise the quadratic form of parameter k has the matrix D − PᵀP over blocks.
    const Eigen::MatrixXd weights =
        adjust.transpose() * inverse;  // column k: how the block enters parameter k
    for (Eigen::Index k = 0; k < n; ++k) {
      const Eigen::VectorXd a = weights.col(k);
      const Eigen::VectorXd spread = block.curvature * a;
      const double own_part = a.dot(spread);
      const Eigen::VectorXd p = inverse_root * spread;
      trace[k] += own_part - p.squaredNorm();
      square[k] += own_part * own_part - 2.0 * own_part * p.squaredNorm();
      cross[static_cast<std::size_t>(k)] += p * p.transpose();
    }
  }
  out.covariance = inverse * meat * inverse;
  for (Eigen::Index k = 0; k < n; ++k) {
    const double norm = square[k] + cross[static_cast<std::size_t>(k)].squaredNorm();
    out.degrees_of_freedom[k] = norm > 0 ? std::max(1.0, trace[k] * trace[k] / norm) : 1.0;
  }
  if (prior.score_variance.size() == n) {
    const Eigen::MatrixXd known = inverse * prior.score_variance.asDiagonal() * inverse;
    for (Eigen::Index k = 0; k < n; ++k) {
      const double seen = out.covariance(k, k), ratio = seen > 0 ? 1.0 + known(k, k) / seen : 1e3;
      out.degrees_of_freedom[k] *= std::min(ratio * ratio, 1e6);
    }
    out.covariance += known;
  }
  return out;
}

}  // namespace isac::estimate
