#include "isac/estimate/joint_core.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/estimate/block_covariance.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/robust.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kHuber = 1.345;   // 95 % efficient under normal noise (Huber and Ronchetti)
constexpr double kCauchy = 2.385;  // likewise for Cauchy's loss

/// Robust spread of the residual from at most 100 000 rows spread over the record: its own error is then below 0.5 %.
double spread_of(const std::vector<double>& residual) {
  const std::size_t stride = std::max<std::size_t>(1, residual.size() / 100000);
  std::vector<double> some;
  for (std::size_t i = 0; i < residual.size(); i += stride) some.push_back(residual[i]);
  return series::robust_deviation(some, true);
}

RobustProblem problem_of(const JointRows& rows, const JointTerms& terms, const std::vector<int>& kept) {
  RobustProblem problem;
  problem.rows = rows.size();
  for (const int k : kept) problem.columns.push_back(rows.x(static_cast<std::size_t>(k)).data());
  problem.output = rows.y().data();
  const std::size_t count = terms.nonlinear().size();
  if (count == 0) return problem;
  for (const JointParameter& p : terms.nonlinear()) {
    problem.nonlinear.start.push_back(p.typical);
    problem.nonlinear.lower.push_back(p.lower);
    problem.nonlinear.upper.push_back(p.upper);
  }
  problem.nonlinear.evaluate = [&rows, &terms, count](const double* parameters,
                                                      std::vector<double>& prediction,
                                                      std::vector<std::vector<double>>& derivatives) {
    prediction.resize(rows.size());
    derivatives.assign(count, std::vector<double>(rows.size()));
    std::vector<double> gradient(count);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      prediction[i] = terms.nonlinear_value(rows.state(i), parameters, gradient.data());
      for (std::size_t q = 0; q < count; ++q) derivatives[q][i] = gradient[q];
    }
  };
  return problem;
}

Eigen::VectorXd join(const Eigen::VectorXd& linear, const std::vector<double>& nonlinear) {
  Eigen::VectorXd out(linear.size() + static_cast<Eigen::Index>(nonlinear.size()));
  out << linear,
      Eigen::Map<const Eigen::VectorXd>(nonlinear.data(), static_cast<Eigen::Index>(nonlinear.size()));
  return out;
}

/// Least squares for the linear part with the nonlinear one held at `shape`.
Eigen::VectorXd linear_start(const RobustProblem& problem, const std::vector<double>& shape) {
  const Eigen::Index linear = problem.linear_size();
  Eigen::VectorXd theta = join(Eigen::VectorXd::Zero(linear), shape);
  problem.linearise(theta);
  RobustProblem squared = problem;
  squared.kind = Loss::Kind::kSquared;
  squared.linearise(theta);
  const Pass pass = squared.pass(theta, 0, squared.rows, true, false);
  if (linear > 0) {
    Eigen::MatrixXd gram = pass.gram.topLeftCorner(linear, linear);
    if (problem.excess.size() > 0) gram -= problem.excess.topLeftCorner(linear, linear);
    const Eigen::VectorXd scale = gram.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    const Eigen::MatrixXd unit = scale.asDiagonal() * gram * scale.asDiagonal();
    theta.head(linear) =
        scale.cwiseProduct(solve_symmetric(unit, scale.cwiseProduct(pass.moment.head(linear))));
  }
  return theta;
}

/// Nonlinear shapes (Stribeck's velocity, an onset angle) have several valleys: three starts, the lowest cost wins.
RobustSolution solve_from_several(RobustProblem& problem, const JointTerms& terms) {
  RobustSolution best;
  double lowest = std::numeric_limits<double>::infinity();
  for (const double factor : {1.0, 0.25, 4.0}) {
    std::vector<double> shape;
    for (const JointParameter& p : terms.nonlinear())
      shape.push_back(std::clamp(p.typical * (p.shape ? factor : 1.0), p.lower, p.upper));
    problem.nonlinear.start = shape;
    RobustSolution solution = solve(problem, linear_start(problem, shape));
    problem.linearise(solution.theta);
    const double cost = problem.pass(solution.theta, 0, problem.rows, false, false).cost;
    if (cost < lowest) {
      lowest = cost;
      best = std::move(solution);
    }
  }
  problem.linearise(best.theta);
  return best;
}

/// w_i of the rows: residual spread squared over itself with this row's share of regressor noise in place of the median one.
std::vector<double> effective_weights(const JointRows& rows, const JointTerms& terms,
                                      const Eigen::VectorXd& theta, double spread) {
  std::vector<double> weights = prediction_variance(rows, terms, theta);
  const double typical = series::median(weights);
  const double largest = weights.empty() ? 0.0 : *std::max_element(weights.begin(), weights.end());
  if (!(largest > 1e-3 * spread * spread))
    return {};  // no row differs by more than a thousandth: weights would be idle
  const double base = std::max(spread * spread - typical, 0.25 * spread * spread);
  for (double& w : weights) w = (base + typical) / (base + w);
  return weights;
}

std::vector<double> omega_of(const RobustProblem& problem, const std::vector<double>& residual,
                             std::size_t& outliers) {
  std::vector<double> omega(residual.size());
  outliers = 0;
  for (std::size_t i = 0; i < omega.size(); ++i) {
    const double w = problem.weight != nullptr ? problem.weight[i] : 1.0;
    const double size = std::sqrt(w) * std::abs(residual[i]);
    double slope = 1.0;
    if (problem.kind == Loss::Kind::kHuber && size > problem.scale) slope = problem.scale / size;
    if (problem.kind == Loss::Kind::kCauchy)
      slope = 1.0 / (1.0 + size * size / (problem.scale * problem.scale));
    if (slope < 0.5) ++outliers;
    omega[i] = w * slope;
  }
  return omega;
}

/// Full-size vector from kept linear and all nonlinear ones; the rest is zero, and the angle's zero is left out.
Eigen::VectorXd spread_out(const Eigen::VectorXd& part, const std::vector<int>& kept, std::size_t linear,
                           std::size_t nonlinear_size) {
  const auto nonlinear = static_cast<Eigen::Index>(nonlinear_size);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(linear) + nonlinear);
  for (std::size_t j = 0; j < kept.size(); ++j) out[kept[j]] = part[static_cast<Eigen::Index>(j)];
  out.tail(nonlinear) = part.tail(nonlinear);
  return out;
}

/// A matrix over all linear columns brought down to the kept ones, zero elsewhere: for S, whose part of nonlinear terms enters the
/// weights only.
Eigen::MatrixXd kept_excess(const Eigen::MatrixXd& full, const std::vector<int>& kept, int size) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < kept.size(); ++i)
    for (std::size_t j = 0; j < kept.size(); ++j)
      out(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = full(kept[i], kept[j]);
  return out;
}

}  // namespace

std::vector<BlockRange> time_blocks(const JointRows& rows, double seconds) {
  std::vector<BlockRange> out;
  for (const RunRows& run : rows.runs) {
    const std::size_t count = run.end - run.begin;
    if (count == 0) continue;
    // By rows, not by stamps: where rows were trimmed, a block then spans more time, never less data.
    const double length = static_cast<double>(count) * run.interval;
    const auto blocks =
        std::min(count, static_cast<std::size_t>(std::max(1.0, std::round(length / seconds))));
    for (std::size_t b = 0; b < blocks; ++b)
      out.push_back({run.begin + b * count / blocks, run.begin + (b + 1) * count / blocks});
  }
  return out;
}

double residual_correlation_time(const JointRows& rows, std::span<const double> residual, double limit,
                                 double bin_seconds) {
  std::vector<std::vector<double>> pieces;
  double bin = bin_seconds;
  for (const RunRows& run : rows.runs) bin = std::max(bin, run.interval);
  bin = std::max(bin, [&] {
    double total = 0;
    for (const RunRows& run : rows.runs) total += static_cast<double>(run.end - run.begin) * run.interval;
    return total / 20000.0;
  }());
  for (const RunRows& run : rows.runs) {
    if (run.end == run.begin) continue;
    const auto width = std::max<std::size_t>(1, static_cast<std::size_t>(std::llround(bin / run.interval)));
    std::vector<double> piece;
    for (std::size_t i = run.begin; i + width <= run.end; i += width) {
      double sum = 0;
      for (std::size_t j = 0; j < width; ++j) sum += std::clamp(residual[i + j], -limit, limit);
      piece.push_back(sum / static_cast<double>(width));
    }
    pieces.push_back(std::move(piece));
  }
  return bin * series::correlation_time(pieces);
}

JointCore estimate_joint(const JointRows& rows, JointTerms& terms, const JointFitOptions& options,
                         const RowRecipe& recipe) {
  JointCore out;
  const std::size_t linear = terms.linear().size(), nonlinear = terms.nonlinear().size();
  const bool correct = options.errors_in_variables;
  std::vector<int> all(linear);
  for (std::size_t k = 0; k < linear; ++k) all[k] = static_cast<int>(k);

  // Which columns can be fitted at all, before any model is believed.
  Eigen::MatrixXd full_excess =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(linear), static_cast<Eigen::Index>(linear));
  if (correct) full_excess = noise_gram(rows, terms, nullptr, 0, rows.size());
  Pass plain;
  {
    RobustProblem squared;
    squared.rows = rows.size();
    for (std::size_t k = 0; k < linear; ++k) squared.columns.push_back(rows.x(k).data());
    squared.output = rows.y().data();
    plain =
        squared.pass(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(linear)), 0, rows.size(), true, false);
    out.rank = find_rank(plain.gram, full_excess);
  }
  const std::vector<int> kept = out.rank.kept;

  RobustProblem problem = problem_of(rows, terms, kept);
  for (const int k : kept) out.used.push_back(rows.x(static_cast<std::size_t>(k)).data());
  int size = problem.size();
  const auto total = static_cast<Eigen::Index>(linear + nonlinear);
  out.theta = Eigen::VectorXd::Zero(total);
  out.covariance = Eigen::MatrixXd::Constant(total, total, kNan);
  out.degrees_of_freedom = Eigen::VectorXd::Constant(total, kNan);
  out.inflation = Eigen::VectorXd::Constant(total, kNan);

  // Least squares, then the robust loss around it; scale and weights settle in two rounds.
  const auto solve_now = [&](const Eigen::VectorXd& start) {
    if (nonlinear > 0) return solve_from_several(problem, terms);
    return solve(problem, start);
  };
  RobustSolution solution;
  std::vector<double> weights;
  double output_size = 0;
  for (const double y : rows.y()) output_size = std::max(output_size, std::abs(y));
  const bool robust = options.loss.kind != Loss::Kind::kSquared;
  const bool fixed_scale = std::isfinite(options.loss.scale);
  if (size == 0) {
    out.residual = rows.y();
    out.converged = true;
  } else {
    const auto update_baseline = [&](const Eigen::VectorXd& theta) {
      double stiffness = kNan, gain = kNan;
      for (std::size_t k = 0; k < linear; ++k) {
        const double value = theta[static_cast<Eigen::Index>(k)];
        if (terms.linear()[k].name == "A" || terms.linear()[k].name == "stiffness") stiffness = value;
        if (terms.linear()[k].name == "B" || terms.linear()[k].name == "pressure") gain = value;
      }
      if (std::isfinite(stiffness) && std::isfinite(gain)) terms.set_baseline(stiffness, gain);
    };
    const int rounds = !robust && !correct ? 1 : (fixed_scale && !correct ? 1 : 3);
    Eigen::VectorXd start;
    if (nonlinear > 0) {
      start = linear_start(problem, problem.nonlinear.start);
    } else {  // least squares from the sums that are there already
      const Eigen::MatrixXd gram = kept_excess(plain.gram, kept, size);
      const Eigen::VectorXd root = gram.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
      Eigen::VectorXd moment(size);
      for (int k = 0; k < size; ++k) moment[k] = plain.moment[kept[static_cast<std::size_t>(k)]];
      const Eigen::MatrixXd unit = root.asDiagonal() * gram * root.asDiagonal();
      start = root.cwiseProduct(solve_symmetric(unit, root.cwiseProduct(moment)));
    }
    if (robust && fixed_scale) {
      problem.kind = options.loss.kind;
      problem.scale = options.loss.scale;
    } else if (robust) {
      problem.residuals(start, out.residual);
    }
    for (int round = 0; round < rounds; ++round) {
      if (robust && !fixed_scale) {
        // A perfect fit has no spread: the loss must not bend at rounding.
        const double spread = std::max(spread_of(out.residual), 1e-12 * output_size);
        problem.kind = options.loss.kind;
        problem.scale = spread * (options.loss.kind == Loss::Kind::kHuber ? kHuber : kCauchy);
      }
      if (correct && round > 0) {
        const Eigen::VectorXd theta = spread_out(solution.theta, kept, linear, nonlinear);
        if (options.effective_variance && out.spread > 0) {
          weights = effective_weights(rows, terms, theta, out.spread);
          problem.weight = weights.empty() ? nullptr : weights.data();
        }
        std::size_t ignored = 0;
        const std::vector<double> omega = omega_of(problem, out.residual, ignored);
        if (set_zero(rows, terms, theta, recipe.angle_step, out.spread, problem, out.zero))
          start = with_zero(solution.theta, kept.size(), nonlinear, problem);
        size = problem.size();
        problem.excess = kept_excess(noise_gram(rows, terms, omega.data(), 0, rows.size()), kept, size);
        problem.excess.diagonal() -= prior_of(out.zero, kept.size(), size).curvature;
      }
      solution = solve_now(start);
      start = solution.theta;
      problem.residuals(solution.theta, out.residual);
      out.spread = spread_of(out.residual);
      if (nonlinear > 0) update_baseline(spread_out(solution.theta, kept, linear, nonlinear));
    }
    out.converged = solution.converged;
    out.report = solution.report;
    out.theta = spread_out(solution.theta, kept, linear, nonlinear);
  }
  out.omega = omega_of(problem, out.residual, out.outliers);
  if (size == 0) return out;

  // Blocks of time: twenty correlation times keep the bias of the variance below a twentieth; a dozen blocks are the least.
  double length = 0, interval = 0;
  for (const RunRows& run : rows.runs) {
    length += static_cast<double>(run.end - run.begin) * run.interval;
    interval = std::max(interval, run.interval);
  }
  out.correlation_seconds =
      residual_correlation_time(rows, out.residual, 3.0 * out.spread, recipe.window * interval);
  double seconds = options.block_seconds;
  if (!std::isfinite(seconds)) {
    const double wanted = std::max({20.0 * out.correlation_seconds, 4.0 * recipe.window * interval, 3.0});
    seconds = std::min(wanted, length / 12.0);
    out.blocks_cut_short = seconds < 0.5 * wanted;
  }
  out.block_seconds = seconds;
  out.blocks = time_blocks(rows, seconds);
  std::vector<BlockSums> sums;
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(size, size);
  for (const BlockRange& block : out.blocks) {
    const Pass pass = problem.pass(solution.theta, block.begin, block.end, true, true);
    BlockSums sum{pass.moment, pass.curvature};
    if (correct) {
      const Eigen::MatrixXd excess =
          kept_excess(noise_gram(rows, terms, out.omega.data(), block.begin, block.end), kept, size);
      sum.score += excess * solution.theta;
      sum.curvature -= excess;
    }
    gram += pass.gram;
    sums.push_back(std::move(sum));
  }
  // Scaled to a unit diagonal, so that roots and inverses lose nothing to units.
  const Eigen::VectorXd scale = gram.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  Prior prior = prior_of(out.zero, kept.size(), size, out.spread);
  gram.diagonal() += prior.curvature;
  prior.curvature = prior.curvature.cwiseProduct(scale).cwiseProduct(scale);
  prior.score_variance = prior.score_variance.cwiseProduct(scale).cwiseProduct(scale);
  for (BlockSums& sum : sums) {
    sum.score = sum.score.cwiseProduct(scale);
    sum.curvature = scale.asDiagonal() * sum.curvature * scale.asDiagonal();
  }
  BlockCovariance covariance = block_covariance(sums, prior);
  const Eigen::MatrixXd cov = scale.asDiagonal() * covariance.covariance * scale.asDiagonal();
  const Eigen::VectorXd inflation = variance_inflation(gram);
  std::vector<int> place = kept;
  for (std::size_t q = 0; q < nonlinear; ++q) place.push_back(static_cast<int>(linear + q));
  std::vector<Eigen::Index>
      from;  // where the parameters stand among those fitted: the angle's zero is between them
  for (std::size_t k = 0; k < place.size(); ++k)
    from.push_back(static_cast<Eigen::Index>(k) +
                   (k < kept.size() ? 0 : size - static_cast<Eigen::Index>(place.size())));
  for (std::size_t i = 0; i < place.size(); ++i) {
    out.degrees_of_freedom[place[i]] = covariance.degrees_of_freedom[from[i]];
    out.inflation[place[i]] = inflation[from[i]];
    for (std::size_t j = 0; j < place.size(); ++j) out.covariance(place[i], place[j]) = cov(from[i], from[j]);
  }
  if (!out.zero.column.empty()) {
    const auto at = static_cast<Eigen::Index>(kept.size());
    out.zero.value = solution.theta[at];
    out.zero.std_error = std::sqrt(cov(at, at));
  }
  // Nonlinear parameters: a null direction at the answer is a combination that the data do not split.
  out.rank.fault.resize(linear + nonlinear, Rank::Fault::kNone);
  out.rank.partners.resize(linear + nonlinear);
  if (nonlinear > 0) {
    const auto count = static_cast<Eigen::Index>(place.size());
    Eigen::MatrixXd own(count, count);
    for (Eigen::Index i = 0; i < count; ++i)
      for (Eigen::Index j = 0; j < count; ++j)
        own(i, j) = gram(from[static_cast<std::size_t>(i)], from[static_cast<std::size_t>(j)]);
    const Rank local = find_rank(own, Eigen::MatrixXd::Zero(count, count));
    for (std::size_t i = 0; i < place.size(); ++i) {
      const auto to = static_cast<std::size_t>(place[i]);
      if (local.fault[i] == Rank::Fault::kNone) continue;
      out.rank.fault[to] = local.fault[i];
      for (const int partner : local.partners[i])
        out.rank.partners[to].push_back(place[static_cast<std::size_t>(partner)]);
    }
  }
  return out;
}

}  // namespace isac::estimate
