/// @file
/// Columns without what a model's own parameters make of them.
///
///   x ← x − B (Bᵀ x),  BᵀB = 1
///
/// Shapes: B rows × parameters, x rows × columns. A screen does this to a few hundred columns of 1e5 rows beside ten to thirty parameters: two
/// passes over B, 4 multiplications and additions per row, parameter and column.
/// Units: those of x. Threads: any. Errors: none; a column with NaN becomes NaN. Sums are in one order on every processor.
/// Source: G. H. Golub, C. F. Van Loan, Matrix Computations, section 5.2.
#pragma once

#include <Eigen/Core>

namespace isac::explain {

void take_out(const Eigen::MatrixXd& basis, Eigen::MatrixXd& x);

}  // namespace isac::explain
