#include <algorithm>
#include <cmath>

#include "isac/report/joint_view.hpp"

namespace isac::report {
namespace {

/// Pressures of the two muscles from half their difference and their mean.
struct Pressures {
  std::vector<double> p1, p2;
};
Pressures muscle_pressures(const estimate::JointRun& run, double scale) {
  Pressures out;
  for (std::size_t i = 0; i < std::min(run.mean_pressure.size(), run.delta_pressure.size()); ++i) {
    out.p1.push_back((run.mean_pressure[i] - run.delta_pressure[i]) * scale);
    out.p2.push_back((run.mean_pressure[i] + run.delta_pressure[i]) * scale);
  }
  return out;
}

Panel pressure_panel(const JointView& view, const RunView& run) {
  Panel panel{.x = view.time, .y = {.label = "Pressure", .unit = view.pressure_unit}};
  if (run.run != nullptr && !run.run->mean_pressure.empty()) {
    const Pressures p = muscle_pressures(*run.run, view.pressure_scale);
    panel.curves.push_back(line("p₁", colour::kSecond, run.run->time, p.p1));
    panel.curves.push_back(line("p₂", colour::kSixth, run.run->time, p.p2));
  } else {
    panel.y.label = "Δp";
    panel.curves.push_back(line("", colour::kSecond, run.residual->time,
                                scaled(run.residual->delta_pressure, view.pressure_scale)));
  }
  return panel;
}

}  // namespace

Figure signals_figure(const JointView& view, const RunView& run) {
  const estimate::RunResidual& rows = *run.residual;
  Figure figure{.caption = "Signals of " + run.name + (rows.heldout ? " (held out)" : "") + ": " +
                           view.position_symbol + ", its rate" +
                           (view.has_pressure ? ", the pressures" : "") + ", and " + view.output_symbol +
                           " as measured and as the fitted model gives it.",
                .panel_height = 104,
                .shared_x = true};
  Panel angle{.x = view.time, .y = view.angle};
  angle.curves.push_back(line("", colour::kMeasured, rows.time, rows.angle));
  Panel velocity{.x = view.time, .y = view.velocity};
  velocity.curves.push_back(line("", colour::kMeasured, rows.time, rows.velocity));
  figure.panels = {std::move(angle), std::move(velocity)};
  if (view.has_pressure) figure.panels.push_back(pressure_panel(view, run));
  Panel output{.x = view.time, .y = view.output};
  output.curves.push_back(line("measured", colour::kUnderlay, rows.time, rows.measured));
  output.curves.back().size = 2.4;
  Curve model = line("model", colour::kModel, rows.time, rows.predicted);
  model.size = 1.1;
  output.curves.push_back(std::move(model));
  figure.panels.push_back(std::move(output));
  return figure;
}

MaybeFigure fast_pressure_figure(const JointView& view) {
  const RunView* fastest = nullptr;
  for (const RunView& run : view.runs)
    if (run.constant_pressure && run.run != nullptr && !run.run->mean_pressure.empty() &&
        (fastest == nullptr || run.speed > fastest->speed))
      fastest = &run;
  if (fastest == nullptr)
    return {.missing =
                "pressure during fast movement (fig 3.5 of the seed): no run at constant command with both "
                "pressures recorded"};
  const Window window = fastest_window(*fastest->residual, 6);
  const double from = fastest->residual->time[window.first];
  const double to = fastest->residual->time[window.last - 1];
  const estimate::JointRun& run = *fastest->run;
  const Pressures p = muscle_pressures(run, view.pressure_scale);
  std::vector<double> time, p1, p2;
  for (std::size_t i = 0; i < p.p1.size(); ++i) {
    if (run.time[i] < from || run.time[i] > to) continue;
    time.push_back(run.time[i]);
    p1.push_back(p.p1[i]);
    p2.push_back(p.p2[i]);
  }
  Figure figure{
      .caption =
          "Pressure during fast movement (" + fastest->name +
          "): the valves are to hold it constant; what moves with the joint is the compression the pressure "
          "control unit does not take out.",
      .panel_height = 130,
      .shared_x = true};
  Panel pressure{.x = view.time, .y = {.label = "Pressure", .unit = view.pressure_unit}};
  pressure.curves = {line("p₁", colour::kSecond, time, p1), line("p₂", colour::kSixth, time, p2)};
  Panel velocity{.x = view.time, .y = view.velocity};
  const auto rows = [&](const std::vector<double>& v) {
    return std::span(v).subspan(window.first, window.last - window.first);
  };
  velocity.curves = {
      line("", colour::kMeasured, rows(fastest->residual->time), rows(fastest->residual->velocity))};
  figure.panels = {std::move(pressure), std::move(velocity)};
  return {.figure = std::move(figure)};
}

}  // namespace isac::report
