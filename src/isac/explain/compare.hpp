/// @file
/// Which of several refitted models the data prefers, and which it cannot rule out.
///
///   Δ = ‖r_m‖² − ‖r_best‖²,  δ = r_m − r_best,  s_b = Σ_{i∈b} r_best,i δ_i
///   t = Δ / (2 √(c ‖δ‖²)),   separation = ‖δ‖/√c,   c = Σ_b s_b²/‖δ‖², at least the noise's density in δ's chains
///
/// If the best is right, Σ s_b is noise of variance Σ s_b², in whatever colour it comes within blocks; a rival stays in the
/// set while t is below the one-sided 95 % point, or while less than three sigma of data lie between the two.
/// Source: Hansen, Lunde and Nason 2011 for the idea of a set; docs/derivations/explain.md.
#pragma once

#include <algorithm>
#include <vector>

#include "isac/explain/fit.hpp"

namespace isac::explain {

struct Comparison {
  double delta = 0;       ///< of the losses, penalty included
  double t = 0;           ///< sigma by which the second is behind
  double separation = 0;  ///< sigma of data between the two predictions
  double unit = 1;        ///< c
};

/// Spectral density of a residual at low frequencies, per row and chain: Σ_k of its autocovariance over a tenth of a second.
/// It is taken from what the best model leaves, for beside it every effect that is missing is noise too.
struct NoiseDensity {
  double of[kChains] = {1, 1, 1, 1};
  double rows[kChains] = {};
};
[[nodiscard]] NoiseDensity noise_density(const Prepared& data, const Eigen::VectorXd& residual);

/// A rival pays 2 c for each parameter that it has more.
[[nodiscard]] Comparison compare(const Prepared& data, const Eigen::VectorXd& best,
                                 const Eigen::VectorXd& rival, int surplus_parameters,
                                 const NoiseDensity& noise);

inline constexpr double kSetLimit = 1.645;
inline constexpr double kTwinLimit = 3.0;

[[nodiscard]] inline bool cannot_rule_out(const Comparison& c) {
  return c.t < kSetLimit || c.separation < kTwinLimit;
}

/// What is told of t: between two that the data hardly hold apart no more than lies between them. The rest is the price of parameters, which
/// grows beyond all bounds where next to nothing does.
[[nodiscard]] inline double told_behind(const Comparison& c) {
  return c.separation < kTwinLimit ? std::min(c.t, c.separation) : c.t;
}

}  // namespace isac::explain
