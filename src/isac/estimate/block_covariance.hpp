/// @file
/// Covariance of an M-estimate that holds under coloured noise: a sandwich whose meat is summed over blocks of time.
///
///   H = Σ_b H_b (curvature),  u_b = Σ_{i∈b} Ω_i x_i r_i + S_b θ (score),  V = H⁻¹ (Σ_b ũ_b ũ_bᵀ) H⁻¹,
///   ũ_b = H^{1/2} (I − H^{-1/2} H_b H^{-1/2})^{-1/2} H^{-1/2} u_b   (CR2: unbiased when the noise is white)
///
/// Rows of one block may be correlated in any way; blocks must be longer than the noise remembers. The degrees of freedom of
/// each parameter's Student t are those of Bell and McCaffrey (Satterthwaite), which fall when few blocks carry a parameter.
/// Threads: pure. Errors: none; a singular H gives NaN.
/// Source: Bell and McCaffrey 2002; Pustejovsky and Tipton 2018; docs/derivations/joint_fit.md.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace isac::estimate {

/// One block of time: its score and its share of the curvature.
struct BlockSums {
  Eigen::VectorXd score;
  Eigen::MatrixXd curvature;
};

struct BlockCovariance {
  Eigen::MatrixXd covariance;
  Eigen::VectorXd degrees_of_freedom;
};

/// What is known beforehand of parameters around zero: λ on the diagonal of H, and the variance λ² σ₀² of λ θ.
struct Prior {
  Eigen::VectorXd curvature, score_variance;
};

/// With a prior, V = H⁻¹ (Σ_b ũ_b ũ_bᵀ + Λ Σ₀ Λ) H⁻¹, and the share of V that the prior makes counts as known exactly.
[[nodiscard]] BlockCovariance block_covariance(const std::vector<BlockSums>& blocks, const Prior& prior = {});

}  // namespace isac::estimate
