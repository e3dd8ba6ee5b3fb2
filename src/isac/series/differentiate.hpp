/// @file
/// Smoothing and derivatives of sampled signals by local polynomials (Savitzky–Golay) on the actual time
/// stamps.
///
///   x(t_i + u) ≈ b0 + b1 u + … + bp u^p over `window` samples around t_i, by least squares:
///   value b0, first derivative b1, second derivative 2 b2.
///
/// Exact on polynomials up to `order`. Time stamps may jitter; where they are even to a millionth of the
/// interval the same weights serve every row and the fit becomes a convolution. Missing samples and gaps in
/// time split the record; nothing is extrapolated, so the (window − 1)/2 rows beside every edge are NaN and
/// are trimmed by whoever fits. Noise: white noise of standard deviation σ in x gives σ·`NoiseGain` in value
/// and derivatives; a quantiser of step q acts as σ = q/√12 while the signal crosses several steps per
/// window. Units: those of x, x/s, x/s². Threads: pure functions. Throws std::invalid_argument for a window
/// that is even or does not exceed the order (a programmer's error). Source: Savitzky and Golay 1964;
/// derivation in docs/derivations/differentiator.md. Example: `auto d = differentiate(time, angle, {.window =
/// 41, .order = 3}); d.first[i]`.
#pragma once

#include <complex>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace isac::series {

struct LocalPolynomial {
  int window = 41;  ///< samples, odd
  int order = 3;    ///< 1 to 5
};

/// Standard deviation of the result per standard deviation of white noise in the signal.
struct NoiseGain {
  double value = 0;   ///< -
  double first = 0;   ///< 1/s
  double second = 0;  ///< 1/s²
};

/// Rows [begin, end) without a missing sample or a gap in time.
struct Segment {
  std::size_t begin = 0, end = 0;
};

struct Derivatives {
  std::vector<double> value, first, second;  ///< NaN where not known; empty where not asked for
  std::vector<Segment> segments;
  double interval = std::numeric_limits<double>::quiet_NaN();  ///< s, median
  bool even = true;                                            ///< time stamps evenly spaced: convolution
};

struct WhichDerivatives {
  bool value = true, first = true, second = true;
};

[[nodiscard]] Derivatives differentiate(std::span<const double> time, std::span<const double> signal,
                                        LocalPolynomial polynomial, WhichDerivatives which = {});

/// Weights of the `derivative`-th derivative (0, 1, 2) for evenly spaced samples, oldest sample first.
[[nodiscard]] std::vector<double> kernel(LocalPolynomial polynomial, int derivative, double interval);

/// The low-pass L for which kernel(1) = L ∘ d/dt: what the first derivative does to the signal besides
/// differentiating it. It acts on the mean between neighbouring samples; same length as the window, sum 1.
[[nodiscard]] std::vector<double> implied_low_pass(LocalPolynomial polynomial);

[[nodiscard]] NoiseGain noise_gain(LocalPolynomial polynomial, double interval);

/// Σ w_j exp(i 2π f j Δt), j from −h to h.
[[nodiscard]] std::complex<double> frequency_response(std::span<const double> weights, double interval,
                                                      double frequency);

/// Centred moving sum Σ w_j x_{i+j}; NaN within half a kernel of a segment's edge or of a missing sample.
[[nodiscard]] std::vector<double> convolve(std::span<const double> signal, std::span<const double> weights,
                                           std::span<const Segment> segments);

/// Stretches without missing samples and without a step in time beyond 2.5 median intervals.
[[nodiscard]] std::vector<Segment> split_at_gaps(std::span<const double> time,
                                                 std::span<const double> signal);

[[nodiscard]] double median_interval(std::span<const double> time);

struct WindowChoice {
  LocalPolynomial polynomial;
  double noise = std::numeric_limits<double>::quiet_NaN();  ///< of one sample, standard deviation
  double step = 0;  ///< smallest step of a quantised signal, 0 if none is seen
  double pass_band = std::numeric_limits<double>::quiet_NaN();  ///< Hz at which the derivative has lost 1 %
};

/// The widest window (up to `max_seconds`) that still follows the signal: its residual stays at the noise
/// even in the fastest stretches of the record. `known_noise` NaN: estimated from the narrowest window, at
/// least step/√12.
[[nodiscard]] WindowChoice choose_window(std::span<const double> time, std::span<const double> signal,
                                         int order = 3,
                                         double known_noise = std::numeric_limits<double>::quiet_NaN(),
                                         double max_seconds = 0.1);

/// White noise of one sample: robust residual of the narrowest window that interpolates nothing.
[[nodiscard]] double sample_noise(std::span<const double> time, std::span<const double> signal,
                                  int order = 3);

}  // namespace isac::series
