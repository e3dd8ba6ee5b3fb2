/// @file
/// Gains judged on many joints that the identified parameters allow: margins of the linear loop, figures of the nonlinear one.
///
/// A draw takes A, B, C, D, I, K_C, T_C, L from a normal distribution about the model (relative covariance), redrawn while a value
/// would be impossible. The controller keeps believing the model; only the joint differs.
///   stable       the linear loop of the draw, with dead time and sampling, and the simulated step stays bounded
///   good         stable, overshoot and modulus margin within `Limits`
/// Quantiles: of tracking error and overshoot the 95 %, of the modulus margin the 5 %: what the worse draws do.
/// Units: SI. Threads: pure. Errors: none. Source: docs/derivations/tuning.md. Example: `assess(model, draws, gains).good_share`.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "isac/tune/closed_loop.hpp"
#include "isac/tune/loop.hpp"

namespace isac::tune {

enum DrawnParameter {
  kDrawA,
  kDrawB,
  kDrawC,
  kDrawD,
  kDrawInertia,
  kDrawValveGain,
  kDrawLag,
  kDrawDeadTime,
  kDrawnParameters
};

/// Covariance of the relative errors, row-major.
using RelativeCovariance = std::array<double, static_cast<std::size_t>(kDrawnParameters* kDrawnParameters)>;

/// Standard deviations beside each other, nothing correlated.
[[nodiscard]] RelativeCovariance independent(const std::array<double, kDrawnParameters>& relative_errors);

[[nodiscard]] std::vector<JointModel> draw_joints(const JointModel& model,
                                                  const RelativeCovariance& covariance, int count,
                                                  std::uint64_t seed);

struct Limits {
  double overshoot = 0.10;  ///< share of the step
  double modulus = 0.5;     ///< min |1 + L|
  double share = 0.95;      ///< of the draws that must hold both
};

struct Assessment {
  int draws = 0;
  double stable_share = 0, good_share = 0;
  double tracking = 0;      ///< rad, rms error along the trajectory, mean over the bounded draws
  double tracking_p95 = 0;  ///< rad
  double overshoot = 0, overshoot_p95 = 0;  ///< nominal joint; 95 % quantile
  double rise = 0, settling = 0, itae = 0;  ///< nominal joint
  double effort = 0;                        ///< Pa/s, mean
  double modulus = 0, modulus_p05 = 0;      ///< nominal joint; 5 % quantile
  Margins margins;                          ///< nominal joint
  double inner_use = 0;  ///< of the sampled inner loop's border (control/stability.hpp), 1: at it
};

/// Figures of the model itself and of the draws (which may be empty).
[[nodiscard]] Assessment assess(const JointModel& model, std::span<const JointModel> draws,
                                const Gains& gains, const Limits& limits = {},
                                const ClosedLoopOptions& options = {});

/// Why these gains may not be deployed, one sentence; empty: they may.
[[nodiscard]] std::string refusal(const Assessment& assessment, const Limits& limits);

/// The gains of the position loop (of a PID: all) times the greatest factor between 1/20 and 10 at which the draws hold `limits` in
/// their 5 and 95 % quantiles: two tunings then stand equally far from the edge. Nothing where no factor does it.
[[nodiscard]] std::optional<Gains> brought_to_limits(std::span<const JointModel> draws,
                                                     const JointModel& model, const Gains& gains,
                                                     const Limits& limits,
                                                     const ClosedLoopOptions& options = {});

}  // namespace isac::tune
