/// @file
/// A third-order lag with dead time fitted to what an experiment recorded, and what follows from it: K_crit, T_crit, T_L, T_A.
///
///   minimise Σ (φ_k − φ_0 − φ(t_k; K, T_C, T_J, ζ, L, u))²   by Ceres, over log K, log T_C, log T_J, log ζ, L, φ_0 and a
///   load that begins with the excitation (an angle set by another Δp, a creeping rest)
///   φ(t): the exact answer to the command as it was held (linear_step.hpp), so relay, ramp and steps are one problem
///   covariance: sandwich over blocks of time (estimate/block_covariance.hpp), Student's t; what follows by the delta method
///   the same again with L of either sign, and with (1 + q s²) behind the lags too; K_crit … T_L_T_A are the mean of these two forms with
///   Akaike's weights, and their errors hold the difference (plant_spread.hpp): that is how lags and leads that were not thought of are
///   paid for
/// A plant with other lags than these is met well near the frequencies at which it was excited, which is where K_crit lies.
/// `judge` refuses: cost not converged, more than `worst_misfit` of the motion left over, K_crit or T_crit not known to
/// `worst_error`, dead time or lag at the end of its range in a way that K_crit feels.
///
/// Units: SI inside; `Estimated` in rad per kg/cm², kg/cm² per rad, s. Real time: not for the loop. Threads: pure.
/// Errors: throws isac::Error (answer is no, "no_usable_data") for fewer than 50 rows or a joint that did not move; numerical outcomes
/// are data in the result. Source: docs/derivations/tuning.md. Example: `fit_plant(relay.excited())`.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"
#include "isac/tune/experiment.hpp"
#include "isac/tune/loop.hpp"

namespace isac::tune {

struct PlantFitOptions {
  double dead_time = std::numeric_limits<double>::quiet_NaN();  ///< s, known; NaN: fitted
  double time_scale =
      std::numeric_limits<double>::quiet_NaN();  ///< s, e.g. a period of the relay; NaN: from the record
  double noise = 0;                              ///< rad, of the angle at rest: not counted as misfit
  double worst_misfit = 0.10;  ///< rms of the residual beyond the noise, over rms of the motion
  double worst_error = 0.025;  ///< standard error of K_crit and T_crit, relative: 5 % at 95 %
};

struct PlantFit {
  bool converged = false;
  LagPlant plant;                     ///< of the plain form
  std::vector<Estimated> parameters;  ///< K, T_C, T_J, zeta, dead_time
  std::vector<Estimated> derived;     ///< K_crit, T_crit, T_L, T_A, T_L_T_A, joint_T_L, joint_T_A
  double rmse = std::numeric_limits<double>::quiet_NaN();    ///< rad
  double misfit = std::numeric_limits<double>::quiet_NaN();  ///< rms beyond the noise over rms of the motion
  ExperimentRecord record;                                   ///< on an even grid
  std::vector<double> predicted;                             ///< rad, at its rows
  std::string refusal;                                       ///< one sentence; empty: the fit may be used
  std::string solver_summary;
};

[[nodiscard]] PlantFit fit_plant(const ExperimentRecord& record, const PlantFitOptions& options = {});

/// One of `derived` or `parameters` by its name; an assertion when there is none.
[[nodiscard]] const Estimated& value_of(const PlantFit& fit, const std::string& name);

/// The record on an even grid: angle along straight lines, command as held.
[[nodiscard]] ExperimentRecord even_record(const ExperimentRecord& record);

}  // namespace isac::tune
