/// @file
/// Which of several refitted models the data prefers, and which it cannot rule out.
///
///   Δ = ‖r_m‖² − ‖r_best‖²,  δ = r_m − r_best,  s_b = Σ_{i∈b} r_best,i δ_i
///   t = Δ / (2 √(Σ_b s_b²)),   separation = ‖δ‖/√c,   c = Σ_b s_b²/‖δ‖² (at least the noise's own unit)
///
/// If the best is right, Σ s_b is noise of variance Σ s_b², in whatever colour it comes within blocks; a rival stays in the
/// set while t is below the one-sided 95 % point, or while less than three sigma of data lie between the two.
/// Source: Hansen, Lunde and Nason 2011 for the idea of a set; docs/derivations/explain.md.
#pragma once

#include <vector>

#include "isac/explain/fit.hpp"

namespace isac::explain {

struct Comparison {
  double delta = 0;       ///< of the losses, penalty included
  double t = 0;           ///< sigma by which the second is behind
  double separation = 0;  ///< sigma of data between the two predictions
  double unit = 1;        ///< c
};

/// `penalty` is added to the second's loss (twice its surplus of parameters, in units of c).
[[nodiscard]] Comparison compare(const Prepared& data, const Eigen::VectorXd& best,
                                 const Eigen::VectorXd& rival, int surplus_parameters, double noise_unit);

inline constexpr double kSetLimit = 1.645;
inline constexpr double kTwinLimit = 3.0;

[[nodiscard]] inline bool cannot_rule_out(const Comparison& c) {
  return c.t < kSetLimit || c.separation < kTwinLimit;
}

}  // namespace isac::explain
