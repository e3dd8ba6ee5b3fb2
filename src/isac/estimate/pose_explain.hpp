/// @file
/// What is wrong with an arm, told from poses it was held in: a load in the hand, something that pulls on a joint, a link of another
/// length, an angle that is off, a torque read too large; or nothing, or none of these.
///
///   y = g(θ; m) + X_h β_h + e        one hypothesis h at a time; masses m known with errors, actuators' A and B too
///   Σ = W + N Nᵀ                     noise, and what the known errors of m, A and B do to the torques
///   χ²_h = min over β_h of (y − g − X_h β_h)ᵀ Σ⁻¹ (…)
///
/// Something is missing where the best hypothesis gains more than chance gives the best of all (1 %), or where χ² as a whole is too
/// large (0.5 %). Best is the smallest χ²_h + k_h ln n; every hypothesis less than 9 (three standard deviations) behind it stays
/// in the answer beside it. A best one that leaves more than noise (0.1 %) is not named: unknown.
///
/// | id | parameters | what enters |
/// | --- | --- | --- |
/// | hand_load | kg | gravity of the tool centre point |
/// | joint_pull | N m | a constant torque on one joint: a hose, or an offset of its torque |
/// | joint_spring | N m/rad (and N m at zero) | −c φ on one joint: a hose that springs back, or an actuator's A |
/// | link_length | m | one of the lengths a, d of the arm file that is not zero |
/// | angle_zero | rad | recorded angle + ε is the true one |
/// | torque_gain | 1 | one joint's torque, or its actuator's B, is larger by this share |
/// | mass | kg | only where asked for: one of the masses |
///
/// Units: SI. Threads: pure function. Errors: throws isac::Error: "masses_unknown" (bad input) where the arm has none,
/// "no_usable_data" (answer is no). Source: seed 6.4; docs/derivations/pose_explain.md. Example: tests/estimate/pose_explain_test.cpp.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "isac/estimate/mass_fit.hpp"

namespace isac::estimate {

struct PoseExplainOptions {
  MassFitOptions fit;  ///< of angles, torques and their noise; its further unknowns are not used
  std::vector<double>
      mass_errors;  ///< kg, standard errors of the arm's masses; empty: known exactly; infinite: not known
  bool doubt_masses = false;  ///< a mass that is not what the file says is a hypothesis too
};

struct PoseFinding {
  std::string id;    ///< of the table above
  std::string name;  ///< "a load in the hand", "a constant pull on joint 3"
  int joint = -1;    ///< from 0, where it sits on one
  std::vector<Estimated> parameters;
  double chi_square = 0;  ///< left
  double behind = 0;      ///< of χ² + k ln n behind the best
  double p_value = 1;     ///< of its gain, were nothing missing, over all hypotheses
  double left_p = 1;      ///< of what it leaves
  double confidence = 0;  ///< share of exp(−½ (χ² + k ln n))
};

enum class PoseVerdict { kNone, kNamed, kNotSeparable, kUnknown };

struct PoseJointGap {
  int joint = 0;                 ///< from 0
  double before = 0, after = 0;  ///< N m, rms of the residuals without and with the best hypothesis
  double noise = 0;              ///< N m
};

struct PoseGap {
  std::size_t pose = 0;          ///< index into pose_names
  int joint = 0;                 ///< from 0
  double before = 0, after = 0;  ///< N m, residual without and with the best hypothesis
};

struct PoseExplanation {
  PoseVerdict verdict = PoseVerdict::kNone;
  std::vector<PoseFinding>
      findings;  ///< best first: one where named, several where they cannot be told apart
  std::vector<PoseFinding> rejected;  ///< the others, best first
  std::vector<std::string>
      lookalikes;  ///< masses whose change would leave the same torques as the best finding
  std::vector<std::string> not_testable;  ///< names of hypotheses these poses do not show
  std::vector<PoseFinding>
      could_hide;  ///< for none: three standard errors of each, the largest that could be there unseen
  std::vector<std::string> outliers;  ///< poses left out, because no hypothesis could explain them
  std::vector<PoseJointGap> gaps;
  std::vector<PoseGap> rows;
  std::vector<std::string> pose_names;
  double p_value = 1;            ///< that nothing is missing
  double before = 0, after = 0;  ///< N m, rms of all residuals
  double noise = 0;              ///< N m, rms of what they were weighted with
  bool noise_told = false;
  std::size_t torques = 0, poses = 0;
  Warnings warnings;
};

[[nodiscard]] PoseExplanation explain_poses(const MassArm& arm, std::span<const MassPose> poses,
                                            const PoseExplainOptions& options);

}  // namespace isac::estimate
