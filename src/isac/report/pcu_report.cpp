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

constexpr std::size_t kMostSteps = 8;  // per direction, in one picture

double zero_of(const estimate::PcuStep& step) {
  if (std::isfinite(step.step_time)) return step.step_time;
  return std::isfinite(step.start.value) ? step.start.value : step.time.front();
}

std::vector<double> since_step(const estimate::PcuStep& step) {
  std::vector<double> out = step.time;
  for (double& t : out) t -= zero_of(step);
  return out;
}

const char* direction_text(estimate::StepDirection direction) {
  return direction == estimate::StepDirection::kFilling ? "filling" : "venting";
}

std::string name_of(const estimate::PcuStep& step, std::size_t number_of_step) {
  return "step " + whole(static_cast<double>(number_of_step + 1)) + ", " + file_name(step.run);
}

/// Responses of one direction over the time since the step, and what the first-order curve leaves over.
Figure response_figure(const estimate::PcuFit& fit, estimate::StepDirection direction,
                       const ShownPressure& shown) {
  Figure figure{
      .caption =
          "Step responses, " + std::string(direction_text(direction)) +
          ": measured (wide, grey) and each step's first-order curve with dead time (coloured); below, "
          "measured less fitted. Time counts from the step of the command, or from the start of the rise "
          "where no command was recorded.",
      .panel_height = 240,
      .shared_x = true};
  Panel response{.x = {.label = "Time since the step", .unit = "s", .tight = true},
                 .y = {.label = "Pressure", .unit = shown.unit}};
  Panel rest{
      .x = response.x, .y = {.label = "Residual", .unit = shown.unit}, .lines = {{.at = 0}}, .height = 110};
  std::size_t drawn = 0;
  for (std::size_t k = 0; k < fit.steps.size() && drawn < kMostSteps; ++k) {
    const estimate::PcuStep& step = fit.steps[k];
    if (step.direction != direction || step.time.empty()) continue;
    const std::vector<double> time = since_step(step);
    const std::vector<double> measured = in_unit(step.measured, shown.per_pascal);
    const std::vector<double> predicted = in_unit(step.predicted, shown.per_pascal);
    Curve data = line("", colour::kUnderlay, time, measured);
    data.size = 3;
    Curve model = line(name_of(step, k), colour::category(drawn), time, predicted);
    model.size = 1.4;
    model.dash = drawn >= 4 ? Dash::kDashed : Dash::kSolid;
    std::vector<double> left(measured.size());
    for (std::size_t i = 0; i < left.size(); ++i) left[i] = measured[i] - predicted[i];
    Curve difference = line("", colour::category(drawn), time, left);
    difference.size = 1;
    response.curves.push_back(std::move(data));
    response.curves.push_back(std::move(model));
    rest.curves.push_back(std::move(difference));
    ++drawn;
  }
  // Wide grey data first, so that no data curve hides another step's model.
  std::stable_partition(response.curves.begin(), response.curves.end(),
                        [](const Curve& c) { return c.label.empty(); });
  figure.panels = {std::move(response), std::move(rest)};
  return figure;
}

/// All steps on one scale: 0 before, 1 after, time in units of the lag; a first-order step falls on one curve.
Figure normalised_figure(const estimate::PcuFit& fit) {
  Figure figure{.caption =
                    "All used steps on one scale: share of the step over time since the rise in units of the "
                    "step's own "
                    "lag. First-order steps fall on the dashed curve 1 − exp(−t/T).",
                .panel_height = 240};
  Panel panel{.x = {.label = "(t − t_step − L) / T_C", .unit = "-", .low = -1, .high = 6},
              .y = {.label = "Share of the step", .unit = "-", .low = -0.1, .high = 1.15}};
  std::size_t drawn = 0;
  for (std::size_t k = 0; k < fit.steps.size() && drawn < kMostSteps; ++k) {
    const estimate::PcuStep& step = fit.steps[k];
    const double size = step.level_to - step.level_from;
    if (!step.used || !(step.lag.value > 0) || !(std::abs(size) > 0) || !std::isfinite(step.start.value))
      continue;
    std::vector<double> x, y;
    for (std::size_t i = 0; i < step.time.size(); ++i) {
      const double at = (step.time[i] - step.start.value) / step.lag.value;
      if (at < -1 || at > 6) continue;
      x.push_back(at);
      y.push_back((step.measured[i] - step.level_from) / size);
    }
    panel.curves.push_back(line(name_of(step, k), colour::category(drawn), x, y));
    ++drawn;
  }
  if (panel.curves.empty()) return {};
  std::vector<double> x, y;
  for (int i = 0; i <= 140; ++i) {
    x.push_back(-1 + 0.05 * i);
    y.push_back(x.back() < 0 ? 0 : 1 - std::exp(-x.back()));
  }
  Curve ideal = line("first order", "#000000", x, y);
  ideal.dash = Dash::kDashed;
  panel.curves.push_back(std::move(ideal));
  figure.panels = {std::move(panel)};
  return figure;
}

void add_steps(Document& page, const estimate::PcuFit& fit, const ShownPressure& shown) {
  const std::string unit = " (" + pretty_unit(shown.unit) + ")";
  Table table{.caption = "Steps, each fitted by itself.",
              .columns = {{"Step", true},
                          {"File"},
                          {"Direction"},
                          {"From" + unit, true},
                          {"To" + unit, true},
                          {"T_C (s)", true},
                          {"± (s)", true},
                          {"Dead time (s)", true},
                          {"± (s)", true},
                          {"rmse" + unit, true},
                          {"First order"}}};
  for (std::size_t k = 0; k < fit.steps.size(); ++k) {
    const estimate::PcuStep& step = fit.steps[k];
    if (!step.used || !step.adequacy.first_order) table.emphasised.push_back(k);
    const Rounded lag = with_error(step.lag.value, step.lag.std_error);
    const Rounded dead = with_error(step.dead_time.value, step.dead_time.std_error);
    table.rows.push_back({whole(static_cast<double>(k + 1)), file_name(step.run),
                          direction_text(step.direction),
                          fixed_decimals(step.level_from * shown.per_pascal, 3),
                          fixed_decimals(step.level_to * shown.per_pascal, 3), lag.value, lag.error,
                          dead.value, dead.error, number(step.rmse * shown.per_pascal, 2),
                          !step.used ? "not used" : (step.adequacy.first_order ? "yes" : "no")});
  }
  page.table(table);
}

std::vector<std::string> adequacy_sentences(const estimate::PcuFit& fit, bool first_order) {
  std::vector<std::string> out;
  for (std::size_t k = 0; k < fit.steps.size(); ++k) {
    const estimate::PcuStep& step = fit.steps[k];
    if (step.used && step.adequacy.first_order == first_order && !step.adequacy.sentence.empty())
      out.push_back("Step " + whole(static_cast<double>(k + 1)) + ": " + step.adequacy.sentence);
    if (!step.used && !first_order && !step.why_not.empty())
      out.push_back("Step " + whole(static_cast<double>(k + 1)) + " is not used: " + step.why_not);
  }
  return out;
}

void add_next_steps(Document& page, const PcuReportInput& input) {
  std::vector<std::string> next;
  for (const Estimated& parameter : input.fit->parameters)
    if (!parameter.identifiable && !parameter.reason.empty())
      next.push_back("For " + parameter.name + ": " + parameter.reason);
  if (!input.fit->first_order)
    next.push_back(
        "At least one step is not of first order: use the lag only for steps of the size recorded here; the "
        "step's own sentence names the shape that comes closer.");
  if (input.fit->directions_differ)
    next.push_back("Filling and venting differ: give the controller both lags, or the slower one.");
  next.insert(next.end(), input.next_steps.begin(), input.next_steps.end());
  if (next.empty()) next.push_back("The valve unit is described; go on with the sweeps of the joint.");
  page.box(BoxKind::kNext, "What to do next", next);
}

}  // namespace

std::string render_pcu_report(const PcuReportInput& input) {
  if (input.fit == nullptr)
    throw Error(ErrorKind::kUsage, "fit_missing", "a valve report needs the fit it reports on");
  require_gnuplot();
  const estimate::PcuFit& fit = *input.fit;
  const ShownPressure shown{pressure_per_pascal(input.pressure_unit), input.pressure_unit};
  Document page = open_page(input.head, "Identification of the pressure control unit");
  std::vector<Card> cards;
  for (const char* name : {"K_C", "T_C", "dead_time"}) {
    const auto hit = std::find_if(fit.parameters.begin(), fit.parameters.end(),
                                  [&](const auto& p) { return p.name == name; });
    if (hit != fit.parameters.end()) cards.push_back({name, in_words(*hit), "over all used steps"});
  }
  cards.push_back({"rmse", number(fit.rmse * shown.per_pascal, 3) + " " + pretty_unit(shown.unit),
                   number(100 * fit.nrmse, 2) + " % of the largest step"});
  cards.push_back({"First order", fit.first_order ? "yes" : "no", "every used step"});
  page.cards(cards);
  page.box(BoxKind::kWarning, "Before you use these numbers", warning_texts(fit.warnings));
  page.heading("What was identified");
  page.equation({"p(t) = p_a + K_C (u_b − u_a) (1 − exp(−(t − t_step − L) / T_C))  for t > t_step + L",
                 "u: command, p: pressure, L: dead time; filling and venting have a T_C and an L each"});
  add_parameters(page, fit.parameters, "Parameters with standard errors and 95 % intervals.");
  add_steps(page, fit, shown);
  page.box(BoxKind::kWarning, "Where a first-order lag does not do", adequacy_sentences(fit, false));
  page.box(BoxKind::kGood, "Where it does", adequacy_sentences(fit, true));
  add_next_steps(page, input);
  page.heading("Step responses");
  page.add_figure(response_figure(fit, estimate::StepDirection::kFilling, shown));
  page.add_figure(response_figure(fit, estimate::StepDirection::kVenting, shown));
  page.add_figure(normalised_figure(fit));
  close_page(page, input.head);
  return page.html();
}

}  // namespace isac::report
