/// @file
/// Identification of a single joint: T = A r² φ + B r Δp − C φ̇³ − D φ̇ (seed 3.10, signs of docs/errata.md), or any sum of
/// catalogue terms, by Ceres with robust loss and weights that know the noise of torque and regressors.
///
/// Units: SI inside; `JointFit::parameters` in the reporting units of docs/notation.md (A N/m, B N cm2/kg, C N m s3, D N m s).
/// Covariance: sandwich over blocks of time, so that it holds under coloured noise; intervals are 95 %, Student's t over
/// the number of blocks. What the runs cannot identify is refused by name, with the sweep that would mend it.
/// Threads: pure function of its arguments. Errors: throws isac::Error (answer is no: "no_usable_data") when not a single
/// usable row is left; unknown term names are a usage error. Every numerical outcome is data in the result.
/// Source: seed 3.2 to 3.5; derivation in docs/derivations/joint_fit.md.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"

namespace isac::estimate {

/// One recording reduced to what the joint model speaks of; columns of equal length, SI, NaN where missing.
struct JointRun {
  std::string name;        ///< file, for messages
  std::string experiment;  ///< "constant-pressure", "constant-angle", "free", … or empty
  std::string sha256;
  std::vector<double> time;            ///< s
  std::vector<double> angle;           ///< rad (or m for a linear axis)
  std::vector<double> velocity;        ///< rad/s; empty: computed from `angle` by the stated differentiator
  std::vector<double> delta_pressure;  ///< Pa, (p2 − p1)/2; empty where the rig has none
  std::vector<double> mean_pressure;   ///< Pa, (p1 + p2)/2; empty where the rig has none
  std::vector<double> output;          ///< N m (or N): torque T = (F2 − F1) r, or the driving force
};

struct Loss {
  enum class Kind { kSquared, kHuber, kCauchy } kind = Kind::kHuber;
  /// Residual at which the loss bends, in units of the output; NaN: 1.345 robust standard deviations, from the data.
  double scale = std::numeric_limits<double>::quiet_NaN();
};

/// Standard deviations of white measurement noise; NaN: estimated from the data.
struct NoiseLevels {
  double output = std::numeric_limits<double>::quiet_NaN();  ///< N m
  double angle = std::numeric_limits<double>::quiet_NaN();   ///< rad, encoder step included
  double angle_step =
      std::numeric_limits<double>::quiet_NaN();  ///< rad, of the encoder; NaN: from the data, 0: none
  double delta_pressure = std::numeric_limits<double>::quiet_NaN();  ///< Pa
};

struct DifferentiatorChoice {
  int window = 0;  ///< samples of the Savitzky–Golay window, odd; 0: chosen from rate and noise, and stated
  int order = 3;   ///< of its polynomial
};

/// What the model is to hold for (seed 3.2, 3.5): terms whose input never comes near it are refused, and how well a
/// parameter must be known is judged by the torque it makes there. Not used for driven and linear axes.
struct OperatingRange {
  double angle = 1.1780972450961724;      ///< rad, 3/8 π
  double speed = 6.283185307179586;       ///< rad/s, the fast sweeps of the seed
  double delta_pressure = 2.0 * 98066.5;  ///< Pa
};

struct JointFitOptions {
  /// Catalogue ids (models/effects.hpp) or the aliases A, B, C, D of the seed's model.
  std::vector<std::string> terms = {"A", "B", "C", "D"};
  std::string output_unit = "N m";            ///< for messages and the JSON
  std::string position_unit = "rad";          ///< "m" for a linear axis
  double wheel_radius = 0.019;                ///< m
  double reference_pressure = 3.0 * 98066.5;  ///< Pa, p0 of pressure-dependent terms
  Loss loss;
  NoiseLevels noise;
  DifferentiatorChoice differentiator;
  double block_seconds =
      std::numeric_limits<double>::quiet_NaN();  ///< NaN: from the residual's correlation time
  /// False: the regressors are taken as exact: no bias correction, no weights from their noise, no parallel filter.
  bool errors_in_variables = true;
  bool effective_variance = true;  ///< weights 1/(σ_T² + noise of the regressors through the model)
  bool parallel_filter =
      true;  ///< output and all regressors pass the differentiator's low-pass (memoryless linear terms)
  OperatingRange operating;
  double output_lag =
      0;  ///< s, by which the output's sensor is late (a first-order amplifier: its time constant)
  bool keep_rows = true;  ///< false: the columns of RunResidual stay empty, for callers that draw nothing
};

/// A check of the fitted model, with the sentence a lab engineer reads.
struct ResidualTest {
  std::string name;
  double statistic = 0;
  double p_value = 1;
  bool passed = true;
  std::string sentence;
};

/// A counter tells the angle to within a step, and nothing tells where in the step its zero is: the fit lets the zero move,
/// with half a step as prior standard deviation. Not a parameter of the joint.
struct AngleZero {
  bool used = false;
  double value = std::numeric_limits<double>::quiet_NaN();  ///< rad, added to the recorded angles
  double std_error = std::numeric_limits<double>::quiet_NaN();
  double half_step = 0;          ///< rad
  std::size_t resting_runs = 0;  ///< runs within one step, each with an error of its own
  std::string sentence;
};

/// Seed 3.3.2: torque offset over velocity at φ = 0, from stretches of constant velocity.
struct VelocityCut {
  std::vector<double> velocity;       ///< rad/s, bin centres
  std::vector<double> torque_offset;  ///< N m, T − A r² φ − B r Δp in the bin
  std::vector<double> std_error;      ///< N m
  Estimated C, D;                     ///< cubic fit through the cut, a cross-check of the main fit
};

struct RunResidual {
  std::string name;
  bool heldout = false;
  double rmse = std::numeric_limits<double>::quiet_NaN();
  std::size_t rows = 0;  ///< usable
  std::vector<double> time, angle, velocity, delta_pressure, measured,
      predicted;  ///< usable rows only, for pictures
};

struct JointFit {
  bool converged = false;
  std::string solver_summary;  ///< Ceres' brief report
  std::vector<Estimated> parameters;
  std::vector<double> correlation;  ///< row-major n × n over `parameters`; NaN where not identifiable
  double rmse = std::numeric_limits<double>::quiet_NaN();
  double nrmse = std::numeric_limits<double>::quiet_NaN();
  double heldout_rmse = std::numeric_limits<double>::quiet_NaN();
  double noise_floor =
      std::numeric_limits<double>::quiet_NaN();  ///< standard deviation of the output's white noise
  std::size_t samples = 0;
  std::size_t outliers = 0;  ///< rows whose weight the robust loss cut below one half
  std::size_t blocks = 0;
  double block_seconds = 0;
  std::string differentiator;  ///< stated in words
  ValidityBox box;
  std::vector<ResidualTest> tests;
  VelocityCut cut;
  AngleZero angle_zero;
  std::vector<RunResidual> runs;
  Warnings warnings;
};

[[nodiscard]] JointFit fit_joint(std::span<const JointRun> runs, std::span<const JointRun> heldout,
                                 const JointFitOptions& options);

}  // namespace isac::estimate
