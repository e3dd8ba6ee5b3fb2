#include "isac/estimate/identifiability.hpp"

#include <algorithm>
#include <cmath>

#include "isac/estimate/linear_algebra.hpp"

namespace isac::estimate {
namespace {

Eigen::MatrixXd select(const Eigen::MatrixXd& matrix, const std::vector<int>& kept) {
  const auto n = static_cast<Eigen::Index>(kept.size());
  Eigen::MatrixXd out(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      out(i, j) = matrix(kept[static_cast<std::size_t>(i)], kept[static_cast<std::size_t>(j)]);
  return out;
}

Eigen::MatrixXd unit_diagonal(const Eigen::MatrixXd& gram) {
  const Eigen::VectorXd inverse = gram.diagonal().cwiseSqrt().cwiseInverse();
  return inverse.asDiagonal() * gram * inverse.asDiagonal();
}

}  // namespace

Eigen::VectorXd variance_inflation(const Eigen::MatrixXd& gram) {
  return inverse_square(unit_diagonal(gram)).diagonal();
}

Rank find_rank(const Eigen::MatrixXd& gram, const Eigen::MatrixXd& excess) {
  const auto n = static_cast<int>(gram.rows());
  Rank out;
  out.fault.assign(static_cast<std::size_t>(n), Rank::Fault::kNone);
  out.partners.resize(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) {
    if (!(gram(k, k) > 0)) {
      out.fault[static_cast<std::size_t>(k)] = Rank::Fault::kStill;
    } else if (gram(k, k) - excess(k, k) < 0.5 * gram(k, k)) {
      out.fault[static_cast<std::size_t>(k)] = Rank::Fault::kNoiseOnly;
    } else {
      out.kept.push_back(k);
    }
  }
  // Combinations: null directions of the matrix with unit diagonal. 1e-10 is what rounding leaves of an exact zero there
  // (rows · 1e-16), and a combination that differs from zero by 1e-5 of its columns.
  while (out.kept.size() > 1) {
    const SymmetricEigen eigen = symmetric_eigen(unit_diagonal(select(gram, out.kept)));
    if (eigen.values[0] > 1e-10) break;
    const Eigen::VectorXd direction = eigen.vectors.col(0);
    std::vector<int> involved;
    for (Eigen::Index j = 0; j < direction.size(); ++j)
      if (std::abs(direction[j]) > 0.1) involved.push_back(out.kept[static_cast<std::size_t>(j)]);
    for (const int k : involved) {
      out.fault[static_cast<std::size_t>(k)] = Rank::Fault::kCombination;
      for (const int other : involved)
        if (other != k) out.partners[static_cast<std::size_t>(k)].push_back(other);
    }
    out.kept.erase(std::find(out.kept.begin(), out.kept.end(), involved.back()));
  }
  // Beyond the others, is there more than noise? The worst column goes first, for its going may free the others.
  while (!out.kept.empty()) {
    const Eigen::MatrixXd seen = select(gram, out.kept), noise = select(excess, out.kept);
    const Eigen::VectorXd scale = seen.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd unit = scale.asDiagonal() * seen * scale.asDiagonal();
    const Eigen::MatrixXd inverse = inverse_square(unit);
    const Eigen::MatrixXd noise_unit = scale.asDiagonal() * noise * scale.asDiagonal();
    int worst = -1;
    double share = 0.5;
    for (Eigen::Index j = 0; j < unit.rows(); ++j) {
      // Part of column j that the others do not explain: direction inverse.col(j); its noise share.
      const Eigen::VectorXd direction = inverse.col(j);
      const double fraction = direction.dot(noise_unit * direction) / inverse(j, j);
      if (fraction > share) {
        share = fraction;
        worst = static_cast<int>(j);
      }
    }
    if (worst < 0) break;
    out.fault[static_cast<std::size_t>(out.kept[static_cast<std::size_t>(worst)])] = Rank::Fault::kNoiseOnly;
    out.kept.erase(out.kept.begin() + worst);
  }
  return out;
}

}  // namespace isac::estimate
