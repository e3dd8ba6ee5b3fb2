/// @file
/// Output-error identification of a free joint from its command and its angle alone: no force sensor, no derivative.
///
///   T_C q̇ = u − q                                                                        valve unit (seed 4.1), q(t0) = u(t0)
///   I φ̈  = A r² φ + B r q − C φ̇³ − D φ̇ − T_c tanh(φ̇/v_s) − G sin φ                         joint (seed 3.10, 4.3)
///   minimise Σ (φ_measured − φ(t; I, A, B, C, D, T_c, T_C))²                                by Ceres
///
/// The sum of torques is known from the motion only up to a common factor: without a known gravity torque G one of I, A, B
/// must be held (the inertia, by default the one in rig.toml), else all of them are refused by name.
/// Integration: classical Runge-Kutta at the samples (or finer), the command held between them as a controller's output is (or linear, on request); sensitivities of that
/// very recursion are carried along, so the Jacobian is exact for the discrete solution. Cost: one pass per iteration; the normal
/// equations are summed on the way, nothing is stored per row.
/// Covariance: sandwich over blocks of time, Student's t. Intervals hold under coloured measurement noise.
/// Units: SI inside; answers in the reporting units of docs/notation.md. Threads: pure function.
/// Errors: throws isac::Error (answer is no, "no_usable_data"); numerical outcomes are data in the result.
/// Source: seed 4.1, 4.2; derivation in docs/derivations/motion_fit.md. Example: tests/estimate/motion_fit_test.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"

namespace isac::estimate {

struct MotionRun {
  std::string name;
  std::string sha256;
  std::vector<double> time;     ///< s
  std::vector<double> command;  ///< Pa, Δp commanded
  std::vector<double> angle;    ///< rad
};

enum MotionParameter { kInertia, kA, kB, kC, kD, kFriction, kLag, kMotionParameters };
using MotionVector = std::array<double, kMotionParameters>;  ///< SI: kg m², N/m, N/Pa, N m s³, N m s, N m, s

struct MotionOptions {
  double wheel_radius = 0.019;   ///< m
  double gravity_torque = 0;     ///< N m, G = m g l, known
  double friction_speed = 0.05;  ///< rad/s, v_s, known
  double dead_time = 0;          ///< s, known; the command is taken this much earlier
  /// NaN: found from the data (fitted on derivatives first); else where Ceres starts.
  MotionVector start = [] {
    MotionVector v{};
    v.fill(std::numeric_limits<double>::quiet_NaN());
    return v;
  }();
  std::array<bool, kMotionParameters> fixed{};  ///< held at `start`
  bool command_linear =
      false;  ///< false: every command holds until the next sample, as a controller's output does
  bool initial_rest = false;  ///< φ(t0) = φ̇(t0) = 0 exactly; else both are fitted for every run
  double max_step = 0.002;    ///< s, longest step of the integration
  double block_seconds = std::numeric_limits<double>::quiet_NaN();
};

struct MotionRunResult {
  std::string name;
  double rmse = std::numeric_limits<double>::quiet_NaN();  ///< rad
  double initial_angle = 0, initial_speed = 0;             ///< rad, rad/s
  std::vector<double> time, measured, predicted;
};

struct MotionFit {
  bool converged = false;
  std::string solver_summary;
  std::vector<Estimated> parameters;  ///< inertia, A, B, C, D, T_c, T_C; a held one has std_error 0
  MotionVector values{};              ///< SI, as found, refused ones included
  std::vector<double> correlation;    ///< row-major 7 × 7, NaN for held ones
  double rmse = std::numeric_limits<double>::quiet_NaN();  ///< rad
  std::size_t samples = 0;
  int simulations = 0;  ///< passes over the data
  std::vector<MotionRunResult> runs;
  Warnings warnings;
};

[[nodiscard]] MotionFit fit_motion(std::span<const MotionRun> runs, const MotionOptions& options);

/// Angles predicted for one run, from rest or from the initial state given.
[[nodiscard]] std::vector<double> simulate_motion(const MotionRun& run, const MotionVector& parameters,
                                                  const MotionOptions& options, double initial_angle = 0,
                                                  double initial_speed = 0);

}  // namespace isac::estimate
