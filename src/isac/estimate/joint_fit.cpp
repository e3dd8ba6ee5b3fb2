#include "isac/estimate/joint_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/estimate/joint_core.hpp"
#include "isac/estimate/joint_rows.hpp"
#include "isac/estimate/joint_terms.hpp"
#include "isac/estimate/joint_verdict.hpp"
#include "isac/estimate/residual_tests.hpp"
#include "isac/estimate/row_recipe.hpp"
#include "isac/estimate/velocity_cut.hpp"
#include "isac/series/differentiate.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

/// White noise of the output without any model: third differences, Σ of squared weights 20.
double white_noise(std::span<const JointRun> runs) {
  std::vector<double> third;
  for (const JointRun& run : runs) {
    const std::vector<double>& y = run.output;
    const std::size_t stride = std::max<std::size_t>(1, y.size() / 50000);
    for (std::size_t i = 3; i < y.size(); i += stride)
      third.push_back(y[i] - 3 * y[i - 1] + 3 * y[i - 2] - y[i - 3]);
  }
  return series::robust_deviation(third, true) / std::sqrt(20.0);
}

double root_mean_square(std::span<const double> a, std::span<const double> b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return a.empty() ? std::nan("") : std::sqrt(sum / static_cast<double>(a.size()));
}

/// Measured and predicted of each run; returns the error over all of them.
double add_runs(const JointRows& rows, const std::vector<double>& predicted, bool heldout, bool keep_rows,
                JointFit& fit) {
  for (const RunRows& run : rows.runs) {
    const auto cut = [&](const std::vector<double>& column) {
      return std::vector<double>(column.begin() + static_cast<std::ptrdiff_t>(run.begin),
                                 column.begin() + static_cast<std::ptrdiff_t>(run.end));
    };
    RunResidual out;
    out.name = run.name;
    out.heldout = heldout;
    out.rows = run.end - run.begin;
    out.rmse = root_mean_square(std::span(rows.output).subspan(run.begin, out.rows),
                                std::span(predicted).subspan(run.begin, out.rows));
    if (!keep_rows) {
      fit.runs.push_back(std::move(out));
      continue;
    }
    out.time = cut(rows.time);
    out.angle = cut(rows.input[static_cast<int>(Input::kAngle)]);
    out.velocity = cut(rows.input[static_cast<int>(Input::kVelocity)]);
    out.delta_pressure = cut(rows.input[static_cast<int>(Input::kDeltaPressure)]);
    out.measured = cut(rows.output);
    out.predicted = cut(predicted);
    fit.runs.push_back(std::move(out));
  }
  return root_mean_square(rows.output, predicted);
}

void check_cut(JointFit& fit) {
  for (const Estimated* cut : {&fit.cut.C, &fit.cut.D}) {
    if (!cut->identifiable || !std::isfinite(cut->value)) continue;
    for (const Estimated& e : fit.parameters) {
      if (e.name != cut->name || !e.identifiable) continue;
      const double apart = std::abs(e.value - cut->value), error = std::hypot(e.std_error, cut->std_error);
      // Passages are short against the low-pass: measured, the cut itself is off by one per cent.
      if (apart > 4.0 * error && apart > 0.05 * std::abs(e.value))
        fit.warnings.push_back(
            {"cut_disagrees",
             fmt::format(
                 "{} from the cut at the middle ({:.3g}) and from all rows ({:.3g} {}) differ by {:.1f} "
                 "standard "
                 "errors: the torque over speed depends on the angle, look at the residual over both.",
                 e.name, cut->value, e.value, e.unit, apart / error)});
    }
  }
}

}  // namespace

JointFit fit_joint(std::span<const JointRun> runs, std::span<const JointRun> heldout,
                   const JointFitOptions& options) {
  JointTerms terms(options);
  const StatedRecipe stated = choose_recipe(runs, terms, options);
  const JointRows rows = make_rows(runs, terms, stated.recipe);
  const std::size_t count = terms.linear().size() + terms.nonlinear().size();
  if (rows.size() < 4 * count + 4)
    throw Error(ErrorKind::kAnswerIsNo, "no_usable_data",
                fmt::format("of {} rows only {} can be used for {} parameters: time, angle and output must "
                            "be there together over more than a window of {} samples; "
                            "record longer or mend the missing samples",
                            rows.seen, rows.size(), count, stated.recipe.window));
  const JointCore core = estimate_joint(rows, terms, options, stated.recipe);

  JointFit fit;
  fit.converged = core.converged;
  fit.solver_summary = core.report;
  fit.differentiator = stated.words;
  fit.samples = rows.size();
  fit.outliers = core.outliers + rows.cleaned;
  fit.blocks = core.blocks.size();
  fit.block_seconds = core.block_seconds;
  fit.noise_floor = std::isfinite(options.noise.output) ? options.noise.output : white_noise(runs);
  fit.box = validity_box(rows);
  std::vector<int> order;
  fit.parameters = judge_parameters(rows, terms, core, options, order);
  fit.correlation = correlations(fit.parameters, order, core);
  fit.angle_zero = angle_zero(core.zero, options);
  fit.tests =
      residual_tests(rows, {core.used, core.zero.column, core.zero.resting, core.residual, core.omega},
                     core.blocks, stated.recipe.window, options);
  if (fit.angle_zero.used) fit.tests.push_back(zero_test(fit.angle_zero, core.zero, options));

  // The fitted runs are drawn with everything that was fitted; other runs are predicted from what is known only.
  fit.rmse = add_runs(rows, predict(rows, terms, core.theta), false, options.keep_rows, fit);
  const auto [low, high] = std::minmax_element(rows.output.begin(), rows.output.end());
  fit.nrmse = *high > *low ? fit.rmse / (*high - *low) : std::nan("");
  if (!heldout.empty()) {
    Eigen::VectorXd known = core.theta;
    std::string unknown;
    for (std::size_t i = 0; i < order.size(); ++i)
      if (!fit.parameters[i].identifiable) {
        known[order[i]] = 0.0;
        unknown += (unknown.empty() ? "" : ", ") + fit.parameters[i].name;
      }
    RowRecipe plain = stated.recipe;
    plain.parallel_filter = false;
    const JointRows others = make_rows(heldout, terms, plain);
    fit.heldout_rmse = add_runs(others, predict(others, terms, known), true, options.keep_rows, fit);
    if (!unknown.empty())
      fit.warnings.push_back({"heldout_incomplete", "The held-out runs are predicted without " + unknown +
                                                        ", which these runs cannot tell."});
    else if (fit.heldout_rmse > 1.5 * fit.rmse)
      fit.warnings.push_back(
          {"heldout_worse",
           fmt::format("Held-out runs are predicted {:.1f} times worse than the fitted ones: they leave the "
                       "range of the fit or the model misses an effect; "
                       "fit again with the effects that the residual tests name (isac-identify joint --terms "
                       "A,B,C,D,…) and keep the term that makes this number smaller.",
                       fit.heldout_rmse / fit.rmse)});
  }
  bool damping = false;
  for (std::size_t k = 0; k < terms.linear().size(); ++k)
    damping = damping || terms.is_cubic_damping(k) || terms.is_viscous_damping(k);
  if (damping && !terms.driven() && options.position_unit == "rad") {
    fit.cut = velocity_cut(rows, terms, core.theta);
    check_cut(fit);
  }
  add_warnings(rows, terms, core, options, fit);
  return fit;
}

}  // namespace isac::estimate
