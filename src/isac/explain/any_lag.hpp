/// @file
/// Does a valve unit of another linear dynamics leave less of the pressures than what was named? Asked beside the names, each of which that changes
/// how the valves answer may be only like the truth.
///
///   p(t) = q(t) + Σ h_k (q(t − δ_k) − q(t)),   δ_k = 1, 2, 4 … 32 samples, the same h_k for both muscles
///
/// q is what the named model predicts. A dead time, a second lag and a rate that differs a little are each such a sum; what depends on pressure,
/// direction or size of a step is none. The model's parameters, the names' among them, are eliminated (refine.hpp).
/// Units: Pa, weighted. Threads: safe on separate arguments. Errors: none (no taps where no run has commands).
/// Source: docs/derivations/explain.md; a finite impulse response, Ljung 1999 ch. 10.1.
#pragma once

#include <Eigen/Core>

#include "isac/explain/compare.hpp"
#include "isac/explain/refine.hpp"

namespace isac::explain {

struct AnyLag {
  int taps = 0;              ///< that the data tell apart
  Eigen::VectorXd residual;  ///< weighted, all rows
};

[[nodiscard]] AnyLag any_lag(const Around& place, int threads = 1);

/// How far the place is behind it (t > 0).
[[nodiscard]] Comparison behind_any_lag(const Around& place, const AnyLag& lag);

}  // namespace isac::explain
