/// @file
/// What a row counts for: divided by its chain's scale, and freed of the slow part of the noise.
///
///   y_k = r_k/σ = n_k + z_k + d_k,   n white of variance w,   z slow: variance s, memory τ, z_{k+1} = a z_k + …, a = e^(−Δt/τ)
///   d a zero that wanders: variance s_d, memory 100 s
///   v_k = y_k − m_k,  e_k = v_k √(w/(P_k + w)),  m the filter's prediction of z + d, P its variance
///
/// A free joint's torque is read by the same force sensors that its motion is held against: where their zero wanders, what the filter makes
/// of it along the torque's rows is taken off the motion's (`one_zero`), y_motion,k − d̂_k σ_torque/σ_motion, before those pass their own filter.
/// What is left there is how the model's torque moves the joint, which no force sensor reads.
///
/// v are the innovations of the Kalman filter of y; e is without memory and has n's spectral density at low frequencies, if the noise is as
/// assumed. Residuals, sensitivities and responses pass the same filter, so least squares in e is generalised least squares in y: a jump of torque counts for what it is
/// beside noise that cannot jump. Where the noise is assumed wrongly, fits lose efficiency, never their mean; the tests flip blocks and
/// do not rest on the assumption. Each run and chain starts anew; gaps are bridged by a^(gap).
/// Units: weighted rows. Threads: pure functions. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>

#include "isac/explain/prepared.hpp"

namespace isac::explain {

/// Noise of a chain's rows, in units of σ².
struct Colour {
  double white = 1;   ///< w: its spectral density at low frequencies, per row
  double slow = 0;    ///< s; 0: no filter
  double memory = 0;  ///< τ, s
  double wander = 0;  ///< s_d
};

struct NoiseFilter;

struct Weights {
  double sigma[kChains] = {1, 1, 1, 1};  ///< of one low-passed row, N m or Pa
  Colour colour[kChains];
  bool one_zero = false;  ///< of torque and motion: they are read by the same sensors
  std::shared_ptr<const NoiseFilter>
      filter;  ///< of these colours and the data that take() saw; any other is made when it is needed

  void take(const Prepared& data);
  [[nodiscard]] bool is_coloured() const noexcept;
};

/// Rows in the chains' units → weighted rows e, each column by itself.
void weigh(const Prepared& data, const Weights& weights, Eigen::Ref<Eigen::MatrixXd> columns,
           int threads = 1);
/// Rows r/σ of which those of the motion have lost the zero that the torque's rows tell of.
[[nodiscard]] Eigen::VectorXd without_shared_zero(const Prepared& data, const Weights& weights,
                                                  Eigen::VectorXd rows);
/// Weighted rows e → r/σ, as they are in time.
[[nodiscard]] Eigen::VectorXd unfiltered(const Prepared& data, const Weights& weights,
                                         const Eigen::VectorXd& weighted);
/// The same of each column.
[[nodiscard]] Eigen::MatrixXd unfiltered_each(const Prepared& data, const Weights& weights,
                                              Eigen::MatrixXd weighted);

/// Noise of one chain from a residual r/σ that holds little else: the slow part from the autocovariance beyond the kernel's
/// reach, the white part from what is left within it.
[[nodiscard]] Colour colour_of(const Prepared& data, const Eigen::VectorXd& residual, Chain chain);

/// Slow noise of one memory.
struct SlowError {
  double variance = 0;  ///< in the σ² of the rows that it comes from
  double memory = 0;    ///< s
};

/// Error of the wandering zero as the filter reads it off rows of this colour, `apart` seconds from each other, once it has settled:
///   P² = q (P + R),   q = s_d (1 − e^(−2Δt/100 s)),   R = w + 2 s τ/Δt,   memory Δt (P + R)/P
/// P the variance before a row, q what the zero moves in one, R the density of all other noise at low frequencies. Needs s_d > 0, Δt > 0.
[[nodiscard]] SlowError error_of_zero(const Colour& colour, double apart);

/// Takes what an effect may have left out of rows r/σ, chain by chain.
using Cleaned = std::function<Eigen::VectorXd(const Eigen::VectorXd& rows)>;

/// Colours of all chains from what a model leaves, r/σ, `cleaned`, and whether torque and motion have one zero: `weights` with them, ready (take() is
/// called). That zero is taken off the motion before it is cleaned, for each chain by itself loses another share of it. The error
/// with which the torque's rows tell it (error_of_zero, by (σ_torque/σ_motion)²) is the least that stays in the motion.
void take_colours(const Prepared& data, const Eigen::VectorXd& residual, const Cleaned& cleaned,
                  Weights& weights);

/// Logarithm of the likelihood of a residual r/σ under these colours, but for a constant: −½ Σ (v²/(P + w) + ln(P + w)).
[[nodiscard]] double log_likelihood(const Prepared& data, const Weights& weights,
                                    const Eigen::VectorXd& residual);

}  // namespace isac::explain
