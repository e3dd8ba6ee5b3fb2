/// @file
/// Identification of the pressure control unit: gain K_C, lag T_C and dead time L from steps of the command.
///
///   p(t) = p_a + (p_b − p_a) (1 − exp(−(t − t_s − L)/T))  for t > t_s + L,  p_a before      (seed 4.1 with a
///   dead time) K_C  = (p_b − p_a)/(u_b − u_a)
///
/// t_s is the time of the first row that carries the new command. Every step has levels p_a, p_b of its own;
/// steps of one direction share T and L. For given T and L the levels are a linear problem, and for given T
/// the sum of squares over all L is known exactly, kinks included (prefix sums), so the start is the global
/// minimum; Ceres polishes with the analytic Jacobian. Intervals: the noise's autocorrelation is estimated
/// from the residuals and carried through the fit, so they hold under coloured noise; quantisation that the
/// noise does not dither is added; Student's t. docs/derivations/pcu_fit.md.
///
/// Without a command (a pure fill) the time of the step is unknown: T, levels and the start of the rise are
/// fitted, K_C and the dead time are refused by name unless `PcuRun::step_at` (and `step_command`) tell them.
///
/// Units: SI inside (s, Pa); answers: K_C in "-", times in "s". Threads: pure function of its arguments.
/// Errors: throws isac::Error (answer is no) "no_usable_data" without a usable row, "no_step" when the
/// command never steps and the pressure never moves; columns of unequal length are a usage error. Every
/// numerical outcome is data in the result. Source: seed 4.1, 4.2 (K_C = 1, T_C = 0.17 s). Example:
/// `fit_pcu(runs, {}).find("T_C")->value`.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"

namespace isac::estimate {

/// One channel of one recording; columns of equal length, SI, NaN where missing.
struct PcuRun {
  std::string name;  ///< file and channel, for messages: "step.csv p1"
  std::string sha256;
  std::vector<double> time;      ///< s, increasing
  std::vector<double> command;   ///< Pa; empty where none was recorded
  std::vector<double> pressure;  ///< Pa
  double step_at =
      std::numeric_limits<double>::quiet_NaN();  ///< s, time of the step where no command shows it
  /// Pa, size of that step (new command less the old one); NaN: unknown, K_C is refused.
  double step_command = std::numeric_limits<double>::quiet_NaN();
};

struct PcuFitOptions {
  /// Smallest change of the command that counts as a step, Pa; NaN: 5 % of the command's range.
  double min_command_step = std::numeric_limits<double>::quiet_NaN();
  bool leave_out_spikes =
      true;  ///< samples that stand far out from their neighbours get no weight, and are counted
  /// Largest smooth misfit of the first-order curve, as a share of the step, that still passes as first
  /// order.
  double first_order_tolerance = 0.08;
};

enum class StepDirection { kFilling, kVenting };

/// Shapes a step response is compared with; each has the two levels, a dead time, and the parameters named.
enum class StepShape {
  kFirstOrder,   ///< T
  kSecondOrder,  ///< two real lags T ≥ T2 in series
  kFlowLimited,  ///< constant slope for the first `share` of the step, then a lag T (slope continuous)
  kTwoRates,     ///< `share` of the step with lag T2 < T, the rest with lag T
};
[[nodiscard]] const char* describe(StepShape shape) noexcept;

struct StepShapeFit {
  StepShape shape = StepShape::kFirstOrder;
  double lag = std::numeric_limits<double>::quiet_NaN();         ///< s, T
  double second_lag = std::numeric_limits<double>::quiet_NaN();  ///< s, T2
  double share = std::numeric_limits<double>::quiet_NaN();       ///< of the step, 0…1
  double dead_time =
      std::numeric_limits<double>::quiet_NaN();            ///< s behind the step (or the start of the record)
  double rmse = std::numeric_limits<double>::quiet_NaN();  ///< Pa
};

/// Is the step a first-order one? Sizes first, significance second: a tiny pattern can be significant.
struct StepAdequacy {
  bool first_order = true;  ///< the verdict
  double misfit_rms = 0;    ///< rms of the smooth part of the residual over the step's size
  double misfit_worst = 0;  ///< largest of it
  double misfit_at = 0;     ///< s after the step at which it is largest
  double p_value =
      1;  ///< of "the misfit while moving is noise", its block means against those at rest (F test)
  StepShape best = StepShape::kFirstOrder;  ///< by rmse, with a penalty for parameters
  std::vector<StepShapeFit> shapes;         ///< all shapes tried, in the order of the enumeration
  std::string sentence;                     ///< what a lab engineer reads
};

/// One step: what was fitted to it alone, and the curves for the picture.
struct PcuStep {
  std::string run;  ///< PcuRun::name
  StepDirection direction = StepDirection::kFilling;
  double step_time =
      std::numeric_limits<double>::quiet_NaN();  ///< s, time of the command's step; NaN: unknown
  double command_from = std::numeric_limits<double>::quiet_NaN();  ///< Pa
  double command_to = std::numeric_limits<double>::quiet_NaN();    ///< Pa
  bool used = true;                                                ///< false: left out, `why_not` says why
  std::string why_not;
  Estimated gain;       ///< "K_C", -
  Estimated lag;        ///< "T_C", s
  Estimated dead_time;  ///< "dead_time", s
  Estimated start;      ///< "start", s: when the pressure begins to rise, in the recording's time
  double level_from = std::numeric_limits<double>::quiet_NaN();      ///< Pa, fitted p_a
  double level_to = std::numeric_limits<double>::quiet_NaN();        ///< Pa, fitted p_b
  double level_to_error = std::numeric_limits<double>::quiet_NaN();  ///< Pa, standard error of p_b
  double rmse = std::numeric_limits<double>::quiet_NaN();            ///< Pa
  double noise =
      std::numeric_limits<double>::quiet_NaN();  ///< Pa, standard deviation of the sample-to-sample noise
  double sample_time = std::numeric_limits<double>::quiet_NaN();  ///< s, median
  std::size_t samples = 0;
  std::size_t spikes = 0;  ///< samples left out
  StepAdequacy adequacy;
  std::vector<double> time, measured, predicted;  ///< s in the recording's time, Pa, Pa
};

struct PcuFit {
  bool converged = false;
  std::string solver_summary;  ///< Ceres' brief report of the last fit
  /// K_C, T_C, dead_time over all steps; then K_fill, T_fill, dead_time_fill, K_vent, T_vent, dead_time_vent.
  std::vector<Estimated> parameters;
  double rmse = std::numeric_limits<double>::quiet_NaN();   ///< Pa, over all used steps, each direction with
                                                            ///< its own T and L
  double nrmse = std::numeric_limits<double>::quiet_NaN();  ///< rmse over the largest step
  std::size_t samples = 0;
  bool first_order = true;         ///< every used step is
  bool directions_differ = false;  ///< filling and venting differ in lag by more than their errors
  std::vector<PcuStep> steps;
  Warnings warnings;

  [[nodiscard]] const Estimated* find(const std::string& name) const noexcept;
};

[[nodiscard]] PcuFit fit_pcu(std::span<const PcuRun> runs, const PcuFitOptions& options = {});

}  // namespace isac::estimate
