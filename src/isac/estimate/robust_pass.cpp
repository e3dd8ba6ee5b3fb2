#include "isac/estimate/robust_pass.hpp"

#include <cmath>

#include "isac/series/simd.hpp"

namespace isac::estimate::detail {

ISAC_SIMD void add_batch(const BatchInput& in, std::size_t begin, std::size_t count, double (*sums)[8]) {
  double residual[kBatch], omega[kBatch], bend[kBatch], product[kBatch];
  const std::size_t full = (count + 7) / 8 * 8;  // the last lanes are filled with rows of weight zero
  for (std::size_t i = 0; i < count; ++i) residual[i] = in.output[begin + i];
  for (int k = 0; k < in.linear; ++k) {
    const double theta = in.theta[k];
    const double* x = in.columns[k] + begin;
    for (std::size_t i = 0; i < count; ++i) residual[i] -= theta * x[i];
  }
  if (in.weight != nullptr) {
    for (std::size_t i = 0; i < count; ++i) omega[i] = in.weight[begin + i];
  } else {
    for (std::size_t i = 0; i < count; ++i) omega[i] = 1.0;
  }
  for (std::size_t i = count; i < full; ++i) residual[i] = omega[i] = 0;
  double cost[8] = {}, total[8] = {};
  if (in.kind == 1) {
    const double c = in.scale;
    for (std::size_t i = 0; i < full; i += 8)
      for (std::size_t l = 0; l < 8; ++l) {
        const double w = omega[i + l], r = residual[i + l], s = w * r * r;
        const double size = std::sqrt(s), outside = size > c ? 1.0 : 0.0;
        cost[l] += outside * (2.0 * c * size - c * c) + (1.0 - outside) * s;
        bend[i + l] = (1.0 - outside) * w;
        omega[i + l] = w * (size > c ? c / size : 1.0);
      }
  } else if (in.kind == 2) {
    const double b = in.scale * in.scale;
    for (std::size_t i = 0; i < full; i += 8)
      for (std::size_t l = 0; l < 8; ++l) {
        const double w = omega[i + l], r = residual[i + l], s = w * r * r / b;
        const double slope = 1.0 / (1.0 + s);
        cost[l] += b * std::log1p(s);
        bend[i + l] = w * (1.0 - s) * slope * slope;
        omega[i + l] = w * slope;
      }
  } else {
    for (std::size_t i = 0; i < full; i += 8)
      for (std::size_t l = 0; l < 8; ++l) {
        cost[l] += omega[i + l] * residual[i + l] * residual[i + l];
        bend[i + l] = omega[i + l];
      }
  }
  for (std::size_t i = 0; i < full; i += 8)
    for (std::size_t l = 0; l < 8; ++l) total[l] += omega[i + l];

  const std::size_t whole = count / 8 * 8;
  double(*gram)[8] = sums;
  double(*curvature)[8] = sums + in.size * (in.size + 1) / 2;
  double(*moment)[8] = curvature + in.size * (in.size + 1) / 2;
  const auto add_products = [&](const double* weight, int k, double(*pairs)[8])
      __attribute__((always_inline)) {
    const double* x = in.columns[k] + begin;
    for (std::size_t i = 0; i < count; ++i) product[i] = weight[i] * x[i];
    for (int j = 0; j <= k; ++j) {
      const double* y = in.columns[j] + begin;
      double sum[8];
      for (std::size_t l = 0; l < 8; ++l) sum[l] = pairs[k * (k + 1) / 2 + j][l];
      for (std::size_t i = 0; i < whole; i += 8)
        for (std::size_t l = 0; l < 8; ++l) sum[l] += product[i + l] * y[i + l];
      for (std::size_t i = whole; i < count; ++i) sum[i - whole] += product[i] * y[i];
      for (std::size_t l = 0; l < 8; ++l) pairs[k * (k + 1) / 2 + j][l] = sum[l];
    }
  };
  for (int k = 0; k < in.size; ++k) {
    if (in.with_gram) add_products(omega, k, gram);
    if (in.with_curvature) add_products(bend, k, curvature);
  }
  for (std::size_t i = 0; i < count; ++i) product[i] = omega[i] * residual[i];
  for (int k = 0; k < in.size; ++k) {
    const double* x = in.columns[k] + begin;
    double sum[8];
    for (std::size_t l = 0; l < 8; ++l) sum[l] = moment[k][l];
    for (std::size_t i = 0; i < whole; i += 8)
      for (std::size_t l = 0; l < 8; ++l) sum[l] += product[i + l] * x[i + l];
    for (std::size_t i = whole; i < count; ++i) sum[i - whole] += product[i] * x[i];
    for (std::size_t l = 0; l < 8; ++l) moment[k][l] = sum[l];
  }
  for (std::size_t l = 0; l < 8; ++l) {
    moment[in.size][l] += cost[l];
    moment[in.size + 1][l] += total[l];
  }
}

}  // namespace isac::estimate::detail
