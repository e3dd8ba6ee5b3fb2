#include "isac/estimate/robust.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/robust_pass.hpp"

namespace isac::estimate {
namespace {

/// The whole problem as one residual vector: see the header. residuals: size() compressed rows and the constant rest.
class CompressedCost final : public ceres::CostFunction {
 public:
  /// Ceres sees z_k = scale_k θ_k, so that its tolerances mean the same for every parameter.
  /// `first` is the pass at `start`, where Ceres begins.
  CompressedCost(const RobustProblem& problem, Eigen::VectorXd scale, const Eigen::VectorXd& start,
                 const Pass& first)
      : problem_(problem), scale_(std::move(scale)), start_(start.cwiseProduct(scale_)), first_(first) {
    set_num_residuals(problem.size() + 1);
    mutable_parameter_block_sizes()->push_back(problem.size());
  }

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const int n = problem_.size();
    const Eigen::Map<const Eigen::VectorXd> z(parameters[0], n);
    const Eigen::VectorXd theta = z.cwiseQuotient(scale_);
    const bool at_start = z == start_;
    if (!at_start) problem_.linearise(theta);
    const Pass pass = at_start ? first_ : problem_.pass(theta, 0, problem_.rows, true, false);
    Eigen::MatrixXd normal = pass.gram;
    Eigen::VectorXd gradient = -pass.moment;
    double cost = pass.cost;
    if (problem_.excess.size() > 0) {
      normal -= problem_.excess;
      gradient -= problem_.excess * theta;
      cost -= theta.dot(problem_.excess * theta);
    }
    const Eigen::VectorXd back = scale_.cwiseInverse();
    normal = back.asDiagonal() * normal * back.asDiagonal();
    gradient = gradient.cwiseProduct(back);
    // A flat direction (a nonlinear parameter without effect at this point) must not stop the factorisation.
    for (int k = 0; k < n; ++k)
      if (!(normal(k, k) > 0)) normal(k, k) = 1.0;
    const Cholesky factor = cholesky(normal);
    if (!factor.positive || !std::isfinite(cost)) return false;
    const Eigen::VectorXd compressed = factor.whiten(gradient);
    Eigen::Map<Eigen::VectorXd>(residuals, n) = compressed;
    residuals[n] = std::sqrt(std::max(0.0, cost - compressed.squaredNorm()));
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor> jacobian(jacobians[0], n + 1, n);
      jacobian.topRows(n) = factor.lower.transpose();
      jacobian.row(n).setZero();
    }
    return true;
  }

 private:
  const RobustProblem& problem_;
  Eigen::VectorXd scale_, start_;
  const Pass& first_;
};

Eigen::MatrixXd less_excess(const RobustProblem& problem, const Eigen::MatrixXd& matrix) {
  return problem.excess.size() > 0 ? Eigen::MatrixXd(matrix - problem.excess) : matrix;
}

/// ∇ and value of the cost with S, from a pass.
double value_of(const RobustProblem& problem, const Pass& pass, const Eigen::VectorXd& theta) {
  return problem.excess.size() > 0 ? pass.cost - theta.dot(problem.excess * theta) : pass.cost;
}

/// Newton on the piecewise quadratic cost of a linear problem; falls back to the reweighted step where Newton does not descend.
void newton(const RobustProblem& problem, Eigen::VectorXd& theta) {
  const bool squared = problem.kind == Loss::Kind::kSquared;
  // Only the first pass needs the Gram matrix: later steps use the curvature, and the Gram matrix where that fails.
  Pass here = problem.pass(theta, 0, problem.rows, true, false);
  const Eigen::VectorXd size = here.gram.diagonal().cwiseSqrt();
  for (int step = 0; step < 50; ++step) {
    Eigen::VectorXd descent = here.moment;
    if (problem.excess.size() > 0) descent += problem.excess * theta;
    const bool by_gram = here.curvature.size() == 0;
    Cholesky factor = cholesky(less_excess(problem, by_gram ? here.gram : here.curvature));
    const double before = value_of(problem, here, theta);
    Eigen::VectorXd move, next = theta;
    Pass there;
    bool descends = false;
    // Rounding of a sum over the rows is all the increase that is let pass.
    const auto try_step = [&] {
      move = factor.solve(descent);
      next = theta + move;
      there = problem.pass(next, 0, problem.rows, false, !squared);
      descends = value_of(problem, there, next) <= before + 1e-13 * std::abs(before);
    };
    if (factor.positive) try_step();
    if (!descends && !by_gram) {
      factor = cholesky(less_excess(problem, problem.pass(theta, 0, problem.rows, true, false).gram));
      if (factor.positive) try_step();
    }
    if (!descends) return;
    theta = next;
    here = std::move(there);
    if (move.cwiseProduct(size).norm() <= 1e-14 * theta.cwiseProduct(size).norm() || squared) return;
  }
}

}  // namespace

void RobustProblem::linearise(const Eigen::VectorXd& theta) const {
  if (nonlinear.start.empty()) return;
  nonlinear.evaluate(theta.data() + linear_size(), prediction_, derivatives_);
  remainder_.resize(rows);
  for (std::size_t i = 0; i < rows; ++i) remainder_[i] = output[i] - prediction_[i];
}

Pass RobustProblem::pass(const Eigen::VectorXd& theta, std::size_t begin, std::size_t end, bool with_gram,
                         bool with_curvature) const {
  if (locals.empty()) return plain_pass(theta.data(), begin, end, with_gram, with_curvature);
  const int n = size();
  const auto own = static_cast<int>(columns.size());
  Pass out;
  out.moment = Eigen::VectorXd::Zero(n);
  if (with_gram) out.gram = Eigen::MatrixXd::Zero(n, n);
  if (with_curvature) out.curvature = Eigen::MatrixXd::Zero(n, n);
  std::vector<double> here(theta.data(), theta.data() + own);
  const auto stretch = [&](std::size_t first, std::size_t last, int local) {
    if (first >= last) return;
    here.back() = theta[own - 1] + (local >= 0 ? theta[own + local] : 0.0);
    const Pass part = plain_pass(here.data(), first, last, with_gram, with_curvature);
    // Place in the part and in the whole; in a local's rows the last column goes to two places.
    std::vector<std::pair<int, int>> place;
    for (int k = 0; k < own; ++k) place.emplace_back(k, k);
    if (local >= 0) place.emplace_back(own - 1, own + local);
    for (int k = own; k < part.moment.size(); ++k) place.emplace_back(k, k + static_cast<int>(locals.size()));
    for (const auto& [i, a] : place) {
      out.moment[a] += part.moment[i];
      for (const auto& [j, b] : place) {
        if (with_gram) out.gram(a, b) += part.gram(i, j);
        if (with_curvature) out.curvature(a, b) += part.curvature(i, j);
      }
    }
    out.cost += part.cost;
    out.weight += part.weight;
  };
  std::size_t done = begin;
  for (std::size_t k = 0; k < locals.size(); ++k) {
    const std::size_t first = std::clamp(locals[k].begin, done, std::max(done, end)),
                      last = std::clamp(locals[k].end, first, std::max(first, end));
    stretch(done, first, -1);
    stretch(first, last, static_cast<int>(k));
    done = last;
  }
  stretch(done, end, -1);
  return out;
}

Pass RobustProblem::plain_pass(const double* theta, std::size_t begin, std::size_t end, bool with_gram,
                               bool with_curvature) const {
  const auto own = static_cast<int>(columns.size());
  const int n = own + static_cast<int>(nonlinear.start.size());
  std::vector<const double*> all = columns;
  for (const auto& column : derivatives_) all.push_back(column.data());
  const int pairs = n * (n + 1) / 2;
  const auto count = static_cast<std::size_t>(2 * pairs + n + 2);
  std::vector<std::array<double, 8>> lanes(count);
  std::vector<double> total(count, 0.0);
  const detail::BatchInput in{.columns = all.data(),
                              .size = n,
                              .linear = own,
                              .output = nonlinear.start.empty() ? output : remainder_.data(),
                              .weight = weight,
                              .theta = theta,
                              .scale = scale,
                              .kind = static_cast<int>(kind),
                              .with_gram = with_gram,
                              .with_curvature = with_curvature};
  // Lanes are folded into the totals every 64 batches, so that no sum runs over more than 2048 terms before it is folded.
  constexpr std::size_t kFold = 64 * detail::kBatch;
  for (std::size_t fold = begin; fold < end; fold += kFold) {
    for (auto& lane : lanes) lane.fill(0.0);
    const std::size_t stop = std::min(end, fold + kFold);
    for (std::size_t i = fold; i < stop; i += detail::kBatch)
      detail::add_batch(in, i, std::min(detail::kBatch, stop - i),
                        reinterpret_cast<double(*)[8]>(lanes.data()));
    for (std::size_t k = 0; k < count; ++k) {
      const auto& lane = lanes[k];
      total[k] += ((lane[0] + lane[4]) + (lane[1] + lane[5])) + ((lane[2] + lane[6]) + (lane[3] + lane[7]));
    }
  }
  Pass out;
  const auto square = [&](const double* packed) {
    Eigen::MatrixXd matrix(n, n);
    for (int k = 0; k < n; ++k)
      for (int j = 0; j <= k; ++j) matrix(k, j) = matrix(j, k) = packed[k * (k + 1) / 2 + j];
    return matrix;
  };
  if (with_gram) out.gram = square(total.data());
  if (with_curvature) out.curvature = square(total.data() + pairs);
  out.moment = Eigen::Map<const Eigen::VectorXd>(total.data() + 2 * pairs, n);
  out.cost = total[static_cast<std::size_t>(2 * pairs + n)];
  out.weight = total[static_cast<std::size_t>(2 * pairs + n + 1)];
  return out;
}

void RobustProblem::residuals(const Eigen::VectorXd& theta, std::vector<double>& out) const {
  const double* base = nonlinear.start.empty() ? output : remainder_.data();
  out.assign(base, base + rows);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const double* x = columns[k];
    const double value = theta[static_cast<Eigen::Index>(k)];
    for (std::size_t i = 0; i < rows; ++i) out[i] -= value * x[i];
  }
  for (std::size_t k = 0; k < locals.size(); ++k) {
    const double value = theta[static_cast<Eigen::Index>(columns.size() + k)];
    for (std::size_t i = locals[k].begin; i < locals[k].end; ++i) out[i] -= value * columns.back()[i];
  }
}

RobustSolution solve(const RobustProblem& problem, const Eigen::VectorXd& start) {
  RobustSolution solution;
  solution.theta = start;
  if (problem.nonlinear.start.empty()) newton(problem, solution.theta);
  const int linear = problem.linear_size(), n = problem.size();
  problem.linearise(solution.theta);
  const Pass first = problem.pass(solution.theta, 0, problem.rows, true, false);
  Eigen::VectorXd scale(n);
  for (int k = 0; k < n; ++k) {
    const double start_size =
        k >= linear ? std::abs(problem.nonlinear.start[static_cast<std::size_t>(k - linear)]) : 0.0;
    scale[k] = start_size > 0         ? 1.0 / start_size
               : first.gram(k, k) > 0 ? std::sqrt(first.gram(k, k) / std::max(first.weight, 1e-300))
                                      : 1.0;
  }
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  CompressedCost cost(problem, scale, solution.theta, first);
  ceres::Problem solver(ownership);
  Eigen::VectorXd z = solution.theta.cwiseProduct(scale);
  solver.AddResidualBlock(&cost, nullptr, z.data());
  for (int k = linear; k < n; ++k) {
    const auto j = static_cast<std::size_t>(k - linear);
    solver.SetParameterLowerBound(z.data(), k, problem.nonlinear.lower[j] * scale[k]);
    solver.SetParameterUpperBound(z.data(), k, problem.nonlinear.upper[j] * scale[k]);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-30;
  options.gradient_tolerance = 1e-30;
  options.parameter_tolerance = 1e-12;
  options.initial_trust_region_radius = 1e16;  // least squares problems begin with the full Gauss–Newton step
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &solver, &summary);
  solution.converged = summary.termination_type == ceres::CONVERGENCE;
  solution.report = summary.BriefReport();
  solution.theta = z.cwiseQuotient(scale);
  problem.linearise(solution.theta);
  return solution;
}

}  // namespace isac::estimate
