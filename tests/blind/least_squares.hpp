/// @file
/// Linear least squares by normal equations: y ≈ Σ x_i column_i.
#pragma once

#include <cstddef>
#include <vector>

namespace blind {

/// Sums for one normal system of a few unknowns, filled row by row.
struct Normal {
  std::size_t n;
  std::vector<double> matrix, right;
  explicit Normal(std::size_t count) : n(count), matrix(count * count, 0.0), right(count, 0.0) {}

  /// By LDLᵀ with the diagonal scaled to one; a column that the others explain gets zero.
  [[nodiscard]] std::vector<double> solve() const;
};

/// Columns that stay, against one y, together with others that come and go: the products of what stays are summed once.
class LeastSquares {
 public:
  using Column = std::vector<double>;
  LeastSquares() = default;
  /// All of one length; both must outlive it.
  LeastSquares(const std::vector<Column>& fixed, const Column& y);

  /// Norm of what the fixed columns and `extra` leave of y; `weights`, if given, gets those of `extra`, `fixed` those of what stays.
  double distance(const std::vector<const Column*>& extra, std::vector<double>* weights = nullptr,
                  std::vector<double>* fixed = nullptr) const;

 private:
  std::vector<const Column*> fixed_;
  const Column* y_ = nullptr;
  Normal normal_{0};
};

}  // namespace blind
