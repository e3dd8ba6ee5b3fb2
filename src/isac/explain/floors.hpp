/// @file
/// What the sensors' own noise is, sample by sample and row by row, and how large a difference is beside it.
///
/// Threads: pure functions. Errors: none; NaN where a chain is not in the data. Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <string>

#include "isac/explain/explanation.hpp"
#include "isac/explain/fit.hpp"

namespace isac::explain {

struct Floors {
  double white[kChains] = {kNotKnown, kNotKnown, kNotKnown,
                           kNotKnown};  ///< of one sample at the recording's rate, N m or Pa
  std::string from[kChains];
};

[[nodiscard]] Floors floors_of(const Prepared& data);

/// Sets the weights to the standard deviation of rows that is not slower than half a second: noise, with little of a missing effect.
void reweight(const Prepared& data, const Fit& fit, Weights& weights);

/// Longest correlation time of the residual among the chains, s.
[[nodiscard]] double correlation_seconds(const Prepared& data, const Eigen::VectorXd& residual);

/// rms over the floor, chain by chain, of what distinguishes two weighted residuals; the largest and where.
[[nodiscard]] double size_over_floor(const Prepared& data, const Weights& weights, const Floors& floors,
                                     const Eigen::VectorXd& difference, Chain* where = nullptr);

}  // namespace isac::explain
