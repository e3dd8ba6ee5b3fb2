/// @file
/// The columns of one run behind joint_rows.hpp: inputs, regressors and output over all its samples, before rows are chosen.
///
///   x_C = factor (v̂³ − 3σ²v̂), σ the noise of v̂;   A, B, D, inertia: x = factor · input;   the others row by row.
///
/// Internal to the room `estimate`. Units: SI. Threads: pure functions. Errors: none; NaN where a value is not known.
/// Source: docs/derivations/errors_in_variables.md.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "isac/estimate/joint_fit.hpp"
#include "isac/estimate/joint_rows.hpp"
#include "isac/estimate/joint_terms.hpp"
#include "isac/series/differentiate.hpp"

namespace isac::estimate {

/// Columns of one run over all its samples, NaN where not known.
struct RunColumns {
  std::span<const double> input[kInputs];  ///< empty: zero throughout
  std::span<const double> time, y;
  std::vector<std::vector<double>> x;  ///< made only for the parallel filter, which needs whole columns
  std::vector<series::Segment> segments;
  double interval = 0;
  RowNoise noise;
  bool resting = false;
  std::vector<double> first, second, late;  ///< derivatives and shifted output that the spans look at
  [[nodiscard]] double at(int z, std::size_t i) const { return input[z].empty() ? 0.0 : input[z][i]; }
};

/// A regressor that is a constant times one input; input −1: it is not.
struct Proportional {
  int input = -1;
  double factor = 0;
};

[[nodiscard]] Proportional proportional(const JointTerms& terms, std::size_t k);

/// x_k of rows [begin, end).
void fill_regressor(const RunColumns& run, const JointTerms& terms, const RowRecipe& recipe, std::size_t k,
                    std::size_t begin, std::size_t end, double* x);

/// `run` must outlive the answer, whose spans look at it.
[[nodiscard]] RunColumns columns_of(const JointRun& run, const JointTerms& terms, const RowRecipe& recipe);

}  // namespace isac::estimate
