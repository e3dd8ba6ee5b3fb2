#include <algorithm>
#include <cmath>

#include "isac/estimate/identifiability.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/mass_problem.hpp"

namespace isac::estimate {
namespace {

using Kind = MassUnknown::Kind;

constexpr double kStillShare = 1e-9;  // of the largest entry: rounding of a lever arm that is zero
constexpr double kAloneShare =
    1e-5;  // of a column that no combination of the others makes: rounding, squared root

Estimated refused(const MassUnknown& unknown, std::string reason) {
  Estimated out;
  out.name = unknown.name;
  out.unit = unknown.unit;
  out.identifiable = false;
  out.reason = std::move(reason);
  return out;
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < names.size(); ++i)
    out += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  return out;
}

/// The masses: all that show, but those that only a sum of which shows.
void choose_masses(MassProblem& problem, MassChoice& choice) {
  const std::size_t n = problem.arm.mass_names.size();
  for (std::size_t k = 0; k < n; ++k)
    problem.unknowns.push_back({Kind::kMass, k, problem.arm.mass_names[k], "kg"});
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residual;
  problem.linearise(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(n)), jacobian, residual);
  const double largest = jacobian.size() > 0 ? jacobian.cwiseAbs().maxCoeff() : 0;
  for (Eigen::Index k = 0; k < jacobian.cols(); ++k)
    if (jacobian.col(k).norm() <= kStillShare * largest) jacobian.col(k).setZero();
  const Eigen::MatrixXd gram = jacobian.transpose() * jacobian;
  const Rank rank = find_rank(gram, Eigen::MatrixXd::Zero(gram.rows(), gram.cols()));
  std::vector<MassUnknown> kept;
  for (std::size_t k = 0; k < n; ++k) {
    const bool fit = std::find(rank.kept.begin(), rank.kept.end(), static_cast<int>(k)) != rank.kept.end();
    if (fit) kept.push_back(problem.unknowns[k]);
    if (rank.fault[k] == Rank::Fault::kNone) continue;
    std::vector<std::string> partners;
    for (const int other : rank.partners[k])
      partners.push_back(problem.arm.mass_names[static_cast<std::size_t>(other)]);
    choice.refused.push_back(refused(
        problem.unknowns[k],
        rank.fault[k] == Rank::Fault::kCombination
            ? "These poses tell only a combination of it and " + joined(partners) +
                  ": record poses in which their lever arms change differently, and more joints' torques."
            : "Its gravity shows on no measured joint in these poses: record poses in which it hangs to the "
              "side of a measured joint."));
  }
  problem.unknowns = kept;
}

std::vector<MassUnknown> asked_for(const MassProblem& problem, const MassFitOptions& options) {
  std::vector<MassUnknown> out;
  const auto joints = static_cast<std::size_t>(problem.arm.joints);
  if (options.load) out.push_back({Kind::kLoad, 0, "load", "kg"});
  if (options.offsets) {
    for (std::size_t j = 0; j < joints; ++j) {
      if (std::any_of(problem.data.begin(), problem.data.end(),
                      [j](const MassDatum& row) { return row.joint == j; }))
        out.push_back({Kind::kOffset, j, "offset_tau" + std::to_string(j + 1), "N m"});
    }
  }
  if (options.zeros) {
    for (std::size_t j = 0; j < joints; ++j)
      out.push_back({Kind::kZero, j,
                     (problem.actuator_angles ? "zero_phi" : "zero_theta") + std::to_string(j + 1), "rad"});
  }
  return out;
}

std::string why_not(const MassUnknown& unknown, const std::vector<std::string>& partners) {
  const std::string with = partners.empty() ? "the masses" : joined(partners);
  switch (unknown.kind) {
    case Kind::kLoad:
      return "It cannot be told from " + with +
             ", which then includes it: record the same poses with and without the load (column 'load [1]', "
             "1 and 0).";
    case Kind::kOffset:
      return "It cannot be told from " + with +
             ": record more poses in which gravity's torque on this joint differs.";
    default:
      return "It cannot be told from " + with +
             ": record more poses that turn this joint and those around it.";
  }
}

}  // namespace

MassChoice choose_unknowns(MassProblem& problem, const MassFitOptions& options) {
  MassChoice choice;
  problem.unknowns.clear();
  choose_masses(problem, choice);
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residual;
  Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(problem.unknowns.size()));
  if (values.size() > 0) {
    problem.linearise(values, jacobian, residual);
    values = least_squares(jacobian, residual);
  }
  const std::vector<MassUnknown> wanted = asked_for(problem, options);
  for (const MassUnknown& unknown : wanted) {
    const Eigen::VectorXd column = problem.column(unknown, values);
    problem.linearise(values, jacobian, residual);
    const double largest = jacobian.size() > 0 ? jacobian.cwiseAbs().maxCoeff() : 0;
    if (unknown.kind == Kind::kZero && column.norm() <= kStillShare * largest) {
      choice.refused.push_back(refused(
          unknown,
          "Gravity does not change with this angle in any of these poses, so no torque can tell its zero: "
          "calibrate the encoder's middle."));
      continue;
    }
    bool alone = column.norm() > 0;
    std::vector<std::string> partners;
    if (alone && jacobian.cols() > 0) {
      const Eigen::VectorXd made_of = least_squares(jacobian, column);
      alone = (column - jacobian * made_of).norm() > kAloneShare * column.norm();
      for (Eigen::Index k = 0; k < made_of.size(); ++k)
        if (jacobian.col(k).norm() * std::abs(made_of[k]) > 0.05 * column.norm())
          partners.push_back(problem.unknowns[static_cast<std::size_t>(k)].name);
    }
    if (!alone) {
      choice.refused.push_back(refused(unknown, why_not(unknown, partners)));
      continue;
    }
    problem.unknowns.push_back(unknown);
    values.conservativeResize(values.size() + 1);
    values[values.size() - 1] = 0;
  }
  choice.start = values;
  return choice;
}

}  // namespace isac::estimate
