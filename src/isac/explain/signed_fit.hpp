/// @file
/// Least squares of a few columns whose amplitudes may not change their sign: friction does not push.
///
///   min |r − X a|²,  a_i ≥ 0 for some i
///
/// By trying every subset of columns: one effect has four amplitudes at most. What several columns can do alike is theirs together (a ridge of
/// 1e-6 of each column's squares).
/// Shapes: G = XᵀX, columns × columns; s = Xᵀr. Units: those of the columns. Threads: any. Errors: none; without a column that may be there the
/// gain is 0 and so are the amplitudes.
/// Source: C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, chapter 23 (there by an active set).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace isac::explain {

struct SignedFit {
  double gain = 0;  ///< |r|² − |r − X a|²
  Eigen::VectorXd amplitude;
};

[[nodiscard]] SignedFit signed_fit(const Eigen::MatrixXd& gram, const Eigen::VectorXd& score,
                                   const std::vector<bool>& positive_only);

}  // namespace isac::explain
