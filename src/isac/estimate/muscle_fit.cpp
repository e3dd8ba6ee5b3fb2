#include "isac/estimate/muscle_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/estimate/muscle_solve.hpp"
#include "isac/estimate/step_noise.hpp"

namespace isac::estimate {
namespace {

using Law = std::function<double(const MusclePoint&, const MuscleRun&)>;

double reading(double force, double zero, const PreparedRun& run) {
  return std::max(zero + std::max(0.0, force), run.floor);
}

// The offset that fits a run best, censoring included: a fixed point, for the mean of what is not at the stop.
double fitted_zero(const PreparedRun& run, const std::vector<double>& forces) {
  double zero = 0;
  for (int k = 0; k < 100; ++k) {
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < run.rows.size(); ++i) {
      if (run.rows[i].censored && zero + std::max(0.0, forces[i]) <= run.floor) continue;
      sum += run.rows[i].force - zero - std::max(0.0, forces[i]);
      count += 1;
    }
    if (count == 0 || std::abs(sum / count) < 1e-9) break;
    zero += sum / count;
  }
  return zero;
}

MuscleRunResult score(const PreparedRun& run, const Law& law, ZeroHandling handling, bool heldout) {
  MuscleRunResult out;
  out.name = run.run->name;
  out.heldout = heldout;
  std::vector<double> forces;
  forces.reserve(run.rows.size());
  for (const MusclePoint& row : run.rows) forces.push_back(law(row, *run.run));
  out.zero = handling == ZeroHandling::kFitted ? fitted_zero(run, forces) : run.zero;
  out.samples = run.rows.size();
  double sse = 0;
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    const double e = run.rows[i].force - reading(forces[i], out.zero, run);
    sse += e * e;
    out.censored += run.rows[i].censored;
  }
  if (out.samples > 0) out.rmse = std::sqrt(sse / static_cast<double>(out.samples));
  for (const MusclePoint& p : run.points) {
    out.pressure.push_back(p.pressure);
    out.contraction.push_back(p.contraction);
    out.measured.push_back(p.force - out.zero);
    out.predicted.push_back(reading(law(p, *run.run), out.zero, run) - out.zero);
  }
  return out;
}

double pooled_rmse(const std::vector<MuscleRunResult>& runs, bool heldout) {
  double sum = 0, n = 0;
  for (const MuscleRunResult& r : runs)
    if (r.heldout == heldout && r.samples > 0) {
      sum += r.rmse * r.rmse * static_cast<double>(r.samples);
      n += static_cast<double>(r.samples);
    }
  return n > 0 ? std::sqrt(sum / n) : std::numeric_limits<double>::quiet_NaN();
}

// Full contraction belongs to the muscle, not to the run: runs of one rest length share it.
std::vector<MuscleRun> complete(std::span<const MuscleRun> runs, std::span<const MuscleRun> others) {
  std::vector<MuscleRun> out(runs.begin(), runs.end());
  for (MuscleRun& run : out)
    for (const auto from : {runs, others})
      for (const MuscleRun& other : from)
        if (!std::isfinite(run.full_contraction) && std::abs(other.rest_length - run.rest_length) < 1e-6)
          run.full_contraction = other.full_contraction;
  return out;
}

std::vector<PreparedRun> prepare(const std::vector<MuscleRun>& runs, double end_length, double floor,
                                 const MuscleFitOptions& options) {
  std::vector<PreparedRun> out;
  for (const MuscleRun& run : runs)
    out.push_back(prepare_run(run, end_length, floor, options, 2 * static_cast<int>(out.size())));
  return out;
}

std::vector<const MuscleModelEntry*> wanted_models(const MuscleFitOptions& options) {
  std::vector<const MuscleModelEntry*> out;
  for (const MuscleModelEntry& m : muscle_catalogue())
    if (options.models.empty()) out.push_back(&m);
  for (const std::string& id : options.models) {
    const auto all = muscle_catalogue();
    const auto it =
        std::find_if(all.begin(), all.end(), [&](const MuscleModelEntry& m) { return id == m.id; });
    if (it == all.end()) {
      std::string known;
      for (const MuscleModelEntry& m : all) known += std::string(known.empty() ? "" : ", ") + m.id;
      throw Error(ErrorKind::kUsage, "unknown_model",
                  fmt::format("unknown muscle model '{}'; known are {}", id, known));
    }
    out.push_back(&*it);
  }
  return out;
}

bool names(const char* list, const std::string& name) {
  return list && ("," + std::string(list) + ",").find("," + name + ",") != std::string::npos;
}

MuscleModelResult fit_model(const MuscleModelEntry& model, const std::vector<PreparedRun>& train,
                            const std::vector<PreparedRun>& heldout, const MuscleFitOptions& options) {
  MuscleModelResult out;
  out.id = model.id;
  out.name = model.name;
  out.equation = model.equation;
  const bool moves = std::any_of(train.begin(), train.end(), [](const PreparedRun& r) { return r.moves; });
  bool stretches = false;
  for (const PreparedRun& r : train)
    for (const MusclePoint& p : r.points) stretches = stretches || p.contraction < 0;
  std::vector<bool> fixed;
  for (const MuscleParameter& p : model.parameters)
    fixed.push_back((names(model.needs_motion, p.name) && !moves) ||
                    (names(model.needs_stretch, p.name) && !stretches));

  const MuscleSolution s =
      solve_muscle(model, train, fixed, options.diameter, options.zero == ZeroHandling::kFitted);
  out.converged = s.converged;
  out.solver_summary = s.summary;
  if (s.parameters.empty()) {
    out.warnings.push_back({"not_solved", fmt::format("{}: no start led to a solution", model.name)});
    return out;
  }
  for (std::size_t k = 0; k < model.parameters.size(); ++k) {
    const MuscleParameter& p = model.parameters[k];
    Estimated e;
    e.name = p.name;
    e.unit = p.unit;
    if (fixed[k]) {
      e.identifiable = false;
      e.reason = names(model.needs_motion, p.name)
                     ? "the muscle does not move in these runs: record one that changes its length"
                     : "the muscle is never longer than at rest: record one that stretches it";
    } else if (!std::isfinite(s.std_errors[k])) {
      e.identifiable = false;
      e.reason = "these runs cannot tell it from the other parameters: record other contractions";
    } else {
      const double half = student_95(s.degrees_of_freedom) * s.std_errors[k] * p.factor;
      e.value = s.parameters[k] * p.factor;
      e.std_error = s.std_errors[k] * p.factor;
      e.ci_low = e.value - half;
      e.ci_high = e.value + half;
    }
    out.parameters.push_back(std::move(e));
  }
  const Law law = [&](const MusclePoint& p, const MuscleRun&) {
    return model.force(s.parameters.data(), options.diameter, p.pressure, p.contraction, p.rate, nullptr);
  };
  for (const PreparedRun& r : train) out.runs.push_back(score(r, law, options.zero, false));
  for (const PreparedRun& r : heldout) out.runs.push_back(score(r, law, options.zero, true));
  out.train_rmse = pooled_rmse(out.runs, false);
  out.heldout_rmse = pooled_rmse(out.runs, true);
  const double k = static_cast<double>(std::count(fixed.begin(), fixed.end(), false));
  out.aic = s.points * std::log(s.weighted_sse / s.points) + 2 * k;
  return out;
}

}  // namespace

const MuscleModelResult* MuscleFit::find(const std::string& id) const noexcept {
  const auto it =
      std::find_if(ranking.begin(), ranking.end(), [&](const MuscleModelResult& m) { return m.id == id; });
  return it == ranking.end() ? nullptr : &*it;
}

std::span<const char* const> muscle_model_ids() noexcept {
  static const std::vector<const char*> ids = [] {
    std::vector<const char*> out;
    for (const MuscleModelEntry& m : muscle_catalogue()) out.push_back(m.id);
    return out;
  }();
  return ids;
}

MuscleFit fit_muscle(std::span<const MuscleRun> runs, std::span<const MuscleRun> heldout,
                     const MuscleFitOptions& options) {
  const auto models = wanted_models(options);
  const std::vector<MuscleRun> train_runs = complete(runs, heldout), held_runs = complete(heldout, runs);
  MuscleFit fit;
  fit.end_length = find_end_length(train_runs, held_runs, options);
  const double floor = find_force_floor(train_runs, held_runs);
  const std::vector<PreparedRun> train = prepare(train_runs, fit.end_length, floor, options);
  const std::vector<PreparedRun> held = prepare(held_runs, fit.end_length, floor, options);
  if (std::all_of(train.begin(), train.end(), [](const PreparedRun& r) { return r.points.empty(); }))
    throw Error(ErrorKind::kAnswerIsNo, "no_usable_data",
                "not a single row has pressure, force and contraction: nothing to fit");

  double low = 1e300, high = -1e300;
  for (const PreparedRun& r : train)
    for (const MusclePoint& p : r.points)
      low = std::min(low, p.contraction), high = std::max(high, p.contraction);
  if (high - low < 0.01)
    fit.warnings.push_back({"one_contraction",
                            "all training runs hold nearly the same contraction: record others, the models "
                            "differ in how the force falls with it"});
  if (std::isfinite(floor))
    fit.warnings.push_back(
        {"force_stop", fmt::format("the force readings stop at {:.4g} N: readings there count as 'at or "
                                   "below'",
                                   floor)});
  for (const MuscleModelEntry* m : models) fit.ranking.push_back(fit_model(*m, train, held, options));
  const auto key = [&](const MuscleModelResult& m) {
    const double value = heldout.empty() ? m.train_rmse : m.heldout_rmse;
    return std::isfinite(value) ? value : 1e300;
  };
  std::stable_sort(fit.ranking.begin(), fit.ranking.end(),
                   [&](const MuscleModelResult& a, const MuscleModelResult& b) { return key(a) < key(b); });
  for (const auto& set : {&train, &held})
    for (const PreparedRun& r : *set)
      fit.hysteresis.push_back(hysteresis_width(r, std::max(4, options.bins)));
  return fit;
}

std::vector<MuscleRunResult> score_muscle_law(
    std::span<const MuscleRun> runs, const std::function<double(double, double, const MuscleRun&)>& law,
    const MuscleFitOptions& options) {
  const double floor = find_force_floor(runs, {});
  std::vector<MuscleRunResult> out;
  for (const MuscleRun& run : runs) {
    const PreparedRun prepared = prepare_run(run, 0.0, floor, options, 0);
    out.push_back(score(
        prepared, [&](const MusclePoint& p, const MuscleRun& r) { return law(p.pressure, p.contraction, r); },
        options.zero, true));
  }
  return out;
}

}  // namespace isac::estimate
