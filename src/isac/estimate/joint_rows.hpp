/// @file
/// From recordings to rows: derivatives, regressors, the low-pass that output and regressors share, and the noise that each
/// regressor carries.
///
/// Parallel filter: the differentiator's implied low-pass L (series/differentiate.hpp) is applied to the output and to every
/// regressor alike, Ly = Σ θ_k Lx_k, so that what it does to phase and gain cancels. Spikes of the output, samples off the median of
/// their seven neighbours by more than six robust deviations, are replaced by that median before the filter could smear them.
/// Noise: with σ_φ per sample, σ_v = σ_φ g_1, σ_a = σ_φ g_2 (`NoiseGain`), after the filter with kernel L∗w; x_C uses
/// v̂³ − 3 σ_v² v̂, whose mean is v³. Derivation: docs/derivations/errors_in_variables.md.
/// Threads: pure. Errors: none; rows with a missing sample or at an edge are left out.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "isac/estimate/joint_fit.hpp"
#include "isac/estimate/joint_terms.hpp"

namespace isac::estimate {

struct RowNoise {
  double raw[kInputs] = {};       ///< standard deviation of each input as it enters the regressors
  double filtered[kInputs] = {};  ///< the same behind the parallel filter
};

/// How the rows of all runs are made.
struct RowRecipe {
  int window = 41;
  int order = 3;
  bool parallel_filter = true;
  bool unbiased_cube = true;  ///< x_C = v̂³ − 3σ²v̂
  double angle_noise = 0;     ///< per sample
  double angle_step = 0;      ///< of the encoder; 0: not quantised, or not to be allowed for
  double output_lag = 0;      ///< s; the output is read as much later
  double delta_pressure_noise = 0;
  bool clean_spikes = true;
};

struct RunRows {
  std::string name;
  std::size_t begin = 0, end = 0;  ///< rows of this run
  double interval = 0;             ///< s
  RowNoise noise;
  bool resting = false;  ///< the angle stays within about one encoder step: one error for all rows
};

/// Usable rows of several runs, column by column.
struct JointRows {
  std::vector<RunRows> runs;
  std::vector<double> time, input[kInputs], output;  ///< as measured (velocity, acceleration as computed)
  std::vector<std::vector<double>> plain;            ///< regressors, unfiltered
  std::vector<std::vector<double>> filtered;         ///< empty without parallel filter
  std::vector<double> filtered_output;
  std::size_t cleaned = 0;  ///< spikes taken out
  std::size_t seen = 0;     ///< rows in the recordings
  [[nodiscard]] std::size_t size() const noexcept { return time.size(); }
  [[nodiscard]] const std::vector<double>& x(std::size_t k) const {
    return filtered.empty() ? plain[k] : filtered[k];
  }
  [[nodiscard]] const std::vector<double>& y() const { return filtered.empty() ? output : filtered_output; }
  [[nodiscard]] JointState state(std::size_t i) const;
};

[[nodiscard]] JointRows make_rows(std::span<const JointRun> runs, const JointTerms& terms,
                                  const RowRecipe& recipe);

/// S over rows [begin, end): what noise of the regressors adds to XᵀΩX, Ω per row in `omega` (nullptr: one).
[[nodiscard]] Eigen::MatrixXd noise_gram(const JointRows& rows, const JointTerms& terms, const double* omega,
                                         std::size_t begin, std::size_t end);

/// Variance of the prediction from noise of the regressors, row by row, in units of the output squared.
[[nodiscard]] std::vector<double> prediction_variance(const JointRows& rows, const JointTerms& terms,
                                                      const Eigen::VectorXd& theta);

/// ∂(prediction)/∂(angle) row by row, by the half difference over ± `half_step`.
[[nodiscard]] std::vector<double> angle_slope(const JointRows& rows, const JointTerms& terms,
                                              const Eigen::VectorXd& theta, double half_step);

/// Does the angle stay within about one step?
[[nodiscard]] bool rests(double lowest, double highest, double step) noexcept;

/// y(t + lag) by straight lines between samples; NaN where a neighbour is missing, at a gap and at the end.
[[nodiscard]] std::vector<double> advanced(std::span<const double> time, std::span<const double> signal,
                                           double lag, double interval);

/// Prediction from unfiltered regressors.
[[nodiscard]] std::vector<double> predict(const JointRows& rows, const JointTerms& terms,
                                          const Eigen::VectorXd& theta);

}  // namespace isac::estimate
