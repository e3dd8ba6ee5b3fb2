/// @file
/// Low-passes and derivatives of recorded signals, with Gaussian kernels g of standard deviation σ; an encoder's with few of its steps.
///
///   quiet: w = g_w′ ∗ φ, u = 1 − g_w∗, α = σ²/σ_w²      w + (1 − α) u w + ½ (1 − α)(2 − α) u² w ≈ g′ ∗ φ,  σ_w > σ
///
/// where what it differs by from g′ ∗ φ is no more than the steps make; second and fourth moments are g's.
/// Units: σ in samples, intervals s, angles rad. Threads: pure. Errors: none; ends are continued by their last value.
/// Source: docs/derivations/explain.md.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace isac::explain {

inline constexpr double kSlowestStep = 0.05;  ///< s per encoder step: slower is standing still
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
/// g′ ∗ φ, and a wider kernel without its bend where what the two differ by is the encoder's steps: damping times their noise would pass
/// for less damping, and what D φ̇ then lacks for friction. (No step known: g′ ∗ φ.)
[[nodiscard]] std::vector<double> quiet_velocity(std::span<const double> raw_angle, double sigma_samples,
                                                 double interval, double angle_step);
/// g″ ∗ φ by the same way: the steps are in the balance of the motion twice, where an inertia is looked for.
[[nodiscard]] std::vector<double> quiet_acceleration(std::span<const double> raw_angle, double sigma_samples,
                                                     double interval, double angle_step);
/// Where the speed is even and near half a step of the encoder for each sample, or a multiple of that: there the steps beat with the clock,
/// slowly enough to pass any kernel. (None where no step is known.)
[[nodiscard]] std::vector<unsigned char> beats_with_clock(std::span<const double> velocity, double interval,
                                                          double angle_step);
/// Takes such beats out of a low-passed angle and its velocity: within an even stroke a parabola through 0.6 s of it, or through as much as there is
/// on one side, sees the motion as it is.
void hush_beats(std::span<const double> raw_angle, double interval, double angle_step,
                std::vector<double>& angle, std::vector<double>& velocity);
/// An angle and its two derivatives, low-passed; sample `lead` is the first of the recording.
struct Motion {
  std::vector<double> angle, velocity, acceleration;
  std::size_t lead = 0;
  bool from_rest = false;  ///< the recording begins before the joint moves, or as it is let go
};
/// g ∗ φ, g′ ∗ φ and g″ ∗ φ by the same way, all three where g″ ∗ φ is more than the steps make of it: what swings on a spring answers the
/// encoder's steps with its resonance for as long as the joint moves at all. (No step known: as the kernel leaves them.) A joint that is let go
/// at the first sample moves in g ∗ φ before that: the kernel's reach before the recording is there too, the joint at rest in it.
[[nodiscard]] Motion quiet_motion(std::span<const double> raw_angle, double sigma_samples, double interval,
                                  double angle_step);
/// Velocity that can be told from standing still; slower than one step in kSlowestStep is none.
[[nodiscard]] std::vector<double> dry_velocity(std::span<const double> raw_angle,
                                               std::span<const double> velocity, double interval,
                                               double angle_step);

}  // namespace isac::explain
