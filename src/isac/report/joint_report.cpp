#include "isac/report/joint_report.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/report/document.hpp"
#include "isac/report/joint_view.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/plotter.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

constexpr std::size_t kMostSignalFigures = 8;

std::string output_unit(const JointView& view) {
  return pretty_unit(view.output.unit);
}

void add_key_figures(Document& page, const JointView& view) {
  const estimate::JointFit& fit = *view.fit;
  const std::string unit = output_unit(view);
  const auto refused = std::count_if(fit.parameters.begin(), fit.parameters.end(),
                                     [](const Estimated& parameter) { return !parameter.identifiable; });
  std::vector<Card> cards = {
      {"rmse, fitted rows", number(fit.rmse, 3) + " " + unit, number(100 * fit.nrmse, 2) + " % of the range"},
      {"rmse, held-out rows",
       std::isfinite(fit.heldout_rmse) ? number(fit.heldout_rmse, 3) + " " + unit : "–",
       std::isfinite(fit.heldout_rmse) ? "never used for fitting" : "no run was held out"},
      {"Noise of " + view.output_symbol,
       std::isfinite(fit.noise_floor) ? number(fit.noise_floor, 2) + " " + unit : "–",
       "white part, standard deviation"},
      {"Usable rows", whole(static_cast<double>(fit.samples)),
       whole(static_cast<double>(fit.outliers)) + " treated as outliers"},
      {"Parameters",
       whole(static_cast<double>(fit.parameters.size()) - static_cast<double>(refused)) + " of " +
           whole(static_cast<double>(fit.parameters.size())),
       refused == 0 ? "all identified" : whole(static_cast<double>(refused)) + " refused"}};
  page.cards(cards);
}

/// A file's name that may be broken behind its punctuation, so that the table stays within the page; a number's sign and point stay
/// with their digits.
std::string breakable(const std::string& name) {
  const auto is_digit = [&](std::size_t i) { return i < name.size() && name[i] >= '0' && name[i] <= '9'; };
  std::string out;
  for (std::size_t i = 0; i < name.size(); ++i) {
    out += name[i];
    const bool in_number = (name[i] == '-' || name[i] == '.') && is_digit(i + 1);
    if (in_number)
      out += "\u2060";  // a browser breaks behind a hyphen of its own accord
    else if (name[i] == '_' || name[i] == '-' || name[i] == '.')
      out += "\u200b";
  }
  return out;
}

void add_runs(Document& page, const JointView& view) {
  Table table{.caption = "Runs. Speed: 95 % of the rows are slower.",
              .columns = {{"No.", true}, {"File"}, {"Experiment"}, {"Rows", true}, {"Duration (s)", true}},
              .rows = {},
              .emphasised = {}};
  if (view.has_pressure) table.columns.push_back({"Δp (" + pretty_unit(view.pressure_unit) + ")"});
  table.columns.insert(table.columns.end(), {{"Speed (" + pretty_unit(view.velocity.unit) + ")", true},
                                             {"rmse (" + output_unit(view) + ")", true},
                                             {"Held out"}});
  for (std::size_t k = 0; k < view.runs.size(); ++k) {
    const RunView& run = view.runs[k];
    const estimate::RunResidual& rows = *run.residual;
    std::vector<std::string> row = {
        whole(static_cast<double>(k + 1)), breakable(run.name),
        run.run == nullptr || run.run->experiment.empty() ? "–" : run.run->experiment,
        whole(static_cast<double>(rows.time.size())), number(rows.time.back() - rows.time.front(), 3)};
    if (view.has_pressure) {
      const double low = quantile(rows.delta_pressure, 0.02) * view.pressure_scale;
      const double high = quantile(rows.delta_pressure, 0.98) * view.pressure_scale;
      const auto rounded = [](double v) { return fixed_decimals(v, 2); };
      row.push_back(rounded(low) == rounded(high) ? rounded(low) : rounded(low) + " to " + rounded(high));
    }
    row.insert(row.end(), {number(run.speed, 2), number(run.residual->rmse, 3), rows.heldout ? "yes" : "no"});
    table.rows.push_back(std::move(row));
  }
  page.table(table);
}

std::string term_text(const JointReportInput& input, const Estimated& parameter) {
  const std::string value =
      parameter.identifiable ? with_error(parameter.value, parameter.std_error).value : parameter.name;
  const auto is = [&](const char* letter) { return find_parameter(*input.fit, letter) == &parameter; };
  if (is("A")) return value + " r² φ";
  if (is("B")) return value + " r Δp";
  if (is("C")) return "(" + value + ") φ̇³";
  if (is("D")) return "(" + value + ") φ̇";
  return value;
}

/// T = Σ terms, first with letters, then with numbers; terms beyond the seed's four by the catalogue's own text.
void add_equation(Document& page, const JointView& view) {
  const JointReportInput& input = *view.input;
  std::string letters, numbers;
  std::vector<std::string> where;
  for (const Estimated& parameter : view.fit->parameters) {
    const auto is = [&](const char* letter) { return find_parameter(*view.fit, letter) == &parameter; };
    const bool dissipative = is("C") || is("D");
    const bool known = dissipative || is("A") || is("B");
    if (!known) continue;
    std::string value = term_text(input, parameter);
    const bool plain_negative = parameter.identifiable && parameter.value < 0 && !dissipative;
    const std::string sign = dissipative || plain_negative ? " − " : " + ";
    if (plain_negative && value.starts_with("−")) value.erase(0, std::string("−").size());
    if (dissipative && parameter.identifiable &&
        parameter.value >= 0) {  // no parentheses around a positive number
      value.erase(0, 1);
      value.erase(value.find(')'), 1);
    }
    const std::string letter = is("A") ? "A r² φ" : is("B") ? "B r Δp" : is("C") ? "C φ̇³" : "D φ̇";
    letters +=
        letters.empty() ? (dissipative ? "−" + letter : letter) : (dissipative ? " − " : " + ") + letter;
    if (!parameter.identifiable) {
      where.push_back(parameter.name + " is not identified");
      value = letter;
    }
    numbers += numbers.empty() ? (sign == " − " ? "−" + value : value) : sign + value;
  }
  for (const TermText& term : input.terms) {
    const std::string sign = letters.empty() ? "" : " + ";
    letters += sign + "[" + term.equation + "]";
    numbers += sign + "[" + term.id + "]";
  }
  if (letters.empty()) return;
  std::vector<std::string> lines = {view.output_symbol + " = " + letters,
                                    view.output_symbol + " = " + numbers};
  if (view.seed_model)
    lines.push_back("with r = " + number(input.options.wheel_radius, 3) +
                    " m, φ in rad, φ̇ in rad/s, Δp = (p₂ − p₁)/2; B r Δp: B in N cm²/kg, Δp in kg/cm² (kg = "
                    "kgf), T in N m");
  for (std::string& note : where) lines.push_back(std::move(note));
  page.equation(lines);
}

void add_tests(Document& page, const JointView& view) {
  if (view.fit->tests.empty()) return;
  Table table{.caption = "Tests of the residual.",
              .columns = {{"Test"}, {"Statistic", true}, {"p-value", true}, {"Verdict"}, {"In words"}},
              .rows = {},
              .emphasised = {}};
  for (const estimate::ResidualTest& test : view.fit->tests) {
    if (!test.passed) table.emphasised.push_back(table.rows.size());
    table.rows.push_back({test.name, number(test.statistic, 3), probability(test.p_value),
                          test.passed ? "passed" : "not passed", test.sentence});
  }
  page.table(table);
}

void add(Document& page, MaybeFigure figure, std::vector<std::string>& missing) {
  if (!figure.missing.empty()) {
    missing.push_back(figure.missing + ".");
  } else if (!page.add_figure(std::move(figure.figure))) {
    missing.push_back("A figure had no finite point to draw and is left out.");
  }
}

void add_next_steps(Document& page, const JointView& view) {
  std::vector<std::string> next;
  for (const Estimated& parameter : view.fit->parameters)
    if (!parameter.identifiable) next.push_back("For " + parameter.name + ": " + parameter.reason);
  const bool heldout = std::any_of(view.runs.begin(), view.runs.end(),
                                   [](const RunView& run) { return run.residual->heldout; });
  if (!heldout)
    next.push_back(
        "Record one more run of each experiment and put it into the folder heldout/: only rows that the fit "
        "has not "
        "seen tell how far the model can be trusted.");
  if (std::any_of(view.fit->tests.begin(), view.fit->tests.end(),
                  [](const auto& test) { return !test.passed; }))
    next.push_back(
        "A test of the residual is not passed: let `isac-explain` name what is missing, or fit again with "
        "the term that its sentence names (`isac-identify joint --terms …`, terms in docs/effects.md), and "
        "keep it if the held-out runs are then predicted better.");
  next.insert(next.end(), view.input->next_steps.begin(), view.input->next_steps.end());
  if (next.empty())
    next.push_back(
        "Nothing is missing for use inside the validity box. Write the tables for the controller with "
        "`isac-identify export`, and repeat one held-out run after every change of the rig.");
  page.box(BoxKind::kNext, "What to do next", next);
}

void add_figures(Document& page, const JointView& view, std::vector<std::string>& missing) {
  page.heading("How well the model predicts");
  page.add_figure(torque_sensor_figure(view));
  page.add_figure(scatter_figure(view));
  add(page, static_figure(view), missing);

  page.heading("The physics in the plane of " + view.output_symbol + " and " + view.position_symbol);
  add(page, loops_figure(view), missing);
  add(page, pressure_family_figure(view), missing);
  add(page, bundle_figure(view), missing);
  add(page, constant_velocity_figure(view), missing);
  add(page, cut_figure(view), missing);

  page.heading("What the model leaves over");
  page.add_figure(residual_figure(view));
  page.add_figure(residual_time_figure(view));
  page.add_figure(whiteness_figure(view));
  add_tests(page, view);

  page.heading("Where the parameters hold");
  page.add_figure(validity_figure(view));

  page.heading("Recorded signals");
  if (view.has_pressure) add(page, fast_pressure_figure(view), missing);
  for (std::size_t k = 0; k < std::min(view.runs.size(), kMostSignalFigures); ++k)
    page.add_figure(signals_figure(view, view.runs[k]));
  if (view.runs.size() > kMostSignalFigures)
    missing.push_back("signals of runs " + whole(kMostSignalFigures + 1) + " to " +
                      whole(static_cast<double>(view.runs.size())) +
                      ": draw them with `isac-identify check`.");
}

}  // namespace

std::string render_joint_report(const JointReportInput& input) {
  if (input.fit == nullptr)
    throw Error(ErrorKind::kUsage, "fit_missing", "a joint report needs the fit it reports on");
  require_gnuplot();
  const JointView view = make_joint_view(input);
  std::string subtitle = input.rig;
  if (!input.created.empty()) subtitle += (subtitle.empty() ? "" : " · ") + input.created;
  Document page(input.title, subtitle);
  add_key_figures(page, view);
  page.box(BoxKind::kWarning, "Before you use these numbers", warning_texts(view.fit->warnings));
  page.heading("What was identified");
  add_equation(page, view);
  add_parameters(page, view.fit->parameters, "Parameters with standard errors and 95 % intervals.");
  std::vector<std::string> names;
  for (const Estimated& parameter : view.fit->parameters) names.push_back(parameter.name);
  page.correlation("Correlation of the estimates.", names, view.fit->correlation);
  if (view.fit->angle_zero.used) page.paragraph(view.fit->angle_zero.sentence);
  page.paragraph(
      "Standard errors hold under coloured noise: they come from " +
      whole(static_cast<double>(view.fit->blocks)) + " blocks of " + number(view.fit->block_seconds, 3) +
      " s. Velocity: " + (view.fit->differentiator.empty() ? "as recorded" : view.fit->differentiator) + ".");
  page.heading("From which runs");
  std::vector<std::string> missing;
  if (!view.runs.empty()) {
    add_runs(page, view);
    add_next_steps(page, view);
    add_figures(page, view, missing);
  } else {
    page.paragraph("The fit carries no rows to draw.");
    add_next_steps(page, view);
  }
  page.box(BoxKind::kNote, "Not shown, because the runs do not hold it", missing);
  if (!input.command.empty()) page.paragraph("Made by: " + input.command);
  return page.html();
}

}  // namespace isac::report
