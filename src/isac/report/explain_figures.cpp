#include "isac/report/explain_figures.hpp"

#include <algorithm>
#include <cmath>

#include "isac/explain/variable_words.hpp"
#include "isac/report/explain_words.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

using explain::Explanation;
using explain::RunTrace;

constexpr double kHalfBar = 0.32;

std::vector<double> difference(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> out(std::min(a.size(), b.size()));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = a[i] - b[i];
  return out;
}

double rms(const std::vector<double>& values) {
  double sum = 0, n = 0;
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    sum += v * v;
    n += 1;
  }
  return n > 0 ? std::sqrt(sum / n) : std::nan("");
}

/// How much the effects help on this run, in sums of squares: the run that shows most stands first.
double closed(const RunTrace& trace) {
  const double before = rms(difference(trace.measured, trace.before)),
               after = rms(difference(trace.measured, trace.after));
  return std::isfinite(after) ? before * before - after * after : before * before;
}

std::string cut(const std::string& text, std::size_t most) {
  if (glyphs(text) <= most) return text;
  std::string out = text;
  while (glyphs(out) + 1 > most) {
    do out.pop_back();
    while (!out.empty() && (static_cast<unsigned char>(out.back()) & 0xC0) == 0x80);
  }
  return out + "…";
}

Figure run_figure(const RunTrace& trace, std::size_t index, bool added) {
  const std::vector<double> left_before = difference(trace.measured, trace.before),
                            left_after = difference(trace.measured, trace.after);
  Figure figure{
      .id = "run-" + std::to_string(index),
      .alt = signal_in_words(trace.signal) + " of " + trace.run + ", measured and simulated",
      .caption =
          file_name(trace.run) + (trace.heldout ? " (held out: nothing was fitted to it)" : " (fitted)") +
          ": measured " + signal_in_words(trace.signal) + " (wide, grey) and the model" +
          (added ? " without and with what was added" : "") + "; below, measured less model, " +
          number(rms(left_before), 3) + " " + pretty_unit(trace.unit) + " rms" +
          (added ? " before and " + number(rms(left_after), 3) + " " + pretty_unit(trace.unit) + " after"
                 : "") +
          ".",
      .shared_x = true};
  const Axis time{.label = "Time", .unit = "s", .tight = true};
  Panel signal{.x = time, .y = {.label = upper_first(signal_in_words(trace.signal)), .unit = trace.unit}};
  Curve measured = line("measured", colour::kUnderlay, trace.time, trace.measured);
  measured.size = 3.2;
  signal.curves = {std::move(measured),
                   line(added ? "model before" : "model", colour::kModel, trace.time, trace.before)};
  Panel rest{.x = time, .y = {.label = "Residual", .unit = trace.unit}, .lines = {{.at = 0}}, .height = 150};
  rest.curves = {line(added ? "before" : "", colour::kModel, trace.time, left_before)};
  if (added && !left_after.empty()) {
    signal.curves.push_back(line("with what was added", colour::kSecond, trace.time, trace.after));
    rest.curves.push_back(line("after", colour::kSecond, trace.time, left_after));
  }
  figure.panels = {std::move(signal), std::move(rest)};
  return figure;
}

}  // namespace

std::vector<std::string> signals_of(const Explanation& e) {
  std::vector<std::string> signals;
  for (const RunTrace& trace : e.traces)
    if (std::find(signals.begin(), signals.end(), trace.signal) == signals.end())
      signals.push_back(trace.signal);
  std::stable_partition(signals.begin(), signals.end(),
                        [&e](const std::string& s) { return s == e.gap.signal; });
  return signals;
}

Figure waterfall_figure(const Explanation& e) {
  if (e.waterfall.size() < 2) return {};
  Figure figure{.id = "waterfall",
                .alt = "rms of the residual after each effect that was added",
                .caption = "",
                .panel_height = 240};
  const bool heldout = std::isfinite(e.waterfall.front().heldout_rmse);
  figure.caption = std::string(
                       "The gap, effect by effect: each bar is what an effect takes off the rms of measured "
                       "less model on ") +
                   (heldout ? "held-out runs." : "the fitted runs (none was held out).");
  const auto value = [heldout](const explain::WaterfallStep& step) {
    return heldout ? step.heldout_rmse : step.rmse;
  };
  const auto n = static_cast<double>(e.waterfall.size());
  double top = 0;
  for (const explain::WaterfallStep& step : e.waterfall) top = std::max({top, value(step), step.rmse});
  Panel panel{
      .x = {.label = "Effects added", .low = -0.5, .high = n - 0.5, .whole = true},
      .y = {
          .label = "rms of " + e.gap.signal + " residual", .unit = e.gap.unit, .low = 0, .high = 1.15 * top}};
  std::vector<double> x, fitted, held;
  for (std::size_t k = 0; k < e.waterfall.size(); ++k) {
    const explain::WaterfallStep& step = e.waterfall[k];
    const double at = static_cast<double>(k), low = k == 0 ? 0 : value(step),
                 high = k == 0 ? value(step) : value(e.waterfall[k - 1]);
    Curve bar = band("", colour::kFifth, std::vector<double>{at - kHalfBar, at + kHalfBar},
                     std::vector<double>{std::min(low, high), std::min(low, high)},
                     std::vector<double>{std::max(low, high), std::max(low, high)});
    panel.curves.push_back(std::move(bar));
    x.push_back(at);
    fitted.push_back(step.rmse);
    held.push_back(step.heldout_rmse);
    panel.lines.push_back(
        {.vertical = true, .at = at - 0.5, .label = cut(step.label, static_cast<std::size_t>(105 / n))});
  }
  panel.curves.push_back(dots("fitted runs", colour::kMeasured, x, fitted, 1500, 6));
  if (heldout) panel.curves.push_back(dots("held-out runs", colour::kModel, x, held, 1500, 6));
  if (std::isfinite(e.gap.noise_floor))
    panel.lines.push_back({.at = e.gap.noise_floor, .label = "noise floor"});
  figure.panels = {std::move(panel)};
  return figure;
}

std::vector<Figure> run_figures(const Explanation& e, std::size_t most) {
  std::vector<const RunTrace*> traces;
  for (const RunTrace& trace : e.traces)
    if (!trace.time.empty()) traces.push_back(&trace);
  std::stable_sort(traces.begin(), traces.end(), [&e](const RunTrace* a, const RunTrace* b) {
    const bool a_own = a->signal == e.gap.signal, b_own = b->signal == e.gap.signal;
    if (a->heldout != b->heldout) return a->heldout;
    if (a_own != b_own) return a_own;
    return closed(*a) > closed(*b);
  });
  std::vector<Figure> figures;
  const bool any_heldout = !traces.empty() && traces.front()->heldout;
  for (std::size_t i = 0; i < traces.size() && figures.size() < most; ++i) {
    if (any_heldout && !traces[i]->heldout) break;
    figures.push_back(run_figure(*traces[i], i, e.adds()));
  }
  return figures;
}

Figure unknown_figure(const Explanation& e) {
  if (!e.unknown || e.unknown->at.empty()) return {};
  const explain::Unknown& u = *e.unknown;
  const std::string over = explain::variable_in_words(u.variable, explain::of_linear_axis(u.variable_unit));
  Figure figure{.id = "unknown",
                .alt = "Shape of what is missing over " + over,
                .caption = "What is missing, over " + over +
                           ": mean of measured less model in bins; the band holds the mean with 95 %."};
  Panel panel{.x = {.label = upper_first(over), .unit = u.variable_unit},
              .y = {.label = "Missing " + u.signal, .unit = u.unit},
              .lines = {{.at = 0}}};
  std::vector<double> low = u.shape, high = u.shape;
  for (std::size_t i = 0; i < u.band.size() && i < low.size(); ++i) {
    low[i] -= u.band[i];
    high[i] += u.band[i];
  }
  panel.curves = {band("95 % band", colour::kFifth, u.at, low, high),
                  line("mean", colour::kModel, u.at, u.shape)};
  figure.panels = {std::move(panel)};
  return figure;
}

}  // namespace isac::report
