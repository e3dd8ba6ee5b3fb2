/// @file
/// Report of what is hidden in an arm's poses: the verdict, residuals before and after, joint by joint, what fits and what does not.
///
/// Units: input SI. Threads: pure function (a gnuplot process is started). Errors: throws isac::Error "gnuplot_missing",
/// "gnuplot_failed", and a usage error without an answer. Source: docs/derivations/pose_explain.md.
/// Example: `render_pose_explain_report({.answer = &answer, .joints = 6})`.
#pragma once

#include <string>

#include "isac/estimate/pose_explain.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::report {

struct PoseExplainReportInput {
  ReportHead head = {};
  const estimate::PoseExplanation* answer = nullptr;  ///< must not be null
  int joints = 6;
};

/// The verdict as a person would say it, with the amount and its standard error.
[[nodiscard]] std::string pose_verdict_sentence(const estimate::PoseExplanation& answer);
/// What to do next, one sentence.
[[nodiscard]] std::string pose_next_sentence(const estimate::PoseExplanation& answer);
/// "0.34 ± 0.002 kg".
[[nodiscard]] std::string pose_amount(const estimate::PoseFinding& finding);

[[nodiscard]] std::string render_pose_explain_report(const PoseExplainReportInput& input);

}  // namespace isac::report
