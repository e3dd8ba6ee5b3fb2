#include "isac/tune/plant_fit.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/students_t.hpp>
#include <cassert>
#include <cmath>
#include <functional>
#include <numeric>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/estimate/block_covariance.hpp"
#include "isac/tune/linear_step.hpp"

namespace isac::tune {
namespace {

constexpr std::size_t kRowsWanted = 3000;  // of residuals; the command is never thinned
constexpr int kParameters = 7;             // log K, log T_C, log T_J, log ζ, L/scale, φ_0/size, load/reach
constexpr int kFree = 5;
constexpr double kAsGood = 1.01;    // times the least sum of squares
constexpr double kDisagree = 0.04;  // in K_crit, of two plants that fit as well as each other
using Vector = std::array<double, kParameters>;

struct Problem {
  ExperimentRecord record;
  std::vector<double> load;  ///< 0 at rest, the command's reach from its first change on
  double interval = 0, size = 1, scale = 1, known_dead_time = 0;
  bool fit_dead_time = true;
  std::size_t thin = 1;  ///< every how many rows a residual is taken

  [[nodiscard]] std::size_t residuals() const { return (record.time.size() + thin - 1) / thin; }
};

LagPlant plant_of(const Problem& problem, const double* x) {
  return {.gain = std::exp(x[0]),
          .lag = std::exp(x[1]),
          .time_constant = std::exp(x[2]),
          .damping = std::exp(x[3]),
          .dead_time = problem.fit_dead_time ? x[4] * problem.scale : problem.known_dead_time};
}

class Misfit {
 public:
  explicit Misfit(const Problem& problem) : problem_(problem) {}
  bool operator()(double const* const* x, double* residuals) const {
    thread_local std::vector<double> angle, command;
    command = problem_.record.command;
    for (std::size_t k = 0; k < command.size(); ++k) command[k] += x[0][6] * problem_.load[k];
    simulate_into(plant_of(problem_, x[0]), problem_.interval, command, angle);
    for (std::size_t k = 0; k < problem_.residuals(); ++k) {
      const std::size_t row = k * problem_.thin;
      residuals[k] = (problem_.record.angle[row] - angle[row]) / problem_.size - x[0][5];
      if (!std::isfinite(residuals[k])) return false;
    }
    return true;
  }

 private:
  const Problem& problem_;
};

/// Where to begin: the best gain and offset for each of a few shapes.
struct Start {
  Vector x{};
  double cost = std::numeric_limits<double>::infinity();
};

std::vector<Start> starts_of(const Problem& problem) {
  std::vector<Start> starts;
  std::vector<double> angle;
  const auto n = static_cast<double>(problem.record.angle.size());
  for (const double lag : {0.1, 0.3, 1.0, 2.5})
    for (const double time : {0.04, 0.12, 0.3})
      for (const double damping : {0.25, 0.9})
        for (const double dead : {0.0, 0.1, 0.25}) {
          if (!problem.fit_dead_time && dead > 0) continue;
          LagPlant plant{1.0, lag * problem.scale, time * problem.scale, damping,
                         problem.fit_dead_time ? dead * problem.scale : problem.known_dead_time};
          simulate_into(plant, problem.interval, problem.record.command, angle);
          double sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
          for (std::size_t k = 0; k < angle.size(); ++k) {
            const double y = problem.record.angle[k];
            sx += angle[k], sy += y, sxx += angle[k] * angle[k], sxy += angle[k] * y, syy += y * y;
          }
          const double spread = n * sxx - sx * sx, gain = (n * sxy - sx * sy) / spread;
          if (!(gain > 0)) continue;
          const double offset = (sy - gain * sx) / n;
          const double cost = syy - gain * sxy - offset * sy;
          starts.push_back(
              {{std::log(gain), std::log(plant.lag), std::log(plant.time_constant), std::log(damping),
                problem.fit_dead_time ? std::max(dead, 0.01) : 0.0, offset / problem.size, 0.0},
               cost});
        }
  std::sort(starts.begin(), starts.end(), [](const Start& a, const Start& b) { return a.cost < b.cost; });
  if (starts.size() > 4) starts.resize(4);
  return starts;
}

Problem problem_of(const ExperimentRecord& record, const PlantFitOptions& options) {
  const auto refuse = [](const char* text) { throw Error(ErrorKind::kAnswerIsNo, "no_usable_data", text); };
  if (record.time.size() < 50) refuse("the experiment left fewer than fifty samples; let it run longer");
  Problem problem;
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
  const double length = problem.record.time.back() - problem.record.time.front();
  problem.scale = std::isfinite(options.time_scale) ? options.time_scale : length / 20;
  problem.fit_dead_time = !std::isfinite(options.dead_time);
  if (!problem.fit_dead_time) problem.known_dead_time = options.dead_time;
  return problem;
}

struct Solution {
  Vector x{};
  double cost = std::numeric_limits<double>::infinity();
  bool converged = false;
  std::string summary;
};

Solution solve(const Problem& problem, const Vector& start) {
  Solution s;
  s.x = start;
  ceres::Problem p;
  ceres::NumericDiffOptions steps;
  steps.relative_step_size = 1e-5;
  auto* cost = new ceres::DynamicNumericDiffCostFunction<Misfit, ceres::CENTRAL>(
      new Misfit(problem), ceres::TAKE_OWNERSHIP, steps);
  cost->AddParameterBlock(kParameters);
  cost->SetNumResiduals(static_cast<int>(problem.residuals()));
  p.AddResidualBlock(cost, nullptr, s.x.data());
  const double wide = std::log(200.0), scale = std::log(problem.scale);
  for (const int i : {1, 2}) {
    p.SetParameterLowerBound(s.x.data(), i, std::max(scale - wide, std::log(0.05 * problem.interval)));
    p.SetParameterUpperBound(s.x.data(), i, scale + wide);
  }
  p.SetParameterLowerBound(s.x.data(), 3, std::log(0.005));
  p.SetParameterUpperBound(s.x.data(), 3, std::log(20.0));
  p.SetParameterLowerBound(s.x.data(), 4, 0);
  p.SetParameterUpperBound(s.x.data(), 4, 5);
  if (!problem.fit_dead_time) p.SetManifold(s.x.data(), new ceres::SubsetManifold(kParameters, {4}));
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 80;
  options.function_tolerance = 1e-9;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p, &summary);
  s.cost = summary.final_cost;
  s.converged = summary.IsSolutionUsable() && summary.termination_type == ceres::CONVERGENCE;
  s.summary = summary.BriefReport();
  return s;
}

/// Every column of the Jacobian of the residuals, by central differences.
Eigen::MatrixXd jacobian_of(const Problem& problem, const Vector& x, const std::vector<int>& free) {
  const auto n = static_cast<Eigen::Index>(problem.residuals());
  Eigen::MatrixXd jacobian(n, static_cast<Eigen::Index>(free.size()));
  Eigen::VectorXd high(n), low(n);
  const Misfit misfit(problem);
  for (std::size_t j = 0; j < free.size(); ++j) {
    Vector up = x, down = x;
    const auto i = static_cast<std::size_t>(free[j]);
    const double h = 1e-4;
    up[i] += h;
    down[i] -= h;
    const double* a[] = {up.data()};
    const double* b[] = {down.data()};
    misfit(a, high.data());
    misfit(b, low.data());
    jacobian.col(static_cast<Eigen::Index>(j)) = (high - low) / (2 * h);
  }
  return jacobian;
}

struct Spread {
  Eigen::MatrixXd covariance;  ///< of all six, zero for what is held
  double freedom = 1;
};

Spread spread_of(const Problem& problem, const Vector& x) {
  std::vector<int> free = {0, 1, 2, 3, 6};
  if (problem.fit_dead_time && x[4] > 2e-4) free.push_back(4);  // at its bound it is held
  free.push_back(5);
  const Eigen::MatrixXd jacobian = jacobian_of(problem, x, free);
  const auto n = jacobian.rows(), m = jacobian.cols();
  Eigen::VectorXd residual(n);
  const double* at[] = {x.data()};
  Misfit{problem}(at, residual.data());
  // Blocks longer than half a period of what the joint does: its residuals remember no longer.
  const Eigen::Index count = std::clamp<Eigen::Index>(n / 60, 12, 40);
  std::vector<estimate::BlockSums> blocks;
  for (Eigen::Index b = 0; b < count; ++b) {
    const Eigen::Index from = b * n / count, rows = (b + 1) * n / count - from;
    const auto part = jacobian.middleRows(from, rows);
    blocks.push_back({part.transpose() * residual.segment(from, rows), part.transpose() * part});
  }
  // Known beforehand of each logarithm: ± 2, a factor of seven; it keeps lags that cannot be told apart from infinite errors.
  const double variance = residual.squaredNorm() / static_cast<double>(n - m);
  estimate::Prior prior{Eigen::VectorXd::Constant(m, variance / 4),
                        Eigen::VectorXd::Constant(m, variance * variance / 4)};
  const estimate::BlockCovariance found = estimate::block_covariance(blocks, prior);
  Spread spread{Eigen::MatrixXd::Zero(kParameters, kParameters), static_cast<double>(count - m)};
  for (Eigen::Index i = 0; i < m; ++i)
    for (Eigen::Index j = 0; j < m; ++j)
      spread.covariance(free[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(j)]) =
          found.covariance(i, j);
  return spread;
}

/// What is told of the plant: a name, its unit, its value.
struct Fact {
  const char* name;
  const char* unit;
  std::function<double(const LagPlant&)> of;
};

const std::vector<Fact>& parameter_facts() {
  static const std::vector<Fact> facts = {
      {"K", "rad/(kg/cm2)", [](const LagPlant& p) { return p.gain * kPascalPerKgfCm2; }},
      {"T_C", "s", [](const LagPlant& p) { return p.lag; }},
      {"T_J", "s", [](const LagPlant& p) { return p.time_constant; }},
      {"zeta", "-", [](const LagPlant& p) { return p.damping; }},
      {"dead_time", "s", [](const LagPlant& p) { return p.dead_time; }}};
  return facts;
}

const std::vector<Fact>& derived_facts() {
  const auto critical = [](const LagPlant& p) {
    return ultimate(plant_loop(p)).value_or(Ultimate{NAN, NAN});
  };
  static const std::vector<Fact> facts = {
      {"K_crit", "kg/cm2/rad", [critical](const LagPlant& p) { return critical(p).gain / kPascalPerKgfCm2; }},
      {"T_crit", "s", [critical](const LagPlant& p) { return critical(p).period; }},
      {"T_L", "s", [](const LagPlant& p) { return step_shape(p).latency; }},
      {"T_A", "s", [](const LagPlant& p) { return step_shape(p).adjustment; }},
      {"T_L_T_A", "-",
       [](const LagPlant& p) {
         const auto s = step_shape(p);
         return s.latency / s.adjustment;
       }},
      {"joint_T_L", "s", [](const LagPlant& p) { return joint_step_shape(p).latency; }},
      {"joint_T_A", "s", [](const LagPlant& p) { return joint_step_shape(p).adjustment; }}};
  return facts;
}

Estimated estimated(const Fact& fact, const Problem& problem, const Vector& x, const Spread& spread) {
  Estimated e;
  e.name = fact.name;
  e.unit = fact.unit;
  e.value = fact.of(plant_of(problem, x.data()));
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(kParameters);
  for (int i = 0; i < kFree; ++i) {
    if (spread.covariance(i, i) == 0) continue;
    const double h = i == 4 ? std::min(1e-4, 0.5 * x[4]) : 1e-4;
    Vector up = x, down = x;
    up[static_cast<std::size_t>(i)] += h;
    down[static_cast<std::size_t>(i)] -= h;
    slope[i] = (fact.of(plant_of(problem, up.data())) - fact.of(plant_of(problem, down.data()))) / (2 * h);
  }
  e.std_error = std::sqrt(slope.dot(spread.covariance * slope));
  if (std::isfinite(e.std_error)) {
    const double t = boost::math::quantile(boost::math::students_t(std::max(3.0, spread.freedom)), 0.975);
    e.ci_low = e.value - t * e.std_error;
    e.ci_high = e.value + t * e.std_error;
  }
  return e;
}

std::string refusal_of(const PlantFit& fit, const PlantFitOptions& options) {
  if (!fit.converged) return "the plant's fit did not come to rest; excite more, or longer";
  if (!(fit.misfit < options.worst_misfit))
    return "the joint does not move like a lag of third order with dead time: " +
           std::to_string(static_cast<int>(std::lround(100 * fit.misfit))) +
           " % of its motion is left over; friction, slack or too little amplitude may be the cause";
  for (const char* name : {"K_crit", "T_crit"}) {
    const Estimated& e = value_of(fit, name);
    if (!std::isfinite(e.value))
      return "the fitted plant can be given any gain without swinging; nothing follows for " + e.name;
    if (!(e.std_error < options.worst_error * e.value))
      return e.name + " is not known well enough from this record; excite more, or longer";
  }
  return {};
}

/// Plants that fit as well as the best but swing at another gain: then the record does not tell.
std::string disagreement_of(const Problem& problem, const Solution& best,
                            const std::vector<Solution>& solutions) {
  const auto critical = ultimate(plant_loop(plant_of(problem, best.x.data())));
  for (const Solution& s : solutions) {
    if (!std::isfinite(s.cost) || s.cost > kAsGood * best.cost) continue;
    const auto other = ultimate(plant_loop(plant_of(problem, s.x.data())));
    if (critical && other && std::abs(other->gain / critical->gain - 1) < kDisagree) continue;
    return "two plants fit the record equally well and differ in K_crit; use the relay, or excite more";
  }
  return {};
}

}  // namespace

ExperimentRecord even_record(const ExperimentRecord& record) {
  const std::size_t n = record.time.size();
  std::vector<double> steps(n - 1);
  for (std::size_t k = 1; k < n; ++k) steps[k - 1] = record.time[k] - record.time[k - 1];
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  // The median finds the period where ticks were lost; the grid then has whole periods over the whole length, or it would drift.
  const double length = record.time.back() - record.time.front();
  const double periods = std::max(1.0, std::floor(length / steps[steps.size() / 2] + 0.5)),
               interval = length / periods;
  const auto rows = static_cast<std::size_t>(periods) + 1;
  ExperimentRecord even;
  std::size_t at = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const double t = record.time.front() + static_cast<double>(k) * interval;
    while (at + 1 < n && record.time[at + 1] <= t) ++at;
    const std::size_t next = std::min(at + 1, n - 1);
    const double gap = record.time[next] - record.time[at];
    const double share = gap > 0 ? std::clamp((t - record.time[at]) / gap, 0.0, 1.0) : 0.0;
    even.time.push_back(t);
    even.angle.push_back(record.angle[at] + share * (record.angle[next] - record.angle[at]));
    // A command that begins within half an interval of this row is this row's: stamps tremble, commands do not.
    even.command.push_back(record.command[share > 0.5 ? next : at]);
  }
  return even;
}

const Estimated& value_of(const PlantFit& fit, const std::string& name) {
  for (const auto* list : {&fit.derived, &fit.parameters})
    for (const Estimated& e : *list)
      if (e.name == name) return e;
  assert(false && "no such value");
  return fit.parameters.front();
}

PlantFit fit_plant(const ExperimentRecord& record, const PlantFitOptions& options) {
  const Problem problem = problem_of(record, options);
  Solution best;
  std::vector<Solution> solutions;
  for (const Start& start : starts_of(problem)) {
    solutions.push_back(solve(problem, start.x));
    const Solution& s = solutions.back();
    if (std::isfinite(s.cost) && s.cost < best.cost) best = s;
  }
  PlantFit fit;
  fit.record = problem.record;
  fit.converged = best.converged;
  fit.solver_summary = best.summary;
  if (!std::isfinite(best.cost)) {
    fit.refusal = "no plant could be fitted to the record; did the joint move with the command?";
    return fit;
  }
  fit.plant = plant_of(problem, best.x.data());
  std::vector<double> command = problem.record.command;
  for (std::size_t k = 0; k < command.size(); ++k) command[k] += best.x[6] * problem.load[k];
  const std::vector<double> motion = simulate(fit.plant, problem.interval, command);
  double squares = 0;
  for (std::size_t k = 0; k < motion.size(); ++k) {
    fit.predicted.push_back(motion[k] + best.x[5] * problem.size);
    squares += std::pow(problem.record.angle[k] - fit.predicted[k], 2);
  }
  const double mean_square = squares / static_cast<double>(motion.size());
  fit.rmse = std::sqrt(mean_square);
  fit.misfit = std::sqrt(std::max(0.0, mean_square - options.noise * options.noise)) / problem.size;
  const Spread spread = spread_of(problem, best.x);
  for (const Fact& fact : parameter_facts())
    fit.parameters.push_back(estimated(fact, problem, best.x, spread));
  for (const Fact& fact : derived_facts()) fit.derived.push_back(estimated(fact, problem, best.x, spread));
  fit.refusal = refusal_of(fit, options);
  if (fit.refusal.empty()) fit.refusal = disagreement_of(problem, best, solutions);
  return fit;
}

}  // namespace isac::tune
