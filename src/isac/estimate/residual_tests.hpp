/// @file
/// Does anything speak out of the residual? Whiteness, and what the residual still follows, each with a plain sentence.
///
///   whiteness: Ljung–Box on the residual thinned to the differentiator's window
///   input z:   s_b = Σ_{i∈b} Ω_i z⊥_i r_i, t = Σ_b s_b / √(Σ_b s_b²), z⊥ = z − X (XᵀΩX)⁻¹ XᵀΩz
///
/// Taking the fitted regressors out of z makes the test honest (the fit already used them), summing by blocks makes it hold under
/// coloured noise. Several functions of one input share its p-value by Bonferroni. Level 1 %.
/// Threads: pure. Source: Ljung and Box 1978; score test with clusters, docs/derivations/joint_fit.md.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "isac/estimate/joint_fit.hpp"
#include "isac/estimate/joint_rows.hpp"
#include "isac/estimate/robust.hpp"

namespace isac::estimate {

/// A block of time as rows [begin, end).
struct BlockRange {
  std::size_t begin = 0, end = 0;
};

/// What was fitted and what it left over.
struct FittedRows {
  std::span<const double* const> used;            ///< columns of the parameters
  std::span<const double> zero;                   ///< column of the angle's zero, or empty
  std::span<const RobustProblem::Local> resting;  ///< rows that have a zero of their own besides
  std::span<const double> residual, omega;        ///< per row
};

[[nodiscard]] std::vector<ResidualTest> residual_tests(const JointRows& rows, const FittedRows& fitted,
                                                       std::span<const BlockRange> blocks, int window,
                                                       const JointFitOptions& options);

}  // namespace isac::estimate
