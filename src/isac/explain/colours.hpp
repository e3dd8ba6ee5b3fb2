/// @file
/// The noise's colour, read off what a model leaves: white noise, a slow part, and a zero that wanders.
///
/// s and τ by the autocovariance beyond the low-pass' reach, where it passes three of its deviations; s_d by maximum likelihood of means of 2 s, where
/// twice the logarithm of the likelihoods' ratio passes 9. What the letters are: weights.hpp.
/// Units: rows in σ. Threads: pure functions. Errors: none. Source: Bartlett 1946; docs/derivations/explain.md, "The noise's colour", "One zero".
#pragma once

#include <Eigen/Core>
#include <functional>

#include "isac/explain/weights.hpp"

namespace isac::explain {

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

}  // namespace isac::explain
