/// @file
/// Columns without what a model's own parameters make of them.
///
///   x ← x − B (Bᵀ x),  BᵀB = 1
///   r′_b = (1 − B_b B_bᵀ)^(−½) r_b      of a residual r = (1 − B Bᵀ) ε, block b of its rows
///
/// A fit takes from each block what that block told it: of white ε, Σ_i∈b x r has the variance x_bᵀ (1 − B_b B_bᵀ) x_b, which is less than that of
/// Σ_i∈b x ε; Σ_i∈b x r′ has all of it.
/// Shapes: B rows × parameters, x rows × columns. A screen does this to a few hundred columns of 1e5 rows beside ten to thirty parameters: two
/// passes over B, 4 multiplications and additions per row, parameter and column.
/// Units: those of x. Threads: any. Errors: none; a column with NaN becomes NaN. Sums are in one order on every processor.
/// Source: G. H. Golub, C. F. Van Loan, Matrix Computations, section 5.2; R. M. Bell, D. F. McCaffrey, Bias reduction in standard errors for linear
/// regression with multi-stage samples, Survey Methodology 28 (2002).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace isac::explain {

/// Orthonormal basis of the fitted parameters' sensitivities.
[[nodiscard]] Eigen::MatrixXd basis_of(const Eigen::MatrixXd& sensitivities);

/// x ← x − B (Bᵀ x).
void take_out(const Eigen::MatrixXd& basis, Eigen::MatrixXd& x);

/// r′; `block_of_row`: 0 … blocks − 1, in any order. What a block alone tells of stays as it is: nothing is left of it to be scaled.
[[nodiscard]] Eigen::VectorXd with_share_of_fit(const Eigen::MatrixXd& basis, const Eigen::VectorXd& residual,
                                                const std::vector<Eigen::Index>& block_of_row,
                                                Eigen::Index blocks);

}  // namespace isac::explain
