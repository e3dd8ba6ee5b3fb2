#include "isac/tune/plant_spread.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>

#include "isac/core/units.hpp"
#include "isac/estimate/block_covariance.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/tune/linear_step.hpp"

namespace isac::tune {
namespace {

constexpr double kFewestFreedom = 3;     // Student's t beyond says nothing more
constexpr double kLeastDeadTime = 2e-4;  // of the scale; below it stands at its bound and is held

/// Every column of the Jacobian of the residuals, by central differences.
Eigen::MatrixXd jacobian_of(const PlantProblem& problem, const PlantVector& x, const std::vector<int>& free) {
  const auto n = static_cast<Eigen::Index>(problem.residuals());
  Eigen::MatrixXd jacobian(n, static_cast<Eigen::Index>(free.size()));
  Eigen::VectorXd high(n), low(n);
  for (std::size_t j = 0; j < free.size(); ++j) {
    PlantVector up = x, down = x;
    const auto i = static_cast<std::size_t>(free[j]);
    const double h = 1e-4;
    up[i] += h;
    down[i] -= h;
    residuals_of(problem, up, high.data());
    residuals_of(problem, down, low.data());
    jacobian.col(static_cast<Eigen::Index>(j)) = (high - low) / (2 * h);
  }
  return jacobian;
}

void set_interval(Estimated& e, double freedom) {
  const double t = boost::math::quantile(boost::math::students_t(std::max(kFewestFreedom, freedom)), 0.975);
  e.ci_low = e.value - t * e.std_error;
  e.ci_high = e.value + t * e.std_error;
}

}  // namespace

Spread spread_of(const PlantProblem& problem, const PlantVector& x, LagForm form) {
  std::vector<int> free = {kLogGain, kLogLag, kLogTime, kLogDamping, kOffset, kLoad};
  if (problem.fit_dead_time && (form != LagForm::kLag || x[kDeadTime] > kLeastDeadTime))
    free.push_back(kDeadTime);
  if (form == LagForm::kBentLag) free.push_back(kBend);
  const Eigen::MatrixXd jacobian = jacobian_of(problem, x, free);
  const auto n = jacobian.rows(), m = jacobian.cols();
  Eigen::VectorXd residual(n);
  residuals_of(problem, x, residual.data());
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
  const estimate::Prior prior{Eigen::VectorXd::Constant(m, variance / 4),
                              Eigen::VectorXd::Constant(m, variance * variance / 4)};
  const estimate::BlockCovariance found = estimate::block_covariance(blocks, prior);
  Eigen::MatrixXd curvature = jacobian.transpose() * jacobian;
  curvature.diagonal() += prior.curvature;
  const Eigen::MatrixXd white = variance * estimate::inverse_symmetric(curvature);
  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(kPlantUnknowns, kPlantUnknowns);
  Spread spread{zero, zero, Eigen::VectorXd::Ones(kPlantUnknowns)};
  for (Eigen::Index i = 0; i < m; ++i) {
    const int row = free[static_cast<std::size_t>(i)];
    spread.freedom[row] = found.degrees_of_freedom[i];
    for (Eigen::Index j = 0; j < m; ++j) {
      const int column = free[static_cast<std::size_t>(j)];
      spread.sandwich(row, column) = found.covariance(i, j);
      spread.white(row, column) = white(i, j);
    }
  }
  return spread;
}

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
      {"T_L_T_A", "-", [](const LagPlant& p) {
         const auto s = step_shape(p);
         return s.latency / s.adjustment;
       }}};
  return facts;
}

const std::vector<Fact>& joint_facts() {
  static const std::vector<Fact> facts = {
      {"joint_T_L", "s", [](const LagPlant& p) { return joint_step_shape(p).latency; }},
      {"joint_T_A", "s", [](const LagPlant& p) { return joint_step_shape(p).adjustment; }}};
  return facts;
}

Estimated estimated(const Fact& fact, const PlantProblem& problem, const PlantVector& x,
                    const Spread& spread) {
  Estimated e;
  e.name = fact.name;
  e.unit = fact.unit;
  e.value = fact.of(plant_of(problem, x));
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(kPlantUnknowns);
  double together = 0, squares = 0;  // Satterthwaite, over what each unknown contributes
  for (int i = 0; i < kPlantUnknowns; ++i) {
    if (!(spread.sandwich(i, i) > 0) || i == kOffset || i == kLoad) continue;
    const double h = 1e-4;
    PlantVector up = x, down = x;
    up[static_cast<std::size_t>(i)] += h;
    down[static_cast<std::size_t>(i)] -= h;
    slope[i] = (fact.of(plant_of(problem, up)) - fact.of(plant_of(problem, down))) / (2 * h);
    const double part = slope[i] * slope[i] * spread.sandwich(i, i);
    together += part;
    squares += part * part / spread.freedom[i];
  }
  const double variance = std::max(slope.dot(spread.sandwich * slope), slope.dot(spread.white * slope));
  if (!(variance > 0) || !std::isfinite(variance)) return e;  // held: nothing is known of its error
  e.std_error = std::sqrt(variance);
  set_interval(e, together * together / squares);
  return e;
}

Estimated joined(const Estimated& shifted, const Estimated& bent, double weight) {
  Estimated e = shifted;
  e.value += weight * (bent.value - shifted.value);
  e.std_error = std::hypot(std::max(shifted.std_error, bent.std_error), bent.value - shifted.value);
  e.ci_low = e.ci_high = std::numeric_limits<double>::quiet_NaN();
  const Estimated& wider = bent.std_error > shifted.std_error ? bent : shifted;
  const double factor = (wider.ci_high - wider.value) / wider.std_error;  // Student's, of the one that counts
  if (!std::isfinite(e.std_error) || !std::isfinite(factor)) return e;
  e.ci_low = e.value - factor * e.std_error;
  e.ci_high = e.value + factor * e.std_error;
  return e;
}

}  // namespace isac::tune
