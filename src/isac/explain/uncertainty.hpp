/// @file
/// Standard errors and 95 % intervals of every number of a fitted model, which hold under coloured noise.
///
///   V = H⁻¹ (Σ_b ũ_b ũ_bᵀ) H⁻¹,  H = JᵀJ,  u_b = Σ_{i∈b} J_i r_i   (CR2, Student's t by Bell and McCaffrey)
///
/// J holds the sensitivities of all that was fitted, tolerances and resting angles among them, so an error contains what the
/// data cannot tell of these. How an encoder is read within its step is no free number: it lies within its bounds, alike anywhere, and
/// adds (∂β/∂τ)² range²/12 where no run tells more. A number at its bound has no error (NaN).
/// Units: reporting units. Threads: pure. Errors: none; a singular H gives NaN.
/// Source: estimate/block_covariance.hpp; docs/derivations/explain.md.
#pragma once

#include <vector>

#include "isac/core/estimated.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

struct Uncertain {
  std::vector<Estimated> base;  ///< as Predictor::base()
  /// As Found::added, parameter by parameter. One whose error is wider than its range, that no row feels or that stands at
  /// the end of its range has its value, no error and a reason.
  std::vector<std::vector<Estimated>> effects;
};

[[nodiscard]] Uncertain uncertainties(const Predictor& predictor, const Fit& fit, const Weights& weights);

}  // namespace isac::explain
