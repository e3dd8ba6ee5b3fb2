// The answer of a fit in one pass: the Newton step from the summed blocks, its covariance, and the words.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "isac/estimate/angle_zero.hpp"
#include "isac/estimate/block_covariance.hpp"
#include "isac/estimate/identifiability.hpp"
#include "isac/estimate/joint_verdict.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/streaming_state.hpp"

namespace isac::estimate {
namespace {

/// The sums of the angle's zero stand last; those of a resting run's own zero are the same sums over its blocks.
Eigen::VectorXd with_own(const Eigen::VectorXd& sums, Eigen::Index runs, Eigen::Index own) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(sums.size() + runs);
  out.head(sums.size()) = sums;
  if (own >= 0) out[sums.size() + own] = sums[sums.size() - 1];
  return out;
}

Eigen::MatrixXd with_own(const Eigen::MatrixXd& sums, Eigen::Index runs, Eigen::Index own) {
  const Eigen::Index n = sums.rows();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n + runs, n + runs);
  out.topLeftCorner(n, n) = sums;
  if (own < 0) return out;
  out.row(n + own).head(n) = sums.row(n - 1);
  out.col(n + own).head(n) = sums.col(n - 1);
  out(n + own, n + own) = sums(n - 1, n - 1);
  return out;
}

}  // namespace

JointFit StreamingJointFit::finish() {
  State& s = *state_;
  if (!s.ready) {
    s.make_pilot();
    s.take_waiting();
  }
  std::vector<Eigen::Index> own(s.ranges.size(), -1);  // the zero of a resting run of its own
  Eigen::Index resting = 0;
  if (s.zero)
    for (std::size_t r = 0; r < own.size(); ++r)
      if (rests(s.ranges[r].low, s.ranges[r].high, s.stated.recipe.angle_step)) own[r] = resting++;
  if (s.zero) {
    s.pilot.zero.resting.assign(static_cast<std::size_t>(resting), {});
    for (OpenBlock& block : s.blocks) {
      block.sums.score = with_own(block.sums.score, resting, own[block.run]);
      block.sums.curvature = with_own(block.sums.curvature, resting, own[block.run]);
      block.gram = with_own(block.gram, resting, own[block.run]);
    }
    s.start.conservativeResizeLike(Eigen::VectorXd::Zero(s.start.size() + resting));
  }
  const Eigen::Index n = s.start.size(), known = static_cast<Eigen::Index>(s.pilot.rank.kept.size());
  Prior prior = prior_of(s.pilot.zero, s.pilot.rank.kept.size(), static_cast<int>(n), s.pilot.spread);
  Eigen::MatrixXd bread = Eigen::MatrixXd::Zero(n, n), gram = bread;
  Eigen::VectorXd score = -prior.curvature.cwiseProduct(s.start);
  bread.diagonal() += prior.curvature;
  gram.diagonal() += prior.curvature;
  for (const OpenBlock& block : s.blocks) {
    bread += block.sums.curvature;
    gram += block.gram;
    score += block.sums.score;
  }
  const Eigen::VectorXd scale = gram.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd unit = scale.asDiagonal() * bread * scale.asDiagonal();
  const Eigen::VectorXd step = scale.cwiseProduct(solve_symmetric(unit, scale.cwiseProduct(score)));
  std::vector<BlockSums> sums;
  for (const OpenBlock& block : s.blocks)
    sums.push_back({scale.cwiseProduct(block.sums.score - block.sums.curvature * step),
                    scale.asDiagonal() * block.sums.curvature * scale.asDiagonal()});
  prior.curvature = prior.curvature.cwiseProduct(scale).cwiseProduct(scale);
  prior.score_variance = prior.score_variance.cwiseProduct(scale).cwiseProduct(scale);
  const BlockCovariance covariance = block_covariance(sums, prior);
  const Eigen::VectorXd inflation = n > 0 ? variance_inflation(gram) : Eigen::VectorXd();

  JointCore core = s.pilot;
  core.converged = true;
  for (Eigen::Index i = 0; i < known; ++i) {
    const int a = s.pilot.rank.kept[static_cast<std::size_t>(i)];
    core.theta[a] = s.start[i] + step[i];
    core.degrees_of_freedom[a] = covariance.degrees_of_freedom[i];
    core.inflation[a] = inflation[i];
    for (Eigen::Index j = 0; j < known; ++j)
      core.covariance(a, s.pilot.rank.kept[static_cast<std::size_t>(j)]) =
          covariance.covariance(i, j) * scale[i] * scale[j];
  }
  if (s.zero) {
    core.zero.value = s.start[known] + step[known];
    core.zero.std_error = std::sqrt(covariance.covariance(known, known)) * scale[known];
  }
  core.outliers = s.outliers;
  core.blocks.assign(s.blocks.size(), {});
  core.block_seconds =
      static_cast<double>(s.block_rows) * (s.sample.runs.empty() ? 0.0 : s.sample.runs.front().interval);

  JointFit fit;
  fit.converged = true;
  fit.solver_summary = "one pass: a Newton step from the pilot (" + s.pilot.report + ")";
  fit.differentiator = s.stated.words;
  fit.samples = s.rows;
  fit.outliers = s.outliers;
  fit.blocks = s.blocks.size();
  fit.block_seconds = core.block_seconds;
  fit.box = validity_box(s.sample);
  std::vector<int> order;
  fit.parameters = judge_parameters(s.sample, s.terms, core, s.options, order);
  fit.correlation = correlations(fit.parameters, order, core);
  fit.angle_zero = angle_zero(core.zero, s.options);
  if (fit.angle_zero.used) fit.tests.push_back(zero_test(fit.angle_zero, core.zero, s.options));
  const Eigen::VectorXd moved = step.head(known);
  const double square = s.plain_square - 2.0 * moved.dot(s.plain_moment) + moved.dot(s.plain_gram * moved);
  fit.rmse = s.rows > 0 ? std::sqrt(std::max(0.0, square) / static_cast<double>(s.rows)) : std::nan("");
  s.sample.seen = s.sample.size();
  add_warnings(s.sample, s.terms, core, s.options, fit);
  return fit;
}

}  // namespace isac::estimate
