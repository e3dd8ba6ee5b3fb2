/// @file
/// Moments in which a residual is far larger than noise is anywhere else: a disagreement that needs no shape to be seen.
///
///   E_a = Σ r²/n of the rows of atom a in one chain        E° = max(median of all atoms, median of the atoms of its run)
///   share = Σ max(0, E_a − 4 E°) n_a / (median Σ n_a)      what such moments hold, in the power of the chain's usual noise
///
/// A stop that is hit once, a clipped reading, a flow at its limit or a joint that rings after a jerk leave most of their squares in a few
/// half seconds; a generic function of the signals sees next to nothing of them, and flips of blocks cannot pass the root of those few.
/// In the balance of a free joint's motion a recorded noise has bursts of nine times the usual: there E_a must reach ten.
/// A median is not moved by them. Runs that are noisier throughout are their own yardstick.
/// Shapes: one weighted residual for each row of `data`. Units: none. Threads: pure. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>

#include "isac/explain/prepared.hpp"

namespace isac::explain {

struct Moments {
  double share = 0;              ///< of the chain's usual noise power
  Chain chain = Chain::kTorque;  ///< in which they stand out, or the share is largest
  unsigned run = 0;              ///< of the largest moment
  double time = 0;               ///< s from its run's start, the middle of it
  double times_usual = 0;        ///< its mean square over the median's
  [[nodiscard]] bool stand_out() const noexcept;
};

[[nodiscard]] Moments moments_of(const Prepared& data, const Eigen::VectorXd& residual);

}  // namespace isac::explain
