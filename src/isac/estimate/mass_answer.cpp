#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <cmath>

#include "isac/estimate/mass_problem.hpp"

namespace isac::estimate {

using Kind = MassUnknown::Kind;

namespace {

constexpr double kLevel = 0.01;  // of a false alarm over all joints

/// One noise for all joints is a supposition where none was told: says which joint scatters more than the others.
void check_equal_noise(const MassProblem& problem, const MassState& state, Warnings& warnings) {
  ArmVector sum{}, count{};
  double all = 0, rows = 0;
  for (std::size_t i = 0; i < problem.data.size(); ++i) {
    if (!state.informative[i]) continue;
    const auto row = static_cast<Eigen::Index>(i);
    const Eigen::VectorXd x = state.jacobian.row(row);
    const double left = 1 - x.dot(state.covariance * x);
    if (left < 1e-6) continue;
    const double square = state.residual[row] * state.residual[row] / left;
    sum[problem.data[i].joint] += square;
    count[problem.data[i].joint] += 1;
    all += square;
    rows += 1;
  }
  for (std::size_t j = 0; j < kArmJoints; ++j) {
    const double others = rows - count[j], share = static_cast<double>(state.freedom) / rows;
    if (count[j] < 3 || others < 3 || !(all > sum[j])) continue;
    const double ratio = (sum[j] / count[j]) / ((all - sum[j]) / others);
    const boost::math::fisher_f f(count[j] * share, others * share);
    if (boost::math::cdf(boost::math::complement(f, ratio)) * static_cast<double>(kArmJoints) >= kLevel)
      continue;
    warnings.push_back(
        {"noise_differs",
         fmt::format(
             "The torques of joint {} scatter {:.1f} times as much as the others', so the intervals of "
             "masses "
             "that hang on it are too narrow: give torque_noise of every [[actuator]] in the arm file.",
             j + 1, std::sqrt(ratio))});
  }
}

}  // namespace

void add_warnings(const MassProblem& problem, const Eigen::VectorXd& values, const MassState& state,
                  MassFit& fit) {
  auto& warnings = fit.warnings;
  if (state.freedom <= 0) {
    warnings.push_back({"nothing_to_check_with",
                        std::string(problem.poses.size() == 1 ? "A single pose gives" : "These poses give") +
                            " no more torques than there are unknowns, so nothing is left over to check the "
                            "masses with: a wrong "
                            "angle, torque or model passes unseen; record several poses (next_poses)."});
    if (fit.noise_estimated == false)
      warnings.push_back(
          {"noise_assumed", fmt::format("The standard errors hold for torques measured to {:.3g} N m; "
                                        "give yours with --torque-noise.",
                                        fit.torque_noise)});
  }
  if (fit.noise_estimated && state.freedom > 0) check_equal_noise(problem, state, warnings);
  std::string left_out, named;
  for (const MassPoseResult& pose : fit.poses) {
    std::string& list = pose.left_out ? left_out : named;
    if (pose.outlier || pose.left_out) list += (list.empty() ? "" : ", ") + pose.name;
  }
  if (!left_out.empty())
    warnings.push_back({"pose_left_out",
                        "Left out, because the other poses contradict it by far: " + left_out +
                            "; look at its angles and whether something touched the arm, or hold it again."});
  if (!named.empty())
    warnings.push_back({"pose_outlier", "Out of line with the others, with less weight in the fit: " + named +
                                            "; look at its angles and torques, or hold it again."});
  for (const Estimated& mass : fit.masses) {
    if (!mass.identifiable) continue;
    if (mass.ci_high < 0)
      warnings.push_back(
          {"mass_negative",
           fmt::format("{} comes out as {:.3g} kg, and no mass is negative: look at the torques' sign, "
                       "the angles' zeros and the lever arms in the arm file.",
                       mass.name, mass.value)});
    else if (mass.ci_high - mass.value > 0.5 * std::abs(mass.value))
      warnings.push_back(
          {"mass_uncertain",
           fmt::format("{} is known to ±{:.2g} kg only, of {:.3g} kg: record more poses (next_poses).",
                       mass.name, mass.ci_high - mass.value, mass.value)});
  }
  for (std::size_t k = 0; k < problem.unknowns.size(); ++k) {
    const MassUnknown& unknown = problem.unknowns[k];
    const double size = values[static_cast<Eigen::Index>(k)];
    if (!unknown.has_prior() || std::abs(size) < 3) continue;
    const MassActuator& actuator = problem.arm.actuators[unknown.index];
    const double share =
        unknown.kind == Kind::kActuatorA ? actuator.A_error / actuator.A : actuator.B_error / actuator.B;
    warnings.push_back(
        {"actuator_model", fmt::format("The poses contradict {}: it would have to change by {:.2g} %, {:.1f} "
                                       "of its standard errors; identify that joint anew.",
                                       unknown.name, 100 * share * size, std::abs(size))});
  }
}

void fill_rows(const MassProblem& problem, std::span<const MassDatum> every, const Eigen::VectorXd& values,
               MassFit& fit) {
  double squares = 0, count = 0, noise = 0, low = 0, high = 0;
  for (const MassDatum& datum : every) {
    MassRow row{
        datum.pose, static_cast<int>(datum.joint), datum.gravity, problem.predict(datum, values, nullptr), 0,
        datum.noise};
    row.residual = row.measured - row.predicted;
    fit.rows.push_back(row);
    if (fit.poses[datum.pose].left_out) continue;
    squares += row.residual * row.residual;
    noise += row.noise * row.noise;
    low = count == 0 ? row.measured : std::min(low, row.measured);
    high = count == 0 ? row.measured : std::max(high, row.measured);
    count += 1;
  }
  fit.rmse = std::sqrt(squares / count);
  fit.torque_noise = std::sqrt(noise / count);
  if (high > low) fit.nrmse = fit.rmse / (high - low);
}

}  // namespace isac::estimate
