#include "isac/report/joint_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "isac/core/units.hpp"
#include "isac/report/report_head.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::vector<double> magnitudes(const std::vector<double>& values) {
  std::vector<double> out(values.size());
  std::transform(values.begin(), values.end(), out.begin(), [](double v) { return std::abs(v); });
  return out;
}

double si_value(const estimate::JointFit& fit, const std::string& name, double si_per_unit) {
  const Estimated* parameter = find_parameter(fit, name);
  return parameter != nullptr && parameter->identifiable ? parameter->value * si_per_unit : kNaN;
}

}  // namespace

const Estimated* find_parameter(const estimate::JointFit& fit, const std::string& name) noexcept {
  // The seed's letters and the catalogue's ids are two names of one term.
  constexpr std::array<std::array<const char*, 2>, 4> kAlias = {
      {{"A", "stiffness"}, {"B", "pressure"}, {"C", "cubic_damping"}, {"D", "viscous_damping"}}};
  std::string other = name;
  for (const auto& [letter, id] : kAlias)
    if (name == letter) other = id;
  const auto hit = std::find_if(
      fit.parameters.begin(), fit.parameters.end(),
      [&](const Estimated& parameter) { return parameter.name == name || parameter.name == other; });
  return hit == fit.parameters.end() ? nullptr : &*hit;
}

std::vector<double> scaled(std::span<const double> values, double factor) {
  std::vector<double> out(values.size());
  std::transform(values.begin(), values.end(), out.begin(), [factor](double v) { return v * factor; });
  return out;
}

std::vector<double> residuals(const estimate::RunResidual& run) {
  std::vector<double> out(std::min(run.measured.size(), run.predicted.size()));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = run.measured[i] - run.predicted[i];
  return out;
}

Window fastest_window(const estimate::RunResidual& run, double seconds) {
  const std::size_t n = run.time.size();
  if (n == 0) return {};
  std::size_t peak = 0;
  for (std::size_t i = 0; i < std::min(n, run.velocity.size()); ++i)
    if (std::abs(run.velocity[i]) > std::abs(run.velocity[peak])) peak = i;
  const double start =
      std::max(run.time.front(), std::min(run.time[peak] - seconds / 2, run.time.back() - seconds));
  const auto first = std::lower_bound(run.time.begin(), run.time.end(), start);
  const auto last = std::upper_bound(first, run.time.end(), start + seconds);
  return {static_cast<std::size_t>(first - run.time.begin()),
          static_cast<std::size_t>(last - run.time.begin())};
}

JointView make_joint_view(const JointReportInput& input) {
  JointView view;
  view.input = &input;
  view.fit = input.fit;
  view.pressure_scale = pressure_per_pascal(input.pressure_unit);
  view.pressure_unit = input.pressure_unit;

  const bool linear = input.options.position_unit == "m";
  view.position_symbol = linear ? "x" : "φ";
  view.velocity_symbol = linear ? "v" : "φ̇";
  const bool torque = input.options.output_unit == "N m" || input.options.output_unit == "Nm";
  view.output_symbol = torque ? "T" : "F";
  view.time = {.label = "Time t", .unit = "s", .tight = true};
  view.angle = {.label = linear ? "Position x" : "Joint angle φ", .unit = input.options.position_unit};
  view.velocity = {.label = linear ? "Velocity v" : "Velocity φ̇", .unit = input.options.position_unit + "/s"};
  view.pressure_difference = {.label = "Δp", .unit = input.pressure_unit};
  view.output = {.label = torque ? "Torque T" : "Force F", .unit = input.options.output_unit};
  view.residual = {.label = "Residual", .unit = input.options.output_unit};

  std::vector<double> levels;
  for (const estimate::RunResidual& residual : view.fit->runs) {
    if (residual.time.empty()) continue;
    RunView run{.residual = &residual, .name = file_name(residual.name)};
    run.speed = quantile(magnitudes(residual.velocity), 0.95);
    if (!std::isfinite(run.speed)) run.speed = 0;
    run.level = quantile(residual.delta_pressure, 0.5);
    for (const auto& group : {input.runs, input.heldout})
      for (const estimate::JointRun& candidate : group)
        if (candidate.name == residual.name) run.run = &candidate;
    levels.insert(levels.end(),
                  {quantile(residual.delta_pressure, 0.02), quantile(residual.delta_pressure, 0.98)});
    view.fastest = std::max(view.fastest, run.speed);
    view.has_pressure = view.has_pressure || std::isfinite(run.level);
    view.runs.push_back(run);
  }
  const Range pressures = range_of(levels);
  for (RunView& run : view.runs) {
    const auto& delta = run.residual->delta_pressure;
    const double moves = quantile(delta, 0.98) - quantile(delta, 0.02);
    const double allowed = std::max(0.05 * pressures.span(), 0.05 * kPascalPerKgfCm2);
    run.constant_pressure = delta.empty() || !(moves > allowed);
    const std::string experiment = run.run == nullptr ? std::string() : run.run->experiment;
    if (experiment == "constant-pressure") run.constant_pressure = true;
    if (experiment == "constant-angle") run.constant_pressure = false;
  }
  const double r = input.options.wheel_radius;
  view.a = si_value(*view.fit, "A", r * r);
  view.b = si_value(*view.fit, "B", r / kPascalPerKgfCm2);
  view.c = si_value(*view.fit, "C", 1);
  view.d = si_value(*view.fit, "D", 1);
  view.seed_model = std::isfinite(view.a) && std::isfinite(view.b);
  return view;
}

}  // namespace isac::report
