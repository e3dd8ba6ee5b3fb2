/// @file
/// The report of isac-explain: where the model and the measurement disagree, what is missing, the proof, what to record next.
///
///   where      residual over speed, angle and pressures, before and after; maps over two of them
///   what       evidence for and against each near candidate, in sentences
///   proof      measured, simulated before and after on held-out runs; waterfall of the gap
///   numbers    parameters with their intervals, and what changed in the baseline
///   next       the experiment that would separate what is tied; what could hide; what these data cannot test
///
/// Units: those the explanation carries. Threads: pure function (a gnuplot process is started).
/// Errors: throws isac::Error "gnuplot_missing", "gnuplot_failed"; usage error without an answer.
/// Source: docs/effects.md, steps 2, 5 and 8. Example: `render_explain_report({.answer = &explanation})`.
#pragma once

#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::report {

struct ExplainReportInput {
  ReportHead head = {};
  const explain::Explanation* answer = nullptr;  ///< must not be null
  std::string position_unit = "rad";             ///< of the traces' angle: "m" for a linear axis
  std::vector<std::string> compensation =
      {};                        ///< what a controller does about each effect added, in sentences
  std::string params_file = {};  ///< name of the params.toml written beside; empty: none
  std::string plan_file = {};    ///< name of the plan.toml written beside; empty: none
};

[[nodiscard]] std::string render_explain_report(const ExplainReportInput& input);

}  // namespace isac::report
