#include "isac/explain/compare.hpp"

#include <algorithm>
#include <cmath>

namespace isac::explain {
namespace {

constexpr double kReach = 0.1;          // s, of the autocovariance that is summed
constexpr double kLeastDensity = 0.25;  // of the variance: an estimate below it is a sum of errors

}  // namespace

NoiseDensity noise_density(const Prepared& data, const Eigen::VectorXd& residual) {
  NoiseDensity noise;
  double sum[kChains] = {}, variance[kChains] = {};
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const Row& row = data.rows[i];
    const auto c = static_cast<std::size_t>(row.chain);
    const double interval = data.runs[row.run].interval, r = residual[static_cast<Eigen::Index>(i)];
    variance[c] += r * r;
    noise.rows[c] += 1;
    for (std::size_t k = i; k-- > 0;) {
      const Row& before = data.rows[k];
      if (before.run != row.run || before.chain != row.chain ||
          (row.sample - before.sample) * interval > kReach)
        break;
      sum[c] += 2 * r * residual[static_cast<Eigen::Index>(k)];
    }
  }
  for (int c = 0; c < kChains; ++c)
    if (noise.rows[c] > 0)
      noise.of[c] = std::max(variance[c] + sum[c], kLeastDensity * variance[c]) / noise.rows[c];
  return noise;
}

Comparison compare(const Prepared& data, const Eigen::VectorXd& best, const Eigen::VectorXd& rival,
                   int surplus_parameters, const NoiseDensity& noise) {
  Comparison c;
  const Eigen::VectorXd difference = rival - best;
  Eigen::VectorXd score = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.blocks));
  double share[kChains] = {}, all = 0, density = 0;
  for (Eigen::Index i = 0; i < difference.size(); ++i) {
    const Row& row = data.rows[static_cast<std::size_t>(i)];
    score[static_cast<Eigen::Index>(row.block)] += best[i] * difference[i];
    share[static_cast<int>(row.chain)] += difference[i] * difference[i];
  }
  const double norm2 = difference.squaredNorm();
  const double* weight = norm2 > 0 ? share : noise.rows;
  for (int k = 0; k < kChains; ++k) {
    all += weight[k];
    density += weight[k] * noise.of[k];
  }
  c.unit = std::max(density / all, norm2 > 0 ? score.squaredNorm() / norm2 : 0.0);
  c.delta = rival.squaredNorm() - best.squaredNorm() + 2 * c.unit * surplus_parameters;
  c.separation = std::sqrt(norm2 / c.unit);
  const double scatter = 2 * std::sqrt(c.unit * norm2);
  c.t = scatter > 0 ? c.delta / scatter : 0.0;
  return c;
}

}  // namespace isac::explain
