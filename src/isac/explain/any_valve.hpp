/// @file
/// Does a valve unit of another form leave less of the pressures than what was named? Asked beside the names, each of which that changes how the
/// valves answer may be only like the truth.
///
///   a lag of any shape       p(t) = q(t) + Σ h_k (q(t − δ_k) − q(t)),   δ_k = 1, 2, 4 … 32 samples
///   a rate that is any odd   T_C ṗ = e + Σ c_k sat(e, ε_k),   e = K_C u − p,   ε_k = max |e|/3^k, k = 1 … 6:
///   function of the error    p(t) = q(t) + Σ c_k x_k(t),   T_C ẋ_k = sat(e, ε_k) − x_k,   x_k(0) = sat(e(0), ε_k)
///
/// q is what the named model predicts, e its error, h_k and c_k the same for both muscles. A dead time, a second lag and a rate that differs a little are
/// each a sum of the first kind; a valve that does not answer small errors or limits large ones is one of the second. The model's parameters, the
/// names' among them, are eliminated (refine.hpp).
/// Units: Pa, weighted. Threads: safe on separate arguments. Errors: none (no columns where no run has commands).
/// Source: docs/derivations/explain.md; a finite impulse response, Ljung 1999 ch. 10.1; a Hammerstein curve, ib. ch. 5.2.
#pragma once

#include <Eigen/Core>

#include "isac/explain/compare.hpp"
#include "isac/explain/refine.hpp"

namespace isac::explain {

struct AnyValve {
  int columns = 0;           ///< that the data tell apart
  Eigen::VectorXd residual;  ///< weighted, all rows
};

[[nodiscard]] AnyValve any_lag(const Around& place, int threads = 1);
[[nodiscard]] AnyValve any_curve(const Around& place, int threads = 1);

/// How far the place is behind it (t > 0).
[[nodiscard]] Comparison behind_any_valve(const Around& place, const AnyValve& rival);

}  // namespace isac::explain
