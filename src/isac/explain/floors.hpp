/// @file
/// What the sensors' own noise is, sample by sample and row by row, and how large a difference is beside it.
///
/// Threads: pure functions. Errors: none; NaN where a chain is not in the data. Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>

#include "isac/explain/explanation.hpp"
#include "isac/explain/fit.hpp"

namespace isac::explain {

struct Floors {
  double white[kChains] = {kNotKnown, kNotKnown, kNotKnown,
                           kNotKnown};  ///< of one sample at the recording's rate, N m or Pa
  /// Of what is slower than that in the sensors and follows no signal: the noise's coloured part and a zero that wanders.
  double slow[kChains] = {0, 0, 0, 0};
  std::string from[kChains];

  /// What no model can close, N m or Pa: √(white² + slow²).
  [[nodiscard]] double all(Chain chain) const {
    return std::hypot(white[static_cast<int>(chain)], slow[static_cast<int>(chain)]);
  }
};

[[nodiscard]] Floors floors_of(const Prepared& data);
/// Sets the slow parts, from the colours of the noise.
void add_slow_part(const Weights& noise, Floors& floors);

/// Sets the weights to the standard deviation of rows that is not slower than half a second: noise, with little of a missing effect.
void reweight(const Prepared& data, const Fit& fit, Weights& weights);

/// Longest correlation time of the residual among the chains, s.
[[nodiscard]] double correlation_seconds(const Prepared& data, const Eigen::VectorXd& residual);

/// rms over the floor, chain by chain, of what distinguishes two weighted residuals; the largest and where.
[[nodiscard]] double size_over_floor(const Prepared& data, const Weights& weights, const Floors& floors,
                                     const Eigen::VectorXd& difference, Chain* where = nullptr);

}  // namespace isac::explain
