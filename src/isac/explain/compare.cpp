#include "isac/explain/compare.hpp"

#include <algorithm>
#include <cmath>

namespace isac::explain {

Comparison compare(const Prepared& data, const Eigen::VectorXd& best, const Eigen::VectorXd& rival,
                   int surplus_parameters, double noise_unit) {
  Comparison c;
  const Eigen::VectorXd difference = rival - best;
  Eigen::VectorXd score = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.blocks));
  for (Eigen::Index i = 0; i < difference.size(); ++i)
    score[static_cast<Eigen::Index>(data.rows[static_cast<std::size_t>(i)].block)] += best[i] * difference[i];
  const double norm2 = difference.squaredNorm();
  c.unit = std::max(noise_unit, norm2 > 0 ? score.squaredNorm() / norm2 : 0.0);
  c.delta = rival.squaredNorm() - best.squaredNorm() + 2 * c.unit * surplus_parameters;
  c.separation = std::sqrt(norm2 / c.unit);
  const double scatter = 2 * std::sqrt(c.unit * norm2);
  c.t = scatter > 0 ? c.delta / scatter : 0.0;
  return c;
}

}  // namespace isac::explain
