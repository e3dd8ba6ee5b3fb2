#include <algorithm>
#include <array>
#include <cmath>

#include "isac/series/differentiate.hpp"
#include "isac/series/statistics.hpp"

namespace isac::series {
namespace {

constexpr std::size_t kChunk = 256;
constexpr std::size_t kMostChunks = 96;

/// Root mean square of the smoothing residual in each chunk, over sqrt(1 − h) so that white noise gives its
/// own size.
std::vector<double> chunk_residuals(std::span<const double> time, std::span<const double> signal,
                                    std::span<const Segment> chunks, LocalPolynomial polynomial) {
  const double kept = 1.0 - kernel(polynomial, 0, 1.0)[static_cast<std::size_t>(polynomial.window / 2)];
  std::vector<double> out;
  for (const Segment& chunk : chunks) {
    const std::size_t rows = chunk.end - chunk.begin;
    const Derivatives fit = differentiate(time.subspan(chunk.begin, rows), signal.subspan(chunk.begin, rows),
                                          polynomial, {.value = true, .first = false, .second = false});
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < rows; ++i) {
      const double r = signal[chunk.begin + i] - fit.value[i];
      if (!std::isfinite(r)) continue;
      sum += r * r;
      ++count;
    }
    if (count > 0) out.push_back(std::sqrt(sum / static_cast<double>(count) / kept));
  }
  return out;
}

/// The step of a quantised signal: the smallest non-zero difference, if all differences are whole multiples
/// of it.
double quantisation_step(std::span<const double> signal, std::span<const Segment> chunks) {
  double step = std::numeric_limits<double>::infinity();
  std::vector<double> differences;
  for (const Segment& chunk : chunks)
    for (std::size_t i = chunk.begin + 1; i < chunk.end; ++i) {
      const double d = std::abs(signal[i] - signal[i - 1]);
      if (d > 1e-13 * std::abs(signal[i])) {
        step = std::min(step, d);
        differences.push_back(d);
      }
    }
  if (differences.size() < 16) return 0;
  // Printed digits blur a step a little: refine it on small multiples, then ask that nearly all are whole.
  double sum = 0, multiples = 0;
  for (const double d : differences)
    if (d < 5.5 * step) {
      sum += d;
      multiples += std::round(d / step);
    }
  step = sum / multiples;
  std::size_t whole = 0, large = 0;
  for (const double d : differences) {
    const double m = d / step;
    if (m > 20) continue;  // beyond that the blur of the digits hides the grid
    ++large;
    if (std::abs(m - std::round(m)) < 0.1) ++whole;
  }
  return large >= 16 && static_cast<double>(whole) > 0.98 * static_cast<double>(large) ? step : 0.0;
}

/// Stretches of 256 rows, spread over the record.
std::vector<Segment> spread_chunks(std::span<const double> time, std::span<const double> signal) {
  std::vector<Segment> chunks;
  for (const Segment& segment : split_at_gaps(time, signal))
    for (std::size_t b = segment.begin; b + kChunk <= segment.end; b += kChunk)
      chunks.push_back({b, b + kChunk});
  if (chunks.size() <= kMostChunks) return chunks;
  std::vector<Segment> some;
  for (std::size_t k = 0; k < kMostChunks; ++k) some.push_back(chunks[k * chunks.size() / kMostChunks]);
  return some;
}

int narrowest_window(int order) {
  return order + 2 + (order + 1) % 2;
}  // odd, one more than interpolation

}  // namespace

double sample_noise(std::span<const double> time, std::span<const double> signal, int order) {
  const std::vector<Segment> chunks = spread_chunks(time, signal);
  if (chunks.empty()) return std::numeric_limits<double>::quiet_NaN();
  return median(chunk_residuals(time, signal, chunks, {.window = narrowest_window(order), .order = order}));
}

WindowChoice choose_window(std::span<const double> time, std::span<const double> signal, int order,
                           double known_noise, double max_seconds) {
  WindowChoice choice;
  choice.polynomial.order = order;
  const int smallest = narrowest_window(order);
  choice.polynomial.window = smallest;
  const double interval = median_interval(time);
  const std::vector<Segment> chunks = spread_chunks(time, signal);
  if (chunks.empty()) return choice;
  choice.step = quantisation_step(signal, chunks);
  const LocalPolynomial narrow{.window = smallest, .order = order};
  if (std::isfinite(known_noise) && known_noise > 0) {
    choice.noise = known_noise;
  } else {
    choice.noise =
        std::max(median(chunk_residuals(time, signal, chunks, narrow)), choice.step / std::sqrt(12.0));
  }
  static constexpr std::array<int, 17> kWindows{5,  7,  9,  11, 13, 15,  19,  23, 27,
                                                31, 41, 51, 61, 81, 101, 121, 161};
  for (const int window : kWindows) {
    if (window < smallest) continue;
    if ((window - 1) * interval > max_seconds) break;
    const std::vector<double> residual =
        chunk_residuals(time, signal, chunks, {.window = window, .order = order});
    // Worst chunks but one in fifty: twice the noise means a bias of at most 1.7 noise standard deviations in
    // the fastest stretch.
    if (!(quantile(residual, 0.98) <= 2.0 * choice.noise)) break;
    choice.polynomial.window = window;
  }
  const std::vector<double> weights = kernel(choice.polynomial, 1, interval);
  const double nyquist = 0.5 / interval;
  choice.pass_band = nyquist;
  for (int k = 1; k <= 1000; ++k) {
    const double f = nyquist * k / 1000.0;
    if (std::abs(frequency_response(weights, interval, f)) < 0.99 * 6.283185307179586 * f) {
      choice.pass_band = f;
      break;
    }
  }
  return choice;
}

}  // namespace isac::series
