/// @file
/// The deployed controller on the nonlinear joint, tick by tick, and what a person judges it by.
///
///   control::JointController at 2 kHz  →  two valve units behind a dead time  →  I φ̈ = A r² φ + B r Δp − C φ̇³ − D φ̇
///   valve units exactly over a tick, the joint by Runge-Kutta; the encoder's steps and the filtered speed are what is fed back
///   step        overshoot (share of the step), rise (to 90 %), settling (to stay within 5 %), ITAE = ∫ t |e| dt
///   tracking    rms of φ_d − φ along the seed's sine 0.15 sin 2t and two quick smooth moves (`trajectory`)
///   effort      rms of Δp's change per second along the trajectory
///
/// Units: SI. Real time: not for the loop. Threads: pure. Errors: a controller that refuses its settings, or a joint that leaves ± 4 rad,
/// gives `bounded = false`. Source: seed 5 (experiments a, b), docs/derivations/tuning.md. Example: `step_figures(joint, gains, 0.3)`.
#pragma once

#include <functional>
#include <limits>
#include <vector>

#include "isac/tune/loop.hpp"
#include "isac/tune/plant.hpp"

namespace isac::tune {

struct ClosedLoopOptions {
  Sampling sampling{};
  double encoder_step = 2 * kPi / 8000;  ///< rad; 0: none
  double load = 0, load_from = 0;        ///< N m that nobody told the controller of, from this time on, s
};

struct Trace {
  bool bounded = true;
  std::vector<double> time, reference, angle, delta_pressure;
};

/// The controller's settings for these gains on this model.
[[nodiscard]] control::JointSettings<double> settings_of(const JointModel& model, const Gains& gains,
                                                         const Sampling& sampling);

/// `model` is what the controller believes, `joint` what moves; from rest at φ = 0 for `duration` seconds.
[[nodiscard]] Trace run_closed_loop(const JointModel& model, const JointModel& joint, const Gains& gains,
                                    const std::function<double(double)>& reference, double duration,
                                    const ClosedLoopOptions& options = {});

struct StepFigures {
  bool bounded = true;
  double overshoot = 0;                                   ///< share of the step
  double rise = std::numeric_limits<double>::infinity();  ///< s
  double settling = 0;                                    ///< s
  double rest = 0;                                        ///< share of the step that is missing at the end
  double itae = 0;                                        ///< rad s²
};
[[nodiscard]] StepFigures step_figures(const Trace& trace, double height);
inline constexpr double kStepHeight = 0.3;    ///< rad
inline constexpr double kStepDuration = 2.0;  ///< s

struct TrackingFigures {
  bool bounded = true;
  double rms = 0;     ///< rad
  double worst = 0;   ///< rad
  double effort = 0;  ///< Pa/s
};
[[nodiscard]] TrackingFigures tracking_figures(const Trace& trace);
/// A smooth move of 0.4 rad in 0.6 s, back in 0.6 s, then one period of 0.15 sin 2t, in which a load of 0.3 N m hangs on the joint.
[[nodiscard]] double trajectory(double time) noexcept;
inline constexpr double kTrajectoryDuration = 1.6 + kPi;  ///< s
inline constexpr double kTrajectoryLoad = 0.3;  ///< N m, from 1.6 s on: what the integral gains are for
/// The joint along the trajectory, with its load.
[[nodiscard]] Trace run_trajectory(const JointModel& model, const JointModel& joint, const Gains& gains,
                                   const ClosedLoopOptions& options = {});
/// The joint after a step of kStepHeight, without a load.
[[nodiscard]] Trace run_step(const JointModel& model, const JointModel& joint, const Gains& gains,
                             const ClosedLoopOptions& options = {});

}  // namespace isac::tune
