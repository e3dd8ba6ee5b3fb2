/// @file
/// The report of an output-error fit of a free joint: measured against simulated angle, residual, parameters.
///
/// Units: input SI; shown in rad and the parameters' own units. Threads: pure function (a gnuplot process is started).
/// Errors: throws isac::Error "gnuplot_missing", "gnuplot_failed". Source: seed 4.2, figs 4.3, 4.4.
/// Example: `record::write_atomically(path, render_motion_report({.fit = &fit}));`
#pragma once

#include <string>

#include "isac/estimate/motion_fit.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::report {

struct MotionReportInput {
  ReportHead head = {};
  const estimate::MotionFit* fit = nullptr;  ///< must not be null
};
[[nodiscard]] std::string render_motion_report(const MotionReportInput& input);

}  // namespace isac::report
