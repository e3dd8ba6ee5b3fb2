#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/core/units.hpp"
#include "isac/report/joint_view.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

constexpr double kSlowShare = 0.3;  // a run is slow below this share of the fastest run's speed
constexpr std::size_t kMostLevels = 7;
constexpr double kLoopSeconds = 8;  // of fast movement: a few loops, not a felt of them

/// Rows of some runs that pass a test, with the pressure's part of the torque taken off where asked.
struct Rows {
  std::vector<double> angle, velocity, output, model;
};

template <typename Keep>
Rows collect(const JointView& view, bool without_pressure, Keep keep) {
  Rows out;
  for (const RunView& run : view.runs) {
    const estimate::RunResidual& rows = *run.residual;
    for (std::size_t i = 0; i < rows.time.size(); ++i) {
      if (!keep(run, i)) continue;
      const double part =
          without_pressure && i < rows.delta_pressure.size() && std::isfinite(rows.delta_pressure[i])
              ? view.b * rows.delta_pressure[i]
              : 0.0;
      out.angle.push_back(rows.angle[i]);
      out.velocity.push_back(rows.velocity[i]);
      out.output.push_back(rows.measured[i] - part);
      out.model.push_back(rows.predicted[i] - part);
    }
  }
  return out;
}

std::string speed_text(const JointView& view, double speed) {
  return number(speed, 2) + " " + pretty_unit(view.velocity.unit);
}

/// Model torque at Δp = 0 over an angle range at one velocity, seed 3.10.
Curve model_line(const JointView& view, Range angle, double velocity, std::string label,
                 const std::string& colour) {
  const std::vector<double> x = {angle.low, angle.high};
  const double c = std::isfinite(view.c) ? view.c : 0;
  const double d = std::isfinite(view.d) ? view.d : 0;
  std::vector<double> y;
  for (const double phi : x) y.push_back(view.a * phi - c * velocity * velocity * velocity - d * velocity);
  return line(std::move(label), colour, x, y);
}

/// Whole runs where they can be drawn as a line; else the seconds around the fastest movement.
Panel loop_panel(const JointView& view, const std::string& title, const RunView& run) {
  Panel panel{.title = title, .x = view.angle, .y = view.output};
  const estimate::RunResidual& rows = *run.residual;
  const auto draw = [&](Window window) {
    const auto part = [&](const std::vector<double>& v) {
      return std::span(v).subspan(window.first, window.last - window.first);
    };
    Curve measured = loop("measured", colour::kUnderlay, part(rows.angle), part(rows.measured));
    measured.size = measured.mark == Mark::kLine ? 2.4 : measured.size;
    panel.curves = {std::move(measured),
                    loop("model", colour::kModel, part(rows.angle), part(rows.predicted))};
    return panel.curves[0].mark == Mark::kLine && panel.curves[1].mark == Mark::kLine;
  };
  double seconds = rows.time.back() - rows.time.front();
  if (run.speed > kSlowShare * view.fastest) seconds = std::min(seconds, kLoopSeconds);
  while (!draw(fastest_window(rows, seconds)) && seconds > 1) seconds /= 2;
  return panel;
}

}  // namespace

MaybeFigure loops_figure(const JointView& view) {
  const std::string name =
      view.output_symbol + " over " + view.position_symbol + ", slow and fast (figs 3.3, 3.4 of the seed)";
  const auto offset = [](const RunView& run) { return std::isfinite(run.level) ? std::abs(run.level) : 0.0; };
  const RunView* slow = nullptr;
  const RunView* fast = nullptr;
  for (const RunView& run : view.runs) {
    if (!run.constant_pressure || !(run.speed > 0)) continue;
    const bool is_slow = run.speed < kSlowShare * view.fastest;
    if (!is_slow && run.speed < 0.6 * view.fastest) continue;  // neither slow nor fast
    const RunView*& best = is_slow ? slow : fast;
    if (best == nullptr || offset(run) < offset(*best)) best = &run;
  }
  if (slow == nullptr && fast == nullptr)
    return {.missing = name + ": no run at constant pressure in which the joint moves"};
  Figure figure{.caption = view.output.label + " over " + lower_first(view.angle.label) +
                           " at constant pressure, measured and as the model "
                           "gives it. The width of the loop grows with speed: that is what C and D describe.",
                .columns = slow != nullptr && fast != nullptr ? 2 : 1,
                .panel_height = 250};
  if (slow != nullptr)
    figure.panels.push_back(loop_panel(view, "up to " + speed_text(view, slow->speed), *slow));
  if (fast != nullptr)
    figure.panels.push_back(loop_panel(view, "up to " + speed_text(view, fast->speed), *fast));
  if (figure.panels.size() == 2) {
    const Range both = padded(united(data_range_y(figure.panels[0]), data_range_y(figure.panels[1])), 0.05);
    for (Panel& panel : figure.panels) {
      panel.y.low = both.low;
      panel.y.high = both.high;
    }
  }
  return {.figure = std::move(figure)};
}

MaybeFigure pressure_family_figure(const JointView& view) {
  const std::string name =
      view.output_symbol + " over " + view.position_symbol + " for several Δp (fig 3.7 of the seed)";
  std::vector<const RunView*> members;
  for (const RunView& run : view.runs)
    if (run.constant_pressure && run.speed > 0 && run.speed < kSlowShare * view.fastest &&
        std::isfinite(run.level))
      members.push_back(&run);
  std::sort(members.begin(), members.end(),
            [](const RunView* a, const RunView* b) { return a->level < b->level; });
  // Runs whose Δp differ by less than 0.1 kg/cm² show one level; the slowest of them is drawn.
  std::vector<const RunView*> levels;
  for (const RunView* run : members) {
    if (!levels.empty() && run->level - levels.back()->level < 0.1 * kPascalPerKgfCm2) {
      if (run->speed < levels.back()->speed) levels.back() = run;
    } else {
      levels.push_back(run);
    }
  }
  if (levels.size() < 2) return {.missing = name + ": needs slow runs at two or more constant Δp"};
  std::vector<const RunView*> shown;
  for (std::size_t k = 0; k < std::min(levels.size(), kMostLevels); ++k)
    shown.push_back(levels[k * (levels.size() - 1) / (std::min(levels.size(), kMostLevels) - 1)]);
  Figure figure{
      .caption = view.output.label + " over " + lower_first(view.angle.label) +
                 " for constant pressure differences Δp in " + pretty_unit(view.pressure_unit) +
                 " (the slowest run of each)" +
                 (view.seed_model ? "; thin black lines: static part of the model, A r² φ + B r Δp." : "."),
      .panel_height = 330};
  Panel panel{.x = view.angle, .y = view.output};
  for (std::size_t k = 0; k < shown.size(); ++k) {
    const estimate::RunResidual& rows = *shown[k]->residual;
    panel.curves.push_back(dots("Δp = " + fixed_decimals(shown[k]->level * view.pressure_scale, 1),
                                colour::ordered(k, shown.size()), rows.angle, rows.measured, 700, 2.6));
  }
  for (const RunView* run : shown) {
    if (!view.seed_model) break;
    const Range angle = range_of(run->residual->angle);
    const std::vector<double> x = {angle.low, angle.high};
    const std::vector<double> y = {view.a * x[0] + view.b * run->level, view.a * x[1] + view.b * run->level};
    Curve model = line("", "#000000", x, y);
    model.size = 0.9;
    panel.curves.push_back(std::move(model));
  }
  figure.panels = {std::move(panel)};
  return {.figure = std::move(figure)};
}

MaybeFigure bundle_figure(const JointView& view) {
  const std::string name = "bundle of hysteresis curves (fig 3.8 of the seed)";
  if (!view.seed_model) return {.missing = name + ": A and B are not both identified"};
  const Rows rows =
      collect(view, true, [](const RunView& run, std::size_t) { return run.constant_pressure; });
  if (rows.angle.size() < 2) return {.missing = name + ": no run at constant pressure"};
  Figure figure{.caption = "Bundle: " + lower_first(view.output.label) +
                           " less its pressure part B r Δp over " + lower_first(view.angle.label) +
                           ", all runs at constant pressure. Dashed: A r² φ.",
                .panel_height = 260};
  Panel panel{.x = view.angle, .y = view.output};
  panel.y.label = "T − B r Δp";
  panel.curves = scatter(rows.angle, rows.output, kPixelColumns, 260);
  Curve still = model_line(view, range_of(rows.angle), 0, "", "#222222");
  still.dash = Dash::kDashed;
  still.size = 1.2;
  panel.curves.push_back(std::move(still));
  figure.panels = {std::move(panel)};
  return {.figure = std::move(figure)};
}

MaybeFigure constant_velocity_figure(const JointView& view) {
  const std::string name = "points of constant velocity (fig 3.9 of the seed)";
  if (!view.seed_model) return {.missing = name + ": A and B are not both identified"};
  if (!(view.fastest > 0)) return {.missing = name + ": the joint never moves"};
  Figure figure{
      .caption =
          "Points of constant velocity (within 4 % of the fastest speed, and 8 % of it either way for 50 ms "
          "before and after) lie on straight lines, shifted by the damping. Lines: the fitted model.",
      .panel_height = 290};
  Panel panel{.x = view.angle, .y = view.output};
  panel.y.label = "T − B r Δp";
  std::vector<Curve> lines;
  std::size_t k = 0;
  for (const double share : {0.75, 0.3, -0.3, -0.75}) {
    const double target = share * view.fastest;
    const auto steady = [&](const RunView& run, std::size_t i) {
      const estimate::RunResidual& rows = *run.residual;
      if (!(std::abs(rows.velocity[i] - target) < 0.04 * view.fastest)) return false;
      for (const std::ptrdiff_t step : {-1, 1}) {
        std::ptrdiff_t j = static_cast<std::ptrdiff_t>(i);
        while (j + step >= 0 && j + step < static_cast<std::ptrdiff_t>(rows.time.size()) &&
               std::abs(rows.time[static_cast<std::size_t>(j)] - rows.time[i]) < 0.05)
          j += step;
        if (!(std::abs(rows.velocity[static_cast<std::size_t>(j)] - target) < 0.08 * view.fastest))
          return false;
      }
      return true;
    };
    const Rows rows = collect(view, true, steady);
    const std::string shade = colour::category(k++);
    if (rows.angle.size() < 5) continue;
    panel.curves.push_back(dots(view.velocity_symbol + " = " + speed_text(view, target), shade, rows.angle,
                                rows.output, 500, 3));
    lines.push_back(model_line(view, range_of(rows.angle), target, "", shade));
  }
  if (panel.curves.empty()) return {.missing = name + ": the velocity is nowhere constant long enough"};
  panel.curves.insert(panel.curves.end(), lines.begin(), lines.end());
  figure.panels = {std::move(panel)};
  return {.figure = std::move(figure)};
}

MaybeFigure cut_figure(const JointView& view) {
  const estimate::VelocityCut& cut = view.fit->cut;
  if (cut.velocity.size() < 3)
    return {.missing =
                "torque offset over velocity (fig 3.10 of the seed): too few stretches of constant velocity "
                "near " +
                view.position_symbol + " = 0"};
  const Range range = padded(range_of(cut.velocity), 0.03);
  std::vector<double> w(121);
  for (std::size_t i = 0; i < w.size(); ++i) w[i] = range.low + range.span() * static_cast<double>(i) / 120;
  const auto cubic = [&](double c, double d) {
    std::vector<double> y;
    for (const double v : w) y.push_back(-c * v * v * v - d * v);
    return y;
  };
  std::vector<double> half = cut.std_error;
  half.resize(cut.velocity.size(), 0.0);
  for (double& h : half) h *= 1.96;
  Figure figure{
      .caption =
          "Cut of the bundle at " + view.position_symbol +
          " = 0: torque offset over velocity with 95 % bars, "
          "and the cubic −C φ̇³ − D φ̇ of the cut itself and of the fit over all rows. Two ways to the same "
          "numbers: where the curves part, do not trust C and D.",
      .panel_height = 260};
  Panel panel{.x = view.velocity,
              .y = view.output,
              .lines = {{.at = 0, .label = {}}, {.vertical = true, .at = 0, .label = {}}}};
  panel.y.label = "Torque offset";
  if (std::isfinite(view.c) && std::isfinite(view.d))
    panel.curves.push_back(line("fit over all rows", colour::kModel, w, cubic(view.c, view.d)));
  if (std::isfinite(cut.C.value) && std::isfinite(cut.D.value)) {
    Curve own = line("cubic through the cut", colour::kSecond, w, cubic(cut.C.value, cut.D.value));
    own.dash = Dash::kDashed;
    panel.curves.push_back(std::move(own));
  }
  panel.curves.push_back(error_bars("cut at " + view.position_symbol + " = 0", "#222222", cut.velocity,
                                    cut.torque_offset, half));
  figure.panels = {std::move(panel)};
  return {.figure = std::move(figure)};
}

Figure validity_figure(const JointView& view) {
  std::vector<double> angle, velocity, pressure;
  for (const RunView& run : view.runs) {
    if (run.residual->heldout) continue;
    angle.insert(angle.end(), run.residual->angle.begin(), run.residual->angle.end());
    velocity.insert(velocity.end(), run.residual->velocity.begin(), run.residual->velocity.end());
    const std::vector<double> p = scaled(run.residual->delta_pressure, view.pressure_scale);
    pressure.insert(pressure.end(), p.begin(), p.end());
  }
  const ValidityBox& box = view.fit->box;
  Figure figure{
      .caption =
          "Where the parameters hold: the rows that were fitted, and the box written into the parameter file "
          "(green). Outside the box the model extrapolates.",
      .columns = view.has_pressure ? 3 : 1,
      .panel_height = 180};
  const auto add = [&](const Axis& x_axis, const std::vector<double>& x, Range bx, const Axis& y_axis,
                       const std::vector<double>& y, Range by) {
    Panel panel{.x = x_axis, .y = y_axis};
    panel.curves = scatter(x, y, view.has_pressure ? 170 : kPixelColumns, 180);
    if (std::isfinite(bx.low + bx.high + by.low + by.high))
      panel.boxes.push_back({.x_low = bx.low, .x_high = bx.high, .y_low = by.low, .y_high = by.high});
    figure.panels.push_back(std::move(panel));
  };
  const Range phi{box.angle_low, box.angle_high};
  const Range rate{box.speed_low, box.speed_high};
  const Range delta{box.delta_pressure_low * view.pressure_scale,
                    box.delta_pressure_high * view.pressure_scale};
  add(view.angle, angle, phi, view.velocity, velocity, rate);
  if (view.has_pressure) {
    add(view.angle, angle, phi, view.pressure_difference, pressure, delta);
    add(view.velocity, velocity, rate, view.pressure_difference, pressure, delta);
  }
  return figure;
}

}  // namespace isac::report
