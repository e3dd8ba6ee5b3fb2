#include "isac/explain/step_records.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/estimate/pcu_fit.hpp"
#include "isac/estimate/step_shapes.hpp"
#include "isac/explain/compare.hpp"
#include "isac/explain/labels.hpp"
#include "isac/models/effect_hooks.hpp"
#include "isac/models/effect_queries.hpp"

namespace isac::explain {
namespace {

using estimate::PcuFit;
using estimate::PcuStep;
using estimate::StepShape;
using estimate::StepShapeFit;

constexpr double kTenth = 0.9;  // what a parameter must cut the rms by to be worth a name
constexpr std::array kShapes = {StepShape::kFirstOrder, StepShape::kSecondOrder, StepShape::kFlowLimited,
                                StepShape::kTwoRates};
constexpr const char* kUnit = "kg/cm2";
constexpr double kMoments = 12;  // of a step that say something new: six lags, two each

double told(double pascal) {
  return pascal / kPascalPerKgfCm2;
}

int surplus(StepShape shape) {
  return shape == StepShape::kFirstOrder ? 0 : shape == StepShape::kTwoRates ? 2 : 1;
}

const char* id_of(StepShape shape) {
  switch (shape) {
    case StepShape::kSecondOrder:
      return "second_order_lag";
    case StepShape::kFlowLimited:
      return "flow_limit";
    case StepShape::kFirstOrder:
    case StepShape::kTwoRates:
      break;
  }
  return "";
}

const StepShapeFit* fit_of(const PcuStep& step, StepShape shape) {
  const auto& all = step.adequacy.shapes;
  const auto at = std::find_if(all.begin(), all.end(), [&](const auto& s) { return s.shape == shape; });
  return at == all.end() ? nullptr : &*at;
}

/// What a shape leaves of one step, Pa; a step that a lag describes as well as its noise allows is left to the lag.
double left_of(const PcuStep& step, StepShape shape) {
  const StepShapeFit* fit = fit_of(step, shape);
  return fit == nullptr ? step.rmse : fit->rmse;
}

double size_of(const PcuStep& step) {
  return std::abs(step.level_to - step.level_from);
}

/// A shape, judged over all steps; each step counts in shares of its size.
struct Judged {
  StepShape shape = StepShape::kFirstOrder;
  double rms = 0;      ///< Pa over all rows
  double share = 0;    ///< root mean square over steps, of the step's size
  double counted = 0;  ///< share with the penalty for its parameters
};

Judged judge(const std::vector<const PcuStep*>& steps, StepShape shape) {
  Judged out{.shape = shape};
  double squares = 0, rows = 0, shares = 0;
  for (const PcuStep* step : steps) {
    const double left = left_of(*step, shape), n = static_cast<double>(step->samples);
    squares += n * left * left;
    rows += n;
    shares += left * left / (size_of(*step) * size_of(*step));
  }
  out.rms = std::sqrt(squares / rows);
  out.share = std::sqrt(shares / static_cast<double>(steps.size()));
  out.counted = out.share / std::pow(kTenth, surplus(shape));
  return out;
}

/// The step in which a shape shows most tells its numbers.
const PcuStep& carrier(const std::vector<const PcuStep*>& steps, StepShape shape) {
  const auto gain = [&](const PcuStep* step) { return step->rmse / left_of(*step, shape); };
  return **std::max_element(steps.begin(), steps.end(),
                            [&](const PcuStep* a, const PcuStep* b) { return gain(a) < gain(b); });
}

Candidate candidate_of(const std::vector<const PcuStep*>& steps, const Judged& judged) {
  const models::EffectInfo& info =
      models::effect_catalogue()[static_cast<unsigned>(models::find_effect(id_of(judged.shape)))];
  Candidate c;
  c.id = c.form = info.id;
  c.name = info.term;
  c.subsystem = subsystem_name(info.where);
  c.equation = info.equation;
  const PcuStep& step = carrier(steps, judged.shape);
  if (const StepShapeFit* fit = fit_of(step, judged.shape)) {
    Estimated p;
    p.name = info.parameters[0].name;
    p.unit = info.parameters[0].unit;
    p.value = judged.shape == StepShape::kSecondOrder ? fit->second_lag
                                                      : told(size_of(step) * (1 - fit->share) / fit->lag);
    c.parameters.push_back(p);
  }
  for (const PcuStep* one : steps)
    if (const StepShapeFit* fit = fit_of(*one, judged.shape))
      c.evidence.push_back(
          {fit->rmse < kTenth * one->rmse,
           fmt::format("{}: {} {} rms with it, {} with a lag alone; at rest the readings scatter by {}.",
                       one->run, rounded(told(fit->rmse)), kUnit, rounded(told(one->rmse)),
                       rounded(told(one->noise), 2))});
  return c;
}

/// The curve of a shape through one step: its two levels by least squares.
std::vector<double> curve_of(const PcuStep& step, StepShape shape) {
  const StepShapeFit *fit = fit_of(step, shape), *lag = fit_of(step, StepShape::kFirstOrder);
  if (fit == nullptr || lag == nullptr || shape == StepShape::kFirstOrder) return step.predicted;
  const double onset = step.start.value - lag->dead_time + fit->dead_time;
  std::vector<double> g;
  double n = 0, sg = 0, sgg = 0, sy = 0, sgy = 0;
  for (std::size_t i = 0; i < step.time.size(); ++i) {
    g.push_back(estimate::step_shape(shape, step.time[i] - onset, fit->lag, fit->second_lag, fit->share));
    n += 1;
    sg += g[i];
    sgg += g[i] * g[i];
    sy += step.measured[i];
    sgy += g[i] * step.measured[i];
  }
  const double rise = (n * sgy - sg * sy) / (n * sgg - sg * sg), low = (sy - rise * sg) / n;
  for (double& v : g) v = low + rise * v;
  return g;
}

/// Sigma by which `rival` is behind `best`, as compare.hpp has it, with blocks of half a lag.
double behind(const std::vector<const PcuStep*>& steps, StepShape best, StepShape rival) {
  constexpr double kBlock = 0.5;  // lags
  double surplus_loss = 0, scatter = 0;
  for (const PcuStep* step : steps) {
    const std::vector<double> a = curve_of(*step, best), b = curve_of(*step, rival);
    const double size2 = size_of(*step) * size_of(*step);
    double score = 0, block_end = -1e300;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (step->time[i] >= block_end) {
        scatter += score * score / (size2 * size2);
        score = 0;
        block_end = step->time[i] + kBlock * step->lag.value;
      }
      const double ra = a[i] - step->measured[i], rb = b[i] - step->measured[i];
      surplus_loss += (rb * rb - ra * ra) / size2;
      score += ra * (rb - ra);
    }
    scatter += score * score / (size2 * size2);
  }
  return scatter > 0 ? surplus_loss / (2 * std::sqrt(scatter)) : 0.0;
}

RunTrace trace_of(const PcuStep& step, StepShape shape) {
  RunTrace t;
  t.run = step.run;
  t.signal = "pressure";
  t.unit = kUnit;
  t.time = step.time;
  for (const double p : step.measured) t.measured.push_back(told(p));
  for (const double p : step.predicted) t.before.push_back(told(p));
  for (const double p : curve_of(step, shape)) t.after.push_back(told(p));
  return t;
}

std::vector<estimate::PcuRun> channels_of(std::span<const series::Recording> runs) {
  std::vector<estimate::PcuRun> channels;
  for (const series::Recording& recording : runs)
    for (const char* name : {"p1", "p2", "pressure"}) {
      const series::Column* pressure = recording.find(name);
      if (pressure == nullptr) continue;
      const series::Column* command = recording.find(std::string(name) + "_cmd");
      channels.push_back(
          {.name = recording.source.substr(recording.source.find_last_of('/') + 1) + " " + name,
           .sha256 = recording.sha256,
           .time = recording.column("time").values,
           .command = command == nullptr ? std::vector<double>{} : command->values,
           .pressure = pressure->values});
    }
  return channels;
}

std::string lags_in_words(const std::vector<const PcuStep*>& steps) {
  double low = 1e300, high = 0;
  for (const PcuStep* step : steps) {
    low = std::min(low, step->lag.value);
    high = std::max(high, step->lag.value);
  }
  return steps.size() == 1 ? fmt::format("a first-order lag of {} s", rounded(low, 2))
                           : fmt::format("first-order lags of {} to {} s", rounded(low, 2), rounded(high, 2));
}

std::string first_number_of(const Candidate& c) {
  if (c.parameters.empty()) return "";
  const Estimated& p = c.parameters.front();
  return fmt::format(" ({} = {} {})", p.name, rounded(p.value, 2), p.unit);
}

/// "the lag leaves 0.048 kg/cm2 rms, 1.6 % of the step, most of it …"
std::string left_in_words(const std::vector<const PcuStep*>& steps, const Judged& lag) {
  const PcuStep& worst = **std::max_element(steps.begin(), steps.end(), [](const auto* a, const auto* b) {
    return a->adequacy.misfit_worst < b->adequacy.misfit_worst;
  });
  std::string text = fmt::format(
      "Of {} step{}, {} leave{} {} {} rms ({:.1f} % of the step)", steps.size(), steps.size() == 1 ? "" : "s",
      lags_in_words(steps), steps.size() == 1 ? "s" : "", rounded(told(lag.rms)), kUnit, 100 * lag.share);
  if (worst.adequacy.misfit_worst > 0) {
    const StepShapeFit* fit = fit_of(worst, StepShape::kFirstOrder);
    const double origin = fit != nullptr ? worst.start.value - fit->dead_time : worst.time.front();
    text += fmt::format("; the largest smooth part is {:.1f} % of the step, at {} s of the recording",
                        100 * worst.adequacy.misfit_worst, rounded(origin + worst.adequacy.misfit_at, 2));
  }
  return text + ".";
}

NextExperiment steps_of_two_sizes(const std::string& a, const std::string& b) {
  NextExperiment next;
  next.separates_a = a;
  next.separates_b = b;
  next.sentence =
      "Record steps of two sizes, up and down, with the command in a column of its own and the rows at least "
      "every "
      "twentieth of the lag: a flow limit keeps its slope whatever the step's size, a lag keeps its time.";
  return next;
}

}  // namespace

bool only_pressures(std::span<const series::Recording> runs) {
  bool pressures = false;
  for (const series::Recording& run : runs) {
    if (run.find("angle") != nullptr || run.find("torque") != nullptr || run.find("F1") != nullptr)
      return false;
    pressures = pressures || run.find("p1") != nullptr || run.find("p2") != nullptr ||
                run.find("pressure") != nullptr;
  }
  return pressures;
}

Explanation explain_steps(std::span<const series::Recording> runs) {
  const PcuFit fit = estimate::fit_pcu(channels_of(runs));
  std::vector<const PcuStep*> steps;
  for (const PcuStep& step : fit.steps)
    if (step.used && step.samples > 0 && std::isfinite(step.rmse) && size_of(step) > 0)
      steps.push_back(&step);
  if (steps.empty())
    throw Error(ErrorKind::kAnswerIsNo, "no_usable_data",
                "no step could be fitted; record steps of the valve with isac-log pcu-step.");

  Explanation e;
  e.base = fit.parameters;
  e.warnings = fit.warnings;
  e.samples = fit.samples;
  e.fitted_runs = runs.size();
  bool shown = false;
  double noise2 = 0, rows = 0;
  for (const PcuStep* step : steps) {
    shown = shown || !step->adequacy.shapes.empty();
    e.p_value = std::min(e.p_value, step->adequacy.p_value * static_cast<double>(steps.size()));
    noise2 += static_cast<double>(step->samples) * step->noise * step->noise;
    rows += static_cast<double>(step->samples);
    if (step->time.size() > 1) e.seconds += step->time.back() - step->time.front();
  }
  std::vector<Judged> judged;
  for (const StepShape shape : kShapes) judged.push_back(judge(steps, shape));
  const Judged lag = judged.front();
  std::sort(judged.begin(), judged.end(),
            [](const Judged& a, const Judged& b) { return a.counted < b.counted; });
  const Judged best = judged.front();

  e.detected = shown && e.p_value < 0.005;
  e.summary = left_in_words(steps, lag);
  e.gap = {.signal = "pressure",
           .unit = kUnit,
           .before = told(lag.rms),
           .after = told(lag.rms),
           .noise_floor = told(std::sqrt(noise2 / rows))};
  if (!shown || best.shape == StepShape::kFirstOrder) {
    e.verdict = fit.first_order ? (e.detected ? Verdict::kImmaterial : Verdict::kNone) : Verdict::kUnknown;
  } else {
    e.verdict = *id_of(best.shape) == '\0' ? Verdict::kUnknown : Verdict::kNamed;
  }
  double beliefs = 0;
  const auto belief = [&](const Judged& j) {
    return std::pow(best.share / j.share, kMoments * static_cast<double>(steps.size())) *
           std::exp(-surplus(j.shape) + surplus(best.shape));
  };
  for (const Judged& j : judged) beliefs += belief(j);
  if (e.verdict == Verdict::kNamed) {
    for (const Judged& j : judged) {
      if (j.shape == StepShape::kFirstOrder || *id_of(j.shape) == '\0') continue;
      Candidate c = candidate_of(steps, j);
      c.confidence = belief(j) / beliefs;
      c.behind_best = j.shape == best.shape ? 0.0 : behind(steps, best.shape, j.shape);
      if (j.shape == best.shape) {
        e.effects.push_back(std::move(c));
      } else if (c.behind_best < kSetLimit) {
        e.alternatives.push_back(std::move(c));
      } else {
        e.rejected.push_back(std::move(c));
      }
    }
    if (!e.alternatives.empty()) {
      e.verdict = Verdict::kNotSeparable;
      e.next_experiment = steps_of_two_sizes(e.effects.front().id, e.alternatives.front().id);
    }
    e.gap.after = told(best.rms);
    e.summary += fmt::format(" {}{} {}: {} → {} {}", upper_first(e.effects.front().name),
                             first_number_of(e.effects.front()),
                             e.gap.after < 0.5 * e.gap.before ? "closes it" : "takes part of it",
                             rounded(e.gap.before), rounded(e.gap.after), kUnit);
    e.summary += e.alternatives.empty() ? "."
                                        : fmt::format(", but {} cannot be ruled out ({} sigma behind).",
                                                      e.alternatives.front().name,
                                                      rounded(e.alternatives.front().behind_best, 2));
  } else if (e.verdict == Verdict::kUnknown) {
    e.unknown.emplace();
    e.unknown->subsystem = "pcu";
    e.unknown->signal = "pressure";
    e.unknown->depends_on = {"time"};
    e.summary +=
        best.shape == StepShape::kTwoRates
            ? fmt::format(" Two rates in one step describe it ({} {} rms); no effect of the catalogue does.",
                          rounded(told(best.rms)), kUnit)
            : " No shape of the catalogue takes it.";
  } else {
    e.summary += e.verdict == Verdict::kNone
                     ? " That is what the readings do at rest too: nothing is missing in the step's shape."
                     : " Something smooth is left that no other shape takes; it is small.";
  }
  for (const PcuStep* step : steps) {
    const std::string& says = step->adequacy.sentence;
    e.trials.push_back({step->run, says});
    if (const auto at = says.find("at rest the pressure"); at != std::string::npos)
      e.warnings.push_back(
          {"swings_at_rest", step->run + ": " + says.substr(at) + ", a limit cycle that no lag explains"});
    e.traces.push_back(trace_of(*step, best.shape));
  }
  for (const PcuStep* step : steps)
    if (e.detected && step->adequacy.misfit_worst > 0.5 * std::max(0.01, lag.share))
      e.where.push_back({.subsystem = "pcu",
                         .signal = step->run,
                         .variable = "time after the rise begins",
                         .low = 0,
                         .high = 5 * step->lag.value,
                         .unit = "s"});
  e.signals.push_back({.signal = "pressure",
                       .unit = kUnit,
                       .rmse = e.gap.before,
                       .noise_floor = e.gap.noise_floor,
                       .p_value = e.p_value,
                       .after = e.gap.after,
                       .floor_from = "differences"});
  e.waterfall = {{"first-order lag", e.gap.before, kNotKnown}};
  if (!e.effects.empty()) e.waterfall.push_back({e.effects.front().name, e.gap.after, kNotKnown});
  return e;
}

}  // namespace isac::explain
