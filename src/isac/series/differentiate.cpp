#include "isac/series/differentiate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "isac/series/simd.hpp"

namespace isac::series {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kMaxOrder = 5;
constexpr std::size_t kLanes = 8;
using Matrix = std::array<std::array<double, kMaxOrder + 1>, kMaxOrder + 1>;

void check(LocalPolynomial polynomial) {
  if (polynomial.window % 2 == 0 || polynomial.order < 1 || polynomial.order > kMaxOrder ||
      polynomial.window <= polynomial.order) {
    throw std::invalid_argument(
        "a local polynomial needs an odd window above its order, and an order from 1 to 5");
  }
}

/// Cholesky solve of the (order+1)-square system a·x = b in place; a is positive definite by construction.
void solve_in_place(Matrix& a, std::array<double, kMaxOrder + 1>& b, int order) {
  const int n = order + 1;
  for (int k = 0; k < n; ++k) {
    for (int j = 0; j < k; ++j) a[k][k] -= a[k][j] * a[k][j];
    a[k][k] = std::sqrt(a[k][k]);
    for (int i = k + 1; i < n; ++i) {
      for (int j = 0; j < k; ++j) a[i][k] -= a[i][j] * a[k][j];
      a[i][k] /= a[k][k];
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < i; ++j) b[i] -= a[i][j] * b[j];
    b[i] /= a[i][i];
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int j = i + 1; j < n; ++j) b[i] -= a[j][i] * b[j];
    b[i] /= a[i][i];
  }
}

}  // namespace

namespace detail {

/// y_i = Σ_j w_j x_{i+j}, i in [0, count): sixty-four rows at a time, each summed in the kernel's order.
ISAC_SIMD void slide(const double* x, const double* w, std::size_t taps, std::size_t count, double* y) {
  constexpr std::size_t kRows = 64;  // eight chains of additions hide each other's latency
  std::size_t i = 0;
  for (; i + kRows <= count; i += kRows) {
    double sum[kRows] = {};
    for (std::size_t j = 0; j < taps; ++j) {
      const double weight = w[j];
      const double* row = x + i + j;
      for (std::size_t l = 0; l < kRows; ++l) sum[l] += weight * row[l];
    }
    for (std::size_t l = 0; l < kRows; ++l) y[i + l] = sum[l];
  }
  for (; i < count; ++i) {
    double sum = 0;
    for (std::size_t j = 0; j < taps; ++j) sum += w[j] * x[i + j];
    y[i] = sum;
  }
}

/// Power sums Σ u^k and Σ u^k x of eight windows at once; t and x point at the oldest sample of the first
/// window.
ISAC_SIMD void window_moments(const double* t, const double* x, std::size_t window, int order,
                              double inverse_width, double (*power)[kLanes], double (*moment)[kLanes]) {
  const std::size_t half = window / 2;
  double centre[kLanes], origin[kLanes];
  for (std::size_t l = 0; l < kLanes; ++l) {
    centre[l] = t[half + l];
    origin[l] = x[half + l];
  }
  for (int k = 0; k <= 2 * order; ++k)
    for (std::size_t l = 0; l < kLanes; ++l) power[k][l] = 0;
  for (int k = 0; k <= order; ++k)
    for (std::size_t l = 0; l < kLanes; ++l) moment[k][l] = 0;
  for (std::size_t j = 0; j < window; ++j) {
    double u[kLanes], p[kLanes], value[kLanes];
    for (std::size_t l = 0; l < kLanes; ++l) {
      u[l] = (t[j + l] - centre[l]) * inverse_width;
      value[l] = x[j + l] - origin[l];
      p[l] = 1;
    }
    for (int k = 0; k <= 2 * order; ++k) {
      if (k <= order)
        for (std::size_t l = 0; l < kLanes; ++l) moment[k][l] += p[l] * value[l];
      for (std::size_t l = 0; l < kLanes; ++l) {
        power[k][l] += p[l];
        p[l] *= u[l];
      }
    }
  }
}

}  // namespace detail

namespace {

/// Local polynomials on uneven stamps for one segment; writes rows [begin+half, end−half).
void differentiate_uneven(std::span<const double> time, std::span<const double> signal, Segment segment,
                          LocalPolynomial polynomial, double interval, Derivatives& out) {
  const auto window = static_cast<std::size_t>(polynomial.window);
  const std::size_t half = window / 2, rows = segment.end - segment.begin;
  const int order = polynomial.order;
  const double width = static_cast<double>(half) * interval, inverse = 1.0 / width;
  double power[2 * kMaxOrder + 1][kLanes], moment[kMaxOrder + 1][kLanes];
  const std::size_t count = rows - 2 * half;
  for (std::size_t first = 0; first < count; first += kLanes) {
    // The last lanes overlap with rows already done, so that every group of eight is full.
    const std::size_t start = std::min(first, count >= kLanes ? count - kLanes : 0);
    std::vector<double> padded_time, padded_signal;
    const double* t = time.data() + segment.begin + start;
    const double* x = signal.data() + segment.begin + start;
    if (count < kLanes) {  // a segment shorter than eight windows: pad with its last sample, results of the
                           // padding are dropped
      padded_time.assign(t, t + rows);
      padded_signal.assign(x, x + rows);
      for (std::size_t l = count; l < kLanes; ++l) {
        padded_time.push_back(padded_time.back() + interval);
        padded_signal.push_back(padded_signal.back());
      }
      t = padded_time.data();
      x = padded_signal.data();
    }
    detail::window_moments(t, x, window, order, inverse, power, moment);
    for (std::size_t l = 0; l < std::min(kLanes, count); ++l) {
      Matrix a{};
      std::array<double, kMaxOrder + 1> b{};
      for (int i = 0; i <= order; ++i) {
        for (int j = 0; j <= i; ++j) a[i][j] = power[i + j][l];
        b[i] = moment[i][l];
      }
      solve_in_place(a, b, order);
      const std::size_t row = segment.begin + start + half + l;
      if (!out.value.empty()) out.value[row] = signal[row] + b[0];
      if (!out.first.empty()) out.first[row] = b[1] * inverse;
      if (!out.second.empty()) out.second[row] = order >= 2 ? 2.0 * b[2] * inverse * inverse : 0.0;
    }
  }
}

void slide_segments(std::span<const double> signal, std::span<const double> weights,
                    std::span<const Segment> segments, std::vector<double>& out) {
  const std::size_t taps = weights.size(), half = taps / 2;
  for (const Segment& segment : segments) {
    if (segment.end - segment.begin < taps) continue;
    detail::slide(signal.data() + segment.begin, weights.data(), taps, segment.end - segment.begin - 2 * half,
                  out.data() + segment.begin + half);
  }
}

}  // namespace

double median_interval(std::span<const double> time) {
  std::vector<double> steps;
  // A median of up to 20 000 steps spread over the record is the median for every purpose here.
  const std::size_t stride = std::max<std::size_t>(1, time.size() / 20000);
  for (std::size_t i = 1; i < time.size(); i += stride) {
    const double step = time[i] - time[i - 1];
    if (step > 0) steps.push_back(step);
  }
  if (steps.empty()) return kNan;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

std::vector<Segment> split_at_gaps(std::span<const double> time, std::span<const double> signal) {
  const double limit = 2.5 * median_interval(time);
  std::vector<Segment> segments;
  const std::size_t rows = std::min(time.size(), signal.size());
  bool open = false;
  for (std::size_t i = 0; i < rows; ++i) {
    const bool usable = std::isfinite(signal[i]) && std::isfinite(time[i]);
    const bool gap = open && usable && !(time[i] - time[i - 1] <= limit);
    if (open && (!usable || gap)) {
      segments.back().end = i;
      open = false;
    }
    if (usable && !open) {
      segments.push_back({i, rows});
      open = true;
    }
  }
  return segments;
}

std::vector<double> kernel(LocalPolynomial polynomial, int derivative, double interval) {
  check(polynomial);
  const int half = polynomial.window / 2, order = polynomial.order;
  const double width = half;  // u = j/half keeps the normal matrix well scaled
  std::vector<double> weights(static_cast<std::size_t>(polynomial.window), 0.0);
  if (derivative > order) return weights;
  Matrix a{};
  for (int i = 0; i <= order; ++i)
    for (int k = 0; k <= i; ++k) {
      double sum = 0;
      for (int j = -half; j <= half; ++j) sum += std::pow(j / width, i + k);
      a[i][k] = (i + k) % 2 == 0 ? sum : 0.0;  // odd sums vanish exactly
    }
  std::array<double, kMaxOrder + 1> row{};
  row[static_cast<std::size_t>(derivative)] = derivative == 2 ? 2.0 : 1.0;
  solve_in_place(a, row, order);
  const double scale = std::pow(width * interval, -derivative);
  for (int j = -half; j <= half; ++j) {
    double weight = 0;
    for (int k = 0; k <= order; ++k) weight += row[static_cast<std::size_t>(k)] * std::pow(j / width, k);
    weights[static_cast<std::size_t>(j + half)] = weight * scale;
  }
  return weights;
}

std::vector<double> implied_low_pass(LocalPolynomial polynomial) {
  const std::vector<double> first = kernel(polynomial, 1, 1.0);
  // kernel(1) = L * difference: L_{j+1/2} = −Σ_{k≤j} w_k; averaged to whole samples because L acts on
  // interval means.
  std::vector<double> low_pass(first.size(), 0.0);
  double before = 0;
  for (std::size_t j = 0; j < first.size(); ++j) {
    const double after = before - first[j];
    low_pass[j] = 0.5 * (before + after);
    before = after;
  }
  return low_pass;
}

NoiseGain noise_gain(LocalPolynomial polynomial, double interval) {
  const auto norm = [](const std::vector<double>& weights) {
    double sum = 0;
    for (const double w : weights) sum += w * w;
    return std::sqrt(sum);
  };
  return {norm(kernel(polynomial, 0, interval)), norm(kernel(polynomial, 1, interval)),
          norm(kernel(polynomial, 2, interval))};
}

std::complex<double> frequency_response(std::span<const double> weights, double interval, double frequency) {
  constexpr double kTwoPi = 6.283185307179586;
  const auto half = static_cast<double>(weights.size() / 2);
  std::complex<double> sum = 0;
  for (std::size_t j = 0; j < weights.size(); ++j)
    sum += weights[j] * std::polar(1.0, kTwoPi * frequency * interval * (static_cast<double>(j) - half));
  return sum;
}

std::vector<double> convolve(std::span<const double> signal, std::span<const double> weights,
                             std::span<const Segment> segments) {
  std::vector<double> out(signal.size(), kNan);
  slide_segments(signal, weights, segments, out);
  return out;
}

Derivatives differentiate(std::span<const double> time, std::span<const double> signal,
                          LocalPolynomial polynomial, WhichDerivatives which) {
  check(polynomial);
  Derivatives out;
  out.interval = median_interval(time);
  out.segments = split_at_gaps(time, signal);
  const std::size_t rows = std::min(time.size(), signal.size());
  if (which.value) out.value.assign(rows, kNan);
  if (which.first) out.first.assign(rows, kNan);
  if (which.second) out.second.assign(rows, kNan);
  const auto window = static_cast<std::size_t>(polynomial.window);
  std::vector<Segment> even;
  for (const Segment& segment : out.segments) {
    if (segment.end - segment.begin < window) continue;
    bool uniform = true;
    for (std::size_t i = segment.begin + 1; i < segment.end && uniform; ++i)
      uniform = std::abs(time[i] - time[i - 1] - out.interval) <= 1e-6 * out.interval;
    if (uniform) {
      even.push_back(segment);
    } else {
      out.even = false;
      differentiate_uneven(time, signal, segment, polynomial, out.interval, out);
    }
  }
  if (which.value) slide_segments(signal, kernel(polynomial, 0, out.interval), even, out.value);
  if (which.first) slide_segments(signal, kernel(polynomial, 1, out.interval), even, out.first);
  if (which.second) slide_segments(signal, kernel(polynomial, 2, out.interval), even, out.second);
  return out;
}

}  // namespace isac::series
