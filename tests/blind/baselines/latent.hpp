/// @file
/// A latent force: the residual as a Gaussian process in state space, smoothed (Rogers and Friis 2022).
///
///   f ~ GP(0, s² (1 + √3 τ/ℓ) e^(−√3 τ/ℓ)),  y_k = f(t_k) + noise of unit variance
///
/// s and ℓ by the likelihood of the innovations over a grid, all pieces together; posterior mean by a Rauch-Tung-Striebel pass.
/// Threads: pure. Errors: none.
#pragma once

#include <vector>

namespace baselines {

struct Piece {
  std::vector<double> y;  ///< evenly spaced, in units of the noise
  double spacing = 1;     ///< s
};

struct Latent {
  std::vector<std::vector<double>> mean;  ///< of each piece
  double length = 0, deviation = 0;       ///< ℓ in s, s in units of the noise
};

[[nodiscard]] Latent latent_force(const std::vector<Piece>& pieces);

}  // namespace baselines
