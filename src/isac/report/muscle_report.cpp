#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/report/document.hpp"
#include "isac/report/fit_reports.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/plotter.hpp"
#include "isac/report/report_head.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

constexpr std::size_t kMostCurves = 9;  // drawn in one picture

double mean_contraction(const estimate::MuscleRunResult& run) {
  return quantile(run.contraction, 0.5);
}

/// Runs in the order of their contraction, thinned to kMostCurves.
std::vector<const estimate::MuscleRunResult*> runs_of(const estimate::MuscleModelResult& model,
                                                      bool heldout) {
  std::vector<const estimate::MuscleRunResult*> all;
  for (const auto& run : model.runs)
    if (run.heldout == heldout && !run.pressure.empty()) all.push_back(&run);
  std::stable_sort(all.begin(), all.end(),
                   [](const auto* a, const auto* b) { return mean_contraction(*a) < mean_contraction(*b); });
  if (all.size() <= kMostCurves) return all;
  std::vector<const estimate::MuscleRunResult*> thinned;
  for (std::size_t k = 0; k < kMostCurves; ++k)
    thinned.push_back(all[k * (all.size() - 1) / (kMostCurves - 1)]);
  return thinned;
}

/// One model: force over pressure, one colour per contraction; dots measured, lines the model.
Panel force_panel(const estimate::MuscleModelResult& model, bool heldout, const ShownPressure& shown,
                  const std::string& title) {
  Panel panel{.title = title,
              .x = {.label = "Pressure p", .unit = shown.unit},
              .y = {.label = "Force F", .unit = "N"}};
  const auto runs = runs_of(model, heldout);
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const std::vector<double> p = in_unit(runs[k]->pressure, shown.per_pascal);
    panel.curves.push_back(dots("ε = " + fixed_decimals(100 * mean_contraction(*runs[k]), 1) + " %",
                                colour::ordered(k, runs.size()), p, runs[k]->measured, 300, 3));
  }
  for (std::size_t k = 0; k < runs.size(); ++k) {
    std::vector<std::size_t> order(runs[k]->pressure.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return runs[k]->pressure[a] < runs[k]->pressure[b];
    });
    std::vector<double> p, f;
    for (const std::size_t i : order) {
      p.push_back(runs[k]->pressure[i] * shown.per_pascal);
      f.push_back(runs[k]->predicted[i]);
    }
    Curve curve = line("", "#000000", p, f);
    curve.size = 1;
    panel.curves.push_back(std::move(curve));
  }
  return panel;
}

Figure residual_figure(const estimate::MuscleFit& fit, std::size_t models, const ShownPressure& shown) {
  Figure figure{
      .caption = "Measured less modelled force over pressure and over contraction, all runs, best models.",
      .columns = 2,
      .panel_height = 190};
  Panel over_pressure{.x = {.label = "Pressure p", .unit = shown.unit},
                      .y = {.label = "Residual", .unit = "N"},
                      .lines = {{.at = 0}}};
  Panel over_contraction{.x = {.label = "Contraction ε", .unit = "%"},
                         .y = {.label = "Residual", .unit = "N"},
                         .lines = {{.at = 0}}};
  for (std::size_t m = 0; m < models; ++m) {
    std::vector<double> p, e, r;
    for (const auto& run : fit.ranking[m].runs)
      for (std::size_t i = 0; i < run.measured.size(); ++i) {
        p.push_back(run.pressure[i] * shown.per_pascal);
        e.push_back(100 * run.contraction[i]);
        r.push_back(run.measured[i] - run.predicted[i]);
      }
    over_pressure.curves.push_back(dots(fit.ranking[m].id, colour::category(m), p, r, 600));
    over_contraction.curves.push_back(dots(fit.ranking[m].id, colour::category(m), e, r, 600));
  }
  figure.panels = {std::move(over_pressure), std::move(over_contraction)};
  return figure;
}

void add_ranking(Document& page, const estimate::MuscleFit& fit) {
  Table table{
      .caption = "Models, best first: by the error on runs that were not fitted, where there are any.",
      .columns = {{"Rank", true},
                  {"Model"},
                  {"Equation"},
                  {"Parameters", true},
                  {"rmse fitted (N)", true},
                  {"rmse held out (N)", true}}};
  for (std::size_t k = 0; k < fit.ranking.size(); ++k) {
    const auto& model = fit.ranking[k];
    if (k == 0) table.emphasised.push_back(0);
    table.rows.push_back({whole(static_cast<double>(k + 1)), model.name, model.equation,
                          whole(static_cast<double>(model.parameters.size())), number(model.train_rmse, 3),
                          number(model.heldout_rmse, 3)});
  }
  page.table(table);
}

void add_hysteresis(Document& page, const estimate::MuscleFit& fit, const ShownPressure& shown) {
  if (fit.hysteresis.empty()) return;
  Table table{
      .caption =
          "Hysteresis: exhausting less filling branch at equal pressure. The models describe the mean path.",
      .columns = {{"Run"},
                  {"Mean (N)", true},
                  {"Largest (N)", true},
                  {"at (" + pretty_unit(shown.unit) + ")", true}}};
  for (const auto& width : fit.hysteresis)
    table.rows.push_back({file_name(width.run), number(width.mean, 3), number(width.worst, 3),
                          number(width.at_pressure * shown.per_pascal, 3)});
  page.table(table);
}

}  // namespace

std::string render_muscle_report(const MuscleReportInput& input) {
  if (input.fit == nullptr)
    throw Error(ErrorKind::kUsage, "fit_missing", "a muscle report needs the fit it reports on");
  require_gnuplot();
  const estimate::MuscleFit& fit = *input.fit;
  const ShownPressure shown{pressure_per_pascal(input.pressure_unit), input.pressure_unit};
  Document page = open_page(input.head, "Identification of the muscle");
  const bool heldout = !fit.ranking.empty() && std::isfinite(fit.ranking.front().heldout_rmse);
  if (!fit.ranking.empty()) {
    const auto& best = fit.ranking.front();
    page.cards(
        {{"Best model", best.name, heldout ? "on held-out runs" : "on the fitted runs: none was held out"},
         {"rmse, fitted runs", number(best.train_rmse, 3) + " N", ""},
         {"rmse, held-out runs", heldout ? number(best.heldout_rmse, 3) + " N" : "–", ""},
         {"Models compared", whole(static_cast<double>(fit.ranking.size())), ""}});
  }
  std::vector<std::string> warnings = warning_texts(fit.warnings);
  for (const auto& model : fit.ranking)
    for (const Warning& warning : model.warnings) warnings.push_back(model.name + ": " + warning.text);
  page.box(BoxKind::kWarning, "Before you use these numbers", warnings);
  page.heading("Which model");
  add_ranking(page, fit);
  std::vector<std::string> next = input.next_steps;
  if (!heldout)
    next.insert(
        next.begin(),
        "Record runs at contractions that were not fitted and put them into heldout/: a ranking on fitted "
        "runs favours the model with the most parameters.");
  if (next.empty())
    next.push_back("Use the best model inside the pressures and contractions drawn below, not beyond.");
  page.box(BoxKind::kNext, "What to do next", next);

  const std::size_t drawn = std::min(input.models_drawn, fit.ranking.size());
  for (std::size_t m = 0; m < drawn; ++m) {
    const auto& model = fit.ranking[m];
    page.heading(whole(static_cast<double>(m + 1)) + ". " + model.name);
    page.equation({model.equation});
    add_parameters(page, model.parameters, "Parameters of " + model.name + ".");
    Figure figure{
        .caption = model.name +
                   ": force over pressure, one colour per contraction ε. Dots: measured (binned, sensor's "
                   "zero taken off); lines: model.",
        .panel_height = 300};
    figure.panels.push_back(force_panel(model, false, shown, "Fitted runs"));
    if (!runs_of(model, true).empty())
      figure.panels.push_back(force_panel(model, true, shown, "Held-out runs"));
    page.add_figure(std::move(figure));
  }
  page.heading("What the models leave over");
  page.add_figure(residual_figure(fit, drawn, shown));
  add_hysteresis(page, fit, shown);
  close_page(page, input.head);
  return page.html();
}

}  // namespace isac::report
