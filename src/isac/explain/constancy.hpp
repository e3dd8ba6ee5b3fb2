/// @file
/// Is an effect of one size throughout, and is it more than what another takes back? A name explains what is always there in the same measure;
/// what comes and goes is like it on the whole only, and giants that cancel are no explanation of a small gap.
///
///   x(s) = y_pred(a (1 + s)) − y_pred(a),  weighted, projected off the baseline's parameters
///   x = x(0.01)/0.01;  over pieces of one second:  g_b = Σ x r,  w_b = Σ x²,  u_b = Σ s x², s the noise's density in the row's chain (weights.hpp's w)
///   v = (Σ g_b² − Σ u_b) / Σ w_b²,   standard deviation of v where nothing varies: √(2 Σ u_b²)/Σ w_b²
///
/// a: the effect's amplitudes; r = y_pred − y at the fit. If it is a (1 + δ_b) in piece b instead, with E δ² = v, then g_b = −δ_b w_b + noise: v
/// is by how much of itself, squared, it varies. The greatest piece is left out of the sums: one misfit moment is no variation.
/// Units: weighted rows, whitened by the noise's model. Threads: safe. Errors: none; NaN, or no rows, where the effect has no
/// amplitude; NaN too where it rests within runs: a sensor's zero that wanders is not its doing.
/// Source: the score test of a varying coefficient, Nyblom 1989; docs/derivations/explain.md.
#pragma once

#include "isac/explain/refine.hpp"

namespace isac::explain {

struct Constancy {
  double variation = 0;  ///< v
  double error = 0;      ///< its standard deviation where nothing varies
};

/// `effect`: index in `fit.model.effects`.
[[nodiscard]] Constancy constancy_of(const Around& baseline, const Fit& fit, std::size_t effect);

/// x(s), all rows; empty where the effect has no amplitude. x(−1): what is missing without it, nothing refitted but the baseline.
[[nodiscard]] Eigen::VectorXd share_of(const Around& baseline, const Fit& fit, std::size_t effect, double s);

}  // namespace isac::explain
