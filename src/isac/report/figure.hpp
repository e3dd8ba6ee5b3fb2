/// @file
/// A figure as data: panels of curves with axes, units, legend and reference lines. The plotter draws it.
///
/// The factories reduce what they are given (reduce.hpp), so that a figure of ten million rows stays small.
/// Colours: Okabe and Ito's palette, told apart by the colour-blind and in grey print (dashes help).
/// Texts are plain UTF-8 ("φ̇", "Δp", "N m s³"); nothing in them is markup.
/// Units: those written in the axis labels. Threads: values. Errors: std::bad_alloc only.
/// Example: `panel.curves.push_back(line("measured", colour::kMeasured, time, torque));`
#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "isac/report/reduce.hpp"

namespace isac::report {

namespace colour {
inline constexpr const char* kMeasured = "#4d4d4d";
inline constexpr const char* kUnderlay = "#a3a3a3";  // measured, wide, under a thin model
inline constexpr const char* kModel = "#d55e00";     // vermilion
inline constexpr const char* kSecond = "#0072b2";    // blue
inline constexpr const char* kThird = "#009e73";     // green
inline constexpr const char* kFourth = "#cc79a7";    // purple
inline constexpr const char* kFifth = "#56b4e9";     // sky
inline constexpr const char* kSixth = "#e69f00";     // orange
inline constexpr const char* kReference = "#8a8a8a";
inline constexpr const char* kBox = "#009e73";
/// The k-th colour of a set without order; repeats after seven.
[[nodiscard]] const char* category(std::size_t k) noexcept;
/// The k-th of n colours of a set with order (dark to light, monotone in luminance).
[[nodiscard]] std::string ordered(std::size_t k, std::size_t n);
}  // namespace colour

enum class Mark {
  kLine,       ///< x, y
  kSteps,      ///< x, y: value held until the next x
  kPoints,     ///< x, y: round dots of `size` pixels
  kErrorBars,  ///< x, y, low, high
  kBand,       ///< x, low, high: filled
  kBars,       ///< x (centres, equally spaced), y
  kRuns,       ///< low, high (ends in x), y: horizontal strokes of `size` pixels, of a density
};
enum class Dash { kSolid, kDashed, kDotted };

struct Curve {
  std::string label = {};  ///< empty: not in the legend
  Mark mark = Mark::kLine;
  std::string colour = colour::kMeasured;
  std::vector<double> x = {}, y = {}, low = {}, high = {};
  double size = 1.5;  ///< line width or dot diameter, pixels
  Dash dash = Dash::kSolid;
};

struct ReferenceLine {
  bool vertical = false;
  double at = 0;
  std::string label = {};  ///< written at the line's end, empty: none
};

struct Box {  ///< a rectangle in data coordinates, e.g. the range of validity
  double x_low = 0, x_high = 0, y_low = 0, y_high = 0;
  std::string colour = colour::kBox;
};

struct Axis {
  std::string label = {};                                  ///< "Torque T"
  std::string unit = {};                                   ///< "N m", shown in parentheses; empty: none
  double low = std::numeric_limits<double>::quiet_NaN();   ///< NaN: from the data
  double high = std::numeric_limits<double>::quiet_NaN();  ///< NaN: from the data
  bool tight = false;                                      ///< no margin beyond the data
  bool log = false;
  bool whole = false;  ///< ticks at whole numbers only
};

struct Panel {
  std::string title = {};
  Axis x = {}, y = {};
  std::vector<Curve> curves = {};
  std::vector<ReferenceLine> lines = {};
  std::vector<Box> boxes = {};
  std::vector<std::string> notes = {};  ///< lines of text in the upper left corner of the plot
  double height = 0;                    ///< pixels of the plot; 0: the figure's
};

struct Figure {
  std::string id = {};       ///< unique in a document, [a-z0-9-]: prefix of the SVG's ids
  std::string alt = {};      ///< one sentence for screen readers
  std::string caption = {};  ///< shown under the figure
  int columns = 1;
  double width = 760;         ///< pixels, the page's text width
  double panel_height = 220;  ///< pixels of a plot without margins
  bool shared_x = false;      ///< panels of one column share the x axis: only the lowest is labelled
  std::vector<Panel> panels = {};
};

inline constexpr std::size_t kPixelColumns = 680;  ///< plot width of a one-column figure

/// x increasing: least and greatest per pixel column.
[[nodiscard]] Curve line(std::string label, std::string colour, std::span<const double> x,
                         std::span<const double> y, std::size_t columns = kPixelColumns);
[[nodiscard]] Curve steps(std::string label, std::string colour, std::span<const double> x,
                          std::span<const double> y);
/// A curve in the plane (a loop); falls back to dots when it is too long to be drawn as a line.
[[nodiscard]] Curve loop(std::string label, std::string colour, std::span<const double> x,
                         std::span<const double> y);
/// Dots, at most one per grid cell.
[[nodiscard]] Curve dots(std::string label, std::string colour, std::span<const double> x,
                         std::span<const double> y, std::size_t limit = 1500, double size = 2.4);
[[nodiscard]] Curve error_bars(std::string label, std::string colour, std::span<const double> x,
                               std::span<const double> y, std::span<const double> half_width);
[[nodiscard]] Curve band(std::string label, std::string colour, std::span<const double> x,
                         std::span<const double> low, std::span<const double> high);
/// Few points: dots. Many: shades of blue by count, in a plot of about `width` × `height` pixels that shows the given
/// ranges (rows outside are not counted).
[[nodiscard]] std::vector<Curve> scatter(std::span<const double> x, std::span<const double> y, Range range_x,
                                         Range range_y, double width, double height);
/// The same over the data's own ranges.
[[nodiscard]] std::vector<Curve> scatter(std::span<const double> x, std::span<const double> y, double width,
                                         double height);
/// "Torque T" → "torque T", for the middle of a sentence.
[[nodiscard]] std::string lower_first(std::string text);

/// The least x-range and y-range that show all curves of a panel.
[[nodiscard]] Range data_range_x(const Panel& panel);
[[nodiscard]] Range data_range_y(const Panel& panel);
/// True when no panel or a panel without a drawable point is among them: such a figure is not shown.
[[nodiscard]] bool is_empty(const Figure& figure);

}  // namespace isac::report
