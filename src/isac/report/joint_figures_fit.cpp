#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/report/joint_view.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

constexpr double kGap = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kLags = 120;

/// The run a person should judge the model by: held out if there is one, and fast.
const RunView& showcase(const JointView& view) {
  const RunView* best = &view.runs.front();
  for (const RunView& run : view.runs) {
    const bool better =
        run.residual->heldout != best->residual->heldout ? run.residual->heldout : run.speed > best->speed;
    if (better) best = &run;
  }
  return *best;
}

std::span<const double> part(const std::vector<double>& values, Window window) {
  return std::span(values).subspan(window.first, window.last - window.first);
}

struct Pooled {
  std::vector<double> angle, velocity, pressure, measured, predicted, residual;
};

void append(std::vector<double>& to, const std::vector<double>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

Pooled pool(const JointView& view, bool heldout) {
  Pooled all;
  for (const RunView& run : view.runs) {
    if (run.residual->heldout != heldout) continue;
    append(all.angle, run.residual->angle);
    append(all.velocity, run.residual->velocity);
    append(all.pressure, scaled(run.residual->delta_pressure, view.pressure_scale));
    append(all.measured, run.residual->measured);
    append(all.predicted, run.residual->predicted);
    append(all.residual, residuals(*run.residual));
  }
  return all;
}

Panel scatter_panel(const JointView& view, const Pooled& rows, const std::string& title, double rmse) {
  Panel panel{.title = title, .x = view.output, .y = view.output};
  panel.x.label = "Predicted " + view.output_symbol;
  panel.y.label = "Measured " + view.output_symbol;
  const Range both = united(range_of(rows.predicted), range_of(rows.measured));
  const Range shown = padded(both, 0.04);
  panel.x.low = panel.y.low = shown.low;
  panel.x.high = panel.y.high = shown.high;
  panel.curves = scatter(rows.predicted, rows.measured, shown, shown, 298, 298);
  const std::vector<double> ends = {shown.low, shown.high};
  Curve identity = line("", "#222222", ends, ends);
  identity.dash = Dash::kDashed;
  identity.size = 1;
  panel.curves.push_back(std::move(identity));
  if (std::isfinite(rmse))
    panel.notes.push_back("rmse " + number(rmse, 3) + " " + pretty_unit(view.output.unit) +
                          ", n = " + whole(static_cast<double>(rows.measured.size())));
  return panel;
}

Panel residual_panel(const JointView& view, const Axis& axis, const std::vector<double>& x,
                     const std::vector<double>& residual, double reach) {
  Panel panel{.x = axis, .y = view.residual, .lines = {{.at = 0, .label = {}}}};
  panel.y.low = -reach;
  panel.y.high = reach;
  panel.curves = scatter(x, residual, range_of(x), {-reach, reach}, 170, 180);
  const BinnedMean mean = binned_mean(x, residual, 18, 20);
  std::vector<double> half = mean.std_error;
  for (double& h : half) h *= 2;
  panel.curves.push_back(error_bars("", colour::kModel, mean.x, mean.mean, half));
  return panel;
}

/// Autocorrelation over lags of all runs together, each run less its own mean.
std::vector<double> autocorrelation(const JointView& view, std::size_t lags) {
  std::vector<double> sum(lags + 1, 0.0);
  for (const RunView& run : view.runs) {
    if (run.residual->heldout) continue;
    std::vector<double> e = residuals(*run.residual);
    double mean = 0;
    for (const double v : e) mean += v / static_cast<double>(e.size());
    for (double& v : e) v -= mean;
    for (std::size_t lag = 0; lag <= lags && lag < e.size(); ++lag)
      for (std::size_t i = lag; i < e.size(); ++i) sum[lag] += e[i] * e[i - lag];
  }
  std::vector<double> out(lags + 1, kGap);
  for (std::size_t lag = 0; lag <= lags && sum[0] > 0; ++lag) out[lag] = sum[lag] / sum[0];
  return out;
}

}  // namespace

Figure torque_sensor_figure(const JointView& view) {
  const RunView& run = showcase(view);
  const estimate::RunResidual& rows = *run.residual;
  const Window window = fastest_window(rows, 20);
  Figure figure{.caption = "The model as a " + std::string(view.output_symbol == "T" ? "torque" : "force") +
                           " sensor: " + (rows.heldout ? "held-out run " : "run ") + run.name +
                           ", the 20 s around its fastest movement; below, the difference.",
                .panel_height = 170,
                .shared_x = true};
  Panel both{.x = view.time, .y = view.output};
  Curve measured = line("measured", colour::kUnderlay, part(rows.time, window), part(rows.measured, window));
  measured.size = 2.6;
  Curve model = line("model", colour::kModel, part(rows.time, window), part(rows.predicted, window));
  model.size = 1.1;
  both.curves = {std::move(measured), std::move(model)};
  Panel difference{.x = view.time, .y = view.residual, .lines = {{.at = 0, .label = {}}}, .height = 90};
  const std::vector<double> e = residuals(rows);
  Curve error = line("", colour::kSecond, part(rows.time, window), part(e, window));
  error.size = 1;
  difference.curves = {std::move(error)};
  figure.panels = {std::move(both), std::move(difference)};
  return figure;
}

Figure scatter_figure(const JointView& view) {
  const Pooled fitted = pool(view, false);
  const Pooled heldout = pool(view, true);
  Figure figure{.caption =
                    "Measured against predicted, all usable rows; darker where rows lie denser (logarithmic "
                    "shades). On the dashed line the model is exact.",
                .columns = 2,
                .panel_height = 298};
  figure.panels.push_back(scatter_panel(view, fitted, "Fitted runs", view.fit->rmse));
  if (!heldout.measured.empty())
    figure.panels.push_back(scatter_panel(view, heldout, "Held-out runs", view.fit->heldout_rmse));
  return figure;
}

MaybeFigure static_figure(const JointView& view) {
  const std::string name = "static against full model (fig 3.13 of the seed)";
  if (!std::isfinite(view.c) && !std::isfinite(view.d))
    return {.missing = name + ": C and D are not identified"};
  const RunView& run = showcase(view);
  if (!(run.speed > 0)) return {.missing = name + ": the joint never moves"};
  const estimate::RunResidual& rows = *run.residual;
  const Window window = fastest_window(rows, 4);
  std::vector<double> still(rows.predicted);
  for (std::size_t i = 0; i < still.size(); ++i) {
    const double w = rows.velocity[i];
    if (std::isfinite(view.c)) still[i] += view.c * w * w * w;
    if (std::isfinite(view.d)) still[i] += view.d * w;
  }
  Figure figure{
      .caption =
          "Static model (without C and D) against the full model, 4 s around the fastest movement of " +
          run.name + ". The static model errs by the half width of the hysteresis.",
      .panel_height = 210};
  Panel panel{.x = view.time, .y = view.output};
  Curve measured = line("measured", colour::kUnderlay, part(rows.time, window), part(rows.measured, window));
  measured.size = 2.6;
  Curve plain = line("static model", colour::kSecond, part(rows.time, window), part(still, window));
  plain.dash = Dash::kDashed;
  Curve full = line("full model", colour::kModel, part(rows.time, window), part(rows.predicted, window));
  panel.curves = {std::move(measured), std::move(plain), std::move(full)};
  figure.panels = {std::move(panel)};
  return {.figure = std::move(figure)};
}

Figure residual_figure(const JointView& view) {
  const Pooled rows = pool(view, false);
  const double reach =
      1.15 * std::max(std::abs(quantile(rows.residual, 0.0005)), std::abs(quantile(rows.residual, 0.9995)));
  Figure figure{
      .caption =
          "Residual over each regressor. Shades: density of the rows; points with bars: mean in bins and "
          "twice its standard error (rows taken as independent). A pattern in the means is physics that the "
          "model lacks. The outermost 0.1 % of the rows may lie outside the picture.",
      .columns = view.has_pressure ? 3 : 2,
      .panel_height = 180};
  figure.panels.push_back(residual_panel(view, view.angle, rows.angle, rows.residual, reach));
  figure.panels.push_back(residual_panel(view, view.velocity, rows.velocity, rows.residual, reach));
  if (view.has_pressure)
    figure.panels.push_back(
        residual_panel(view, view.pressure_difference, rows.pressure, rows.residual, reach));
  return figure;
}

Figure residual_time_figure(const JointView& view) {
  Figure figure{
      .caption =
          "Residual over time, one run behind the other, numbered as in the table of runs. Steps from run "
          "to run or a drift point at temperature, creep or a sensor's zero.",
      .panel_height = 150};
  Panel panel{.x = {.label = "Recorded time, run after run", .unit = "s", .tight = true}, .y = view.residual};
  double offset = 0;
  double total = 0;
  for (const RunView& run : view.runs) total += run.residual->time.back() - run.residual->time.front();
  for (std::size_t k = 0; k < view.runs.size(); ++k) {
    const estimate::RunResidual& rows = *view.runs[k].residual;
    std::vector<double> time = rows.time;
    const double length = rows.time.back() - rows.time.front();
    for (double& t : time) t += offset - rows.time.front();
    const auto columns =
        static_cast<std::size_t>(std::max(4.0, kPixelColumns * (total > 0 ? length / total : 1.0)));
    Curve curve = line("", k % 2 == 0 ? colour::kSecond : colour::kFifth, time, residuals(rows), columns);
    curve.size = 0.9;
    panel.curves.push_back(std::move(curve));
    if (view.runs.size() > 1)
      panel.lines.push_back({.vertical = true,
                             .at = offset,
                             .label = length > 0.02 * total ? fmt::format("{}", k + 1) : std::string()});
    offset += length;
  }
  panel.lines.push_back({.at = 0, .label = {}});
  figure.panels = {std::move(panel)};
  return figure;
}

Figure whiteness_figure(const JointView& view) {
  const std::vector<double> r = autocorrelation(view, kLags);
  std::size_t n = 0;
  std::vector<double> all, steps;
  for (const RunView& run : view.runs) {
    if (run.residual->heldout) continue;
    n += run.residual->time.size();
    append(all, residuals(*run.residual));
    for (std::size_t i = 1; i < run.residual->time.size(); ++i)
      steps.push_back(run.residual->time[i] - run.residual->time[i - 1]);
  }
  double dt = quantile(steps, 0.5);
  if (!std::isfinite(dt)) dt = 1;
  const double bound = n > 0 ? 1.96 / std::sqrt(static_cast<double>(n)) : 0;
  std::vector<double> lag, low, high, value;
  for (std::size_t k = 1; k < r.size(); ++k) {
    lag.push_back(static_cast<double>(k) * dt * 1e3);
    value.push_back(r[k]);
  }
  const std::vector<double> ends = {0, lag.back()};
  Figure figure{.caption =
                    "Whiteness of the residual of the fitted runs. Left: autocorrelation with the 95 % band "
                    "of white noise "
                    "(grey). Right: distribution beside a normal one of the same robust width.",
                .columns = 2,
                .panel_height = 190};
  Panel correlation{.title = "Autocorrelation",
                    .x = {.label = "Lag", .unit = "ms", .tight = true},
                    .y = {.label = "Correlation", .unit = "-"},
                    .lines = {{.at = 0, .label = {}}}};
  const std::vector<double> lower(2, -bound), upper(2, bound);
  correlation.curves = {band("", "", ends, lower, upper), line("", colour::kSecond, lag, value)};
  figure.panels.push_back(std::move(correlation));

  const double centre = quantile(all, 0.5);
  const double sigma = 0.7413 * (quantile(all, 0.75) - quantile(all, 0.25));  // normal: IQR = 1.349 σ
  if (sigma > 0) {
    const Histogram bars = histogram(all, {centre - 4.5 * sigma, centre + 4.5 * sigma}, 45);
    Panel shape{
        .title = "Distribution", .x = view.residual, .y = {.label = "Share of rows", .unit = "%", .low = 0}};
    shape.x.tight = true;
    const double percent = 100.0 / static_cast<double>(all.size());
    std::vector<double> normal;
    for (const double at : bars.centre) {
      const double z = (at - centre) / sigma;
      normal.push_back(100 * bars.width / sigma * 0.3989422804014327 * std::exp(-0.5 * z * z));
    }
    Curve counts{
        .mark = Mark::kBars, .colour = "#9fb8cc", .x = bars.centre, .y = scaled(bars.count, percent)};
    Curve bell = line("normal", colour::kModel, bars.centre, normal);
    shape.curves = {std::move(counts), std::move(bell)};
    figure.panels.push_back(std::move(shape));
  }
  return figure;
}

}  // namespace isac::report
