#include "isac/report/plot_layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/report/text.hpp"

namespace isac::report {
namespace {

constexpr double kGlyph = 6.2;  // mean width of a glyph of the font
constexpr double kRightMargin = 14;
constexpr double kBottomMargin = 44;
constexpr double kBottomUnlabelled = 12;
constexpr double kTopMargin = 10;
constexpr double kRow = 19;       // one row of title or legend
constexpr double kSampleGap = 6;  // between sample and text
constexpr double kEntryGap = 16;  // between two entries

double text_width(const std::string& text) {
  return static_cast<double>(glyphs(text)) * kGlyph;
}

/// Legend entries in rows that fit `width`; positions relative to the right end and the lowest row.
std::vector<std::vector<const Curve*>> legend_rows(const Panel& panel, double width) {
  std::vector<std::vector<const Curve*>> rows;
  double used = 0;
  for (const Curve& curve : panel.curves) {
    if (curve.label.empty()) continue;
    const double need = kSampleWidth + kSampleGap + text_width(curve.label) + kEntryGap;
    if (rows.empty() || used + need > width + kEntryGap) {
      rows.emplace_back();
      used = 0;
    }
    rows.back().push_back(&curve);
    used += need;
  }
  return rows;
}

double row_width(const std::vector<const Curve*>& row) {
  double width = -kEntryGap;
  for (const Curve* curve : row) width += kSampleWidth + kSampleGap + text_width(curve->label) + kEntryGap;
  return width;
}

struct Head {  // what stands above a plot
  std::vector<std::vector<const Curve*>> legend;
  bool title_row = false;  // the title has a row of its own
  [[nodiscard]] double height() const {
    return kRow * (static_cast<double>(legend.size()) + (title_row ? 1 : 0));
  }
};

Head head_of(const Panel& panel, double width) {
  Head head{.legend = legend_rows(panel, width)};
  if (panel.title.empty()) return head;
  const double title = 1.12 * (text_width(panel.title) + 5 * kGlyph);
  head.title_row = head.legend.size() != 1 || title + row_width(head.legend.front()) > width;
  return head;
}

void place_head(PlacedPanel& placed, const Head& head) {
  const double lowest = placed.top - 0.5 * kRow;
  placed.title_y = lowest - (head.title_row ? kRow * static_cast<double>(head.legend.size()) : 0);
  for (std::size_t r = 0; r < head.legend.size(); ++r) {
    double x = placed.left + placed.width - row_width(head.legend[r]);
    for (const Curve* curve : head.legend[r]) {
      placed.legend.push_back({curve, x, lowest - kRow * static_cast<double>(head.legend.size() - 1 - r)});
      x += kSampleWidth + kSampleGap + text_width(curve->label) + kEntryGap;
    }
  }
}

}  // namespace

Layout lay_out(const Figure& figure) {
  const auto columns = static_cast<std::size_t>(std::max(1, figure.columns));
  const double cell = figure.width / static_cast<double>(columns);
  Layout out{.panels = std::vector<PlacedPanel>(figure.panels.size()), .width = figure.width};
  for (std::size_t first = 0; first < figure.panels.size(); first += columns) {
    const std::size_t last = std::min(first + columns, figure.panels.size());
    const bool labelled = last == figure.panels.size() || !figure.shared_x;
    std::vector<Head> heads;
    double head_height = 0;
    double height = 0;
    for (std::size_t k = first; k < last; ++k) {
      const Panel& panel = figure.panels[k];
      PlacedPanel& placed = out.panels[k];
      placed.left = cell * static_cast<double>(k - first) + kLeftMargin;
      placed.width = cell - kLeftMargin - kRightMargin;
      placed.x_labelled = labelled;
      heads.push_back(head_of(panel, placed.width));
      head_height = std::max(head_height, heads.back().height());
      height = std::max(height, panel.height > 0 ? panel.height : figure.panel_height);
    }
    for (std::size_t k = first; k < last; ++k) {
      out.panels[k].top = out.height + kTopMargin + head_height;
      out.panels[k].height = height;
      place_head(out.panels[k], heads[k - first]);
    }
    out.height += kTopMargin + head_height + height + (labelled ? kBottomMargin : kBottomUnlabelled);
  }
  return out;
}

Range axis_range(const Axis& axis, Range data) {
  Range out = data;
  if (!axis.tight && !axis.log) out = padded(data, 0.05);
  if (axis.log) out = {std::max(data.low, 1e-300) / 1.3, data.high * 1.3};
  if (std::isfinite(axis.low)) out.low = axis.low;
  if (std::isfinite(axis.high)) out.high = axis.high;
  if (!(out.low < out.high)) out.high = out.low + 1;
  return out;
}

double tick_step(double span, double most) {
  const double raw = span / std::max(1.0, most);
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 2.5, 5.0})
    if (factor * power >= raw * (1 - 1e-9)) return factor * power;
  return 10 * power;
}

std::string tick_format(double step, Range range) {
  const double largest = std::max(std::abs(range.low), std::abs(range.high));
  if (largest >= 1e6 || largest < 1e-3) return "%.3g";
  int decimals = std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
  const double leftover = step * std::pow(10.0, decimals);
  if (std::abs(leftover - std::round(leftover)) > 1e-6) ++decimals;  // 0.25, 2.5
  return fmt::format("%.{}f", decimals);
}

}  // namespace isac::report
