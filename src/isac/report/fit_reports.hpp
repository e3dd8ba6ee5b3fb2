/// @file
/// Reports of the other fits and of a plain check: valve units, muscles, calibration, recordings.
///
///   render_pcu_report          step responses measured against p_a + (p_b − p_a)(1 − exp(−(t − t_s − L)/T)) (seed 4.1),
///                              filling and venting apart, residuals, adequacy sentences
///   render_muscle_report       force over pressure by contraction, measured and by the best models; ranking on held-out runs
///   render_calibration_report  line and residual of every channel (seed E.3), encoder middle
///   render_check_report        every signal of every file with its gaps, time steps and statistics; nothing is fitted
///
/// Units: input SI; pressures shown in `pressure_unit`. Threads: pure functions (a gnuplot process is started).
/// Errors: throws isac::Error "gnuplot_missing", "gnuplot_failed"; usage error for an unknown pressure unit.
/// Source: seed 4.1, figs 4.2, 2.x, E.3. Example: `render_pcu_report({.fit = &fit})`.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "isac/estimate/calibrate.hpp"
#include "isac/estimate/muscle_fit.hpp"
#include "isac/estimate/pcu_fit.hpp"
#include "isac/series/recording.hpp"

namespace isac::report {

/// What stands at the head of every report.
struct ReportHead {
  std::string title = {};    ///< empty: the report's own
  std::string rig = {};      ///< name of the rig
  std::string created = {};  ///< ISO 8601; from the caller, so that the report has no clock
  std::string command = {};  ///< the call that made it
};

struct PcuReportInput {
  ReportHead head = {};
  const estimate::PcuFit* fit = nullptr;  ///< must not be null
  std::string pressure_unit = "kg/cm2";
  std::vector<std::string> next_steps = {};
};
[[nodiscard]] std::string render_pcu_report(const PcuReportInput& input);

struct MuscleReportInput {
  ReportHead head = {};
  const estimate::MuscleFit* fit = nullptr;  ///< must not be null
  std::string pressure_unit = "kPa";
  std::size_t models_drawn = 3;  ///< best first
  std::vector<std::string> next_steps = {};
};
[[nodiscard]] std::string render_muscle_report(const MuscleReportInput& input);

struct CalibrationReportInput {
  ReportHead head = {};
  std::vector<estimate::ChannelCalibration> channels = {};  ///< sensors and valves (ValveCalibration::line)
  std::vector<estimate::MiddleCalibration> middles = {};
  std::vector<std::string> next_steps = {};
};
[[nodiscard]] std::string render_calibration_report(const CalibrationReportInput& input);

struct CheckReportInput {
  ReportHead head = {};
  std::span<const series::Recording> recordings = {};
  /// Sentences of the validation, per recording (may be shorter than `recordings`).
  std::vector<Warnings> findings = {};
};
[[nodiscard]] std::string render_check_report(const CheckReportInput& input);

}  // namespace isac::report
