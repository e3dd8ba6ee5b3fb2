/// @file
/// The report of a tuning: the experiment and the plant fitted to it, the loop's frequency response with its margins, the step and the
/// trajectory before and after, and every rule's gains on the same joints.
///
/// Units: input SI; shown in rad, kg/cm², s, Hz. Threads: pure function (a gnuplot process is started).
/// Errors: throws isac::Error "gnuplot_missing", "gnuplot_failed". Source: seed 4.2, 5, 6.3.
/// Example: `record::write_atomically(path, render_tune_report({.model = &model, .tuning = &tuning}));`
#pragma once

#include <string>

#include "isac/report/fit_reports.hpp"
#include "isac/tune/plant_fit.hpp"
#include "isac/tune/tuning.hpp"

namespace isac::report {

struct TuneReportInput {
  ReportHead head = {};
  const tune::JointModel* model = nullptr;  ///< must not be null where `tuning` is not
  const tune::Tuning* tuning = nullptr;     ///< null: it ended with the experiment
  const tune::PlantFit* fit = nullptr;      ///< null: no experiment was made
  tune::ExperimentRecord record = {};       ///< of an experiment that failed: drawn where there is no fit
  tune::Limits limits = {};
  std::string experiment = {};  ///< "relay", "gain ramp", "steps"
  std::string refusal = {};     ///< why the old gains stay; empty: new ones
  std::string deployed = {};    ///< file that holds the new gains; empty: none was written
  Warnings warnings = {};
};
[[nodiscard]] std::string render_tune_report(const TuneReportInput& input);

}  // namespace isac::report
