/// @file
/// What the joint report's figures share: names and units of the axes, classes of runs, parts of the model.
///
/// Internal to the report room. Units: SI in the data, `pressure_scale` leads to the shown unit. Threads: values.
/// Errors: make_joint_view throws isac::Error (usage) for a pressure unit that is not one.
#pragma once

#include <string>
#include <vector>

#include "isac/report/figure.hpp"
#include "isac/report/joint_report.hpp"

namespace isac::report {

struct RunView {
  const estimate::RunResidual* residual = nullptr;
  const estimate::JointRun* run = nullptr;  ///< may be null
  std::string name = {};
  double speed = 0;                ///< 95 % quantile of |velocity|, rad/s
  bool constant_pressure = false;  ///< Δp moves less than 5 % of its range over all runs
  double level = 0;                ///< median Δp, Pa
};

struct JointView {
  const JointReportInput* input = nullptr;
  const estimate::JointFit* fit = nullptr;
  std::vector<RunView> runs = {};  ///< those with a usable row, as in fit->runs
  Axis time = {}, angle = {}, velocity = {}, pressure_difference = {}, output = {}, residual = {};
  std::string output_symbol = {};    ///< "T" or "F"
  std::string position_symbol = {};  ///< "φ" or "x"
  std::string velocity_symbol = {};
  double pressure_scale = 1;  ///< shown = Pa · scale
  std::string pressure_unit = {};
  bool has_pressure = false;
  double fastest = 0;                 ///< largest RunView::speed
  double a = 0, b = 0, c = 0, d = 0;  ///< SI: T = a φ + b Δp − c φ̇³ − d φ̇; NaN where not identified
  bool seed_model = false;            ///< A and B identified
};

[[nodiscard]] JointView make_joint_view(const JointReportInput& input);
[[nodiscard]] const Estimated* find_parameter(const estimate::JointFit& fit,
                                              const std::string& name) noexcept;
[[nodiscard]] std::vector<double> scaled(std::span<const double> values, double factor);
[[nodiscard]] std::vector<double> residuals(const estimate::RunResidual& run);
/// Index range [first, last) of the window of `seconds` around the largest |velocity|.
struct Window {
  std::size_t first = 0, last = 0;
};
[[nodiscard]] Window fastest_window(const estimate::RunResidual& run, double seconds);

/// A figure, or the reason why the data do not hold it.
struct MaybeFigure {
  Figure figure = {};
  std::string missing =
      {};  ///< "torque over angle at high speed (fig 3.4): no run …"; empty: the figure is there
};

// joint_figures_signals.cpp
[[nodiscard]] Figure signals_figure(const JointView& view, const RunView& run);
[[nodiscard]] MaybeFigure fast_pressure_figure(const JointView& view);
// joint_figures_fit.cpp
[[nodiscard]] Figure torque_sensor_figure(const JointView& view);
[[nodiscard]] Figure scatter_figure(const JointView& view);
[[nodiscard]] MaybeFigure static_figure(const JointView& view);
[[nodiscard]] Figure residual_figure(const JointView& view);
[[nodiscard]] Figure residual_time_figure(const JointView& view);
[[nodiscard]] Figure whiteness_figure(const JointView& view);
// joint_figures_plane.cpp
[[nodiscard]] MaybeFigure loops_figure(const JointView& view);
[[nodiscard]] MaybeFigure pressure_family_figure(const JointView& view);
[[nodiscard]] MaybeFigure bundle_figure(const JointView& view);
[[nodiscard]] MaybeFigure constant_velocity_figure(const JointView& view);
[[nodiscard]] MaybeFigure cut_figure(const JointView& view);
[[nodiscard]] Figure validity_figure(const JointView& view);

}  // namespace isac::report
