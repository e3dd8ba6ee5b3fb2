#include "isac/estimate/pose_hypotheses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace isac::estimate {
namespace {

using Kind = MassUnknown::Kind;

std::string joint_name(const MassProblem& problem, std::size_t joint) {
  return (problem.actuator_torques ? "actuator " : "joint ") + std::to_string(joint + 1);
}

/// The angle on which the datum's torque works: φ of its actuator, or θ of its joint.
double angle_of(const MassProblem& problem, const models::Coupling<double, 6>& inverse,
                const MassDatum& row) {
  const MassPose& pose = problem.poses[row.pose];
  if (problem.actuator_angles || !problem.actuator_torques) return pose.angle[row.joint];
  double phi = 0;
  for (std::size_t l = 0; l < kArmJoints; ++l)
    phi += inverse[row.joint][l] * (pose.angle[l] - problem.arm.middle[l]);
  return phi;
}

template <class Value>
Eigen::VectorXd column_of(const MassProblem& problem, Value value) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(problem.data.size()));
  for (std::size_t i = 0; i < problem.data.size(); ++i)
    out[static_cast<Eigen::Index>(i)] = value(problem.data[i]) / problem.data[i].noise;
  return out;
}

/// y is affine in a length: the difference of one metre is the derivative.
Eigen::VectorXd length_column(const MassProblem& problem, const Eigen::VectorXd& masses, std::size_t link,
                              bool along) {
  MassArm longer = problem.arm;
  (along ? longer.chain.links[link].d : longer.chain.links[link].a) += 1.0;
  MassFitOptions options;
  options.actuator_angles = problem.actuator_angles;
  options.from_pressures = problem.actuator_torques;
  MassProblem other(longer, options);
  other.poses = problem.poses;
  other.unknowns = problem.unknowns;
  return column_of(problem, [&](const MassDatum& row) {
    return other.predict(row, masses, nullptr) - problem.predict(row, masses, nullptr);
  });
}

bool measured(const MassProblem& problem, std::size_t joint) {
  return std::any_of(problem.data.begin(), problem.data.end(),
                     [joint](const MassDatum& row) { return row.joint == joint; });
}

PoseHypothesis one(std::string id, std::string name, int joint, std::string parameter, std::string unit,
                   const Eigen::VectorXd& column) {
  PoseHypothesis h;
  h.id = std::move(id);
  h.name = std::move(name);
  h.joint = joint;
  h.parameters = {std::move(parameter)};
  h.units = {std::move(unit)};
  h.columns = column;
  return h;
}

}  // namespace

Eigen::VectorXd pose_residual(const MassProblem& problem, const Eigen::VectorXd& masses) {
  return column_of(problem,
                   [&](const MassDatum& row) { return row.gravity - problem.predict(row, masses, nullptr); });
}

void moved_residual(const MassProblem& problem, const Eigen::VectorXd& masses, const MassUnknown& zero,
                    double shift, Eigen::VectorXd& residual, Eigen::VectorXd& column) {
  MassProblem moved = problem;
  moved.unknowns.push_back(zero);
  Eigen::VectorXd values(masses.size() + 1), slope(masses.size() + 1);
  values << masses, shift;
  residual.resize(static_cast<Eigen::Index>(problem.data.size()));
  column.resize(residual.size());
  for (Eigen::Index i = 0; i < residual.size(); ++i) {
    const MassDatum& row = problem.data[static_cast<std::size_t>(i)];
    residual[i] = (row.gravity - moved.predict(row, values, slope.data())) / row.noise;
    column[i] = slope[slope.size() - 1] / row.noise;
  }
}

Eigen::MatrixXd pose_nuisances(const MassProblem& problem, const Eigen::VectorXd& masses,
                               const std::vector<double>& mass_errors) {
  constexpr double kNotKnown = 1e3;  // kg: no arm's mass is known worse
  std::vector<Eigen::VectorXd> columns;
  for (std::size_t k = 0; k < mass_errors.size(); ++k) {
    if (!(mass_errors[k] > 0)) continue;
    columns.push_back(std::min(mass_errors[k], kNotKnown) * problem.column({Kind::kMass, k, "", ""}, masses));
  }
  for (std::size_t j = 0; j < static_cast<std::size_t>(problem.arm.joints); ++j) {
    columns.push_back(column_of(problem, [j](const MassDatum& row) { return row.joint == j ? row.u : 0; }));
    columns.push_back(column_of(problem, [j](const MassDatum& row) { return row.joint == j ? row.v : 0; }));
  }
  std::erase_if(columns, [](const Eigen::VectorXd& c) { return !(c.norm() > 0); });
  Eigen::MatrixXd out(static_cast<Eigen::Index>(problem.data.size()),
                      static_cast<Eigen::Index>(columns.size()));
  for (std::size_t c = 0; c < columns.size(); ++c) out.col(static_cast<Eigen::Index>(c)) = columns[c];
  return out;
}

std::vector<PoseHypothesis> pose_hypotheses(const MassProblem& problem, const Eigen::VectorXd& masses,
                                            const PoseExplainOptions& options) {
  std::vector<PoseHypothesis> out;
  const auto joints = static_cast<std::size_t>(problem.arm.joints);
  const bool by_model = options.fit.from_pressures || options.fit.torques_by_model;
  models::Coupling<double, 6> inverse;
  (void)models::inverse_coupling<double, 6>(problem.arm.coupling,
                                            inverse);  // arm files with a singular one are refused

  out.push_back(one("hand_load", "a load in the hand", -1, "load", "kg",
                    problem.column({Kind::kLoad, 0, "load", "kg"}, masses)));
  for (std::size_t j = 0; j < joints; ++j) {
    if (!measured(problem, j)) continue;
    const int joint = static_cast<int>(j);
    const Eigen::VectorXd pull =
        column_of(problem, [j](const MassDatum& row) { return row.joint == j ? 1.0 : 0.0; });
    const Eigen::VectorXd spring = column_of(problem, [&](const MassDatum& row) {
      return row.joint == j ? -angle_of(problem, inverse, row) : 0.0;
    });
    out.push_back(
        one("joint_pull", "a constant pull on " + joint_name(problem, j), joint, "torque", "N m", pull));
    const std::string springs = "a pull on " + joint_name(problem, j) + " that grows with its angle";
    out.push_back(one("joint_spring", springs, joint, "stiffness", "N m/rad", spring));
    PoseHypothesis both = one("joint_spring", springs, joint, "stiffness", "N m/rad", spring);
    both.parameters.push_back("torque_at_zero");
    both.units.push_back("N m");
    both.columns.conservativeResize(Eigen::NoChange, 2);
    both.columns.col(1) = pull;
    out.push_back(std::move(both));
    // By the model y = −(A r² φ + B r Δp), and B γ too small makes y smaller by γ (g + A r² φ); a torque read γ too large, larger by γ g.
    const Eigen::VectorXd gain = column_of(problem, [&](const MassDatum& row) {
      if (row.joint != j) return 0.0;
      const double all = problem.predict(row, masses, nullptr);
      return by_model ? -all - row.stiffness * angle_of(problem, inverse, row) : all;
    });
    out.push_back(
        one("torque_gain",
            (by_model ? "the pressure gain B of " : "the torque's gain of ") + joint_name(problem, j), joint,
            "gain_error", "-", gain));
  }
  for (std::size_t i = 0; i < joints; ++i) {
    const models::DhLink<double>& link = problem.arm.chain.links[i];
    for (const bool along : {false, true}) {
      if ((along ? link.d : link.a) == 0) continue;
      out.push_back(one("link_length",
                        fmt::format("the length {} of joint {} ({:.3f} m in the file)", along ? "d" : "a",
                                    i + 1, along ? link.d : link.a),
                        static_cast<int>(i), "length_error", "m", length_column(problem, masses, i, along)));
    }
  }
  for (std::size_t j = 0; j < joints; ++j) {
    const MassUnknown zero{Kind::kZero, j, "", "rad"};
    PoseHypothesis h =
        one("angle_zero", fmt::format("the zero of {}{}", problem.actuator_angles ? "phi" : "theta", j + 1),
            static_cast<int>(j), "zero", "rad", problem.column(zero, masses));
    h.zero = zero;
    h.is_zero = true;
    out.push_back(std::move(h));
  }
  if (options.doubt_masses) {
    for (std::size_t k = 0; k < problem.arm.mass_names.size(); ++k)
      out.push_back(one("mass", "the mass " + problem.arm.mass_names[k], -1, "mass_error", "kg",
                        problem.column({Kind::kMass, k, "", "kg"}, masses)));
  }
  return out;
}

}  // namespace isac::estimate
