/// @file
/// All gains of a controller by search (NLopt): least tracking error over draws of the joint, with limits that most draws keep.
///
///   minimise  E_draws[rms tracking error + w_s · ITAE of the step + w_e · effort]
///   such that on 95 % of the draws  overshoot ≤ limit,  min |1 + L| ≥ modulus,  stable,  inner use ≤ 0.5,  K_I ≥ K_P/10 s outside,
///             a step has come within 5 % after 2 s
/// Over the logarithms of the gains, by Subplex (Rowan; derivative-free) with the limits as penalties: first on the model alone from
/// every start; then on the model and a few critical draws: all draws are judged, those at the 97 % quantile of overshoot and the 3 %
/// quantile of the modulus margin join the set, and the search goes on, until enough draws hold. What comes out should be judged on other
/// draws (assess.hpp).
///
/// Units: SI. Deterministic for a seed. Threads: pure; some thousand simulations of seven seconds, 2 ms each. Errors: none; `found` is false
/// where no gains kept the limits. Source: seed 5 (demands 1 to 3), docs/derivations/tuning.md.
/// Example: `optimise(model, draws, {start}, {.limits = {.modulus = 0.5}})`.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "isac/tune/assess.hpp"

namespace isac::tune {

struct OptimiseOptions {
  Limits limits{};
  double effort_weight = 1e-9;  ///< rad per Pa/s: 1 kg/cm² per second counts as 0.1 mrad
  double itae_weight = 0.1;     ///< 1/s²: a step that creeps to its end is not forgotten over the tracking
  int nominal_evaluations = 220, round_evaluations = 120, rounds = 6;
  double least_integral = 0.1;  ///< 1/s, K_I/K_P of a cascade's position loop: a load's droop must go away
  double spare = 0.02;          ///< by which the critical draws keep the limits better than asked
  double share_spare = 0.015;   ///< by which more of the draws must hold than asked: others will be drawn
  ClosedLoopOptions loop{};
  std::function<bool()> stop =
      {};  ///< asked before every evaluation; true ends the search with the best so far
};

struct Optimised {
  bool found = false;
  Gains gains;
  double objective = 0;   ///< rad
  double good_share = 0;  ///< of the draws given
  int evaluations = 0;
};

[[nodiscard]] Optimised optimise(const JointModel& model, std::span<const JointModel> draws,
                                 const std::vector<Gains>& starts, const OptimiseOptions& options = {});

}  // namespace isac::tune
