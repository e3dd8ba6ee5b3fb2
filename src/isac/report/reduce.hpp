/// @file
/// Large series made small enough for a picture without changing what the picture shows.
///
///   envelope   least and greatest value per pixel column: every spike stays visible
///   path       points closer than a given part of the picture to the last kept one are left out
///   cloud      at most one point per cell of a grid, the grid coarsened until few enough are left
///   density    counts per cell of a grid, in levels of a factor in the count, as horizontal runs
///
/// Units: those of the caller; NaN marks a gap and stays one. Columns of one call have equal length.
/// Threads: pure functions. Errors: std::bad_alloc only. Cost: one pass over the data each.
/// Example: `auto small = isac::report::envelope(time, torque, 680);`
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "isac/series/statistics.hpp"

namespace isac::report {

struct Range {
  double low = 0, high = 1;
  [[nodiscard]] double span() const noexcept { return high - low; }
};

/// Smallest range that holds all finite values; {0, 1} without any, widened when all values are equal.
[[nodiscard]] Range range_of(std::span<const double> values) noexcept;
/// The range widened by `share` of its span on both sides.
[[nodiscard]] Range padded(Range range, double share) noexcept;
[[nodiscard]] Range united(Range a, Range b) noexcept;

struct Series {
  std::vector<double> x, y;
};

/// x increasing. At most two points per column (plus gaps) over the range of x, in the order of the data.
[[nodiscard]] Series envelope(std::span<const double> x, std::span<const double> y, std::size_t columns);

/// A curve in the plane; drops points that move less than `resolution` of the ranges. At most `limit` points:
/// beyond it the path is cut, and `complete` says so.
struct Path : Series {
  bool complete = true;
};
[[nodiscard]] Path path(std::span<const double> x, std::span<const double> y, double resolution,
                        std::size_t limit);

/// One point per occupied cell of a grid of `columns` × `rows` over the data's range, at most `limit` points.
[[nodiscard]] Series cloud(std::span<const double> x, std::span<const double> y, std::size_t columns,
                           std::size_t rows, std::size_t limit);

/// Runs of neighbouring cells with equal level, y at the cell's centre.
struct DensityLevel {
  std::vector<double> left, right, y;
  double from_count = 1;  ///< smallest count of this level
};

/// Counts over a grid on the data's range (or the given ones), cut into `levels` equal steps of log(count).
[[nodiscard]] std::vector<DensityLevel> density(std::span<const double> x, std::span<const double> y,
                                                Range range_x, Range range_y, std::size_t columns,
                                                std::size_t rows, std::size_t levels);

/// Mean of y and its standard error in equal bins of x; bins with fewer than `least` values are left out.
struct BinnedMean {
  std::vector<double> x, mean, std_error;
};
[[nodiscard]] BinnedMean binned_mean(std::span<const double> x, std::span<const double> y, std::size_t bins,
                                     std::size_t least);

/// Counts in equal bins over `range`; values outside are not counted.
struct Histogram {
  std::vector<double> centre, count;
  double width = 0;
};
[[nodiscard]] Histogram histogram(std::span<const double> values, Range range, std::size_t bins);

using series::quantile;

}  // namespace isac::report
