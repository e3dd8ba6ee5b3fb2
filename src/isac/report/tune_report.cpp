#include "isac/report/tune_report.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/report/document.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/plotter.hpp"
#include "isac/report/report_head.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

using TuneCandidate = tune::Candidate;

constexpr double kDegreesPerRadian = 180 / kPi;

const TuneCandidate* chosen_of(const TuneReportInput& input) {
  return input.tuning != nullptr && input.tuning->chosen ? &input.tuning->candidates[*input.tuning->chosen]
                                                         : nullptr;
}

/// The record and, where a plant could be fitted, the plant and what is left over.
Figure experiment_figure(const TuneReportInput& input) {
  const bool fitted = input.fit != nullptr && !input.fit->predicted.empty();
  const tune::ExperimentRecord& record = fitted ? input.fit->record : input.record;
  std::string caption = "The " + input.experiment + ": angle as measured and the command.";
  if (fitted)
    caption = "The " + input.experiment +
              ": angle as measured (wide, grey) and of the fitted plant, what is left between them, and the "
              "command; the plant leaves " +
              number(100 * input.fit->misfit, 2) + " % of the motion beyond the noise at rest.";
  Figure figure{.id = "tune-experiment",
                .alt = "Angle and command during the experiment",
                .caption = std::move(caption),
                .shared_x = true};
  const Axis time{.label = "Time", .unit = "s", .tight = true};
  const auto in_mrad = [](std::vector<double> angle) {
    for (double& a : angle) a *= 1e3;
    return angle;
  };
  Panel angle{.x = time, .y = {.label = "Angle φ", .unit = "mrad"}};
  Curve measured = line("measured", colour::kUnderlay, record.time, in_mrad(record.angle));
  measured.size = 3;
  angle.curves = {std::move(measured)};
  if (fitted)
    angle.curves.push_back(line("fitted plant", colour::kModel, record.time, in_mrad(input.fit->predicted)));
  figure.panels = {std::move(angle)};
  if (fitted) {
    std::vector<double> left = record.angle;
    for (std::size_t k = 0; k < left.size(); ++k) left[k] -= input.fit->predicted[k];
    Panel residual{.x = time, .y = {.label = "Left", .unit = "mrad"}, .height = 90};
    residual.curves = {line("", colour::kMeasured, record.time, in_mrad(std::move(left)))};
    figure.panels.push_back(std::move(residual));
  }
  std::vector<double> command = record.command;
  for (double& u : command) u /= kPascalPerKgfCm2;
  Panel below{.x = time, .y = {.label = "Δp", .unit = "kg/cm²"}, .height = 90};
  below.curves = {line("", colour::kSecond, record.time, command)};
  below.curves[0].mark = Mark::kSteps;
  figure.panels.push_back(std::move(below));
  return figure;
}

/// Gain and phase of one loop; the phase unwrapped, in degrees.
void add_bode(Figure& figure, const tune::JointModel& model, const TuneCandidate& c, const char* label,
              const char* shade, Dash dash) {
  std::vector<double> frequency, size, phase;
  double last = 0;
  for (const tune::FrequencyPoint& p : tune::trace_response(tune::control_loop(model, c.gains))) {
    const double hertz = p.omega / (2 * kPi);
    if (hertz < 0.02 || hertz > 50) continue;
    double angle = std::arg(p.value) * kDegreesPerRadian;
    if (phase.empty() && angle > 0) angle -= 360;
    if (!phase.empty()) angle += 360 * std::round((last - angle) / 360);
    last = angle;
    frequency.push_back(hertz);
    size.push_back(std::abs(p.value));
    phase.push_back(angle);
  }
  Curve gain{.label = label, .colour = shade, .x = frequency, .y = size, .size = 1.8, .dash = dash};
  Curve turn{.colour = shade, .x = frequency, .y = phase, .size = 1.8, .dash = dash};
  figure.panels[0].curves.push_back(std::move(gain));
  figure.panels[1].curves.push_back(std::move(turn));
}

Figure bode_figure(const TuneReportInput& input, const TuneCandidate& chosen) {
  const tune::Margins& m = chosen.figures.margins;
  Figure figure{.id = "tune-bode",
                .alt = "Frequency response of the loop with its margins",
                .caption =
                    "Frequency response of the loop opened at the valves, dead time and sampling included. "
                    "Dashed verticals: where |L| = 1 "
                    "(the phase margin is what is left to −180° there) and where the phase is −180° (the "
                    "gain margin is 1/|L| there).",
                .shared_x = true};
  const Axis frequency{.label = "Frequency", .unit = "Hz", .tight = true, .log = true};
  figure.panels = {
      {.x = frequency, .y = {.label = "|L|", .log = true}, .lines = {{.at = 1}}},
      {.x = frequency, .y = {.label = "Phase", .unit = "°"}, .lines = {{.at = -180, .label = "−180°"}}}};
  if (input.tuning->before)
    add_bode(figure, *input.model, *input.tuning->before, "before", colour::kReference, Dash::kDashed);
  add_bode(figure, *input.model, chosen, "new gains", colour::kModel, Dash::kSolid);
  for (const auto& [omega, label] :
       {std::pair{m.gain_crossover, "phase margin"}, {m.phase_crossover, "gain margin"}}) {
    const double hertz = omega / (2 * kPi);
    if (!(hertz > 0.02 && hertz < 50)) continue;
    figure.panels[0].lines.push_back({.vertical = true, .at = hertz, .label = label});
    figure.panels[1].lines.push_back({.vertical = true, .at = hertz});
  }
  return figure;
}

Figure time_figure(const TuneReportInput& input, const TuneCandidate& chosen, bool step) {
  const auto run = [&](const TuneCandidate& c) {
    return step ? tune::run_step(*input.model, *input.model, c.gains)
                : tune::run_trajectory(*input.model, *input.model, c.gains);
  };
  Figure figure{.id = step ? "tune-step" : "tune-trajectory",
                .alt = step ? "Step response before and after" : "Trajectory before and after",
                .caption = step ? "Simulated step of 0.3 rad on the nonlinear joint: angle, and the Δp asked "
                                  "of the valves. The reference rises no faster "
                                  "than the speed limit."
                                : "Simulated trajectory by which gains are compared: two smooth moves, then "
                                  "0.15 sin 2t with a load of 0.3 N m that the "
                                  "controller is not told of.",
                .shared_x = true};
  const Axis time{.label = "Time", .unit = "s", .tight = true};
  figure.panels = {{.x = time, .y = {.label = "Angle φ", .unit = "rad"}},
                   {.x = time, .y = {.label = "Δp", .unit = "kg/cm²"}, .height = 110}};
  bool first = true;
  const auto add = [&](const TuneCandidate& c, const char* label, const char* shade, Dash dash) {
    const tune::Trace t = run(c);
    if (first) figure.panels[0].curves.push_back(line("reference", colour::kMeasured, t.time, t.reference));
    first = false;
    std::vector<double> command = t.delta_pressure;
    for (double& u : command) u /= kPascalPerKgfCm2;
    for (auto& [panel, values] :
         {std::pair<std::size_t, const std::vector<double>&>{0, t.angle}, {1, command}}) {
      Curve c2 = line(panel == 0 ? label : "", shade, t.time, values);
      c2.dash = dash;
      figure.panels[panel].curves.push_back(std::move(c2));
    }
  };
  if (input.tuning->before) add(*input.tuning->before, "before", colour::kSecond, Dash::kDashed);
  add(chosen, "new gains", colour::kModel, Dash::kSolid);
  return figure;
}

std::string structure_name(const tune::Gains& g) {
  switch (g.structure) {
    case control::Structure::kPid:
      return "PID";
    case control::Structure::kCascade:
      return "PI-PI";
    case control::Structure::kModelBased:
      break;
  }
  return "PI-MBPI";
}

void add_candidates(Document& page, const TuneReportInput& input) {
  Table table{
      .caption =
          "Every rule on the same " +
          whole(static_cast<double>(input.tuning->candidates.front().figures.draws)) +
          " joints that the parameters allow. Tracking error: rms along the trajectory below, "
          "mean and 95 % quantile; overshoot and "
          "modulus margin: what the worse 5 % of the joints have; effort: rms of Δp's change per second.",
      .columns = {{"Gains"},
                  {"Loop"},
                  {"Tracking (mrad)", true},
                  {"95 % (mrad)", true},
                  {"Overshoot (%)", true},
                  {"Modulus margin", true},
                  {"Effort (kg/cm² s)", true},
                  {"Stable (%)", true},
                  {"Within limits (%)", true}}};
  const auto add = [&](const TuneCandidate& c) {
    const tune::Assessment& a = c.figures;
    if (a.draws == 0) return;
    const bool lost = a.overshoot_p95 >= 5;
    table.rows.push_back({c.name, structure_name(c.gains), lost ? "–" : fixed_decimals(1e3 * a.tracking, 1),
                          lost ? "–" : fixed_decimals(1e3 * a.tracking_p95, 1),
                          lost ? "–" : fixed_decimals(100 * a.overshoot_p95, 1),
                          fixed_decimals(a.modulus_p05, 2), fixed_decimals(a.effort / kPascalPerKgfCm2, 1),
                          fixed_decimals(100 * a.stable_share, 1), fixed_decimals(100 * a.good_share, 1)});
  };
  if (input.tuning->before) add(*input.tuning->before);
  for (std::size_t i = 0; i < input.tuning->candidates.size(); ++i) {
    if (input.tuning->chosen == i) table.emphasised.push_back(table.rows.size());
    add(input.tuning->candidates[i]);
  }
  page.table(table);
}

void add_gains(Document& page, const TuneReportInput& input, const TuneCandidate& chosen) {
  Table table{.caption = "Gains of PI-MBPI, in the units of params.toml.",
              .columns = {{"Gain"}, {"Unit"}, {"before", true}, {"new", true}}};
  const auto before = [&](double control::PidGains<double>::*member, bool torque) {
    if (!input.tuning->before) return std::string("–");
    const tune::Gains& g = input.tuning->before->gains;
    return number((torque ? g.torque : g.position).*member / (torque ? kPascalPerKgfCm2 : 1), 4);
  };
  const tune::Gains& g = chosen.gains;
  using K = control::PidGains<double>;
  table.rows = {
      {"K_P position", "N m/rad", before(&K::proportional, false), number(g.position.proportional, 4)},
      {"K_I position", "N m/(rad s)", before(&K::integral, false), number(g.position.integral, 4)},
      {"K_P torque", "kg/cm² per N m", before(&K::proportional, true),
       number(g.torque.proportional / kPascalPerKgfCm2, 4)},
      {"K_I torque", "kg/cm² per N m s", before(&K::integral, true),
       number(g.torque.integral / kPascalPerKgfCm2, 4)}};
  page.table(table);
}

std::string finite_or(double value, const std::string& text, const char* otherwise) {
  return std::isfinite(value) ? text : otherwise;
}

}  // namespace

std::string render_tune_report(const TuneReportInput& input) {
  require_gnuplot();
  Document page = open_page(input.head, "Tuning of a joint");
  const TuneCandidate* chosen = chosen_of(input);
  const std::string& refusal = input.refusal;
  if (refusal.empty() && chosen != nullptr)
    page.box(BoxKind::kGood, "The gains hold their limits",
             {input.deployed.empty()
                  ? "They were not written to a file; give -o params.toml to deploy them."
                  : "They are in " + input.deployed + "; the old file is kept beside it as .bak."});
  else
    page.box(BoxKind::kWarning, "The old gains stay", {"No new gains were written: " + refusal + "."});
  if (chosen != nullptr) {
    const tune::Assessment& a = chosen->figures;
    page.cards(
        {{.label = "Tracking error",
          .value = fixed_decimals(1e3 * a.tracking, 1) + " mrad",
          .note = "rms along the trajectory"},
         {.label = "Overshoot",
          .value = fixed_decimals(100 * a.overshoot_p95, 1) + " %",
          .note = "worst twentieth of the joints"},
         {.label = "Modulus margin",
          .value = fixed_decimals(a.modulus_p05, 2),
          .note = "worst twentieth; asked for " + fixed_decimals(input.limits.modulus, 2)},
         {.label = "Phase margin",
          .value = finite_or(a.margins.phase, fixed_decimals(a.margins.phase * kDegreesPerRadian, 0) + "°",
                             "none"),
          .note = "delay margin " + (a.margins.delay > 1 ? std::string("above 1 s")
                                                         : fixed_decimals(1e3 * a.margins.delay, 0) + " ms")},
         {.label = "Gain margin",
          .value = finite_or(a.margins.gain, fixed_decimals(a.margins.gain, 2), "any"),
          .note = "factor"}});
  }
  page.box(BoxKind::kWarning, "Before you use these gains", warning_texts(input.warnings));
  if (chosen != nullptr && chosen->figures.draws > 0) {
    page.heading("Gains");
    add_gains(page, input, *chosen);
    add_candidates(page, input);
  }
  if (input.fit != nullptr && !input.fit->predicted.empty()) {
    page.heading("What the experiment found");
    page.equation({"φ/Δp = K e^(−L s) / ((1 + T_C s)(1 + 2 ζ T_J s + T_J² s²))"});
    add_parameters(page, input.fit->parameters, "The plant, with 95 % intervals.");
    add_parameters(page, input.fit->derived,
                   "What follows from it: ultimate gain and period, latency and adjustment time of the whole "
                   "and of the joint alone.");
    page.add_figure(experiment_figure(input));
  } else if (!input.record.time.empty()) {
    page.heading("What the experiment saw");
    page.add_figure(experiment_figure(input));
  }
  if (chosen != nullptr) {
    page.heading("Step before and after");
    page.add_figure(time_figure(input, *chosen, true));
    page.heading("Trajectory before and after");
    page.add_figure(time_figure(input, *chosen, false));
    page.heading("Margins");
    page.add_figure(bode_figure(input, *chosen));
  }
  close_page(page, input.head);
  return page.html();
}

}  // namespace isac::report
