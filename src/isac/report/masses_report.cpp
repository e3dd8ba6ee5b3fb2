#include "isac/report/masses_report.hpp"

#include <cmath>

#include "isac/core/error.hpp"
#include "isac/report/document.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/plotter.hpp"
#include "isac/report/report_head.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

constexpr double kDegrees = 57.29577951308232;

Figure residual_figure(const MassesReportInput& input) {
  const estimate::MassFit& fit = *input.fit;
  Figure figure{.caption =
                    "Residual of every pose, joint by joint; the band is two standard deviations of one "
                    "torque. Poses stand in the order of the file.",
                .panel_height = 260};
  Panel panel{
      .x = {.label = "Pose", .low = 0, .high = static_cast<double>(fit.poses.size()) + 1, .whole = true},
      .y = {.label = "Measured less predicted torque", .unit = "N m"},
      .lines = {{.at = 0}}};
  if (std::isfinite(fit.torque_noise) && fit.torque_noise > 0) {
    const double end = static_cast<double>(fit.poses.size()) + 1, wide = 2 * fit.torque_noise;
    panel.boxes.push_back({.x_low = 0, .x_high = end, .y_low = -wide, .y_high = wide});
  }
  for (int joint = 0; joint < input.joints; ++joint) {
    std::vector<double> x, y;
    for (const estimate::MassRow& row : fit.rows) {
      if (row.joint != joint) continue;
      x.push_back(static_cast<double>(row.pose + 1));
      y.push_back(row.residual);
    }
    if (x.empty()) continue;
    panel.curves.push_back(
        dots("joint " + whole(joint + 1), colour::category(static_cast<std::size_t>(joint)), x, y, 1500, 5));
  }
  figure.panels = {std::move(panel)};
  return figure;
}

Figure prediction_figure(const MassesReportInput& input) {
  Figure figure{
      .caption = "Measured torque of gravity over the one that the masses predict; the line is equality.",
      .panel_height = 300};
  Panel panel{.x = {.label = "Predicted torque", .unit = "N m"},
              .y = {.label = "Measured torque", .unit = "N m"}};
  double low = 0, high = 0;
  for (int joint = 0; joint < input.joints; ++joint) {
    std::vector<double> x, y;
    for (const estimate::MassRow& row : input.fit->rows) {
      if (row.joint != joint) continue;
      x.push_back(row.predicted);
      y.push_back(row.measured);
      low = std::min(low, row.predicted);
      high = std::max(high, row.predicted);
    }
    if (x.empty()) continue;
    panel.curves.push_back(
        dots("joint " + whole(joint + 1), colour::category(static_cast<std::size_t>(joint)), x, y, 1500, 5));
  }
  if (high > low) {
    const std::vector<double> ends{low, high};
    Curve equal = line("", colour::kReference, ends, ends);
    equal.dash = Dash::kDashed;
    panel.curves.insert(panel.curves.begin(), std::move(equal));
  }
  figure.panels = {std::move(panel)};
  return figure;
}

void add_poses(Document& page, const MassesReportInput& input) {
  Table table{
      .caption = "Poses, residual of each joint in N m, and how likely residuals as large are by chance.",
      .columns = {{"Pose"}}};
  for (int j = 0; j < input.joints; ++j) table.columns.push_back({"Joint " + whole(j + 1), true});
  table.columns.push_back({"p", true});
  table.columns.push_back({"Verdict"});
  for (std::size_t p = 0; p < input.fit->poses.size(); ++p) {
    const estimate::MassPoseResult& pose = input.fit->poses[p];
    std::vector<std::string> cells(static_cast<std::size_t>(input.joints) + 3, "–");
    cells.front() = pose.name;
    for (const estimate::MassRow& row : input.fit->rows)
      if (row.pose == p) cells[static_cast<std::size_t>(row.joint) + 1] = fixed_decimals(row.residual, 3);
    cells[cells.size() - 2] = probability(pose.p_value);
    cells.back() = pose.left_out ? "left out" : pose.outlier ? "out of line" : "in line";
    if (pose.left_out || pose.outlier) table.emphasised.push_back(p);
    table.rows.push_back(std::move(cells));
  }
  page.table(table);
}

void add_design(Document& page, const MassesReportInput& input) {
  if (input.design == nullptr || input.design->theta.empty()) return;
  const estimate::PoseDesign& design = *input.design;
  page.heading("Poses to hold next");
  Table errors{.caption = "Standard errors of the masses (kg) that these poses promise, all joints measured.",
               .columns = {{"Mass"}, {"These poses", true}, {"As many random poses", true}}};
  if (!design.with_recorded.empty()) errors.columns.push_back({"With those recorded", true});
  for (std::size_t k = 0; k < design.std_errors.size() && k < input.mass_names.size(); ++k) {
    errors.rows.push_back({input.mass_names[k], fixed_decimals(design.std_errors[k], 4),
                           fixed_decimals(design.random_std_errors[k], 4)});
    if (!design.with_recorded.empty())
      errors.rows.back().push_back(fixed_decimals(design.with_recorded[k], 4));
  }
  page.table(errors);
  Table poses{.caption = "Arm angles θ in deg. Hold each once from either side, so that friction cancels.",
              .columns = {{"Pose", true}}};
  for (int j = 0; j < input.joints; ++j) poses.columns.push_back({"θ" + whole(j + 1), true});
  for (std::size_t i = 0; i < design.theta.size(); ++i) {
    std::vector<std::string> cells{whole(static_cast<double>(i + 1))};
    for (int j = 0; j < input.joints; ++j)
      cells.push_back(fixed_decimals(design.theta[i][static_cast<std::size_t>(j)] * kDegrees, 1));
    poses.rows.push_back(std::move(cells));
  }
  page.table(poses);
}

}  // namespace

std::string render_masses_report(const MassesReportInput& input) {
  if (input.fit == nullptr)
    throw Error(ErrorKind::kUsage, "fit_missing", "a report of masses needs the fit it reports on");
  require_gnuplot();
  const estimate::MassFit& fit = *input.fit;
  Document page = open_page(input.head, "Masses of the arm");
  std::vector<Card> cards;
  for (std::size_t k = 0; k < fit.masses.size(); ++k) {
    std::string note;
    if (fit.masses[k].identifiable && k < fit.model_errors.size() && fit.model_errors[k] > 0)
      note = "of the error, " + number(fit.model_errors[k], 2) + " kg is the actuators' model";
    cards.push_back({fit.masses[k].name, in_words(fit.masses[k]), note});
  }
  cards.push_back(
      {"rmse", number(fit.rmse, 3) + " N m", whole(static_cast<double>(fit.poses.size())) + " poses"});
  cards.push_back({"Left over to check with", whole(static_cast<double>(fit.degrees_of_freedom)),
                   "torques beyond the unknowns"});
  cards.push_back({"Condition", number(fit.condition, 3), "of the lever arms"});
  page.cards(cards);
  page.box(BoxKind::kWarning, "Before you use these numbers", warning_texts(fit.warnings));
  page.heading("What was identified");
  page.equation({"τ_j = Σ_k m_k g · (z_j × (q_k − o_j))",
                 "q_k: place of mass k, z_j and o_j: axis and origin of joint j, g: gravity"});
  std::vector<Estimated> parameters = fit.masses;
  parameters.insert(parameters.end(), fit.others.begin(), fit.others.end());
  add_parameters(page, parameters, "Masses with standard errors and 95 % intervals.");
  page.heading("What the poses say");
  page.add_figure(residual_figure(input));
  page.add_figure(prediction_figure(input));
  add_poses(page, input);
  add_design(page, input);
  close_page(page, input.head);
  return page.html();
}

}  // namespace isac::report
