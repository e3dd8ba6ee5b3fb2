#include "isac/explain/uncertainty.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "isac/estimate/block_covariance.hpp"
#include "isac/explain/explanation.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

void give_interval(Estimated& e, double error, double degrees) {
  if (!std::isfinite(error)) return;
  e.std_error = error;
  const double reach = error * series::student_t_limit(0.95, degrees);
  e.ci_low = e.value - reach;
  e.ci_high = e.value + reach;
}

}  // namespace

Uncertain uncertainties(const Predictor& predictor, const Fit& fit, const Weights& weights) {
  const Prepared& data = predictor.data();
  Uncertain out;
  for (std::size_t j = 0; j < predictor.base().size(); ++j) {
    const BaseParameter& b = predictor.base()[j];
    Estimated e;
    e.name = b.name;
    e.unit = b.unit;
    e.value = fit.model.base[j] / b.si_per_unit;
    out.base.push_back(std::move(e));
  }
  for (std::size_t i = fit.tolerances; i < fit.model.effects.size(); ++i) {
    const Active& a = fit.model.effects[i];
    std::vector<Estimated> parameters;
    for (int p = 0; p < a.hypothesis->info().parameter_count; ++p) {
      const auto& info = a.hypothesis->info().parameters[p];
      Estimated e;
      e.name = info.name;
      e.unit = info.unit;
      e.value = a.values[static_cast<std::size_t>(p)] / info.si_per_unit;
      parameters.push_back(std::move(e));
    }
    out.effects.push_back(std::move(parameters));
  }

  std::vector<Coordinate> used;
  const Eigen::MatrixXd slopes = sensitivities(predictor, fit, weights, &used);
  std::vector<Eigen::Index> columns;
  for (Eigen::Index j = 0; j < slopes.cols(); ++j)
    if (slopes.col(j).allFinite() && slopes.col(j).squaredNorm() > 0) columns.push_back(j);
  const auto m = static_cast<Eigen::Index>(columns.size());
  if (m == 0) return out;
  // Columns of unit norm: H is then a matrix of correlations.
  std::vector<double> norm;
  Eigen::MatrixXd x(slopes.rows(), m);
  for (Eigen::Index j = 0; j < m; ++j) {
    norm.push_back(slopes.col(columns[static_cast<std::size_t>(j)]).norm());
    x.col(j) = slopes.col(columns[static_cast<std::size_t>(j)]) / norm.back();
  }
  // The refit may have stopped short of its minimum: only what no parameter can still take is noise.
  const Eigen::VectorXd residual =
      fit.residual - x * (x.transpose() * x).ldlt().solve(x.transpose() * fit.residual);
  std::vector<estimate::BlockSums> blocks(data.blocks);
  for (auto& block : blocks) {
    block.score = Eigen::VectorXd::Zero(m);
    block.curvature = Eigen::MatrixXd::Zero(m, m);
  }
  for (Eigen::Index from = 0; from < x.rows();) {
    const unsigned b = data.rows[static_cast<std::size_t>(from)].block;
    Eigen::Index to = from;
    while (to < x.rows() && data.rows[static_cast<std::size_t>(to)].block == b) ++to;
    const auto part = x.middleRows(from, to - from);
    blocks[b].score += part.transpose() * residual.segment(from, to - from);
    blocks[b].curvature += part.transpose() * part;
    from = to;
  }
  const estimate::BlockCovariance v = estimate::block_covariance(blocks);
  for (Eigen::Index j = 0; j < m; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const Coordinate& c = used[static_cast<std::size_t>(columns[at])];
    if (c.tolerance) continue;
    const double error = std::sqrt(v.covariance(j, j)) * c.scale / norm[at],
                 degrees = v.degrees_of_freedom[j];
    if (c.base >= 0) {
      const auto b = static_cast<std::size_t>(c.base);
      give_interval(out.base[b], error / predictor.base()[b].si_per_unit, degrees);
    } else if (c.effect >= static_cast<int>(fit.tolerances)) {
      const auto e = static_cast<std::size_t>(c.effect) - fit.tolerances;
      const auto p = static_cast<std::size_t>(c.component);
      const auto& info = fit.model.effects[static_cast<std::size_t>(c.effect)].hypothesis->info();
      give_interval(out.effects[e][p], error / info.parameters[p].si_per_unit, degrees);
    }
  }
  return out;
}

}  // namespace isac::explain
