#include "isac/estimate/motion_fit.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/estimate/block_covariance.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/motion_pass.hpp"
#include "isac/estimate/motion_start.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

using motion::Prepared;
using motion::Sums;

constexpr std::size_t kCount = kMotionParameters;
constexpr int kResidualSize = motion::kUsedLanes + 1;

struct Name {
  const char* name;
  const char* unit;
  double reported_per_si;
  double least_scale;  ///< SI; a parameter that starts at zero still has a size
};
constexpr Name kNames[kCount] = {
    {"inertia", "kg m2", 1, 1e-4}, {"A", "N/m", 1, 100},    {"B", "N cm2/kg", kPascalPerKgfCm2, 1e-5},
    {"C", "N m s3", 1, 1e-3},      {"D", "N m s", 1, 1e-2}, {"coulomb_friction", "N m", 1, 1e-2},
    {"T_C", "s", 1, 1e-3}};

MotionVector scales_of(const MotionVector& start) {
  MotionVector scale;
  for (std::size_t j = 0; j < kCount; ++j) scale[j] = std::max(std::abs(start[j]), kNames[j].least_scale);
  return scale;
}

/// One run as one Ceres cost function. Its residual and Jacobian are the square root of the run's normal equations: same
/// cost, gradient and Gauss-Newton matrix as one residual per row (docs/derivations/motion_fit.md).
class RunCost final : public ceres::CostFunction {
 public:
  RunCost(const Prepared& run, const MotionOptions& options, const MotionVector& scale, int& passes)
      : run_(run), options_(options), scale_(scale), passes_(passes) {
    set_num_residuals(kResidualSize);
    mutable_parameter_block_sizes()->push_back(kMotionParameters);
    if (!options.initial_rest) mutable_parameter_block_sizes()->push_back(2);
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    motion::State state;
    for (std::size_t j = 0; j < kCount; ++j) state.parameters[j] = blocks[0][j] * scale_[j];
    if (!(state.parameters[kInertia] > 0) || !(state.parameters[kLag] > 0)) return false;
    if (!options_.initial_rest) {
      state.angle = blocks[1][0];
      state.speed = blocks[1][1];
    }
    if (!sums_at(state)) return false;
    if (jacobians == nullptr) {
      std::fill_n(residuals, kResidualSize, 0.0);
      residuals[kResidualSize - 1] = std::sqrt(sums_.square);
      return true;
    }
    constexpr int n = motion::kUsedLanes;
    Eigen::Matrix<double, n, n> gram;
    Eigen::Matrix<double, n, 1> moment;
    for (int i = 0; i < n; ++i) {
      moment[i] = sums_.moment[i] * lane_scale(i);
      for (int j = 0; j < n; ++j) gram(i, j) = sums_.gram[i][j] * lane_scale(i) * lane_scale(j);
    }
    const SymmetricEigen eigen = symmetric_eigen(gram);
    if (!eigen.converged) return false;
    Eigen::Matrix<double, n, 1> root = eigen.values.cwiseMax(0.0).cwiseSqrt();
    Eigen::Matrix<double, n, 1> r = eigen.vectors.transpose() * moment;
    const double smallest = 1e-14 * root.maxCoeff();
    for (int i = 0; i < n; ++i) r[i] = root[i] > smallest ? r[i] / root[i] : 0.0;
    Eigen::Map<Eigen::Matrix<double, n, 1>>(residuals, n) = r;
    residuals[n] = std::sqrt(std::max(0.0, sums_.square - r.squaredNorm()));
    const Eigen::Matrix<double, n, n> slope = -(root.asDiagonal() * eigen.vectors.transpose());
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, kResidualSize, kMotionParameters, Eigen::RowMajor>> out(jacobians[0]);
      out.setZero();
      out.topRows<n>() = slope.leftCols<kMotionParameters>();
    }
    if (!options_.initial_rest && jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, kResidualSize, 2, Eigen::RowMajor>> out(jacobians[1]);
      out.setZero();
      out.topRows<n>() = slope.rightCols<2>();
    }
    return true;
  }

 private:
  /// Ceres asks for the cost of a step first and for its Jacobian when the step is taken: one pass serves both.
  bool sums_at(const motion::State& state) const {
    if (known_ && state.parameters == at_.parameters && state.angle == at_.angle && state.speed == at_.speed)
      return valid_;
    std::vector<Sums> sums;
    ++passes_;
    known_ = true;
    at_ = state;
    valid_ = motion::accumulate(run_, state, options_, 0, sums);
    if (valid_) sums_ = sums.front();
    return valid_;
  }

  [[nodiscard]] double lane_scale(int lane) const {
    return lane < kMotionParameters ? scale_[static_cast<std::size_t>(lane)] : 1.0;
  }

  const Prepared& run_;
  const MotionOptions& options_;
  MotionVector scale_;
  int& passes_;
  mutable bool known_ = false, valid_ = false;
  mutable motion::State at_;
  mutable Sums sums_;
};

struct Solution {
  MotionVector parameters{};
  std::vector<std::array<double, 2>> initial;
  double cost = std::numeric_limits<double>::infinity();
  bool converged = false;
  std::string report;
};

/// Angle and speed of the first tenth of a second, by a straight line.
std::array<double, 2> initial_guess(const Prepared& run) {
  std::size_t n = 1;
  while (n < run.time.size() && run.time[n] - run.time[0] < 0.05) ++n;
  const double speed = n > 1 ? (run.angle[n - 1] - run.angle[0]) / (run.time[n - 1] - run.time[0]) : 0.0;
  return {run.angle[0], speed};
}

Solution solve_from(const std::vector<Prepared>& runs, const MotionOptions& options,
                    const MotionVector& start, const std::array<bool, kCount>& fixed, int& passes) {
  const MotionVector scale = scales_of(start);
  MotionVector z;
  for (std::size_t j = 0; j < kCount; ++j) z[j] = start[j] / scale[j];
  Solution solution;
  for (const Prepared& run : runs) solution.initial.push_back(initial_guess(run));

  ceres::Problem problem;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    auto* cost = new RunCost(runs[i], options, scale, passes);
    if (options.initial_rest) {
      problem.AddResidualBlock(cost, nullptr, z.data());
    } else {
      problem.AddResidualBlock(cost, nullptr, z.data(), solution.initial[i].data());
    }
  }
  std::vector<int> held;
  for (std::size_t j = 0; j < kCount; ++j) {
    if (fixed[j]) held.push_back(static_cast<int>(j));
  }
  if (held.size() == kCount) {
    problem.SetParameterBlockConstant(z.data());
  } else if (!held.empty()) {
    problem.SetManifold(z.data(), new ceres::SubsetManifold(static_cast<int>(kCount), held));
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_QR;
  solver.max_num_iterations = 100;
  solver.function_tolerance = 1e-14;
  solver.parameter_tolerance = 1e-10;
  solver.gradient_tolerance = 1e-14;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  for (std::size_t j = 0; j < kCount; ++j) solution.parameters[j] = fixed[j] ? start[j] : z[j] * scale[j];
  solution.cost = summary.IsSolutionUsable() ? summary.final_cost : std::numeric_limits<double>::infinity();
  solution.converged = summary.termination_type == ceres::CONVERGENCE;
  solution.report = summary.BriefReport();
  return solution;
}

/// The three starts whose simulated motion comes nearest to the measured one.
std::vector<MotionVector> best_by_simulation(const std::vector<Prepared>& runs, const MotionOptions& options,
                                             const std::vector<MotionVector>& starts, int& passes) {
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t s = 0; s < starts.size(); ++s) {
    double square = 0;
    for (const Prepared& run : runs) {
      const auto initial = options.initial_rest ? std::array<double, 2>{} : initial_guess(run);
      std::vector<double> predicted(run.time.size());
      ++passes;
      if (!motion::predict(run, {starts[s], initial[0], initial[1]}, options, predicted.data())) {
        square = std::numeric_limits<double>::infinity();
        break;
      }
      for (std::size_t i = 0; i < predicted.size(); ++i) {
        square += (run.angle[i] - predicted[i]) * (run.angle[i] - predicted[i]);
      }
    }
    order.emplace_back(square, s);
  }
  std::sort(order.begin(), order.end());
  std::vector<MotionVector> best;
  for (std::size_t i = 0; i < std::min<std::size_t>(3, order.size()); ++i)
    best.push_back(starts[order[i].second]);
  return best;
}

void refuse(Estimated& parameter, const std::string& reason) {
  parameter.identifiable = false;
  parameter.value = parameter.std_error = parameter.ci_low = parameter.ci_high =
      std::numeric_limits<double>::quiet_NaN();
  parameter.reason = reason;
}

constexpr const char* kScaleReason =
    "the motion tells torques only up to a common factor; hold one that is known, e.g. the inertia from "
    "rig.toml, or add a "
    "known gravity torque";

}  // namespace

MotionFit fit_motion(std::span<const MotionRun> runs, const MotionOptions& options) {
  std::vector<Prepared> ready;
  std::vector<const MotionRun*> sources;
  for (const MotionRun& run : runs) {
    if (run.time.size() != run.angle.size() || run.time.size() != run.command.size()) {
      throw Error(ErrorKind::kUsage, "columns_unequal",
                  run.name + ": time, command and angle must have equal length");
    }
    Prepared prepared = motion::prepare(run, options);
    if (prepared.time.size() < 50) continue;
    ready.push_back(std::move(prepared));
    sources.push_back(&run);
  }
  if (ready.empty()) {
    throw Error(ErrorKind::kAnswerIsNo, "no_usable_data",
                "no run has 50 rows with time, command and angle; record a free joint with isac-log free");
  }

  MotionFit fit;
  fit.parameters.resize(kCount);
  for (std::size_t j = 0; j < kCount; ++j) {
    fit.parameters[j].name = kNames[j].name;
    fit.parameters[j].unit = kNames[j].unit;
  }
  for (const Prepared& run : ready) fit.samples += run.time.size();

  std::vector<MotionVector> starts;
  const bool all_given =
      std::all_of(options.start.begin(), options.start.end(), [](double v) { return std::isfinite(v); });
  if (all_given) {
    starts = {options.start};
  } else {
    starts = best_by_simulation(ready, options, motion::find_starts(ready, options), fit.simulations);
  }
  const bool scale_known = options.gravity_torque != 0 || options.fixed[kInertia] || options.fixed[kA] ||
                           options.fixed[kB] || options.fixed[kC] || options.fixed[kD] ||
                           options.fixed[kFriction];
  if (starts.empty() || !scale_known) {
    for (std::size_t j = 0; j < kCount; ++j) refuse(fit.parameters[j], kScaleReason);
    return fit;
  }

  Solution best;
  for (const MotionVector& start : starts) {
    Solution solution = solve_from(ready, options, start, options.fixed, fit.simulations);
    if (solution.cost < best.cost) best = std::move(solution);
  }
  fit.solver_summary = best.report;
  fit.converged = best.converged && std::isfinite(best.cost);
  if (!std::isfinite(best.cost)) {
    for (Estimated& parameter : fit.parameters) {
      refuse(
          parameter,
          "the simulated motion runs away from every start; check the signs and units of command and angle");
    }
    return fit;
  }
  fit.values = best.parameters;

  // Residuals, and blocks of time longer than they remember.
  std::vector<std::vector<double>> residuals;
  double square = 0;
  for (std::size_t i = 0; i < ready.size(); ++i) {
    const Prepared& run = ready[i];
    std::vector<double> predicted(run.time.size());
    motion::State state{best.parameters, 0, 0};
    if (!options.initial_rest) {
      state.angle = best.initial[i][0];
      state.speed = best.initial[i][1];
    }
    if (!motion::predict(run, state, options, predicted.data()))
      predicted.assign(run.time.size(), std::nan(""));
    std::vector<double> residual(run.time.size());
    double run_square = 0;
    for (std::size_t k = 0; k < residual.size(); ++k) {
      residual[k] = run.angle[k] - predicted[k];
      run_square += residual[k] * residual[k];
    }
    square += run_square;
    fit.runs.push_back({.name = sources[i]->name,
                        .rmse = std::sqrt(run_square / static_cast<double>(run.time.size())),
                        .initial_angle = state.angle,
                        .initial_speed = state.speed,
                        .time = run.time,
                        .measured = run.angle,
                        .predicted = std::move(predicted)});
    residuals.push_back(std::move(residual));
  }
  fit.rmse = std::sqrt(square / static_cast<double>(fit.samples));

  double interval = 0, seconds = 0;
  for (const Prepared& run : ready) seconds += run.time.back() - run.time.front();
  interval = seconds / static_cast<double>(fit.samples);
  double block_seconds = options.block_seconds;
  if (!std::isfinite(block_seconds)) {
    block_seconds = std::clamp(10 * series::correlation_time(residuals) * interval, 1.0, seconds / 20);
  }
  const auto block_rows = static_cast<std::size_t>(std::max(20.0, block_seconds / interval));

  std::vector<std::size_t> free;  // lanes of the shared parameters that were fitted
  for (std::size_t j = 0; j < kCount; ++j) {
    if (!options.fixed[j]) free.push_back(j);
  }
  const std::size_t own = options.initial_rest ? 0 : 2;
  const auto size = static_cast<Eigen::Index>(free.size() + own * ready.size());
  const MotionVector scale = scales_of(best.parameters);
  std::vector<BlockSums> blocks;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < ready.size(); ++i) {
    std::vector<Sums> sums;
    motion::State state{best.parameters, fit.runs[i].initial_angle, fit.runs[i].initial_speed};
    if (!motion::accumulate(ready[i], state, options, block_rows, sums)) continue;
    std::vector<std::pair<int, Eigen::Index>> lanes;  // lane, place
    for (std::size_t a = 0; a < free.size(); ++a)
      lanes.emplace_back(static_cast<int>(free[a]), static_cast<Eigen::Index>(a));
    for (std::size_t b = 0; b < own; ++b) {
      lanes.emplace_back(motion::kInitialAngle + static_cast<int>(b),
                         static_cast<Eigen::Index>(free.size() + own * i + b));
    }
    const auto lane_scale = [&scale](int lane) {
      return lane < kMotionParameters ? scale[static_cast<std::size_t>(lane)] : 1.0;
    };
    for (const Sums& block : sums) {
      BlockSums out{Eigen::VectorXd::Zero(size), Eigen::MatrixXd::Zero(size, size)};
      for (const auto& [lane_a, a] : lanes) {
        out.score[a] = block.moment[lane_a] * lane_scale(lane_a);
        for (const auto& [lane_b, b] : lanes) {
          out.curvature(a, b) = block.gram[lane_a][lane_b] * lane_scale(lane_a) * lane_scale(lane_b);
        }
      }
      information += out.curvature;
      blocks.push_back(std::move(out));
    }
  }

  // Which parameters does the motion not tell apart? Unit diagonal first, so that units do not matter.
  const Eigen::VectorXd diagonal = information.diagonal().cwiseMax(1e-300).cwiseSqrt();
  const Eigen::MatrixXd unit =
      diagonal.cwiseInverse().asDiagonal() * information * diagonal.cwiseInverse().asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(unit);
  std::vector<bool> refused(kCount, false);
  for (Eigen::Index k = 0; k < size; ++k) {
    if (eigen.values[k] > 1e-9) continue;
    for (std::size_t a = 0; a < free.size(); ++a) {
      if (std::abs(eigen.vectors(static_cast<Eigen::Index>(a), k)) > 0.1) refused[free[a]] = true;
    }
  }
  // What is refused is held, so that the others keep their errors.
  std::vector<Eigen::Index> kept;
  for (Eigen::Index a = 0; a < size; ++a) {
    const bool shared = a < static_cast<Eigen::Index>(free.size());
    if (!shared || !refused[free[static_cast<std::size_t>(a)]]) kept.push_back(a);
  }
  for (BlockSums& block : blocks) {
    block.score = Eigen::VectorXd(block.score(kept));
    block.curvature = Eigen::MatrixXd(block.curvature(kept, kept));
  }
  const BlockCovariance sandwich = block_covariance(blocks);
  fit.correlation.assign(kCount * kCount, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t j = 0; j < kCount; ++j) {
    Estimated& parameter = fit.parameters[j];
    parameter.value = best.parameters[j] * kNames[j].reported_per_si;
    if (options.fixed[j]) {
      parameter.std_error = 0;
      parameter.ci_low = parameter.ci_high = parameter.value;
    }
  }
  const auto place = [&kept](std::size_t a) {  // of a free parameter in the sandwich, −1: refused
    const auto found = std::find(kept.begin(), kept.end(), static_cast<Eigen::Index>(a));
    return found == kept.end() ? Eigen::Index{-1} : static_cast<Eigen::Index>(found - kept.begin());
  };
  for (std::size_t a = 0; a < free.size(); ++a) {
    Estimated& parameter = fit.parameters[free[a]];
    const Eigen::Index at = place(a);
    if (at < 0 || !std::isfinite(sandwich.covariance(at, at))) {
      refuse(parameter,
             "this motion does not tell it apart from the others; record larger and faster motion with "
             "moving valves, or hold "
             "one of them");
      continue;
    }
    const double variance = sandwich.covariance(at, at);
    parameter.std_error = std::sqrt(variance) * scale[free[a]] * kNames[free[a]].reported_per_si;
    const double reach = parameter.std_error * series::student_t_limit(0.95, sandwich.degrees_of_freedom[at]);
    parameter.ci_low = parameter.value - reach;
    parameter.ci_high = parameter.value + reach;
    for (std::size_t b = 0; b < free.size(); ++b) {
      const Eigen::Index bt = place(b);
      if (bt < 0) continue;
      fit.correlation[free[a] * kCount + free[b]] =
          sandwich.covariance(at, bt) / std::sqrt(variance * sandwich.covariance(bt, bt));
    }
  }
  return fit;
}

std::vector<double> simulate_motion(const MotionRun& run, const MotionVector& parameters,
                                    const MotionOptions& options, double initial_angle,
                                    double initial_speed) {
  const Prepared ready = motion::prepare(run, options);
  std::vector<double> angles(ready.time.size());
  if (!motion::predict(ready, {parameters, initial_angle, initial_speed}, options, angles.data())) {
    angles.assign(angles.size(), std::numeric_limits<double>::quiet_NaN());
  }
  return angles;
}

}  // namespace isac::estimate
