#include "isac/explain/uncertainty.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <vector>

#include "isac/estimate/block_covariance.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/explain/explanation.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr const char* kNotTold = "these runs do not tell it";
constexpr const char* kAtItsEnd = "at the end of its range";

/// `range`: of all values that it may have, in its own unit; an error beyond it says that the runs do not feel the parameter. The value stays,
/// because the model was fitted with it.
void give_interval(Estimated& e, double error, double degrees, double range) {
  if (!(error <= range)) {
    e.reason = kNotTold;
    return;
  }
  e.std_error = error;
  const double reach = error * series::student_t_limit(0.95, degrees);
  e.ci_low = e.value - reach;
  e.ci_high = e.value + reach;
}

/// Columns x of unit norm of which each brings something of its own. Later ones that the others make up for are left out, and their parameters
/// keep their values: no error of another is the larger for what nothing shows.
struct Independent {
  std::vector<Eigen::Index> kept;
  /// Of each column that was left out: the kept one that it is a multiple of, if there is one.
  struct LeftOut {
    Eigen::Index column = 0;
    std::optional<Eigen::Index> like;
    double correlation = 0;
  };
  std::vector<LeftOut> left_out;
};

Independent independent_of(const Eigen::MatrixXd& x) {
  constexpr double kOfItsOwn = 1e-3, kMultiple = 0.999;
  Independent out;
  Eigen::MatrixXd q(x.rows(), x.cols());
  Eigen::Index count = 0;
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    Eigen::VectorXd v = x.col(j);
    for (int round = 0; round < 2; ++round) v -= q.leftCols(count) * (q.leftCols(count).transpose() * v);
    if (v.norm() > kOfItsOwn) {
      q.col(count++) = v.normalized();
      out.kept.push_back(j);
      continue;
    }
    Independent::LeftOut left{.column = j, .like = {}, .correlation = 0};
    for (const Eigen::Index k : out.kept)
      if (const double r = x.col(j).dot(x.col(k)); std::abs(r) > kMultiple)
        left.like = k, left.correlation = r;
    out.left_out.push_back(left);
  }
  return out;
}

/// How the encoder is read within its step: known to lie within bounds, alike anywhere, and not more where no run tells.
bool is_reading_within_a_step(const Fit& fit, int effect) {
  return effect >= 0 && effect < static_cast<int>(fit.tolerances) &&
         fit.model.effects[static_cast<std::size_t>(effect)].hypothesis->id() == "encoder_offset";
}

/// Variances that such readings add to the coefficients of `x`: (∂β/∂τ)² v, ∂β/∂τ = −(xᵀx)⁻¹ xᵀs, 1/v = 12/range² + ‖s⊥‖²/(mean square), of the
/// first alone where it was held.
Eigen::VectorXd variance_by_readings(const Predictor& predictor, const Fit& fit, const Weights& weights,
                                     const Eigen::MatrixXd& x, double mean_square) {
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(x.cols());
  for (std::size_t i = 0; i < fit.tolerances; ++i) {
    const Hypothesis& h = *fit.model.effects[i].hypothesis;
    const double range = h.upper[0] - h.lower[0];
    if (!is_reading_within_a_step(fit, static_cast<int>(i)) || !(range > 0)) continue;
    Eigen::VectorXd here = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(predictor.rows()));
    predictor.predict(fit.model, kAllChains, here);
    const Eigen::VectorXd s = response(predictor, fit, here, {&h, {0.5 * range}}, weights) / (0.5 * range);
    if (!s.allFinite()) continue;
    const Eigen::VectorXd a = estimate::solve_symmetric(x.transpose() * x, x.transpose() * s);
    // Held in the middle, it was not asked of the runs.
    const bool held = fit.model.effects[i].values[0] == 0.5 * (h.lower[0] + h.upper[0]);
    const double told = held ? 0.0 : (s - x * a).squaredNorm() / mean_square;
    variance += a.cwiseAbs2() / (12 / (range * range) + told);
  }
  return variance;
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
  const auto effect_parameter = [&](const Coordinate& c) -> Estimated* {
    if (c.effect < static_cast<int>(fit.tolerances)) return nullptr;
    return &out.effects[static_cast<std::size_t>(c.effect) - fit.tolerances]
                       [static_cast<std::size_t>(c.component)];
  };
  for (Eigen::Index j = 0; j < slopes.cols(); ++j) {
    const Coordinate& c = used[static_cast<std::size_t>(j)];
    if (is_reading_within_a_step(fit, c.effect)) continue;
    Estimated* of_effect = effect_parameter(c);
    // A leak that can only be a leak and would rather be none takes no freedom from the others.
    const bool at_its_end = of_effect != nullptr && (fit.value(c) <= c.lower || fit.value(c) >= c.upper);
    if (slopes.col(j).allFinite() && slopes.col(j).squaredNorm() > 0 && !at_its_end) {
      columns.push_back(j);
    } else if (of_effect != nullptr) {
      of_effect->reason = at_its_end ? kAtItsEnd : kNotTold;
    }
  }
  if (columns.empty()) return out;
  // Columns of unit norm: H is then a matrix of correlations.
  std::vector<double> norm;
  Eigen::MatrixXd all(slopes.rows(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t j = 0; j < columns.size(); ++j) {
    norm.push_back(slopes.col(columns[j]).norm());
    all.col(static_cast<Eigen::Index>(j)) = slopes.col(columns[j]) / norm.back();
  }
  const Independent told = independent_of(all);
  const auto m = static_cast<Eigen::Index>(told.kept.size());
  const Eigen::MatrixXd x = all(Eigen::all, told.kept);
  // The refit may have stopped short of its minimum: only what no parameter can still take is noise.
  const Eigen::VectorXd residual =
      fit.residual - x * estimate::solve_symmetric(x.transpose() * x, x.transpose() * fit.residual);
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
  const Eigen::VectorXd by_readings = variance_by_readings(
      predictor, fit, weights, x, residual.squaredNorm() / static_cast<double>(residual.size()));
  const auto coordinate = [&](Eigen::Index column) -> const Coordinate& {
    return used[static_cast<std::size_t>(columns[static_cast<std::size_t>(column)])];
  };
  const auto si_per_unit = [&](const Coordinate& c) {
    return fit.model.effects[static_cast<std::size_t>(c.effect)]
        .hypothesis->info()
        .parameters[c.component]
        .si_per_unit;
  };
  for (Eigen::Index j = 0; j < m; ++j) {
    const auto at = static_cast<std::size_t>(told.kept[static_cast<std::size_t>(j)]);
    const Coordinate& c = coordinate(told.kept[static_cast<std::size_t>(j)]);
    if (c.tolerance) continue;
    const double error = std::sqrt(v.covariance(j, j) + by_readings[j]) * c.scale / norm[at],
                 degrees = v.degrees_of_freedom[j];
    if (c.base >= 0) {
      const auto b = static_cast<std::size_t>(c.base);
      const BaseParameter& parameter = predictor.base()[b];
      give_interval(out.base[b], error / parameter.si_per_unit, degrees,
                    (parameter.upper - parameter.lower) / parameter.si_per_unit);
    } else if (Estimated* of_effect = effect_parameter(c)) {
      const Hypothesis& h = *fit.model.effects[static_cast<std::size_t>(c.effect)].hypothesis;
      const auto p = static_cast<std::size_t>(c.component);
      const double unit = si_per_unit(c);
      give_interval(*of_effect, error / unit, degrees, (h.upper[p] - h.lower[p]) / unit);
    }
  }
  for (const Independent::LeftOut& left : told.left_out) {
    const Coordinate& c = coordinate(left.column);
    if (c.tolerance) continue;
    Estimated* of_effect = effect_parameter(c);
    if (of_effect == nullptr) {
      if (c.base >= 0) out.base[static_cast<std::size_t>(c.base)].reason = kNotTold;
      continue;
    }
    of_effect->reason = kNotTold;
    Estimated* like = left.like ? effect_parameter(coordinate(*left.like)) : nullptr;
    if (like == nullptr || coordinate(*left.like).effect != c.effect || !std::isfinite(like->std_error))
      continue;
    // x_c = r x_k, each per unit of its parameter: only k + f c shows, f = r |∂/∂c|/|∂/∂k|.
    constexpr double kOne = 0.05;
    const Coordinate& k = coordinate(*left.like);
    const double f = left.correlation *
                     (norm[static_cast<std::size_t>(left.column)] / c.scale * si_per_unit(c)) /
                     (norm[static_cast<std::size_t>(*left.like)] / k.scale * si_per_unit(k));
    if (std::abs(std::abs(f) - 1) > kOne) continue;
    of_effect->reason = like->reason =
        fmt::format("only {} {} {} = {:.3g} ± {:.1g}{}{} is told", like->name, f > 0 ? "+" : "−",
                    of_effect->name, like->value + (f > 0 ? 1 : -1) * of_effect->value, like->std_error,
                    like->unit.empty() ? "" : " ", like->unit);
    like->std_error = like->ci_low = like->ci_high = kNotKnown;
  }
  return out;
}

}  // namespace isac::explain
