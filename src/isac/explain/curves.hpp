/// @file
/// Does a residual depend on one signal by any curve, however bent? A test of what is left that needs neither a name nor a formula.
///
///   s_bj = Σ (e_i − ē_run) over the rows of block b with the signal in bin j,   Q = Σ_j (Σ_b s_bj)²/Σ_b s_bj²
///   z = (Q − J)/sd of Q under joint sign flips of the blocks                    size: rms of the bins' means over the noise floor
///
/// J bins that hold equally many rows. A ripple of fifteen waves a turn, which no power of the angle is like, moves every bin; a run's own mean
/// (a zero, where an encoder rests) moves none. Blocks whose signs are drawn anew have the same scatter, in noise of any colour.
/// Shapes: one weighted residual for each row of `data`, and the same as it is in time, r/σ. Threads: pure. Errors: none.
/// Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "isac/explain/floors.hpp"
#include "isac/explain/weights.hpp"

namespace isac::explain {

struct Curve {
  double z = 0;     ///< standard deviations of Q beyond what flips make of it
  double size = 0;  ///< noise floors
  Chain chain = Chain::kTorque;
  std::string variable;  ///< angle, velocity; in torque and motion also delta_pressure, p1, p2
};

/// The one of largest z among those of at least `material` floors; z = 0 where there is none.
[[nodiscard]] Curve clearest_curve(const Prepared& data, const Weights& weights, const Floors& floors,
                                   const Eigen::VectorXd& weighted, double material, std::uint64_t seed);
/// Beyond what noise of four kinds was seen to make of it.
[[nodiscard]] bool stands_out(const Curve& curve) noexcept;

}  // namespace isac::explain
