#include "isac/tune/plant_problem.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "isac/core/error.hpp"
#include "isac/tune/linear_step.hpp"

namespace isac::tune {
namespace {

constexpr std::size_t kRowsWanted = 3000;  // of residuals; what is between them is averaged, not left out

/// The command with its load, as the plant saw it.
const std::vector<double>& loaded_command(const PlantProblem& problem, const PlantVector& x) {
  thread_local std::vector<double> command;
  command = problem.record.command;
  for (std::size_t k = 0; k < command.size(); ++k) command[k] += x[kLoad] * problem.load[k];
  return command;
}

struct Misfit {
  const PlantProblem& problem;
  bool operator()(double const* const* x, double* residuals) const {
    PlantVector at;
    std::copy_n(x[0], kPlantUnknowns, at.begin());
    return residuals_of(problem, at, residuals);
  }
};

}  // namespace

LagPlant plant_of(const PlantProblem& problem, const PlantVector& x) {
  return {.gain = std::exp(x[kLogGain]),
          .lag = std::exp(x[kLogLag]),
          .time_constant = std::exp(x[kLogTime]),
          .damping = std::exp(x[kLogDamping]),
          .dead_time = problem.fit_dead_time ? x[kDeadTime] * problem.scale : problem.known_dead_time,
          .bend = x[kBend] * problem.scale * problem.scale};
}

std::vector<double> motion_of(const PlantProblem& problem, const PlantVector& x) {
  std::vector<double> angle;
  simulate_into(plant_of(problem, x), problem.interval, loaded_command(problem, x), angle);
  for (double& y : angle) y += x[kOffset] * problem.size;
  return angle;
}

bool residuals_of(const PlantProblem& problem, const PlantVector& x, double* residuals) {
  thread_local std::vector<double> mean;
  simulate_means_into(plant_of(problem, x), problem.interval, loaded_command(problem, x), problem.thin, mean);
  for (std::size_t k = 0; k < problem.residuals(); ++k) {
    residuals[k] = (problem.mean[k] - mean[k]) / problem.size - x[kOffset];
    if (!std::isfinite(residuals[k])) return false;
  }
  return true;
}

std::vector<PlantVector> starts_of(const PlantProblem& problem) {
  // The best gain and offset for each of a few shapes.
  struct Start {
    PlantVector x;
    double cost;
  };
  std::vector<Start> starts;
  std::vector<double> angle;  // means of it
  const auto n = static_cast<double>(problem.residuals());
  for (const double lag : {0.1, 0.3, 1.0, 2.5})
    for (const double time : {0.04, 0.12, 0.3})
      for (const double damping : {0.25, 0.9})
        for (const double dead : {0.0, 0.1, 0.25}) {
          if (!problem.fit_dead_time && dead > 0) continue;
          LagPlant plant{1.0, lag * problem.scale, time * problem.scale, damping,
                         problem.fit_dead_time ? dead * problem.scale : problem.known_dead_time};
          simulate_means_into(plant, problem.interval, problem.record.command, problem.thin, angle);
          double sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
          for (std::size_t k = 0; k < angle.size(); ++k) {
            const double y = problem.mean[k];
            sx += angle[k], sy += y, sxx += angle[k] * angle[k], sxy += angle[k] * y, syy += y * y;
          }
          const double spread = n * sxx - sx * sx, gain = (n * sxy - sx * sy) / spread;
          if (!(gain > 0)) continue;
          const double offset = (sy - gain * sx) / n;
          const double cost = syy - gain * sxy - offset * sy;
          starts.push_back(
              {{std::log(gain), std::log(plant.lag), std::log(plant.time_constant), std::log(damping),
                problem.fit_dead_time ? std::max(dead, 0.01) : 0.0, offset / problem.size, 0.0, 0.0},
               cost});
        }
  std::sort(starts.begin(), starts.end(), [](const Start& a, const Start& b) { return a.cost < b.cost; });
  std::vector<PlantVector> best;
  for (std::size_t i = 0; i < std::min<std::size_t>(4, starts.size()); ++i) best.push_back(starts[i].x);
  return best;
}

PlantProblem plant_problem(const ExperimentRecord& record, const PlantFitOptions& options) {
  const auto refuse = [](const char* text) { throw Error(ErrorKind::kAnswerIsNo, "no_usable_data", text); };
  if (record.time.size() < 50) refuse("the experiment left fewer than fifty samples; let it run longer");
  PlantProblem problem;
  problem.record = even_record(record);
  const std::size_t n = problem.record.time.size();
  problem.interval = problem.record.time[1] - problem.record.time[0];
  problem.thin = n / kRowsWanted + 1;
  const auto& u = problem.record.command;
  const auto begins = std::find_if(u.begin(), u.end(), [&u](double value) { return value != u[0]; });
  double reach = 0;
  for (const double value : u) reach = std::max(reach, std::abs(value - u[0]));
  if (!(reach > 0)) refuse("the command never changed; is the experiment's amplitude zero?");
  problem.load.assign(n, 0.0);
  std::fill(problem.load.begin() + (begins - u.begin()), problem.load.end(), reach);
  const auto& y = problem.record.angle;
  const double mean = std::accumulate(y.begin(), y.end(), 0.0) / static_cast<double>(n);
  double squares = 0;
  for (const double angle : y) squares += (angle - mean) * (angle - mean);
  problem.size = std::sqrt(squares / static_cast<double>(n));
  if (!(problem.size > 0))
    refuse("the joint did not move; is the experiment's amplitude too small, or the joint held?");
  for (std::size_t k = 0; k < n / problem.thin; ++k) {
    const auto from = y.begin() + static_cast<std::ptrdiff_t>(k * problem.thin);
    const double sum = std::accumulate(from, from + static_cast<std::ptrdiff_t>(problem.thin), 0.0);
    problem.mean.push_back(sum / static_cast<double>(problem.thin));
  }
  const double length = problem.record.time.back() - problem.record.time.front();
  problem.scale = std::isfinite(options.time_scale) ? options.time_scale : length / 20;
  problem.fit_dead_time = !std::isfinite(options.dead_time);
  if (!problem.fit_dead_time) problem.known_dead_time = options.dead_time;
  return problem;
}

PlantSolution solve(const PlantProblem& problem, const PlantVector& start, LagForm form) {
  PlantSolution s;
  s.x = start;
  ceres::Problem p;
  ceres::NumericDiffOptions steps;
  steps.relative_step_size = 1e-7;
  auto* cost = new ceres::DynamicNumericDiffCostFunction<Misfit, ceres::FORWARD>(
      new Misfit{problem}, ceres::TAKE_OWNERSHIP, steps);
  cost->AddParameterBlock(kPlantUnknowns);
  cost->SetNumResiduals(static_cast<int>(problem.residuals()));
  p.AddResidualBlock(cost, nullptr, s.x.data());
  const double wide = std::log(200.0), scale = std::log(problem.scale);
  for (const int i : {kLogLag, kLogTime}) {
    p.SetParameterLowerBound(s.x.data(), i, std::max(scale - wide, std::log(0.05 * problem.interval)));
    p.SetParameterUpperBound(s.x.data(), i, scale + wide);
  }
  p.SetParameterLowerBound(s.x.data(), kLogDamping, std::log(0.005));
  p.SetParameterUpperBound(s.x.data(), kLogDamping, std::log(20.0));
  p.SetParameterLowerBound(s.x.data(), kDeadTime, form == LagForm::kLag ? 0 : -1);
  p.SetParameterUpperBound(s.x.data(), kDeadTime, 5);
  p.SetParameterLowerBound(s.x.data(), kBend, -1);
  p.SetParameterUpperBound(s.x.data(), kBend, 1);
  std::vector<int> held;
  if (!problem.fit_dead_time) held.push_back(kDeadTime);
  if (form != LagForm::kBentLag) held.push_back(kBend);
  if (!held.empty()) p.SetManifold(s.x.data(), new ceres::SubsetManifold(kPlantUnknowns, held));
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 80;
  options.function_tolerance = 1e-9;
  options.line_search_interpolation_type =
      ceres::QUADRATIC;  // a cubic one asks for all slopes at every step along the line
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p, &summary);
  s.cost = summary.final_cost;
  s.converged = summary.IsSolutionUsable() && summary.termination_type == ceres::CONVERGENCE;
  s.summary = summary.BriefReport();
  return s;
}

}  // namespace isac::tune
