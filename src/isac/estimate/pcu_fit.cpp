#include "isac/estimate/pcu_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/estimate/pcu_pool.hpp"
#include "isac/estimate/step_data.hpp"
#include "isac/estimate/step_fit.hpp"
#include "isac/estimate/step_noise.hpp"
#include "isac/estimate/step_shapes.hpp"

namespace isac::estimate {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kShortestHold =
    1.5;                         // lags: with less the level it tends to and the lag cannot be told apart
constexpr double kGoodHold = 4;  // lags: below, it works, but a person should hold longer
constexpr double kMoved = 6;     // standard errors the pressure must move by

struct Window {
  double step_time, begin, end, from, to;
  bool time_known;
};

void check_columns(const PcuRun& run) {
  const std::size_t n = run.time.size();
  if (run.pressure.size() != n || (!run.command.empty() && run.command.size() != n))
    throw Error(ErrorKind::kUsage, "columns_differ",
                fmt::format("{}: time has {} rows, pressure {}, command {}; expected equal lengths", run.name,
                            n, run.pressure.size(), run.command.size()));
}

std::vector<Window> windows_of(const PcuRun& run, const PcuFitOptions& options, Warnings& warnings) {
  std::vector<double> commands;
  for (double u : run.command)
    if (std::isfinite(u)) commands.push_back(u);
  std::vector<Window> out;
  if (!commands.empty()) {
    const auto [low, high] = std::minmax_element(commands.begin(), commands.end());
    const double least =
        std::isfinite(options.min_command_step) ? options.min_command_step : 0.05 * (*high - *low);
    if (*high > *low) {
      bool first = true;
      for (const CommandStep& s : find_command_steps(run.time, run.command, std::max(least, 1e-300))) {
        // Behind an earlier step the second half of the hold counts as "before"; what is left of that step is taken off.
        const double hold = s.time - s.previous_time;
        out.push_back({s.time, s.time - (first ? 1.0 : 0.5) * hold, s.next_time, s.from, s.to, true});
        first = false;
      }
      if (out.empty())
        warnings.push_back(
            {"no_step", fmt::format("{}: the command changes, but never in a clean step: hold it still, step "
                                    "it within one row, and hold it again",
                                    run.name)});
      return out;
    }
  }
  if (run.time.empty()) return out;
  const double begin = run.time.front();
  const double end = std::nextafter(run.time.back(), std::numeric_limits<double>::infinity());
  const bool known = std::isfinite(run.step_at);
  out.push_back({known ? run.step_at : begin, begin, end, kNaN, kNaN, known});
  if (std::isfinite(run.step_command)) {
    out.back().from = commands.empty() ? 0.0 : commands.front() - run.step_command;
    out.back().to = out.back().from + run.step_command;
  }
  return out;
}

Estimated estimate(const char* name, const char* unit, double value, double variance, double dof) {
  const double error = std::sqrt(variance), half = student_95(dof) * error;
  return {.name = name,
          .unit = unit,
          .value = value,
          .std_error = error,
          .ci_low = value - half,
          .ci_high = value + half,
          .reason = {}};
}

Estimated refused(const char* name, const char* unit, std::string reason) {
  return {.name = name, .unit = unit, .identifiable = false, .reason = std::move(reason)};
}

void leave_out(PcuStep& step, std::string why) {
  step.used = false;
  step.why_not = std::move(why);
  step.gain = refused("K_C", "-", step.why_not);
  step.lag = refused("T_C", "s", step.why_not);
  step.dead_time = refused("dead_time", "s", step.why_not);
  step.start = refused("start", "s", step.why_not);
}

// Why this step cannot be used, or nothing.
std::string objection(const PcuStep& step, const StepData& data, const StepFit& fit, const Window& w) {
  if (!fit.ok) return "the pressure never moves, or too few rows lie before and behind the step";
  const double gain = fit.parameters[1], lag = fit.parameters[2], onset = fit.parameters[3];
  if (!(std::abs(gain) > kMoved * std::sqrt(fit.covariance(1, 1))) || !(std::abs(gain) > 3 * data.quantum))
    return fmt::format(
        "the pressure does not move with it (fitted change {:.3g} Pa, noise {:.3g} Pa): look at the valve, "
        "its "
        "supply and the wiring",
        gain, step.noise);
  const double hold = (data.s.back() - onset) / lag;
  if (!(hold > kShortestHold))
    return fmt::format("it is held for {:.2g} lags only: hold the command for five lags or longer", hold);
  if (std::isfinite(w.to) && gain * (w.to - w.from) < 0)
    return "the pressure moves against the command: are the channels swapped?";
  if (!(lag > 0.5 * data.sample_time))
    return fmt::format("the pressure jumps within one row: sample faster than every {:.3g} s",
                       data.sample_time);
  return {};
}

void set_dead_time(PcuStep& step, const StepFit& fit, const Window& w, Warnings& warnings) {
  const double onset = fit.parameters[3], variance = fit.covariance(3, 3), dof = fit.degrees_of_freedom;
  step.start = estimate("start", "s", w.step_time + onset, variance, dof);
  if (!w.time_known) {
    step.dead_time = refused(
        "dead_time", "s",
        "the record does not show when the command stepped, so dead time and step time cannot be told "
        "apart: record the command, or give the step's time");
    return;
  }
  step.dead_time = estimate("dead_time", "s", onset, variance, dof);
  if (step.dead_time.ci_high < -step.sample_time) {
    step.dead_time = refused(
        "dead_time", "s",
        fmt::format("the pressure moves {:.3g} s before the command: the time stamps of the two disagree",
                    -onset));
    return;
  }
  if (onset < step.sample_time) {
    step.dead_time.value = std::max(0.0, onset);
    step.dead_time.ci_low = 0;
    step.dead_time.ci_high = std::max(step.dead_time.ci_high, step.sample_time);
    warnings.push_back(
        {"dead_time_below_sample",
         fmt::format(
             "{}, step at {:.4g} s: the dead time is below one sample ({:.3g} s); its interval is given "
             "as 0 to {:.3g} s",
             step.run, w.step_time, step.sample_time, step.dead_time.ci_high)});
  } else {
    step.dead_time.ci_low = std::max(0.0, step.dead_time.ci_low);
  }
}

/// Every step of a fast valve says the same; one sentence is enough.
void merge_dead_time_warnings(Warnings& warnings, std::size_t steps) {
  const auto is_one = [](const Warning& w) { return w.code == "dead_time_below_sample"; };
  const auto count = std::count_if(warnings.begin(), warnings.end(), is_one);
  if (count < 2) return;
  const auto first = std::find_if(warnings.begin(), warnings.end(), is_one);
  first->text = fmt::format(
      "in {} of {} steps the dead time is below one sample; the interval of such a step begins at 0 and is "
      "at least one sample wide",
      count, steps);
  warnings.erase(std::remove_if(std::next(first), warnings.end(), is_one), warnings.end());
}

PcuStep fit_one(const PcuRun& run, const Window& w, const PcuFitOptions& options, std::vector<Tail>& tails,
                PcuFit& total) {
  Warnings& warnings = total.warnings;
  PcuStep step;
  step.run = run.name;
  if (w.time_known) step.step_time = w.step_time;
  step.command_from = w.from;
  step.command_to = w.to;
  StepData data = cut_step(run, w.step_time, w.begin, w.end, options.leave_out_spikes);
  for (const Tail& tail : tails) remove_tail(data, w.step_time, tail);
  step.samples = data.y.size();
  step.spikes = data.spikes;
  step.noise = data.noise;
  step.sample_time = data.sample_time;
  const double earliest = -std::numeric_limits<double>::infinity();
  const StepFit fit = step.samples < 8 ? StepFit{} : fit_step(data, earliest);
  step.direction =
      (fit.ok ? fit.parameters[1] : w.to - w.from) < 0 ? StepDirection::kVenting : StepDirection::kFilling;
  if (std::string why = objection(step, data, fit, w); !why.empty()) {
    leave_out(step, std::move(why));
    return step;
  }
  const auto [low, gain, lag, onset] = fit.parameters;
  tails.push_back({.size = gain, .lag = lag, .onset = w.step_time + onset});
  const double dof = fit.degrees_of_freedom;
  step.level_from = low;
  step.level_to = low + gain;
  step.level_to_error =
      std::sqrt(std::max(0.0, fit.covariance(0, 0) + fit.covariance(1, 1) + 2 * fit.covariance(0, 1)));
  step.rmse = std::sqrt(fit.sse / static_cast<double>(step.samples));
  step.lag = estimate("T_C", "s", lag, fit.covariance(2, 2), dof);
  const double change = w.to - w.from;
  step.gain = std::isfinite(change) && change != 0
                  ? estimate("K_C", "-", gain / change, fit.covariance(1, 1) / (change * change), dof)
                  : refused("K_C", "-",
                            "the record does not show the size of the command's step: record the command, or "
                            "give its size");
  set_dead_time(step, fit, w, warnings);
  const double hold = (data.s.back() - onset) / lag;
  if (hold < kGoodHold)
    warnings.push_back(
        {"hold_short",
         fmt::format("{}: a step is held for {:.2g} lags only; five make its level and lag sure", run.name,
                     hold)});
  step.adequacy = judge_step(data, fit, w.time_known ? 0.0 : data.s.front(), options.first_order_tolerance);
  for (std::size_t i = 0; i < data.s.size(); ++i) {
    step.time.push_back(w.step_time + data.s[i]);
    step.predicted.push_back(data.reading[i] - fit.residuals[i]);
  }
  step.measured = data.reading;
  total.converged = total.converged && fit.converged;
  total.solver_summary = fit.summary;
  total.samples += step.samples;
  return step;
}

void remark(PcuFit& fit) {
  std::size_t spikes = 0;
  for (const PcuStep& s : fit.steps) {
    spikes += s.spikes;
    const std::string at =
        std::isfinite(s.step_time) ? fmt::format(", step at {:.4g} s", s.step_time) : std::string();
    if (!s.used)
      fit.warnings.push_back({"step_left_out", fmt::format("{}{}: left out, {}", s.run, at, s.why_not)});
    else if (!s.adequacy.first_order)
      fit.warnings.push_back({"not_first_order", fmt::format("{}{}: {}", s.run, at, s.adequacy.sentence)});
    if (s.used && !s.adequacy.first_order) fit.first_order = false;
  }
  if (spikes > 0)
    fit.warnings.push_back(
        {"spikes", fmt::format("{} samples stand far out from their neighbours and were left out", spikes)});
}

}  // namespace

const Estimated* PcuFit::find(const std::string& name) const noexcept {
  const auto it =
      std::find_if(parameters.begin(), parameters.end(), [&](const Estimated& e) { return e.name == name; });
  return it == parameters.end() ? nullptr : &*it;
}

PcuFit fit_pcu(std::span<const PcuRun> runs, const PcuFitOptions& options) {
  PcuFit fit;
  fit.converged = true;
  bool any_row = false;
  for (const PcuRun& run : runs) {
    check_columns(run);
    any_row = any_row || std::any_of(run.pressure.begin(), run.pressure.end(),
                                     [](double p) { return std::isfinite(p); });
    std::vector<Tail> tails;
    for (const Window& w : windows_of(run, options, fit.warnings))
      fit.steps.push_back(fit_one(run, w, options, tails, fit));
  }
  if (!any_row)
    throw Error(ErrorKind::kAnswerIsNo, "no_usable_data",
                "not a single row has a pressure: expected a column such as p1 with its command p1_cmd");
  if (fit.steps.empty())
    throw Error(ErrorKind::kAnswerIsNo, "no_step",
                "the command never steps: record a step (hold, step within one row, hold for five lags)");
  double sse = 0, largest = 0;
  for (const PcuStep& s : fit.steps) {
    if (!s.used) continue;
    sse += s.rmse * s.rmse * static_cast<double>(s.samples);
    largest = std::max(largest, std::abs(s.level_to - s.level_from));
  }
  if (fit.samples > 0) {
    fit.rmse = std::sqrt(sse / static_cast<double>(fit.samples));
    fit.nrmse = fit.rmse / largest;
  } else {
    fit.converged = false;
    fit.first_order = false;
  }
  pool_steps(fit);
  remark(fit);
  merge_dead_time_warnings(fit.warnings, fit.steps.size());
  return fit;
}

}  // namespace isac::estimate
