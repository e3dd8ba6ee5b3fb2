/// @file
/// Masses of an arm from poses it was held in: angles and joint torques, or angles, pressures and the actuators' model.
///
///   y_ij = Σ_k g_jk(θ_i) m_k  [ + g_jL(θ_i) m_L + o_j + ∂g_j/∂x_l ε_l ] + e_ij      gravity of point masses (seed 4.39 to 4.50)
///   y = τ measured (sign as found or told), or −(A r² φ + B r Δp) of the actuator; then  + r²φ δA + rΔp δB,  δ/σ ~ N(0, 1)
///   minimise Σ ρ(r²/σ²) + Σ (δ/σ)²   by Ceres, ρ Huber's
///
/// x are the angles recorded (θ of the arm or φ of the actuators), torques belong to the same angles; with pressures to φ. The
/// errors of A and B are shared by all poses of a joint: as unknowns with a prior they make exactly the generalised least squares
/// with that correlated covariance, and a model that is wrong shows as a δ of many σ. Load, offsets o and zeros ε are fitted
/// when asked for and when the poses tell them apart, else refused by name. Rows of one pose from both sides are averaged, so
/// that friction cancels. Standard errors: Huber's with finite-sample factor; Student's t where the noise is estimated.
/// Units: SI. Threads: pure function. Errors: throws isac::Error (answer is no, "no_usable_data") without a usable row;
/// every other outcome is data in the result. Source: seed 6.4; docs/derivations/mass_identification.md.
/// Example: tests/estimate/mass_fit_test.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"
#include "isac/models/arm/coupling.hpp"
#include "isac/models/arm/soft_arm.hpp"

namespace isac::estimate {

inline constexpr std::size_t kArmJoints = 6;
using ArmVector = models::JointVector<double, 6>;

/// What is known of one actuator; NaN where not given.
struct MassActuator {
  double A = std::numeric_limits<double>::quiet_NaN();             ///< N/m
  double B = std::numeric_limits<double>::quiet_NaN();             ///< N/Pa
  double wheel_radius = std::numeric_limits<double>::quiet_NaN();  ///< m
  double A_error = 0;                                              ///< N/m, standard error
  double B_error = 0;                                              ///< N/Pa, standard error
};

struct MassArm {
  models::Chain<double, 6> chain;  ///< joints behind `joints` do nothing; masses are start values
  int joints = 6;
  models::Coupling<double, 6> coupling{};  ///< θ = K φ + middle
  ArmVector middle{};                      ///< rad
  models::JointLimits<double> limits;      ///< of φ, rad
  std::vector<std::string> mass_names;     ///< one per mass of the chain
  std::vector<MassActuator> actuators;     ///< none, or one per joint
};

/// One row of a recording of poses; NaN where not measured.
struct MassPose {
  std::string name;  ///< "row 3"
  ArmVector angle{};
  ArmVector torque{};          ///< N m, not read where the run gives pressures
  ArmVector delta_pressure{};  ///< Pa, read where the run gives pressures
  double load = 1;             ///< 1: the load is in the hand, 0: it is not
  long target = -1;            ///< rows of one target and load belong together; −1: the row stands alone
  int approach = 0;            ///< +1 or −1: the side the pose was approached from; 0: not told
};

enum class TorqueSign {
  kAuto,      ///< the sign under which masses are positive
  kGravity,   ///< torques that gravity exerts (seed's −4.61, −1.26, −0.22 N m)
  kActuator,  ///< torques that hold the arm
};

struct MassFitOptions {
  bool actuator_angles = false;   ///< `angle` is φ, else θ
  bool from_pressures = false;    ///< torques by the actuators' model from `delta_pressure`
  bool torques_by_model = false;  ///< `torque` was computed by the actuators' model: its errors count
  TorqueSign sign = TorqueSign::kAuto;
  /// N m, standard deviation of one measured torque per joint; NaN: estimated from the residuals, alike for all joints.
  ArmVector torque_noise = [] {
    ArmVector v{};
    v.fill(std::numeric_limits<double>::quiet_NaN());
    return v;
  }();
  double assumed_noise = 0.1;  ///< N m, where nothing is left over to estimate it from (seed 3.4)
  bool load = false, offsets = false, zeros = false;  ///< further unknowns
  bool robust = true;
};

struct MassRow {
  std::size_t pose = 0;                                         ///< index into MassFit::poses
  int joint = 0;                                                ///< from 0
  double measured = 0, predicted = 0, residual = 0, noise = 0;  ///< N m
};

struct MassPoseResult {
  std::string name;
  ArmVector angle{};   ///< as recorded, mean of the sides
  double p_value = 1;  ///< of its residuals under the noise
  bool outlier = false;
  bool left_out = false;
};

/// What an unmodelled error of one kind would do to the masses: dm/dx, per rad, per N m or per 1.
struct MassSensitivity {
  std::string cause;             ///< "zero of theta2", "torque offset of joint 3", "torque gain of joint 2"
  std::string unit;              ///< of the cause: "rad", "N m", "-"
  std::vector<double> per_unit;  ///< kg per unit, one per mass
};

struct MassFit {
  bool converged = false;
  std::string solver_summary;
  std::vector<Estimated> masses;                    ///< in the arm's order
  std::vector<Estimated> others;                    ///< load, offsets, zeros, as asked for
  std::vector<double> random_errors, model_errors;  ///< kg: parts of each mass's standard error
  std::vector<double> correlation;                  ///< of the masses, row-major
  std::vector<double> information;                  ///< XᵀΣ⁻¹X of the masses alone, row-major, 1/kg²
  double condition = std::numeric_limits<double>::quiet_NaN();  ///< of the masses' regressors, unweighted
  TorqueSign sign = TorqueSign::kGravity;
  double torque_noise =
      std::numeric_limits<double>::quiet_NaN();  ///< N m, rms of what the rows were weighted with
  bool noise_estimated = false;
  double rmse = std::numeric_limits<double>::quiet_NaN();   ///< N m
  double nrmse = std::numeric_limits<double>::quiet_NaN();  ///< rmse over the range of the torques
  long degrees_of_freedom = 0;
  std::vector<MassRow> rows;
  std::vector<MassPoseResult> poses;
  ArmVector friction{};  ///< N m, half the difference of the sides, NaN where no pair was measured
  std::vector<MassSensitivity> sensitivities;
  Warnings warnings;
};

[[nodiscard]] MassFit fit_masses(const MassArm& arm, std::span<const MassPose> poses,
                                 const MassFitOptions& options);

}  // namespace isac::estimate
