#include "isac/estimate/row_spikes.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {

Eigen::VectorXd pilot_fit(const std::vector<RunColumns>& runs, std::size_t terms) {
  std::size_t total = 0;
  for (const RunColumns& run : runs) total += run.y.size();
  const std::size_t stride = std::max<std::size_t>(1, total / 20000);
  std::vector<std::vector<double>> picked;
  for (const RunColumns& run : runs)
    for (std::size_t i = stride / 2; i < run.y.size(); i += stride) {
      std::vector<double> row;
      for (std::size_t k = 0; k < terms; ++k) row.push_back(run.x[k][i]);
      row.push_back(run.y[i]);
      if (std::all_of(row.begin(), row.end(), [](double v) { return std::isfinite(v); }))
        picked.push_back(std::move(row));
    }
  const auto n = static_cast<Eigen::Index>(picked.size());
  const auto p = static_cast<Eigen::Index>(terms);
  Eigen::MatrixXd x(n, p);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = 0; k < p; ++k)
      x(i, k) = picked[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)];
    y[i] = picked[static_cast<std::size_t>(i)][terms];
  }
  const Eigen::VectorXd scale = x.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  x = x * scale.asDiagonal();
  Eigen::VectorXd theta = Eigen::VectorXd::Zero(p), weight = Eigen::VectorXd::Ones(n);
  for (int round = 0; round < 6; ++round) {
    Eigen::MatrixXd normal = x.transpose() * weight.asDiagonal() * x;
    normal.diagonal().array() += 1e-10;  // still columns stay at zero
    theta = solve_symmetric(normal, x.transpose() * weight.cwiseProduct(y));
    const Eigen::VectorXd residual = y - x * theta;
    const double bend =
        1.345 * series::robust_deviation({residual.data(), static_cast<std::size_t>(n)}, true);
    if (!(bend > 0)) break;
    for (Eigen::Index i = 0; i < n; ++i)
      weight[i] = std::min(1.0, bend / std::max(std::abs(residual[i]), 1e-300));
  }
  return theta.cwiseProduct(scale);
}

std::size_t remove_output_spikes(const RunColumns& run, const Eigen::VectorXd& pilot,
                                 std::vector<double>& y) {
  constexpr std::size_t kHalf = 3;
  if (y.size() < 2 * kHalf + 1) return 0;
  std::vector<double> residual = y, off(y.size(), std::nan(""));
  for (std::size_t k = 0; k < run.x.size(); ++k) {
    const double theta = pilot[static_cast<Eigen::Index>(k)];
    for (std::size_t i = 0; i < y.size(); ++i) residual[i] -= theta * run.x[k][i];
  }
  for (std::size_t i = kHalf; i + kHalf < y.size(); ++i) {
    double near[2 * kHalf + 1], sum = 0;
    for (std::size_t j = 0; j <= 2 * kHalf; ++j) sum += near[j] = residual[i + j - kHalf];
    if (!std::isfinite(sum)) continue;
    std::nth_element(near, near + kHalf, near + 2 * kHalf + 1);
    off[i] = residual[i] - near[kHalf];
  }
  std::vector<double> some;
  const std::size_t stride = std::max<std::size_t>(1, off.size() / 50000);
  for (std::size_t i = 0; i < off.size(); i += stride) some.push_back(off[i]);
  // A spike stands out of its neighbours and out of the residual as a whole; noise that grows with speed does neither.
  std::vector<double> overall;
  for (std::size_t i = 0; i < residual.size(); i += stride) overall.push_back(residual[i]);
  const double limit =
      std::max(6.0 * series::robust_deviation(some, true), 4.0 * series::robust_deviation(overall, true));
  if (!(limit > 0)) return 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < y.size(); ++i)
    if (std::abs(off[i]) > limit) {
      y[i] -= off[i];
      ++count;
    }
  return count;
}

}  // namespace isac::estimate
