#include "isac/report/motion_report.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "isac/report/document.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/report_head.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

constexpr std::size_t kMostRuns = 6;

Figure run_figure(const estimate::MotionRunResult& run, std::size_t index) {
  Figure figure{
      .id = "motion-" + std::to_string(index),
      .alt = "Measured and simulated angle of " + run.name,
      .caption =
          file_name(run.name) +
          ": measured angle (wide, grey) and the motion simulated from the command alone; below, measured "
          "less simulated (rms " +
          number(run.rmse, 3) + " rad).",
      .shared_x = true};
  Panel angle{.x = {.label = "Time", .unit = "s", .tight = true}, .y = {.label = "Angle φ", .unit = "rad"}};
  Curve measured = line("measured", colour::kUnderlay, run.time, run.measured);
  measured.size = 3;
  angle.curves = {std::move(measured), line("simulated", colour::kModel, run.time, run.predicted)};
  std::vector<double> rest(run.time.size());
  for (std::size_t i = 0; i < rest.size(); ++i) rest[i] = 1000 * (run.measured[i] - run.predicted[i]);
  Panel residual{
      .x = angle.x, .y = {.label = "Residual", .unit = "mrad"}, .lines = {{.at = 0}}, .height = 110};
  residual.curves = {line("", colour::kSecond, run.time, rest)};
  figure.panels = {std::move(angle), std::move(residual)};
  return figure;
}

}  // namespace

std::string render_motion_report(const MotionReportInput& input) {
  const estimate::MotionFit& fit = *input.fit;
  Document page = open_page(input.head, "Motion of a free joint");
  page.cards({{.label = "Residual",
               .value = number(fit.rmse, 3) + " rad",
               .note = "rms, measured less simulated angle"},
              {.label = "Rows", .value = whole(static_cast<double>(fit.samples)), .note = ""},
              {.label = "Runs", .value = whole(static_cast<double>(fit.runs.size())), .note = ""}});
  page.heading("Model");
  page.equation({"T_C q̇ = u − q", "I φ̈ = A r² φ + B r q − C φ̇³ − D φ̇ − T_c tanh(φ̇/v_s) − G sin φ"});
  page.paragraph(
      "The motion is simulated from the commanded pressure difference u alone and compared with the measured "
      "angle; nothing "
      "measured is differentiated, and no force sensor is needed.");
  page.heading("Parameters");
  add_parameters(page, fit.parameters,
                 "Identified parameters with 95 % intervals; a held parameter has no error.");
  const auto warnings = warning_texts(fit.warnings);
  if (!warnings.empty()) page.box(BoxKind::kWarning, "Warnings", warnings);
  page.heading("Measured against simulated");
  for (std::size_t i = 0; i < std::min(kMostRuns, fit.runs.size()); ++i)
    page.add_figure(run_figure(fit.runs[i], i));
  if (fit.runs.size() > kMostRuns) {
    page.paragraph(whole(static_cast<double>(fit.runs.size() - kMostRuns)) +
                   " more runs were fitted and are not drawn.");
  }
  close_page(page, input.head);
  return page.html();
}

}  // namespace isac::report
