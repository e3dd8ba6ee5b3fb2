#include "isac/estimate/muscle_solve.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>

#include "isac/estimate/linear_algebra.hpp"

namespace isac::estimate {
namespace {

std::size_t count_points(const std::vector<PreparedRun>& runs) {
  std::size_t n = 0;
  for (const PreparedRun& r : runs) n += r.points.size();
  return n;
}

}  // namespace

void muscle_residuals(const MuscleModelEntry& model, const std::vector<PreparedRun>& runs, double diameter,
                      const std::vector<double>& parameters, const std::vector<double>& zeros,
                      std::vector<double>& residuals, std::vector<double>* jacobian) {
  const std::size_t k_model = parameters.size(), columns = k_model + zeros.size();
  residuals.assign(count_points(runs), 0.0);
  if (jacobian) jacobian->assign(residuals.size() * columns, 0.0);
  std::vector<double> gradient(k_model);
  std::size_t row = 0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const double zero = zeros.empty() ? runs[r].zero : zeros[r];
    for (const MusclePoint& point : runs[r].points) {
      const double f = model.force(parameters.data(), diameter, point.pressure, point.contraction, point.rate,
                                   jacobian ? gradient.data() : nullptr);
      const bool slack = !(f > 0);
      const double reading = zero + (slack ? 0.0 : f);
      const std::size_t at = row++;
      // At the stop: a model at or below it agrees, whatever its value.
      if (point.censored && reading <= point.force) continue;
      const double w = std::sqrt(point.weight);
      residuals[at] = w * (point.force - reading);
      if (!jacobian) continue;
      double* line = jacobian->data() + at * columns;
      if (!slack)
        for (std::size_t k = 0; k < k_model; ++k) line[k] = -w * gradient[k];
      if (!zeros.empty()) line[k_model + r] = -w;
    }
  }
}

namespace {

class MuscleCost : public ceres::CostFunction {
 public:
  MuscleCost(const MuscleModelEntry& model, const std::vector<PreparedRun>& runs,
             const std::vector<std::size_t>& free, double diameter, bool fit_zeros)
      : model_(model), runs_(runs), free_(free), diameter_(diameter), zeros_(fit_zeros ? runs.size() : 0) {
    set_num_residuals(static_cast<int>(count_points(runs)));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(free.size() + zeros_));
  }
  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    std::vector<double> parameters(model_.parameters.size(), 0.0), r, j;
    for (std::size_t k = 0; k < free_.size(); ++k) parameters[free_[k]] = x[0][k];
    const std::vector<double> zeros(x[0] + free_.size(), x[0] + free_.size() + zeros_);
    const bool wanted = jacobians && jacobians[0];
    muscle_residuals(model_, runs_, diameter_, parameters, zeros, r, wanted ? &j : nullptr);
    for (double v : r)
      if (!std::isfinite(v)) return false;
    std::copy(r.begin(), r.end(), residuals);
    if (!wanted) return true;
    const std::size_t from = parameters.size() + zeros_, to = free_.size() + zeros_;
    for (std::size_t i = 0; i < r.size(); ++i) {
      for (std::size_t k = 0; k < free_.size(); ++k) jacobians[0][i * to + k] = j[i * from + free_[k]];
      for (std::size_t k = 0; k < zeros_; ++k)
        jacobians[0][i * to + free_.size() + k] = j[i * from + parameters.size() + k];
    }
    return true;
  }

 private:
  const MuscleModelEntry& model_;
  const std::vector<PreparedRun>& runs_;
  const std::vector<std::size_t>& free_;
  double diameter_;
  std::size_t zeros_;
};

// Sandwich over groups (branches of runs): within a branch the misfit is one smooth curve, not independent noise.
void set_errors(const MuscleModelEntry& model, const std::vector<PreparedRun>& runs,
                const std::vector<std::size_t>& free, double diameter, bool fit_zeros, MuscleSolution& s) {
  std::vector<double> r, j;
  muscle_residuals(model, runs, diameter, s.parameters, fit_zeros ? s.zeros : std::vector<double>(), r, &j);
  const std::size_t zeros = fit_zeros ? runs.size() : 0, all = s.parameters.size() + zeros;
  std::vector<std::size_t> columns = free;
  for (std::size_t k = 0; k < zeros; ++k) columns.push_back(s.parameters.size() + k);
  const auto n = static_cast<Eigen::Index>(columns.size());
  int groups = 0;
  for (const PreparedRun& run : runs)
    for (const MusclePoint& p : run.points) groups = std::max(groups, p.group + 1);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n), scores = Eigen::MatrixXd::Zero(n, groups);
  std::size_t row = 0;
  for (const PreparedRun& run : runs)
    for (const MusclePoint& p : run.points) {
      Eigen::VectorXd g(n);
      for (Eigen::Index k = 0; k < n; ++k) g[k] = j[row * all + columns[static_cast<std::size_t>(k)]];
      information += g * g.transpose();
      scores.col(p.group) += g * r[row];
      s.weighted_sse += r[row] * r[row];
      s.points += p.weight;
      ++row;
    }
  s.std_errors.assign(s.parameters.size(), std::numeric_limits<double>::quiet_NaN());
  s.degrees_of_freedom = std::max(1, groups - 1);
  const Eigen::VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt();
  const Eigen::MatrixXd scaled =
      scale.cwiseInverse().asDiagonal() * information * scale.cwiseInverse().asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(scaled);
  constexpr double kSingular = 1e-12;  // of the largest eigenvalue, unit diagonal
  if (!eigen.converged || !(eigen.values[0] > kSingular * eigen.values[n - 1])) return;
  const Eigen::MatrixXd bread =
      scale.cwiseInverse().asDiagonal() * inverse_square(scaled) * scale.cwiseInverse().asDiagonal();
  const double small_sample = groups > 1 ? static_cast<double>(groups) / (groups - 1) : 1.0;
  const Eigen::MatrixXd covariance = small_sample * bread * scores * scores.transpose() * bread;
  for (std::size_t k = 0; k < free.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    s.std_errors[free[k]] = std::sqrt(std::max(0.0, covariance(at, at)));
  }
}

}  // namespace

MuscleSolution solve_muscle(const MuscleModelEntry& model, const std::vector<PreparedRun>& runs,
                            const std::vector<bool>& fixed, double diameter, bool fit_zeros) {
  std::vector<std::size_t> free;
  for (std::size_t k = 0; k < fixed.size(); ++k)
    if (!fixed[k]) free.push_back(k);
  MuscleSolution best;
  double best_cost = std::numeric_limits<double>::infinity();
  // A slack muscle has no gradient: several sizes of start, the best end.
  constexpr double kStarts[][2] = {{1, 1},   {0.7, 0.7}, {1.4, 1.4},
                                   {1, 1.5}, {0.7, 1.5}, {1.4, 0.7}};  // first, others
  for (const auto& factor : kStarts) {
    std::vector<double> x;
    for (std::size_t k : free) x.push_back(model.parameters[k].start * factor[k == 0 ? 0 : 1]);
    if (fit_zeros)
      for (const PreparedRun& r : runs) x.push_back(r.zero);
    ceres::Problem problem;
    problem.AddResidualBlock(new MuscleCost(model, runs, free, diameter, fit_zeros), nullptr, x.data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.max_num_iterations = 300;
    options.function_tolerance = 1e-12;
    options.parameter_tolerance = 1e-10;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable() || !(summary.final_cost < best_cost)) continue;
    best_cost = summary.final_cost;
    best.converged = summary.termination_type == ceres::CONVERGENCE;
    best.summary = summary.BriefReport();
    best.parameters.assign(fixed.size(), 0.0);
    for (std::size_t k = 0; k < free.size(); ++k) best.parameters[free[k]] = x[k];
    best.zeros.clear();
    for (std::size_t r = 0; r < runs.size(); ++r)
      best.zeros.push_back(fit_zeros ? x[free.size() + r] : runs[r].zero);
  }
  if (!best.parameters.empty()) set_errors(model, runs, free, diameter, fit_zeros, best);
  return best;
}

}  // namespace isac::estimate
