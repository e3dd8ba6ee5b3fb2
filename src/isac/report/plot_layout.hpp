/// @file
/// Where everything of a figure stands, in pixels from the top left: plots, titles, legends; and which ticks to draw.
///
/// Pure geometry, no gnuplot. Internal to the report room. Units: pixels. Threads: pure. Errors: std::bad_alloc only.
#pragma once

#include <string>
#include <vector>

#include "isac/report/figure.hpp"

namespace isac::report {

inline constexpr double kFontSize = 12;
inline constexpr double kLeftMargin = 84;  ///< room for the y ticks and the y label

struct LegendEntry {
  const Curve* curve = nullptr;
  double left = 0;  ///< of the sample stroke
  double y = 0;     ///< middle of the row
};

struct PlacedPanel {
  double left = 0, top = 0, width = 0, height = 0;  ///< of the plot
  double title_y = 0;                               ///< middle of the title's row
  bool x_labelled = true;
  std::vector<LegendEntry> legend = {};
};

struct Layout {
  std::vector<PlacedPanel> panels = {};
  double width = 0, height = 0;
};

[[nodiscard]] Layout lay_out(const Figure& figure);

/// The range an axis shows for data of a given range.
[[nodiscard]] Range axis_range(const Axis& axis, Range data);
/// A step of 1, 2, 2.5 or 5 times a power of ten that gives at most `most` ticks.
[[nodiscard]] double tick_step(double span, double most);
/// printf format of a tick's number.
[[nodiscard]] std::string tick_format(double step, Range range);

inline constexpr double kSampleWidth = 18;  ///< of a legend's sample stroke

}  // namespace isac::report
