/// @file
/// Single samples that stand out of their neighbours: spikes of a reading.
///
///   d_k = x_k − Σ_j w_j (x_{k−j} + x_{k+j}),  w = (3, 3/2, −1)/7: what any cubic passes;   outlier: |d_k| > limit, its neighbours near each
///     other but for a slope, |x_{k+1} − x_{k−1} − (x_{k+3} − x_{k−3})/3| < |d|/2, and on one side of it,
///     |(x_{k−1} + x_{k+1} − x_{k−2} − x_{k+2})/2| < |d|/2: where a command jumps, a smoothed pressure rounds the torque's corner, which is no spike
///   limit = max(q98 (ln(N/α)/ln 50)^(1/(0.96 k)), 6.5 s, 3 quanta),  k = ln(ln 50/ln 10)/ln(q98/q90), 0.5 ≤ k ≤ 1.6
///
/// q are quantiles of |d|, without the neighbours of what stands alone beyond 8 s: the tail ln(1/S) = (x/a)^k that passes through both is continued
/// to where one of N samples passes with probability α (k is 1 for Laplace's noise, 1.5 here for normal noise, whose own tail is thinner
/// still). First, of limits 15 % apart up to 13 s, the nearest that 25 or more pass, of which the tail holds a twenty-fifth at most (a fifth below
/// 6.5 s), is the limit; they begin at 5.5 s where k ≥ 1, else at 6.5 s, and at 3 quanta at least. Else what passes the limit above holds a quarter of s for sure, or
/// is 25 samples and more, or the limit is the end of an exponential tail, q98 + b ln(0.02 N/α), b = max((q98 − q90)/ln 5, q98/ln 50), and 8 s
/// at least: steps of a converter bend a tail the other way. Five must pass before they count as spikes (raw_effects.cpp). s is the standard
/// deviation of white noise, a quantum the smallest change of the reading: a last bit that flickers is no spike.
/// Units: the signal's. Threads: pure. Errors: none.
/// Source: docs/derivations/explain.md.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace isac::explain {

struct Outliers {
  std::size_t count = 0, samples = 0;
  double height = 0;  ///< median |d| of the outliers
  double limit = 0;   ///< beyond which a sample is one
  double rms = 0;     ///< √(Σ d²/N) over the outliers: what they add to the residual
  bool among_noise =
      false;  ///< found where the noise itself still reaches: of the smaller ones most are not counted
};

/// At an even rate; samples that are not to be used are NaN.
using Readings = std::span<const std::vector<double>* const>;

/// Outliers of all readings together; `quantum` is the smallest change of the reading (0: none).
[[nodiscard]] Outliers find_outliers(Readings readings, double quantum = 0);
/// Those beyond a limit that is known already.
[[nodiscard]] Outliers count_outliers(Readings readings, double limit);

}  // namespace isac::explain
