/// @file
/// Low-passes and derivatives of recorded signals, with Gaussian kernels g of standard deviation σ.
///
/// Units: σ in samples, intervals s. Threads: pure. Errors: none; ends are continued by their last value.
/// Source: docs/derivations/explain.md, "One kernel for all signals".
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace isac::explain {

inline constexpr double kKernelReach =
    6.0;  ///< standard deviations: what is cut off the second derivative is below 1e-6

/// A signal low-passed widely where what is lost is noise, narrowly where it moves.
[[nodiscard]] std::vector<double> quieten(std::span<const double> raw, std::span<const double> narrow,
                                          double sigma_samples, double wide_sigma_samples,
                                          double white_noise);
/// Standard deviation of white noise of one sample, from differences that a smooth signal does not pass.
[[nodiscard]] double white_noise(std::span<const std::vector<double>* const> signals);

/// Weights of g, or of its first or second derivative per sample: exact on the polynomial that each must be exact on.
[[nodiscard]] std::vector<double> gaussian(double sigma_samples, int derivative);
/// Σ g_k x_{i+k} with the weights centred at i; the ends are continued by their last value.
[[nodiscard]] double centred_sum(std::span<const double> weights, std::span<const double> x, std::size_t i);
/// g ∗ x at the samples asked for (every `stride`-th from `first`); the ends are continued by their last value.
[[nodiscard]] std::vector<double> low_pass(std::span<const double> x, double sigma_samples,
                                           std::size_t first = 0, std::size_t stride = 1);
/// The same for a wide Gaussian, as three running means, whose cost does not grow with its width; its variance is that of the
/// Gaussian to a part in a hundred.
[[nodiscard]] std::vector<double> wide_low_pass(std::span<const double> x, double sigma_samples);
/// (g′ ∗ x)/Δt and (g″ ∗ x)/Δt².
[[nodiscard]] std::vector<double> low_pass_derivative(std::span<const double> x, double sigma_samples,
                                                      double interval, int order);
}  // namespace isac::explain
