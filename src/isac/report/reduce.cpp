#include "isac/report/reduce.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace isac::report {
namespace {

constexpr double kGap = std::numeric_limits<double>::quiet_NaN();

bool finite(double x, double y) noexcept {
  return std::isfinite(x) && std::isfinite(y);
}

std::size_t cell(double value, Range range, std::size_t cells) noexcept {
  const double position = (value - range.low) / range.span() * static_cast<double>(cells);
  return std::min(cells - 1, static_cast<std::size_t>(std::max(0.0, position)));
}

void push_gap(Series& out) {
  if (out.x.empty() || std::isnan(out.y.back())) return;
  out.x.push_back(kGap);
  out.y.push_back(kGap);
}

/// The points of one pixel column, condensed to its extremes.
struct Column {
  std::size_t low = 0, high = 0;
  bool any = false;

  void add(std::size_t i, std::span<const double> y) {
    if (!any) low = high = i;
    any = true;
    if (y[i] < y[low]) low = i;
    if (y[i] > y[high]) high = i;
  }
  void flush(Series& out, std::span<const double> x, std::span<const double> y) {
    if (!any) return;
    const std::size_t first = std::min(low, high);
    const std::size_t last = std::max(low, high);
    out.x.push_back(x[first]);
    out.y.push_back(y[first]);
    if (last != first) {
      out.x.push_back(x[last]);
      out.y.push_back(y[last]);
    }
    any = false;
  }
};

}  // namespace

Range range_of(std::span<const double> values) noexcept {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  if (!(low <= high)) return {0, 1};
  if (high - low <= 1e-12 * std::max(std::abs(low), std::abs(high)) || high == low) {
    const double widen = low == 0 ? 1 : 0.05 * std::abs(low);
    return {low - widen, high + widen};
  }
  return {low, high};
}

Range padded(Range range, double share) noexcept {
  const double by = share * range.span();
  return {range.low - by, range.high + by};
}

Range united(Range a, Range b) noexcept {
  return {std::min(a.low, b.low), std::max(a.high, b.high)};
}

Series envelope(std::span<const double> x, std::span<const double> y, std::size_t columns) {
  const std::size_t n = std::min(x.size(), y.size());
  Series out;
  if (n <= 2 * columns) {
    for (std::size_t i = 0; i < n; ++i) {
      if (finite(x[i], y[i])) {
        out.x.push_back(x[i]);
        out.y.push_back(y[i]);
      } else {
        push_gap(out);
      }
    }
    return out;
  }
  const Range range = range_of(x.first(n));
  Column column;
  std::size_t current = 0;
  std::size_t missing = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (!finite(x[i], y[i])) {
      ++missing;
      continue;
    }
    const std::size_t here = cell(x[i], range, columns);
    if (here != current) {
      column.flush(out, x, y);
      if (missing > 0 && here > current + 1) push_gap(out);  // a gap wider than a pixel is seen
      current = here;
    }
    missing = 0;
    column.add(i, y);
  }
  column.flush(out, x, y);
  return out;
}

Path path(std::span<const double> x, std::span<const double> y, double resolution, std::size_t limit) {
  const std::size_t n = std::min(x.size(), y.size());
  const Range rx = range_of(x.first(n));
  const Range ry = range_of(y.first(n));
  Path out;
  for (std::size_t i = 0; i < n; ++i) {
    if (!finite(x[i], y[i])) {
      push_gap(out);
      continue;
    }
    if (!out.x.empty() && !std::isnan(out.y.back())) {
      const double dx = (x[i] - out.x.back()) / rx.span();
      const double dy = (y[i] - out.y.back()) / ry.span();
      if (std::hypot(dx, dy) < resolution) continue;
    }
    if (out.x.size() >= limit) {
      out.complete = false;
      break;
    }
    out.x.push_back(x[i]);
    out.y.push_back(y[i]);
  }
  return out;
}

Series cloud(std::span<const double> x, std::span<const double> y, std::size_t columns, std::size_t rows,
             std::size_t limit) {
  const std::size_t n = std::min(x.size(), y.size());
  const Range rx = range_of(x.first(n));
  const Range ry = range_of(y.first(n));
  const auto thinned = [&](std::span<const double> xs, std::span<const double> ys, std::size_t nx,
                           std::size_t ny) {
    std::vector<char> taken(nx * ny, 0);
    Series kept;
    for (std::size_t i = 0; i < xs.size(); ++i) {
      if (!finite(xs[i], ys[i])) continue;
      char& mark = taken[cell(ys[i], ry, ny) * nx + cell(xs[i], rx, nx)];
      if (mark != 0) continue;
      mark = 1;
      kept.x.push_back(xs[i]);
      kept.y.push_back(ys[i]);
    }
    return kept;
  };
  double nx = static_cast<double>(std::max<std::size_t>(columns, 1));
  double ny = static_cast<double>(std::max<std::size_t>(rows, 1));
  Series out = thinned(x.first(n), y.first(n), static_cast<std::size_t>(nx), static_cast<std::size_t>(ny));
  while (out.x.size() > limit && nx > 2 && ny > 2) {
    nx = std::floor(nx / 1.2);
    ny = std::floor(ny / 1.2);
    out = thinned(out.x, out.y, static_cast<std::size_t>(nx), static_cast<std::size_t>(ny));
  }
  return out;
}

std::vector<DensityLevel> density(std::span<const double> x, std::span<const double> y, Range range_x,
                                  Range range_y, std::size_t columns, std::size_t rows, std::size_t levels) {
  std::vector<double> count(columns * rows, 0.0);
  const std::size_t n = std::min(x.size(), y.size());
  for (std::size_t i = 0; i < n; ++i) {
    if (!finite(x[i], y[i]) || x[i] < range_x.low || x[i] > range_x.high || y[i] < range_y.low ||
        y[i] > range_y.high)
      continue;
    count[cell(y[i], range_y, rows) * columns + cell(x[i], range_x, columns)] += 1;
  }
  const double most = *std::max_element(count.begin(), count.end());
  std::vector<DensityLevel> out(levels);
  if (most < 1) return out;
  const double step = std::log(most + 1) / static_cast<double>(levels);
  const auto level_of = [&](double c) {
    return std::min(levels - 1, static_cast<std::size_t>(std::log(c) / step));
  };
  for (std::size_t k = 0; k < levels; ++k)
    out[k].from_count = std::ceil(std::exp(step * static_cast<double>(k)));
  const double wx = range_x.span() / static_cast<double>(columns);
  const double wy = range_y.span() / static_cast<double>(rows);
  for (std::size_t row = 0; row < rows; ++row) {
    std::size_t start = 0;
    while (start < columns) {
      const double c = count[row * columns + start];
      if (c < 1) {
        ++start;
        continue;
      }
      const std::size_t level = level_of(c);
      std::size_t end = start + 1;
      while (end < columns && count[row * columns + end] >= 1 &&
             level_of(count[row * columns + end]) == level)
        ++end;
      out[level].left.push_back(range_x.low + (static_cast<double>(start) + 0.5) * wx);
      out[level].right.push_back(range_x.low + (static_cast<double>(end) - 0.5) * wx);
      out[level].y.push_back(range_y.low + (static_cast<double>(row) + 0.5) * wy);
      start = end;
    }
  }
  return out;
}

BinnedMean binned_mean(std::span<const double> x, std::span<const double> y, std::size_t bins,
                       std::size_t least) {
  const std::size_t n = std::min(x.size(), y.size());
  const Range range = range_of(x.first(n));
  std::vector<double> sum(bins, 0), square(bins, 0), at(bins, 0), count(bins, 0);
  for (std::size_t i = 0; i < n; ++i) {
    if (!finite(x[i], y[i])) continue;
    const std::size_t k = cell(x[i], range, bins);
    const double before = count[k] > 0 ? sum[k] / count[k] : 0;
    count[k] += 1;
    sum[k] += y[i];
    square[k] += (y[i] - before) * (y[i] - sum[k] / count[k]);  // Welford's update
    at[k] += x[i];
  }
  BinnedMean out;
  for (std::size_t k = 0; k < bins; ++k) {
    if (count[k] < static_cast<double>(std::max<std::size_t>(least, 2))) continue;
    out.x.push_back(at[k] / count[k]);
    out.mean.push_back(sum[k] / count[k]);
    out.std_error.push_back(std::sqrt(square[k] / (count[k] - 1) / count[k]));
  }
  return out;
}

Histogram histogram(std::span<const double> values, Range range, std::size_t bins) {
  Histogram out;
  out.width = range.span() / static_cast<double>(bins);
  out.count.assign(bins, 0.0);
  for (std::size_t k = 0; k < bins; ++k)
    out.centre.push_back(range.low + (static_cast<double>(k) + 0.5) * out.width);
  for (const double v : values) {
    if (std::isfinite(v) && v >= range.low && v <= range.high) out.count[cell(v, range, bins)] += 1;
  }
  return out;
}

}  // namespace isac::report
