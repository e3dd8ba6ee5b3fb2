#include "isac/estimate/step_fit.hpp"

#include <ceres/ceres.h>

#include <cmath>
#include <utility>

#include "isac/estimate/step_noise.hpp"

namespace isac::estimate {

void step_residuals(std::span<const double> s, std::span<const double> y, const StepParameters& parameters,
                    double* residuals, double* jacobian) {
  const auto [low, gain, lag, onset] = parameters;
  double last = -1, decay = 1;
  for (std::size_t i = 0; i < s.size(); ++i) {
    const double x = s[i] - onset;
    if (x <= 0) {
      residuals[i] = y[i] - low;
      if (jacobian) {
        jacobian[4 * i] = -1;
        jacobian[4 * i + 1] = jacobian[4 * i + 2] = jacobian[4 * i + 3] = 0;
      }
      continue;
    }
    if (x != last) decay = std::exp(-x / lag);
    last = x;
    residuals[i] = y[i] - low - gain * (1 - decay);
    if (jacobian) {
      jacobian[4 * i] = -1;
      jacobian[4 * i + 1] = -(1 - decay);
      jacobian[4 * i + 2] = gain * decay * x / (lag * lag);
      jacobian[4 * i + 3] = gain * decay / lag;
    }
  }
}

namespace {

// Parameters are scaled: levels by the step, times by the starting lag, so that Ceres' tolerances mean the same for all.
class StepCost : public ceres::CostFunction {
 public:
  StepCost(const StepData& data, const StepParameters& scale) : data_(data), scale_(scale) {
    set_num_residuals(static_cast<int>(data.y.size()));
    mutable_parameter_block_sizes()->push_back(4);
  }
  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    StepParameters p;
    for (std::size_t k = 0; k < 4; ++k) p[k] = x[0][k] * scale_[k];
    if (!(p[2] > 0)) return false;
    double* jacobian = jacobians ? jacobians[0] : nullptr;
    step_residuals(data_.s, data_.y, p, residuals, jacobian);
    if (jacobian)
      for (std::size_t i = 0; i < data_.y.size(); ++i)
        for (std::size_t k = 0; k < 4; ++k) jacobian[4 * i + k] *= scale_[k];
    return true;
  }

 private:
  const StepData& data_;
  StepParameters scale_;
};

}  // namespace

StepFit fit_step(const StepData& data, double earliest) {
  StepFit fit;
  auto [start, start_sse] = search_step(data, earliest);
  if (!std::isfinite(start_sse) || start[1] == 0 || !(start[2] > 0)) return fit;

  const double size = std::abs(start[1]);
  const StepParameters scale = {size, size, start[2], start[2]};
  double x[4];
  for (std::size_t k = 0; k < 4; ++k) x[k] = start[k] / scale[k];
  ceres::Problem problem;
  problem.AddResidualBlock(new StepCost(data, scale), nullptr, x);
  if (std::isfinite(earliest)) problem.SetParameterLowerBound(x, 3, earliest / scale[3]);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 50;
  options.function_tolerance = 1e-15;
  options.gradient_tolerance = 1e-12 * size * size;
  options.parameter_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (std::size_t k = 0; k < 4; ++k) fit.parameters[k] = x[k] * scale[k];
  fit.summary = summary.BriefReport();
  // At a kink the gradient jumps and no step helps: Ceres stops at the start, which is the minimum.
  fit.converged = summary.IsSolutionUsable();
  if (!(2 * summary.final_cost <= start_sse * (1 + 1e-9))) fit.parameters = start;

  const std::size_t n = data.y.size();
  fit.residuals.resize(n);
  std::vector<double> jacobian(4 * n);
  step_residuals(data.s, data.y, fit.parameters, fit.residuals.data(), jacobian.data());
  for (double r : fit.residuals) fit.sse += r * r;
  const StepCovariance c = step_covariance(jacobian, fit.residuals, data, fit.parameters);
  fit.ok = c.ok;
  fit.covariance = c.covariance;
  fit.degrees_of_freedom = c.degrees_of_freedom;
  fit.correlation_rows = c.correlation_rows;
  return fit;
}

}  // namespace isac::estimate
