/// @file
/// Which poses to hold so that the masses come out with the smallest errors.
///
///   I = Σ_i Gᵀ(θ_i) Σ⁻¹ G(θ_i),   G = gravity's torques per kilogram (seed 4.49),  Σ = diag(σ_j²)
///   D: maximise det I (the ellipsoid of the errors is smallest);  A: minimise Σ_k (I⁻¹)_kk / s_k², s_k the mass' own size
///
/// Greedy choice from a Halton set inside the limits of φ, then every pose in turn moved by NLopt (BOBYQA) until a round gains nothing. An
/// angle that gravity does not feel stays where it is nearest to zero. Torques are those on the arm's joints θ. Deterministic: same
/// input, same poses on every machine of the same arithmetic. Units: SI. Threads: pure function. Errors: fewer poses
/// than can tell the masses give infinite errors; throws nothing but std::bad_alloc.
/// Source: docs/derivations/mass_identification.md. Example: `design_poses(arm, {.poses = 8}).std_errors[0]`.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "isac/estimate/mass_fit.hpp"

namespace isac::estimate {

enum class DesignCriterion { kD, kA };

struct PoseDesignOptions {
  int poses = 8;
  DesignCriterion criterion = DesignCriterion::kA;
  ArmVector torque_noise{0.1, 0.1, 0.1, 0.1, 0.1, 0.1};  ///< N m, on the arm's joints
  std::array<bool, kArmJoints> measured{true, true, true, true, true, true};
  std::vector<double> recorded;  ///< information of poses already held (MassFit::information), or empty
  bool add_to_recorded = false;  ///< choose what adds most to them; else a set that stands alone
  int candidates = 4096;
  /// Pa: only poses that muscles within ± this can hold, by the arm's actuators and masses; NaN: any.
  double delta_pressure_limit = std::numeric_limits<double>::quiet_NaN();
  double spare_angle = 0;  ///< rad, to every limit of φ: room to approach a pose from both sides
};

struct PoseDesign {
  std::vector<ArmVector> theta, phi;      ///< rad
  std::vector<double> std_errors;         ///< kg, of these poses alone
  std::vector<double> with_recorded;      ///< kg, together with those recorded; empty without
  std::vector<double> random_std_errors;  ///< kg, rms over sets of as many random poses inside the limits
  double condition = 0;                   ///< of the regressors
};

[[nodiscard]] PoseDesign design_poses(const MassArm& arm, const PoseDesignOptions& options);

}  // namespace isac::estimate
