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
#include <memory>

#include "isac/explain/prepared.hpp"

namespace isac::explain {

inline constexpr double kWanderMemory = 100;  ///< s, of a zero that wanders

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

/// Logarithm of the likelihood of a residual r/σ under these colours, but for a constant: −½ Σ (v²/(P + w) + ln(P + w)).
[[nodiscard]] double log_likelihood(const Prepared& data, const Weights& weights,
                                    const Eigen::VectorXd& residual);

}  // namespace isac::explain
