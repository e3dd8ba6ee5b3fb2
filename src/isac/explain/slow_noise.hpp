/// @file
/// Does one run move as no other does? Noise of one kind is as slow in every run; what is slow in one only is an effect.
///
///   q_r = mean (m_b+1 − m_b)² of run r, m_b the mean of the torque's rows in bin b of 2 s        times_usual = max q_r/median q_r
///
/// Shapes: one residual r/σ for each row of `data`, as it is in time. Units: σ. Threads: pure. Errors: none; zeros where fewer than four driven
/// runs have eight steps. Source: docs/decisions/0168.
#pragma once

#include <Eigen/Core>

#include "isac/explain/prepared.hpp"

namespace isac::explain {

struct SlowRun {
  double times_usual = 0;  ///< mean square of its steps over the median of all runs
  double step = 0;         ///< their rms, in σ
  std::size_t run = 0;
};

/// The driven run in which what is left of the torque moves most from one bin to the next.
[[nodiscard]] SlowRun most_moving_run(const Prepared& data, const Eigen::VectorXd& left);

}  // namespace isac::explain
