/// @file
/// One pass of the motion model over a run: angles, and on the way the normal equations of its sensitivities.
///
///   s_j = ∂(φ, ω, q)/∂θ_j,   ṡ_j = F_x s_j + F_θj,   integrated by the same Runge-Kutta steps as the state.
///
/// Lanes 0 … 6 are the parameters in the order of MotionParameter, 7 and 8 the initial angle and speed.
/// Vectorised over the lanes; one portable build, the machine's vectors chosen at run time, the same bits.
/// Threads: pure. Source: docs/derivations/motion_fit.md.
#pragma once

#include <cstddef>
#include <vector>

#include "isac/estimate/motion_fit.hpp"

namespace isac::estimate::motion {

inline constexpr int kLanes = 12;  ///< nine used, three of padding
inline constexpr int kInitialAngle = 7, kInitialSpeed = 8, kUsedLanes = 9;

/// A run made ready: only rows with a number in every column, steps fine enough.
struct Prepared {
  std::vector<double> time, angle;
  std::vector<double> command_from, command_to;  ///< at the two ends of the interval that begins at the row
  std::vector<std::size_t> source_row;
  std::vector<int> substeps;  ///< of the interval that begins at the row
};
[[nodiscard]] Prepared prepare(const MotionRun& run, const MotionOptions& options);

/// Sums over a stretch of time: JᵀJ, Jᵀe and eᵀe with e = measured − predicted and J = ∂predicted/∂θ.
struct Sums {
  double gram[kLanes][kLanes] = {};
  double moment[kLanes] = {};
  double square = 0;
  std::size_t rows = 0;
};

struct State {
  MotionVector parameters;
  double angle = 0, speed = 0;
};

/// Predicted angles; false when the motion leaves all bounds (|φ| > 1e6) or is not a number.
[[nodiscard]] bool predict(const Prepared& run, const State& state, const MotionOptions& options,
                           double* angles);

/// The same with sums over blocks of `block_rows` rows (0: one block).
[[nodiscard]] bool accumulate(const Prepared& run, const State& state, const MotionOptions& options,
                              std::size_t block_rows, std::vector<Sums>& blocks);

}  // namespace isac::estimate::motion
