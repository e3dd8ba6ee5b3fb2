#include <cmath>

#include "isac/estimate/mass_problem.hpp"

namespace isac::estimate {
namespace {

using Kind = MassUnknown::Kind;

/// φ of a pose as recorded.
ArmVector actuator_angles_of(const MassProblem& problem, const models::Coupling<double, 6>& inverse,
                             const MassPose& pose) {
  if (problem.actuator_angles) return pose.angle;
  ArmVector from_middle{};
  for (std::size_t j = 0; j < kArmJoints; ++j) from_middle[j] = pose.angle[j] - problem.arm.middle[j];
  return models::multiply<double, 6>(inverse, from_middle);
}

}  // namespace

void torques_from_pressures(const MassProblem& problem, std::vector<MassPose>& rows) {
  models::Coupling<double, 6> inverse;
  (void)models::inverse_coupling<double, 6>(problem.arm.coupling, inverse);
  for (MassPose& row : rows) {
    const ArmVector phi = actuator_angles_of(problem, inverse, row);
    row.torque.fill(std::nan(""));
    for (std::size_t j = 0; j < problem.arm.actuators.size(); ++j) {
      const MassActuator& actuator = problem.arm.actuators[j];
      const double r = actuator.wheel_radius;
      row.torque[j] = actuator.A * r * r * phi[j] + actuator.B * r * row.delta_pressure[j];
    }
  }
}

TorqueSign find_sign(const MassProblem& problem) {
  Eigen::VectorXd masses(static_cast<Eigen::Index>(problem.unknowns.size()));
  bool known = false;
  for (Eigen::Index k = 0; k < masses.size(); ++k) {
    masses[k] = problem.arm.chain.masses[static_cast<std::size_t>(k)].mass;
    known = known || masses[k] > 0;
  }
  if (!known) masses.setOnes();
  double product = 0;
  for (const MassDatum& row : problem.data) product += row.gravity * problem.predict(row, masses, nullptr);
  return product >= 0 ? TorqueSign::kGravity : TorqueSign::kActuator;
}

void fill_data(MassProblem& problem, const MassFitOptions& options, const std::vector<double>& noise_factor,
               TorqueSign sign, bool noise_known) {
  problem.data.clear();
  const double direction = sign == TorqueSign::kActuator ? -1 : 1;
  double known_sum = 0, known_count = 0;
  for (const double noise : options.torque_noise) {
    if (!std::isfinite(noise)) continue;
    known_sum += noise;
    known_count += 1;
  }
  models::Coupling<double, 6> inverse;
  (void)models::inverse_coupling<double, 6>(problem.arm.coupling, inverse);
  const bool by_model = options.from_pressures || options.torques_by_model;
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    const MassPose& pose = problem.poses[i];
    const ArmVector phi = actuator_angles_of(problem, inverse, pose);
    for (std::size_t j = 0; j < static_cast<std::size_t>(problem.arm.joints); ++j) {
      if (!std::isfinite(pose.torque[j])) continue;
      MassDatum row{.pose = i, .joint = j, .gravity = direction * pose.torque[j]};
      const double own = options.torque_noise[j];
      row.noise = noise_factor[i] * (!noise_known ? 1 : std::isfinite(own) ? own : known_sum / known_count);
      if (by_model) {
        const MassActuator& actuator = problem.arm.actuators[j];
        const double r = actuator.wheel_radius, held = -row.gravity;  // the actuator holds against gravity
        row.stiffness = actuator.A * r * r;
        row.u = r * r * phi[j] * actuator.A_error;
        row.v = (held - row.stiffness * phi[j]) / actuator.B * actuator.B_error;
      }
      problem.data.push_back(row);
    }
  }
}

void add_actuator_unknowns(MassProblem& problem, Eigen::VectorXd& start) {
  for (std::size_t j = 0; j < problem.arm.actuators.size(); ++j) {
    bool has_a = false, has_b = false;
    for (const MassDatum& row : problem.data) {
      has_a = has_a || (row.joint == j && row.u != 0);
      has_b = has_b || (row.joint == j && row.v != 0);
    }
    if (has_a)
      problem.unknowns.push_back({Kind::kActuatorA, j, "A of actuator " + std::to_string(j + 1), "-"});
    if (has_b)
      problem.unknowns.push_back({Kind::kActuatorB, j, "B of actuator " + std::to_string(j + 1), "-"});
  }
  const Eigen::Index before = start.size();
  start.conservativeResize(static_cast<Eigen::Index>(problem.unknowns.size()));
  start.tail(start.size() - before).setZero();
}

}  // namespace isac::estimate
