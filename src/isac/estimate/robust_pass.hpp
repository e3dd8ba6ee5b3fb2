/// @file
/// The one pass over rows behind robust.hpp: sums of weighted products in a fixed order, vectorised for the processor at hand.
#pragma once

#include <cstddef>

namespace isac::estimate::detail {

inline constexpr std::size_t kBatch = 256;

struct BatchInput {
  const double* const* columns;
  int size;    ///< columns
  int linear;  ///< the first so many have a part in the prediction
  const double* output;
  const double* weight;  ///< or nullptr
  const double* theta;
  double scale;
  int kind;  ///< 0 squared, 1 Huber, 2 Cauchy
  bool with_gram, with_curvature;
};

/// Adds rows [begin, begin + count), count ≤ kBatch, to `sums`: size·(size+1)/2 products under Ω, the same under H, `size`
/// moments, Σρ, ΣΩ; each sum in eight lanes.
void add_batch(const BatchInput& in, std::size_t begin, std::size_t count, double (*sums)[8]);

}  // namespace isac::estimate::detail
