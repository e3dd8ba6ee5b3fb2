/// @file
/// The report of a joint identification: what was fitted from which runs, how well, and what to do next.
///
/// Content: key figures, runs, parameters with 95 % intervals and correlation, the equation with its numbers, signals,
/// measured against predicted, residuals over every regressor and time, torque over angle (seed figs 3.3, 3.4, 3.7,
/// 3.8), constant velocities (3.9), torque offset over velocity (3.10), the model as a torque sensor (3.11), static
/// against full model (3.13), pressure during fast movement (3.5), whiteness, validity box, warnings, refusals.
/// Pictures whose experiment is not among the runs are left out, and the report says which and why.
/// Units: input SI; shown in rad, N m and `pressure_unit`. Threads: pure function (a gnuplot process is started).
/// Errors: throws isac::Error "gnuplot_missing", "gnuplot_failed"; usage error for an unknown pressure unit.
/// Example: `record::write_atomically(path, render_joint_report({.fit = &fit, .runs = runs, .options = options}));`
#pragma once

#include <span>
#include <string>
#include <vector>

#include "isac/estimate/joint_fit.hpp"

namespace isac::report {

/// A term's equation for the reader, from the catalogue of effects: {"coulomb_friction", "−T_c sgn(w)"}.
struct TermText {
  std::string id = {}, equation = {};
};

struct JointReportInput {
  std::string title = "Joint identification";
  std::string rig = {};                     ///< name of the rig, empty: not said
  std::string created = {};                 ///< ISO 8601; from the caller, so that the report has no clock
  std::string command = {};                 ///< the call that made it, for repetition
  const estimate::JointFit* fit = nullptr;  ///< must not be null
  std::span<const estimate::JointRun> runs = {};  ///< as given to fit_joint
  std::span<const estimate::JointRun> heldout = {};
  estimate::JointFitOptions options = {};
  std::vector<TermText> terms = {};  ///< of terms beyond A, B, C, D
  std::string pressure_unit = "kg/cm2";
  std::vector<std::string> next_steps = {};  ///< added to those the fit itself suggests
};

[[nodiscard]] std::string render_joint_report(const JointReportInput& input);

}  // namespace isac::report
