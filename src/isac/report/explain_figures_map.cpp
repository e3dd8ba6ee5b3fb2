#include <algorithm>
#include <array>
#include <cmath>

#include "isac/report/explain_figures.hpp"
#include "isac/report/explain_words.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

using explain::Explanation;
using explain::RunTrace;

constexpr std::size_t kBins = 28;
constexpr std::size_t kLeast = 8;     // samples of a bin that is shown
constexpr std::size_t kColumns = 26;  // cells of a map
constexpr std::size_t kRows = 22;
constexpr double kMapHeight = 240, kMapWidth = 290;  // pixels of a plot, for the strokes that make cells
constexpr std::array<const char*, 7> kDiverging = {"#2166ac", "#67a9cf", "#d1e5f0", "#ececec",
                                                   "#fddbc7", "#ef8a62", "#b2182b"};

/// All samples of one signal: where they were taken, and what the model leaves over before and after.
struct Samples {
  std::vector<double> speed, angle, delta_pressure, mean_pressure, before, after;
  std::string unit;
};

void append(std::vector<double>& all, const std::vector<double>& part, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) all.push_back(i < part.size() ? part[i] : std::nan(""));
}

Samples gather(const Explanation& e, const std::string& signal) {
  Samples all;
  for (const RunTrace& trace : e.traces) {
    if (trace.signal != signal) continue;
    const std::size_t n = trace.measured.size();
    append(all.speed, trace.velocity, n);
    append(all.angle, trace.angle, n);
    append(all.delta_pressure, trace.delta_pressure, n);
    append(all.mean_pressure, trace.mean_pressure, n);
    for (std::size_t i = 0; i < n; ++i) {
      all.before.push_back(i < trace.before.size() ? trace.measured[i] - trace.before[i] : std::nan(""));
      all.after.push_back(i < trace.after.size() ? trace.measured[i] - trace.after[i] : std::nan(""));
    }
    all.unit = trace.unit;
  }
  return all;
}

/// The middle 99 % of a variable, and whether it moves at all.
Range used_range(const std::vector<double>& values) {
  return {quantile(values, 0.005), quantile(values, 0.995)};
}

bool moves(const std::vector<double>& values, double least) {
  return std::count_if(values.begin(), values.end(), [](double v) { return std::isfinite(v); }) > 100 &&
         used_range(values).span() > least;
}

std::vector<double> inside(const std::vector<double>& values, Range range) {
  std::vector<double> out = values;
  for (double& v : out)
    if (!(v >= range.low && v <= range.high)) v = std::nan("");
  return out;
}

struct Variable {
  std::string label, unit;
  const std::vector<double>* values;
  double least;  ///< range below which it stands still
};

std::vector<Variable> variables_of(const Samples& all, const std::string& position_unit) {
  const bool rotary = position_unit == "rad";
  return {{rotary ? "Speed φ̇" : "Speed v", position_unit + "/s", &all.speed, rotary ? 0.05 : 1e-4},
          {rotary ? "Angle φ" : "Position x", position_unit, &all.angle, rotary ? 0.02 : 1e-4},
          {"Pressure difference Δp", "kg/cm2", &all.delta_pressure, 0.05},
          {"Mean pressure", "kg/cm2", &all.mean_pressure, 0.05}};
}

/// Mean of the residual in the cells of a grid; NaN where too few samples lie.
std::vector<double> cell_means(const std::vector<double>& x, Range range_x, const std::vector<double>& y,
                               Range range_y, const std::vector<double>& residual) {
  std::vector<double> sum(kColumns * kRows, 0.0), count(kColumns * kRows, 0.0);
  for (std::size_t i = 0; i < residual.size(); ++i) {
    const double u = (x[i] - range_x.low) / range_x.span(), v = (y[i] - range_y.low) / range_y.span();
    if (!(u >= 0 && u < 1 && v >= 0 && v < 1) || !std::isfinite(residual[i])) continue;
    const std::size_t cell =
        static_cast<std::size_t>(v * kRows) * kColumns + static_cast<std::size_t>(u * kColumns);
    sum[cell] += residual[i];
    count[cell] += 1;
  }
  for (std::size_t c = 0; c < sum.size(); ++c) sum[c] = count[c] >= 3 ? sum[c] / count[c] : std::nan("");
  return sum;
}

double largest(const std::vector<double>& means) {
  std::vector<double> sizes;
  for (const double m : means)
    if (std::isfinite(m)) sizes.push_back(std::abs(m));
  return sizes.empty() ? 0 : quantile(sizes, 0.97);
}

/// Cells as horizontal strokes, one curve per colour; `step` is the width of a colour.
std::vector<Curve> cells(const std::vector<double>& means, Range range_x, Range range_y, double step,
                         bool labelled) {
  const double width = range_x.span() / kColumns, height = range_y.span() / kRows;
  const double stroke = kMapHeight / kRows;
  // Round ends reach half a stroke beyond both ends.
  const double trim = std::min(0.45 * width, 0.5 * stroke * range_x.span() / kMapWidth);
  std::vector<Curve> curves;
  for (std::size_t k = 0; k < kDiverging.size(); ++k) {
    const double middle = (static_cast<double>(k) - 3) * step;
    Curve curve{.mark = Mark::kRuns, .colour = kDiverging[k], .size = stroke};
    if (labelled) curve.label = (k == 0 ? "≤ " : k + 1 == kDiverging.size() ? "≥ " : "") + number(middle, 2);
    for (std::size_t c = 0; c < means.size(); ++c) {
      if (!std::isfinite(means[c])) continue;
      const double level = std::clamp(std::round(means[c] / step), -3.0, 3.0) + 3;
      if (static_cast<std::size_t>(level) != k) continue;
      const double left = range_x.low + static_cast<double>(c % kColumns) * width;
      curve.low.push_back(left + trim);
      curve.high.push_back(left + width - trim);
      curve.y.push_back(range_y.low + (static_cast<double>(c / kColumns) + 0.5) * height);
    }
    curves.push_back(std::move(curve));
  }
  return curves;
}

void add_map(Figure& figure, const Variable& x, const Variable& y, const Samples& all, bool added) {
  const Range range_x = used_range(*x.values), range_y = used_range(*y.values);
  const std::vector<double> before = cell_means(*x.values, range_x, *y.values, range_y, all.before);
  const double step = std::max(largest(before), 1e-12) / 3;
  const auto panel = [&](const std::string& title, const std::vector<double>& means) {
    Panel p{.title = title,
            .x = {.label = x.label, .unit = x.unit, .low = range_x.low, .high = range_x.high},
            .y = {.label = y.label, .unit = y.unit, .low = range_y.low, .high = range_y.high}};
    p.curves = cells(means, range_x, range_y, step, true);
    return p;
  };
  figure.panels.push_back(panel(added ? "before" : "residual", before));
  if (added)
    figure.panels.push_back(panel("after", cell_means(*x.values, range_x, *y.values, range_y, all.after)));
}

}  // namespace

Figure profile_figure(const Explanation& e, const std::string& signal, const std::string& position_unit) {
  const Samples all = gather(e, signal);
  const bool added = e.adds();
  Figure figure{
      .id = "profile-" + signal,
      .alt = "Mean residual of " + signal + " over speed, angle and pressures",
      .caption = "Where the model is off: mean of measured less modelled " + signal_in_words(signal) +
                 (added ? ", before and after the effects were added," : "") +
                 " in bins of one variable, over all runs. A model that lacks nothing lies on zero.",
      .columns = 2,
      .panel_height = 170};
  for (const Variable& variable : variables_of(all, position_unit)) {
    if (!moves(*variable.values, variable.least)) continue;
    const std::vector<double> x = inside(*variable.values, used_range(*variable.values));
    Panel panel{.x = {.label = variable.label, .unit = variable.unit, .tight = true},
                .y = {.label = "Residual", .unit = all.unit},
                .lines = {{.at = 0}}};
    const BinnedMean before = binned_mean(x, all.before, kBins, kLeast),
                     after = binned_mean(x, all.after, kBins, kLeast);
    const bool first = figure.panels.empty();
    panel.curves = {line(added && first ? "before" : "", colour::kModel, before.x, before.mean)};
    panel.curves.push_back(dots("", colour::kModel, before.x, before.mean, 1500, 4));
    if (added) {
      panel.curves.push_back(line(first ? "after" : "", colour::kSecond, after.x, after.mean));
      panel.curves.push_back(dots("", colour::kSecond, after.x, after.mean, 1500, 4));
    }
    figure.panels.push_back(std::move(panel));
  }
  // One scale for all, so that the variable that matters stands out.
  Range common{0, 0};
  for (const Panel& panel : figure.panels) common = united(common, data_range_y(panel));
  common = padded(common, 0.05);
  for (Panel& panel : figure.panels) {
    panel.y.low = common.low;
    panel.y.high = common.high;
  }
  return figure;
}

Figure map_figure(const Explanation& e, const std::string& signal, const std::string& position_unit) {
  const Samples all = gather(e, signal);
  const bool added = e.adds();
  const std::string unit = pretty_unit(all.unit);
  Figure figure{.id = "map-" + signal,
                .alt = "Mean residual of " + signal + " over two variables, as colours",
                .caption = "Map of the mean residual (" + unit +
                           "; blue: measured below the model, red: above)" +
                           (added ? ", before and after, with the same colours" : "") +
                           ". White: fewer than three samples.",
                .columns = added ? 2 : 1,
                .panel_height = kMapHeight};
  const auto variables = variables_of(all, position_unit);
  const Variable &speed = variables[0], &angle = variables[1], &difference = variables[2],
                 &mean = variables[3];
  if (!moves(*angle.values, angle.least)) return {};
  if (moves(*speed.values, speed.least)) add_map(figure, speed, angle, all, added);
  if (moves(*difference.values, difference.least)) add_map(figure, difference, angle, all, added);
  if (moves(*mean.values, mean.least) && moves(*speed.values, speed.least))
    add_map(figure, mean, speed, all, added);
  return figure;
}

}  // namespace isac::report
