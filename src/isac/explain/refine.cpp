#include "isac/explain/refine.hpp"

#include <ceres/cost_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "isac/explain/screen.hpp"

namespace isac::explain {
namespace {

class Projected final : public ceres::CostFunction {
 public:
  Projected(const Around& place, const Hypothesis& hypothesis, const Values& start,
            std::vector<std::size_t> free, std::vector<double> scale)
      : place_(place),
        hypothesis_(hypothesis),
        values_(start),
        free_(std::move(free)),
        scale_(std::move(scale)) {
    set_num_residuals(static_cast<int>(place.residual.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(free_.size()));
  }

  Eigen::VectorXd residual_at(const double* x) const {
    Active a;
    a.hypothesis = &hypothesis_;
    a.values = values_;
    for (std::size_t j = 0; j < free_.size(); ++j) a.values[free_[j]] = x[j] * scale_[j];
    return place_.residual +
           place_.project(response(*place_.predictor, *place_.fit, place_.here, a, *place_.weights));
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::VectorXd here = residual_at(parameters[0]);
    if (!here.allFinite()) return false;
    Eigen::Map<Eigen::VectorXd>(residuals, here.size()) = here;
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    const auto m = static_cast<Eigen::Index>(free_.size());
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> j(jacobians[0],
                                                                                         here.size(), m);
    std::vector<double> x(parameters[0], parameters[0] + free_.size());
    for (Eigen::Index k = 0; k < m; ++k) {
      const auto i = static_cast<std::size_t>(k);
      // Onsets and widths move events from sample to sample: a longer step sees more of them.
      const bool shape = std::isnan(hypothesis_.info().parameters[free_[i]].null_value);
      const bool memory = hypothesis_.info().state_count > 0;
      double step = memory ? 1e-2 : shape ? 2e-3 : 1e-4;
      if ((x[i] + step) * scale_[i] > hypothesis_.upper[free_[i]]) step = -step;
      const double kept = x[i];
      x[i] = kept + step;
      const Eigen::VectorXd there = residual_at(x.data());
      x[i] = kept;
      if (!there.allFinite()) return false;
      j.col(k) = (there - here) / step;
    }
    return true;
  }

 private:
  const Around& place_;
  const Hypothesis& hypothesis_;
  Values values_;
  std::vector<std::size_t> free_;
  std::vector<double> scale_;
};

}  // namespace

Around around(const Predictor& predictor, const Fit& fit, const Weights& weights) {
  Around place;
  place.predictor = &predictor;
  place.fit = &fit;
  place.weights = &weights;
  place.basis = basis_of(sensitivities(predictor, fit, weights));
  place.here = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(predictor.rows()));
  predictor.predict(fit.model, kAllChains, place.here);
  place.residual = place.project(fit.residual);
  return place;
}

Refined refine(const Around& place, const Hypothesis& hypothesis, const Values& start, int iterations) {
  std::vector<std::size_t> free;
  std::vector<double> scale, x;
  for (int i = 0; i < hypothesis.info().parameter_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!hypothesis.free[k]) continue;
    free.push_back(k);
    double s = std::max(std::abs(start[k]), 1e-3 * std::abs(hypothesis.info().parameters[i].typical));
    if (!(s > 0)) s = 1;
    scale.push_back(s);
    x.push_back(start[k] / s);
  }
  ceres::Problem problem;
  auto* cost = new Projected(place, hypothesis, start, free, scale);
  problem.AddResidualBlock(cost, nullptr, x.data());
  for (std::size_t j = 0; j < x.size(); ++j) {
    problem.SetParameterLowerBound(x.data(), static_cast<int>(j), hypothesis.lower[free[j]] / scale[j]);
    problem.SetParameterUpperBound(x.data(), static_cast<int>(j), hypothesis.upper[free[j]] / scale[j]);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = iterations;
  options.function_tolerance = 1e-6;
  options.parameter_tolerance = 1e-5;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  Refined refined;
  refined.values = start;
  for (std::size_t j = 0; j < x.size(); ++j) refined.values[free[j]] = x[j] * scale[j];
  refined.residual = cost->residual_at(x.data());
  refined.loss = refined.residual.squaredNorm();
  const bool staircase =
      hypothesis.info().state_count > 0 && (hypothesis.dry || hypothesis.reads_angle ||
                                            std::string_view(hypothesis.info().id) == "valve_hysteresis");
  if (staircase) {
    // Events make the loss a staircase on which derivatives mislead: one parameter after another, ever finer.
    for (const double change : {0.3, 0.1, 0.03, 0.01}) {
      bool better = true;
      for (int round = 0; better && round < 3; ++round) {
        better = false;
        for (std::size_t j = 0; j < x.size(); ++j)
          for (const double factor : {1 + change, 1 / (1 + change)}) {
            std::vector<double> tried = x;
            tried[j] =
                std::clamp(x[j] * factor * scale[j], hypothesis.lower[free[j]], hypothesis.upper[free[j]]) /
                scale[j];
            Eigen::VectorXd residual = cost->residual_at(tried.data());
            const double loss = residual.squaredNorm();
            if (!(loss < refined.loss * (1 - 1e-7))) continue;
            refined.loss = loss;
            refined.residual = std::move(residual);
            x = std::move(tried);
            better = true;
          }
      }
    }
    for (std::size_t j = 0; j < x.size(); ++j) refined.values[free[j]] = x[j] * scale[j];
  }
  return refined;
}

}  // namespace isac::explain
