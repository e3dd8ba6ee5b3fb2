#include "isac/explain/projection.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/series/simd.hpp"

namespace isac::explain {
namespace {

constexpr std::ptrdiff_t kRowsAtOnce = 512;  // rows whose part of both matrices stays near the processor

/// Four rows; a plain processor takes two steps for each, to the same digits.
typedef double Lanes __attribute__((vector_size(32)));
constexpr std::ptrdiff_t kLanes = sizeof(Lanes) / sizeof(double);

[[gnu::always_inline]] inline void load(Lanes& rows, const double* from) {
  std::memcpy(&rows, from, sizeof rows);
}

/// products[p + q · stride] += Σ over rows of b_p x_q, of P columns of the basis and Q of x.
template <int P, int Q>
[[gnu::always_inline]] inline void add_products(const double* basis, const double* x, std::ptrdiff_t height,
                                                std::ptrdiff_t count, double* products,
                                                std::ptrdiff_t stride) {
  Lanes sum[P][Q] = {};
  std::ptrdiff_t k = 0;
  for (; k + kLanes <= count; k += kLanes) {
    Lanes b[P], y[Q];
    for (int p = 0; p < P; ++p) load(b[p], basis + p * height + k);
    for (int q = 0; q < Q; ++q) load(y[q], x + q * height + k);
    for (int p = 0; p < P; ++p)
      for (int q = 0; q < Q; ++q) sum[p][q] += b[p] * y[q];
  }
  for (int p = 0; p < P; ++p)
    for (int q = 0; q < Q; ++q) {
      double all = (sum[p][q][0] + sum[p][q][1]) + (sum[p][q][2] + sum[p][q][3]);
      for (std::ptrdiff_t i = k; i < count; ++i) all += basis[p * height + i] * x[q * height + i];
      products[p + q * stride] += all;
    }
}

/// y −= Σ_p b_p · share_p over P columns of the basis.
template <int P>
[[gnu::always_inline]] inline void subtract(const double* basis, std::ptrdiff_t height, std::ptrdiff_t count,
                                            const double* share, double* y) {
  std::ptrdiff_t k = 0;
  for (; k + kLanes <= count; k += kLanes) {
    Lanes left, b;
    load(left, y + k);
    for (int p = 0; p < P; ++p) {
      load(b, basis + p * height + k);
      left -= b * share[p];
    }
    std::memcpy(y + k, &left, sizeof left);
  }
  for (; k < count; ++k)
    for (int p = 0; p < P; ++p) y[k] -= basis[p * height + k] * share[p];
}

/// products += Bᵀ x, of `count` rows.
ISAC_SIMD void add_block(const double* basis, const double* x, std::ptrdiff_t height, std::ptrdiff_t count,
                         std::ptrdiff_t parameters, std::ptrdiff_t columns, double* products) {
  for (std::ptrdiff_t p = 0; p < parameters; p += 2) {
    const bool two = p + 1 < parameters;
    const double* b = basis + p * height;
    std::ptrdiff_t q = 0;
    for (; q + 4 <= columns; q += 4)
      two ? add_products<2, 4>(b, x + q * height, height, count, products + p + q * parameters, parameters)
          : add_products<1, 4>(b, x + q * height, height, count, products + p + q * parameters, parameters);
    for (; q < columns; ++q)
      two ? add_products<2, 1>(b, x + q * height, height, count, products + p + q * parameters, parameters)
          : add_products<1, 1>(b, x + q * height, height, count, products + p + q * parameters, parameters);
  }
}

/// x −= B products, of `count` rows.
ISAC_SIMD void subtract_block(const double* basis, double* x, std::ptrdiff_t height, std::ptrdiff_t count,
                              std::ptrdiff_t parameters, std::ptrdiff_t columns, const double* products) {
  std::ptrdiff_t p = 0;
  for (; p + 4 <= parameters; p += 4)
    for (std::ptrdiff_t q = 0; q < columns; ++q)
      subtract<4>(basis + p * height, height, count, products + p + q * parameters, x + q * height);
  for (; p < parameters; ++p)
    for (std::ptrdiff_t q = 0; q < columns; ++q)
      subtract<1>(basis + p * height, height, count, products + p + q * parameters, x + q * height);
}

}  // namespace

Eigen::MatrixXd basis_of(const Eigen::MatrixXd& sensitivities) {
  Eigen::MatrixXd scaled = sensitivities;
  for (Eigen::Index j = 0; j < scaled.cols(); ++j) {
    const double norm = scaled.col(j).norm();
    if (norm > 0) scaled.col(j) /= norm;
  }
  // Gram–Schmidt twice: columns are few, and nearly dependent ones must fall away instead of becoming noise.
  Eigen::MatrixXd q(scaled.rows(), scaled.cols());
  Eigen::Index count = 0;
  for (Eigen::Index j = 0; j < scaled.cols(); ++j) {
    Eigen::VectorXd v = scaled.col(j);
    for (int round = 0; round < 2; ++round)
      for (Eigen::Index k = 0; k < count; ++k) v -= q.col(k).dot(v) * q.col(k);
    const double norm = v.norm();
    if (norm > 1e-7) q.col(count++) = v / norm;
  }
  q.conservativeResize(scaled.rows(), count);
  return q;
}

void take_out(const Eigen::MatrixXd& basis, Eigen::MatrixXd& x) {
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(basis.cols(), x.cols());
  for (Eigen::Index from = 0; from < x.rows(); from += kRowsAtOnce)
    add_block(basis.data() + from, x.data() + from, x.rows(), std::min(kRowsAtOnce, x.rows() - from),
              basis.cols(), x.cols(), products.data());
  for (Eigen::Index from = 0; from < x.rows(); from += kRowsAtOnce)
    subtract_block(basis.data() + from, x.data() + from, x.rows(), std::min(kRowsAtOnce, x.rows() - from),
                   basis.cols(), x.cols(), products.data());
}

Eigen::VectorXd with_share_of_fit(const Eigen::MatrixXd& basis, const Eigen::VectorXd& residual,
                                  const std::vector<Eigen::Index>& block_of_row, Eigen::Index blocks) {
  constexpr double kAlone = 0.99;  // of a direction: hardly anything but that block tells of it
  const Eigen::Index parameters = basis.cols();
  std::vector<Eigen::MatrixXd> gram(static_cast<std::size_t>(blocks),
                                    Eigen::MatrixXd::Zero(parameters, parameters));
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(parameters, blocks);
  for (Eigen::Index i = 0; i < residual.size(); ++i) {
    const Eigen::Index b = block_of_row[static_cast<std::size_t>(i)];
    for (Eigen::Index p = 0; p < parameters; ++p) {
      product(p, b) += basis(i, p) * residual[i];
      for (Eigen::Index q = 0; q <= p; ++q)
        gram[static_cast<std::size_t>(b)](p, q) += basis(i, p) * basis(i, q);
    }
  }
  // (1 − B Bᵀ)^(−½) − 1 = B V diag(((1 − λ)^(−½) − 1)/λ) Vᵀ Bᵀ,  BᵀB = V diag(λ) Vᵀ
  for (Eigen::Index b = 0; b < blocks; ++b) {
    const estimate::SymmetricEigen of = estimate::symmetric_eigen(gram[static_cast<std::size_t>(b)]);
    Eigen::VectorXd more = of.vectors.transpose() * product.col(b);
    for (Eigen::Index p = 0; p < parameters; ++p) {
      const double share = std::clamp(of.values[p], 0.0, 1.0), root = std::sqrt(1 - share);
      more[p] *= share < kAlone ? 1 / (root * (1 + root)) : 0.0;
    }
    product.col(b) = of.vectors * more;
  }
  Eigen::VectorXd scaled = residual;
  for (Eigen::Index i = 0; i < residual.size(); ++i)
    scaled[i] += basis.row(i).dot(product.col(block_of_row[static_cast<std::size_t>(i)]));
  return scaled;
}

}  // namespace isac::explain
