#include "least_squares.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace blind {
namespace {

using Column = LeastSquares::Column;

/// Σ of `one` times each of four: four chains of additions side by side, each in the order of the rows.
std::array<double, 4> products(const Column& one, const std::array<const double*, 4>& with) {
  double a = 0.0, b = 0.0, c = 0.0, d = 0.0;
  for (std::size_t k = 0; k < one.size(); ++k) {
    a += with[0][k] * one[k];
    b += with[1][k] * one[k];
    c += with[2][k] * one[k];
    d += with[3][k] * one[k];
  }
  return {a, b, c, d};
}

/// Fills the rows and columns of `normal` from `first` on.
void add_products(Normal& normal, const std::vector<const Column*>& columns, const Column& y,
                  std::size_t first) {
  for (std::size_t i = first; i < columns.size(); ++i) {
    std::vector<const Column*> with(columns.begin(), columns.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    with.push_back(&y);
    for (std::size_t j = 0; j < with.size(); j += 4) {
      std::array<const double*, 4> four;
      for (std::size_t m = 0; m < 4; ++m) four[m] = with[std::min(j + m, with.size() - 1)]->data();
      const std::array<double, 4> sums = products(*columns[i], four);
      for (std::size_t m = 0; m < 4 && j + m < with.size(); ++m) {
        if (j + m == with.size() - 1)
          normal.right[i] = sums[m];
        else
          normal.matrix[i * normal.n + j + m] = normal.matrix[(j + m) * normal.n + i] = sums[m];
      }
    }
  }
}

}  // namespace

std::vector<double> Normal::solve() const {
  std::vector<double> scale(n), L(n * n, 0.0), d(n, 0.0), x(n, 0.0);
  for (std::size_t i = 0; i < n; ++i)
    scale[i] = matrix[i * n + i] > 0.0 ? 1.0 / std::sqrt(matrix[i * n + i]) : 0.0;
  for (std::size_t j = 0; j < n; ++j) {
    double pivot = matrix[j * n + j] * scale[j] * scale[j];
    for (std::size_t k = 0; k < j; ++k) pivot -= L[j * n + k] * L[j * n + k] * d[k];
    d[j] = pivot > 1e-12 ? pivot : 0.0;
    for (std::size_t i = j + 1; i < n && d[j] > 0.0; ++i) {
      double sum = matrix[i * n + j] * scale[i] * scale[j];
      for (std::size_t k = 0; k < j; ++k) sum -= L[i * n + k] * L[j * n + k] * d[k];
      L[i * n + j] = sum / d[j];
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = right[i] * scale[i];
    for (std::size_t k = 0; k < i; ++k) x[i] -= L[i * n + k] * x[k];
  }
  for (std::size_t i = 0; i < n; ++i) x[i] = d[i] > 0.0 ? x[i] / d[i] : 0.0;
  for (std::size_t i = n; i-- > 0;)
    for (std::size_t k = i + 1; k < n; ++k) x[i] -= L[k * n + i] * x[k];
  for (std::size_t i = 0; i < n; ++i) x[i] *= scale[i];
  return x;
}

LeastSquares::LeastSquares(const std::vector<Column>& fixed, const Column& y)
    : y_(&y), normal_(fixed.size()) {
  for (const Column& column : fixed) fixed_.push_back(&column);
  add_products(normal_, fixed_, y, 0);
}

double LeastSquares::distance(const std::vector<const Column*>& extra, std::vector<double>* weights,
                              std::vector<double>* fixed) const {
  std::vector<const Column*> columns = fixed_;
  columns.insert(columns.end(), extra.begin(), extra.end());
  const std::size_t kept = fixed_.size();
  Normal normal(columns.size());
  for (std::size_t i = 0; i < kept; ++i) {
    normal.right[i] = normal_.right[i];
    for (std::size_t j = 0; j < kept; ++j) normal.matrix[i * normal.n + j] = normal_.matrix[i * kept + j];
  }
  add_products(normal, columns, *y_, kept);
  const std::vector<double> x = normal.solve();
  // In pieces that stay in the cache.
  constexpr std::size_t kPiece = 512;
  double rest[kPiece], sum = 0.0;
  for (std::size_t from = 0; from < y_->size(); from += kPiece) {
    const std::size_t count = std::min(kPiece, y_->size() - from);
    std::copy_n(y_->data() + from, count, rest);
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const double weight = x[i], *column = columns[i]->data() + from;
      for (std::size_t k = 0; k < count; ++k) rest[k] -= weight * column[k];
    }
    for (std::size_t k = 0; k < count; ++k) sum += rest[k] * rest[k];
  }
  if (weights != nullptr) weights->assign(x.begin() + static_cast<std::ptrdiff_t>(kept), x.end());
  if (fixed != nullptr) fixed->assign(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(kept));
  return std::sqrt(sum);
}

}  // namespace blind
