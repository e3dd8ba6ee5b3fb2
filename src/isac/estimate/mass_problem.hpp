/// @file
/// The rows and unknowns behind mass_fit.hpp: prediction and Jacobian of every torque, and the solve by Ceres.
///
/// Unknowns in order: masses, load, torque offsets, angle zeros, then the actuators' δA/σ_A, δB/σ_B with unit prior. Linear but
/// for the zeros. Units: SI, δ in standard errors. Threads: const functions may run side by side. Errors: none.
/// Source: docs/derivations/mass_identification.md.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "isac/estimate/mass_fit.hpp"

namespace isac::estimate {

struct MassUnknown {
  enum class Kind { kMass, kLoad, kOffset, kZero, kActuatorA, kActuatorB };
  Kind kind = Kind::kMass;
  std::size_t index = 0;  ///< mass or joint
  std::string name, unit;
  [[nodiscard]] bool has_prior() const { return kind == Kind::kActuatorA || kind == Kind::kActuatorB; }
};

/// One measured torque, as gravity's.
struct MassDatum {
  std::size_t pose = 0, joint = 0;
  double gravity = 0;    ///< N m, y
  double noise = 1;      ///< N m, standard deviation, or relative where the scale is estimated
  double u = 0, v = 0;   ///< dy/dδA and dy/dδB, per standard error
  double stiffness = 0;  ///< A r² where y comes from the actuator's model with this angle, N m/rad
};

class MassProblem {
 public:
  MassProblem(const MassArm& arm, const MassFitOptions& options);

  const MassArm& arm;
  bool actuator_angles, actuator_torques;
  std::vector<MassPose> poses;
  std::vector<MassDatum> data;
  std::vector<MassUnknown> unknowns;

  /// Gravity's torque of datum `row` for the values of the unknowns, and (unless null) its derivatives.
  double predict(const MassDatum& row, const Eigen::VectorXd& values, double* derivatives) const;
  /// Derivatives and residuals of all data, each over its noise; then one row per prior.
  void linearise(const Eigen::VectorXd& values, Eigen::MatrixXd& jacobian, Eigen::VectorXd& residual) const;
  /// Derivative of every datum by an unknown that is not among the fitted ones, over the noise.
  [[nodiscard]] Eigen::VectorXd column(const MassUnknown& unknown, const Eigen::VectorXd& values) const;
  [[nodiscard]] Eigen::Index priors() const;
  /// θ of a pose, shifted by the zeros among `values`.
  [[nodiscard]] ArmVector arm_angles(const MassPose& pose, const Eigen::VectorXd& values) const;

 private:
  models::Coupling<double, 6> inverse_{};
};

struct MassSolution {
  Eigen::VectorXd values;
  bool converged = false;
  std::string report;
};

/// Minimises Σ ρ + priors from `start`; `huber` is the loss' corner in noises, 0 for plain squares.
[[nodiscard]] MassSolution solve_masses(const MassProblem& problem, const Eigen::VectorXd& start,
                                        double huber);

/// Rows of one target and load, averaged: the mean of each side, then of the sides. `noise_factor` is what is left of a row's noise;
/// `friction` half the sides' difference. Rows without a target stay as they are. Says which targets have one side only.
[[nodiscard]] std::vector<MassPose> average_approaches(std::span<const MassPose> rows,
                                                       std::vector<double>& noise_factor, ArmVector& friction,
                                                       Warnings& warnings);

/// The recorded rows as data of the problem: incomplete ones left out, sides averaged, torques as gravity's. Throws as fit_masses.
struct MassReading {
  std::vector<double> noise_factor;  ///< per pose of the problem
  TorqueSign sign = TorqueSign::kGravity;
  ArmVector friction{};
  Warnings warnings;
};
[[nodiscard]] MassReading read_mass_poses(MassProblem& problem, std::span<const MassPose> recorded,
                                          const MassFitOptions& options, bool noise_known);

/// Where a solution stands: derivatives and residuals over the noise (prior rows last), and what they leave to check with.
struct MassState {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residual;
  Eigen::MatrixXd covariance;     ///< without the loss' factor
  std::vector<bool> informative;  ///< rows that some unknown moves; the others are no evidence of noise
  long freedom = 0;               ///< informative rows less unknowns without prior
};
[[nodiscard]] MassState mass_state(const MassProblem& problem, const Eigen::VectorXd& values);

/// Residuals of all poses, the left-out ones too, and what a person must know.
void fill_rows(const MassProblem& problem, std::span<const MassDatum> every, const Eigen::VectorXd& values,
               MassFit& fit);
void add_warnings(const MassProblem& problem, const Eigen::VectorXd& values, const MassState& state,
                  MassFit& fit);

/// Fills `torque` of every row by the actuators' model.
void torques_from_pressures(const MassProblem& problem, std::vector<MassPose>& rows);
/// Do the torques go with gravity or against it, given that masses are positive? The unknowns are all masses.
[[nodiscard]] TorqueSign find_sign(const MassProblem& problem);
/// The torques that were measured, with the sign of gravity, and how the actuators' errors enter them.
void fill_data(MassProblem& problem, const MassFitOptions& options, const std::vector<double>& noise_factor,
               TorqueSign sign, bool noise_known);
/// δA, δB of every measured actuator whose errors are known.
void add_actuator_unknowns(MassProblem& problem, Eigen::VectorXd& start);

/// Chooses the unknowns that the data tell apart, in order; what is refused goes into `refused` by name with the poses to record.
/// Start values of the masses come from plain least squares.
struct MassChoice {
  std::vector<Estimated> refused;
  Eigen::VectorXd start;  ///< one per unknown of the problem
};
[[nodiscard]] MassChoice choose_unknowns(MassProblem& problem, const MassFitOptions& options);

/// Errors that the fit does not have: what each would do to the masses, and whether the residuals follow one of them.
void check_unmodelled(const MassProblem& problem, const Eigen::VectorXd& values, const MassState& state,
                      MassFit& fit);

}  // namespace isac::estimate
