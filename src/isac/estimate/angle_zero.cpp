#include "isac/estimate/angle_zero.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace isac::estimate {

Prior prior_of(const ZeroFit& zero, std::size_t kept, int size, double spread) {
  Prior prior{Eigen::VectorXd::Zero(size), Eigen::VectorXd::Zero(size)};
  if (zero.column.empty()) return prior;
  const auto at = static_cast<Eigen::Index>(kept), runs = static_cast<Eigen::Index>(zero.resting.size());
  prior.curvature[at] = zero.weight;
  prior.curvature.segment(at + 1, runs).setConstant(zero.resting_weight);
  prior.score_variance = spread * spread * prior.curvature;
  return prior;
}

bool set_zero(const JointRows& rows, const JointTerms& terms, const Eigen::VectorXd& theta, double step,
              double spread, RobustProblem& problem, ZeroFit& zero) {
  if (!(step > 0) || !(spread > 0)) return false;
  std::vector<double> column = angle_slope(rows, terms, theta, 0.5 * step);
  double largest = 0;
  for (const double value : column) largest = std::max(largest, std::abs(value));
  const bool known = !zero.column.empty();
  // Half a step that moves the output by less than a thousandth of its scatter is not worth a parameter.
  if (!known && !(largest * 0.5 * step > 1e-3 * spread)) return false;
  zero.column = std::move(column);
  zero.half_step = 0.5 * step;
  zero.slope = 0;
  for (const double value : zero.column) zero.slope += value / static_cast<double>(zero.column.size());
  zero.weight = spread * spread / (zero.half_step * zero.half_step);
  zero.resting_weight = 3.0 * zero.weight;  // variance step²/12 is a third of (step/2)²
  if (known) {
    problem.columns.back() = zero.column.data();
    return true;
  }
  for (const RunRows& run : rows.runs)
    if (run.resting && run.end > run.begin) zero.resting.push_back({run.begin, run.end});
  problem.columns.push_back(zero.column.data());
  problem.locals = zero.resting;
  return true;
}

Eigen::VectorXd with_zero(const Eigen::VectorXd& theta, std::size_t kept, std::size_t nonlinear,
                          const RobustProblem& problem) {
  if (theta.size() == problem.size()) return theta;
  Eigen::VectorXd out = Eigen::VectorXd::Zero(problem.size());
  out.head(static_cast<Eigen::Index>(kept)) = theta.head(static_cast<Eigen::Index>(kept));
  out.tail(static_cast<Eigen::Index>(nonlinear)) = theta.tail(static_cast<Eigen::Index>(nonlinear));
  return out;
}

AngleZero angle_zero(const ZeroFit& zero, const JointFitOptions& options) {
  AngleZero out;
  out.used = zero.slope != 0;
  if (!out.used) return out;
  out.value = zero.value;
  out.std_error = zero.std_error;
  out.half_step = zero.half_step;
  out.resting_runs = zero.resting.size();
  out.sentence = fmt::format(
      "The angle is counted in steps of {:.2g} {}, so its zero is known to half a step only: the fit let it "
      "move, by "
      "{:.2g} ± {:.1g} {}{}.",
      2.0 * zero.half_step, options.position_unit, zero.value, zero.std_error, options.position_unit,
      zero.resting.empty() ? ""
                           : fmt::format(", and gave {} at rest a zero of {} own",
                                         zero.resting.size() == 1 ? "the run" : "each of the runs",
                                         zero.resting.size() == 1 ? "its" : "their"));
  return out;
}

ResidualTest zero_test(const AngleZero& zero, const ZeroFit& fit, const JointFitOptions& options) {
  const double size = std::abs(zero.value), torque = size * std::abs(fit.slope);
  // What is beyond half a step, in standard errors.
  const double beyond = std::max(0.0, size - zero.half_step) / std::max(zero.std_error, 1e-300);
  ResidualTest test{.name = "residual_against_constant",
                    .statistic = beyond,
                    .p_value = std::erfc(beyond / std::sqrt(2.0)),
                    .passed = true,
                    .sentence = {}};
  test.passed = test.p_value > 0.01;
  test.sentence =
      test.passed
          ? fmt::format(
                "A constant of {:.2g} {} is no more than half an encoder step of the angle's zero makes "
                "({:.2g} {}): it says nothing about the joint.",
                torque, options.output_unit, zero.half_step * std::abs(fit.slope), options.output_unit)
          : fmt::format(
                "A constant of {:.2g} {} is left, and half an encoder step of the angle's zero makes only "
                "{:.2g} "
                "{} (p = {:.1g}): the force sensors, the torque or the angle's middle have an offset; zero "
                "them at rest, or fit with --terms A,B,C,D,offset.",
                torque, options.output_unit, zero.half_step * std::abs(fit.slope), options.output_unit,
                test.p_value);
  return test;
}

}  // namespace isac::estimate
