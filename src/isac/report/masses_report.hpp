/// @file
/// Report of the masses of an arm: what came out, residual of every pose and joint, outliers, and the poses to hold next.
///
/// Units: input SI; angles are shown in deg. Threads: pure function (a gnuplot process is started). Errors: throws isac::Error
/// "gnuplot_missing", "gnuplot_failed", and a usage error without a fit. Source: seed 6.4.
/// Example: `render_masses_report({.fit = &fit, .design = &design, .joints = 6})`.
#pragma once

#include <string>
#include <vector>

#include "isac/estimate/mass_fit.hpp"
#include "isac/estimate/pose_design.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::report {

struct MassesReportInput {
  ReportHead head = {};
  const estimate::MassFit* fit = nullptr;        ///< must not be null
  const estimate::PoseDesign* design = nullptr;  ///< may be null or empty
  int joints = 6;
  std::vector<std::string> mass_names = {};
};

[[nodiscard]] std::string render_masses_report(const MassesReportInput& input);

}  // namespace isac::report
