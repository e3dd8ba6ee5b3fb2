#include "isac/estimate/mass_problem.hpp"

#include <ceres/ceres.h>

#include <array>
#include <cmath>
#include <memory>

namespace isac::estimate {
namespace {

using Kind = MassUnknown::Kind;

struct Gravity {
  ArmVector torque{};                            // per kilogram, on the arm's joints
  std::array<ArmVector, kArmJoints> gradient{};  // of it, by the arm's angles
};

Gravity gravity_of(const models::Chain<double, 6>& chain,
                   const std::array<models::Transform<double>, kArmJoints>& frames, int mass) {
  return {models::gravity_per_kilogram(chain, frames, mass),
          models::gravity_gradient_per_kilogram(chain, frames, mass)};
}

/// The chain with one more mass, at the tool.
models::Chain<double, 6> with_load(const models::Chain<double, 6>& chain) {
  models::Chain<double, 6> out = chain;
  out.masses[0] = {chain.tool_link, chain.tool, 1.0};
  out.mass_count = 1;
  return out;
}

double entry(const ArmVector& v, std::size_t i) {
  return v[i];
}

/// Residual of one datum over its noise.
class DatumCost final : public ceres::CostFunction {
 public:
  DatumCost(const MassProblem& problem, const MassDatum& datum) : problem_(problem), datum_(datum) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(static_cast<int>(problem.unknowns.size()));
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const auto n = static_cast<Eigen::Index>(problem_.unknowns.size());
    const Eigen::VectorXd values = Eigen::Map<const Eigen::VectorXd>(parameters[0], n);
    double* derivatives = jacobians != nullptr ? jacobians[0] : nullptr;
    residuals[0] = (problem_.predict(datum_, values, derivatives) - datum_.gravity) / datum_.noise;
    if (derivatives != nullptr) Eigen::Map<Eigen::VectorXd>(derivatives, n) /= datum_.noise;
    return std::isfinite(residuals[0]);
  }

 private:
  const MassProblem& problem_;
  const MassDatum& datum_;
};

/// δ/σ of one parameter of an actuator, known from its own identification.
class PriorCost final : public ceres::CostFunction {
 public:
  PriorCost(int size, int index) : index_(index) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(size);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    residuals[0] = parameters[0][index_];
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      std::fill_n(jacobians[0], parameter_block_sizes()[0], 0.0);
      jacobians[0][index_] = 1;
    }
    return true;
  }

 private:
  int index_;
};

}  // namespace

MassProblem::MassProblem(const MassArm& the_arm, const MassFitOptions& options)
    : arm(the_arm),
      actuator_angles(options.actuator_angles),
      actuator_torques(options.actuator_angles || options.from_pressures) {
  (void)models::inverse_coupling<double, 6>(arm.coupling,
                                            inverse_);  // arm files with a singular one are refused
}

ArmVector MassProblem::arm_angles(const MassPose& pose, const Eigen::VectorXd& values) const {
  ArmVector x = pose.angle;
  for (std::size_t k = 0; k < unknowns.size(); ++k)
    if (unknowns[k].kind == Kind::kZero) x[unknowns[k].index] += values[static_cast<Eigen::Index>(k)];
  if (!actuator_angles) return x;
  ArmVector theta = models::multiply<double, 6>(arm.coupling, x);
  for (std::size_t j = 0; j < kArmJoints; ++j) theta[j] += arm.middle[j];
  return theta;
}

double MassProblem::predict(const MassDatum& row, const Eigen::VectorXd& values, double* derivatives) const {
  const MassPose& pose = poses[row.pose];
  const auto frames = models::chain_frames(arm.chain, arm_angles(pose, values));
  const models::Chain<double, 6> load = with_load(arm.chain);
  // Torque on the measured joint: row j of Kᵀ for actuators, else joint j itself.
  const auto on_joint = [&](const ArmVector& torque) {
    if (!actuator_torques) return torque[row.joint];
    double sum = 0;
    for (std::size_t i = 0; i < kArmJoints; ++i) sum += arm.coupling[i][row.joint] * torque[i];
    return sum;
  };
  double sum = 0;
  std::array<ArmVector, kArmJoints> gradient{};
  const auto add = [&](const models::Chain<double, 6>& chain, int mass, double kilograms, Eigen::Index at) {
    const Gravity g = gravity_of(chain, frames, mass);
    const double share = on_joint(g.torque);
    sum += kilograms * share;
    if (derivatives != nullptr) derivatives[at] = share;
    for (std::size_t i = 0; i < kArmJoints; ++i)
      for (std::size_t l = 0; l < kArmJoints; ++l) gradient[i][l] += kilograms * g.gradient[i][l];
  };
  const auto n = static_cast<Eigen::Index>(unknowns.size());
  for (Eigen::Index k = 0; k < n; ++k) {
    const MassUnknown& unknown = unknowns[static_cast<std::size_t>(k)];
    if (unknown.kind == Kind::kMass) {
      add(arm.chain, static_cast<int>(unknown.index), values[k], k);
    } else if (unknown.kind == Kind::kLoad) {
      add(load, 0, values[k] * pose.load, k);
      if (derivatives != nullptr) derivatives[k] *= pose.load;
    }
  }
  for (Eigen::Index k = 0; k < n; ++k) {
    const MassUnknown& unknown = unknowns[static_cast<std::size_t>(k)];
    double slope = 0, amount = values[k];
    switch (unknown.kind) {
      case Kind::kMass:
      case Kind::kLoad:
        continue;
      case Kind::kOffset:
        slope = unknown.index == row.joint ? 1 : 0;
        break;
      case Kind::kZero: {
        // dθ/dx_l is column l of K for φ, else the joint itself; the model's own A r² φ shifts with it.
        ArmVector by_zero{};
        for (std::size_t i = 0; i < kArmJoints; ++i) {
          if (!actuator_angles) {
            by_zero[i] = gradient[i][unknown.index];
          } else {
            for (std::size_t l = 0; l < kArmJoints; ++l)
              by_zero[i] += gradient[i][l] * arm.coupling[l][unknown.index];
          }
        }
        const double turn = actuator_angles ? (unknown.index == row.joint ? 1.0 : 0.0)
                                            : entry(inverse_[row.joint], unknown.index);
        slope = on_joint(by_zero) + row.stiffness * turn;
        amount = 0;  // gravity has moved with the angles already
        sum += values[k] * row.stiffness * turn;
        break;
      }
      case Kind::kActuatorA:
        slope = unknown.index == row.joint ? row.u : 0;
        break;
      case Kind::kActuatorB:
        slope = unknown.index == row.joint ? row.v : 0;
        break;
    }
    sum += slope * amount;
    if (derivatives != nullptr) derivatives[k] = slope;
  }
  return sum;
}

void MassProblem::linearise(const Eigen::VectorXd& values, Eigen::MatrixXd& jacobian,
                            Eigen::VectorXd& residual) const {
  const auto rows = static_cast<Eigen::Index>(data.size()), n = static_cast<Eigen::Index>(unknowns.size());
  jacobian.setZero(rows + priors(), n);
  residual.setZero(rows + priors());
  Eigen::VectorXd slope(n);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const MassDatum& row = data[static_cast<std::size_t>(i)];
    residual[i] = (row.gravity - predict(row, values, slope.data())) / row.noise;
    jacobian.row(i) = slope.transpose() / row.noise;
  }
  Eigen::Index at = rows;
  for (Eigen::Index k = 0; k < n; ++k) {
    if (!unknowns[static_cast<std::size_t>(k)].has_prior()) continue;
    residual[at] = -values[k];
    jacobian(at++, k) = 1;
  }
}

Eigen::VectorXd MassProblem::column(const MassUnknown& unknown, const Eigen::VectorXd& values) const {
  MassProblem more = *this;
  more.unknowns.push_back(unknown);
  Eigen::VectorXd longer(values.size() + 1);
  longer << values, 0.0;
  Eigen::VectorXd slope(longer.size()), out(static_cast<Eigen::Index>(data.size()));
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    const MassDatum& row = data[static_cast<std::size_t>(i)];
    (void)more.predict(row, longer, slope.data());
    out[i] = slope[slope.size() - 1] / row.noise;
  }
  return out;
}

Eigen::Index MassProblem::priors() const {
  Eigen::Index count = 0;
  for (const MassUnknown& unknown : unknowns) count += unknown.has_prior() ? 1 : 0;
  return count;
}

MassSolution solve_masses(const MassProblem& problem, const Eigen::VectorXd& start, double huber) {
  MassSolution out;
  out.values = start;
  const auto n = static_cast<int>(problem.unknowns.size());
  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::HuberLoss loss(huber > 0 ? huber : 1.0);
  ceres::Problem least(ownership);
  least.AddParameterBlock(out.values.data(), n);
  for (const MassDatum& datum : problem.data)
    least.AddResidualBlock(new DatumCost(problem, datum), huber > 0 ? &loss : nullptr, out.values.data());
  for (int k = 0; k < n; ++k) {
    if (problem.unknowns[static_cast<std::size_t>(k)].has_prior())
      least.AddResidualBlock(new PriorCost(n, k), nullptr, out.values.data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-14;
  options.gradient_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.initial_trust_region_radius = 1e12;  // linear but for small angles: begin with the full step
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &least, &summary);
  out.converged = summary.IsSolutionUsable();
  out.report = summary.BriefReport();
  return out;
}

}  // namespace isac::estimate
