#include "isac/explain/experiment.hpp"

#include <algorithm>
#include <cmath>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/explain/experiment_words.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr int kMostRuns = 3;
constexpr double kRestPrior = 3;       // of a half step of the encoder, uniform
constexpr double kTolerancePrior = 3;  // of half of what is tolerated, uniform
constexpr double kUniform = 12;        // range² over variance
constexpr std::size_t kMostModels = 4;
constexpr double kNothing = 1e9;  // s: no time suffices
// Twenty of the blocks by whose scatter the search tells two models apart: what a recording has of its own (half a step of the encoder, a zero that
// wanders) is in few blocks as sure as the difference is.
constexpr double kFewest = 40;  // s of a run

double round_to(double value, double step) {
  return step * std::round(value / step);
}

double two_digits(double value) {
  if (!(value > 0)) return value;
  return round_to(value, std::pow(10, std::floor(std::log10(value)) - 1));
}

/// Numbers that a person can set.
PlannedRun tidy(PlannedRun run) {
  run.seconds = 5 * std::ceil(0.2 * run.seconds - 1e-9);
  run.mean_pressure_kgcm2 = round_to(run.mean_pressure_kgcm2, 0.05);
  run.delta_pressure_kgcm2 = round_to(run.delta_pressure_kgcm2, 0.05);
  run.amplitude_rad = round_to(run.amplitude_rad, 0.01);
  run.middle_rad = round_to(run.middle_rad, 0.01);
  run.peak_speed_rad_s = two_digits(run.peak_speed_rad_s);
  run.pressure_swing_kgcm2 = two_digits(run.pressure_swing_kgcm2);
  run.pressure_period_s = two_digits(run.pressure_period_s);
  return run;
}

/// The Gram matrix without the unknowns of one recording, which are refitted to nothing else.
Eigen::MatrixXd without(const Eigen::MatrixXd& gram, const std::vector<Eigen::Index>& own, double prior) {
  if (own.empty()) return gram;
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < gram.rows(); ++i)
    if (std::find(own.begin(), own.end(), i) == own.end()) kept.push_back(i);
  Eigen::MatrixXd inner = gram(own, own);
  inner.diagonal().array() += prior;
  const Eigen::MatrixXd cross = gram(own, kept);
  return gram(kept, kept) - cross.transpose() * estimate::solve_symmetric_each(inner, cross);
}

std::vector<std::size_t> free_of(const Active& model) {
  std::vector<std::size_t> numbers;
  for (int p = 0; p < model.hypothesis->info().parameter_count; ++p)
    if (model.hypothesis->free[static_cast<std::size_t>(p)]) numbers.push_back(static_cast<std::size_t>(p));
  return numbers;
}

double step_of(const Active& active, std::size_t k) {
  const auto& info = active.hypothesis->info().parameters[k];
  double scale = std::max(std::abs(active.values[k]), 1e-3 * std::abs(info.typical));
  if (!(scale > 0)) scale = 1;
  return scale;
}

/// Columns of (S, x) for the rows of one dataset, and their products.
Eigen::MatrixXd gram_over(const Predictor& predictor, const Fit& stem, const Weights& weights,
                          const std::vector<Active>& models, double noise_unit,
                          std::vector<Coordinate>& used) {
  const Eigen::MatrixXd base = sensitivities(predictor, stem, weights, &used);
  const auto rows = static_cast<Eigen::Index>(predictor.rows());
  Eigen::VectorXd here = Eigen::VectorXd::Zero(rows);
  predictor.predict(stem.model, kAllChains, here);
  std::vector<Eigen::VectorXd> responses, slopes;
  for (const Active& model : models) {
    responses.push_back(response(predictor, stem, here, model, weights));
    for (const std::size_t k : free_of(model)) {
      // Onsets and widths move events from sample to sample: a longer step sees more of them.
      const bool shape = !model.hypothesis->amplitude[k];
      const double scale = step_of(model, k);
      double step = (shape ? 5e-3 : 1e-4) * scale;
      if (model.values[k] + step > model.hypothesis->upper[k]) step = -step;
      Active there = model;
      there.values[k] += step;
      slopes.push_back((response(predictor, stem, here, there, weights) - responses.back()) * (scale / step));
    }
  }
  Eigen::MatrixXd columns(rows, base.cols() + static_cast<Eigen::Index>(slopes.size() + responses.size()));
  columns.leftCols(base.cols()) = base;
  Eigen::Index at = base.cols();
  for (const auto* group : {&slopes, &responses})
    for (const auto& v : *group) {
      // A number that the equation does not bear at its bound says nothing.
      if (v.allFinite()) {
        columns.col(at++) = v;
      } else {
        columns.col(at++).setZero();
      }
    }
  std::vector<Eigen::Index> resting;
  for (std::size_t j = 0; j < used.size(); ++j)
    if (used[j].rest >= 0) resting.push_back(static_cast<Eigen::Index>(j));
  return without(columns.transpose() * columns, resting, kRestPrior * noise_unit);
}

}  // namespace

Designer::Designer(Tie tie, const ExperimentOptions& options) : tie_(std::move(tie)), options_(options) {
  if (tie_.models.size() > kMostModels) tie_.models.resize(kMostModels);
  const Predictor& predictor = *tie_.predictor;
  options_.limits.initial_pressure = predictor.data().rig.initial_pressure;
  range_ = range_of(predictor, tie_.stem.model, options_.limits);
  if (range_.free_row_noise > 0)
    tie_.weights.sigma[3] = std::hypot(tie_.weights.sigma[0], range_.free_row_noise);
  candidates_ = candidate_runs(range_, predictor.data().rig);
  for (PlannedRun& run : candidates_) run = tidy(run);
  look_back();
  if (suppose_typical()) look_back();
}

/// The Gram matrix of what is recorded, where its columns belong, and what is known of them beforehand.
void Designer::look_back() {
  std::vector<Coordinate> used;
  recorded_ = gram_over(*tie_.predictor, tie_.stem, tie_.weights, tie_.models, tie_.noise_unit, used);
  std::vector<double> prior;
  for (const Coordinate& c : used)
    if (c.rest < 0) prior.push_back(c.tolerance ? kTolerancePrior * tie_.noise_unit : 0.0);
  begin_.clear();
  for (const Active& model : tie_.models) {
    begin_.push_back(static_cast<Eigen::Index>(prior.size()));
    for (const std::size_t k : free_of(model)) {
      const double share = step_of(model, k) / (model.hypothesis->upper[k] - model.hypothesis->lower[k]);
      prior.push_back(std::isfinite(share) ? kUniform * share * share * tie_.noise_unit : 0.0);
    }
  }
  begin_.push_back(static_cast<Eigen::Index>(prior.size()));
  prior_ = Eigen::Map<Eigen::VectorXd>(prior.data(), static_cast<Eigen::Index>(prior.size()));
}

/// A shape that the recordings leave open is a number that noise has drawn: the typical one stands in for it, and the other
/// numbers of the effect follow as the recordings ask.
bool Designer::suppose_typical() {
  bool changed = false;
  const Eigen::Index base = begin_.front();
  for (std::size_t m = 0; m < tie_.models.size(); ++m) {
    Active& model = tie_.models[m];
    const std::vector<std::size_t> numbers = free_of(model);
    for (std::size_t j = 0; j < numbers.size(); ++j) {
      const std::size_t k = numbers[j];
      const auto& info = model.hypothesis->info().parameters[k];
      if (model.hypothesis->amplitude[k] || !(std::abs(info.typical) > 0)) continue;
      const Eigen::Index own = begin_[m] + static_cast<Eigen::Index>(j);
      std::vector<Eigen::Index> others;
      for (Eigen::Index i = 0; i < begin_[m + 1]; ++i)
        if ((i < base || i >= begin_[m]) && i != own) others.push_back(i);
      Eigen::MatrixXd inner = recorded_(others, others);
      for (Eigen::Index i = 0; i < inner.rows(); ++i)
        inner(i, i) += 1e-9 * inner(i, i) + prior_[others[static_cast<std::size_t>(i)]];
      const Eigen::VectorXd cross = recorded_(others, own), follow = estimate::solve_symmetric(inner, cross);
      const double scale = step_of(model, k),
                   information = std::max(0.0, recorded_(own, own) - cross.dot(follow)) / tie_.noise_unit,
                   deviation = information > 0 ? scale / std::sqrt(information) : kNothing,
                   change = info.typical - model.values[k];
      if (deviation < 0.5 * std::abs(info.typical) || std::abs(change) > 2 * deviation || change == 0)
        continue;
      for (std::size_t i = 0; i < numbers.size(); ++i) {
        const auto at = std::find(others.begin(), others.end(), begin_[m] + static_cast<Eigen::Index>(i));
        if (at == others.end() || !model.hypothesis->amplitude[numbers[i]]) continue;
        double& value = model.values[numbers[i]];
        value = std::clamp(value - follow[at - others.begin()] * change / scale * step_of(model, numbers[i]),
                           model.hypothesis->lower[numbers[i]], model.hypothesis->upper[numbers[i]]);
      }
      model.values[k] = info.typical;
      changed = true;
    }
  }
  return changed;
}

std::optional<Designer::Information> Designer::information(const PlannedRun& run) const {
  ModelPoint truth = tie_.stem.model;
  truth.effects.push_back(tie_.models.front());
  const std::optional<Prepared> data = would_record(*tie_.predictor, truth, range_, run);
  if (!data) return std::nullopt;
  const Predictor predictor(*data);
  Fit stem = tie_.stem;
  stem.model.rest.assign(1, 0.0);
  std::vector<Coordinate> used;
  Information gram = gram_over(predictor, stem, tie_.weights, tie_.models, tie_.noise_unit, used);
  if (gram.cols() != recorded_.cols() || !gram.allFinite()) return std::nullopt;
  return gram;
}

double Designer::one_way(const Information& gram, std::size_t truth, std::size_t refitted) const {
  const Eigen::Index base = begin_.front(), x = begin_.back();
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < base; ++i) free.push_back(i);
  for (Eigen::Index i = begin_[refitted]; i < begin_[refitted + 1]; ++i) free.push_back(i);
  const auto a = x + static_cast<Eigen::Index>(truth), b = x + static_cast<Eigen::Index>(refitted);
  const double norm2 = gram(a, a) - 2 * gram(a, b) + gram(b, b);
  const auto n = static_cast<Eigen::Index>(free.size());
  Eigen::VectorXd g(n), scale(n);
  Eigen::MatrixXd inner = gram(free, free);
  for (Eigen::Index i = 0; i < n; ++i) {
    g[i] = gram(free[static_cast<std::size_t>(i)], b) - gram(free[static_cast<std::size_t>(i)], a);
    inner(i, i) += prior_[free[static_cast<std::size_t>(i)]];
    scale[i] = inner(i, i) > 0 ? 1 / std::sqrt(inner(i, i)) : 0.0;
  }
  inner = scale.asDiagonal() * inner * scale.asDiagonal();
  inner.diagonal().array() += 1e-9;
  g = scale.asDiagonal() * g;
  const double left = norm2 - g.dot(estimate::solve_symmetric(inner, g));
  return std::sqrt(std::max(0.0, left) / tie_.noise_unit);
}

double Designer::separation(const Information& gram, std::size_t a, std::size_t b) const {
  const std::string name_a = tie_.models[a].hypothesis->id(), name_b = tie_.models[b].hypothesis->id();
  if (nests(name_a, name_b)) return one_way(gram, a, b);
  if (nests(name_b, name_a)) return one_way(gram, b, a);
  return std::min(one_way(gram, a, b), one_way(gram, b, a));
}

double Designer::smallest(const Information& gram, const std::vector<std::size_t>& rivals) const {
  double least = std::numeric_limits<double>::infinity();
  for (const std::size_t r : rivals) least = std::min(least, separation(gram, 0, r));
  return least;
}

std::vector<std::optional<Designer::Information>> Designer::all_candidates() const {
  std::vector<std::optional<Information>> grams(candidates_.size());
  share_work(options_.threads, grams.size(), [&](std::size_t i) { grams[i] = information(candidates_[i]); });
  return grams;
}

namespace {

/// Seconds of such a run until `wanted` is reached, for information grows evenly with time.
double seconds_needed(double before, double after, double wanted, const PlannedRun& run) {
  const double gained = after * after - before * before;
  if (!(gained > 1e-9)) return kNothing;
  return std::max(
      {kFewest, least_seconds(run), run.seconds * std::max(0.0, wanted * wanted - before * before) / gained});
}

/// Fewer seconds are better; among equals more sigma, up to thrice what is wanted: more of it is to be had where the models were never seen.
double score_of(double before, double after, double wanted, const PlannedRun& run) {
  return -seconds_needed(before, after, wanted, run) + 1e-2 * std::min(after, 3 * wanted);
}

/// Every number of the run that its experiment uses, moved up and down by `step`.
std::vector<PlannedRun> neighbours(const PlannedRun& run, double step) {
  std::vector<PlannedRun> all;
  const auto vary = [&](double PlannedRun::*field, double by, bool relative) {
    if (!std::isfinite(run.*field)) return;
    for (const double sign : {1.0, -1.0}) {
      PlannedRun next = run;
      next.*field = relative ? run.*field * (sign > 0 ? 1 + by : 1 / (1 + by)) : run.*field + sign * by;
      next = tidy(next);
      if (next.*field != run.*field) all.push_back(next);
    }
  };
  vary(&PlannedRun::mean_pressure_kgcm2, 0.6 * step, true);
  if (run.experiment == "constant-pressure") {
    vary(&PlannedRun::amplitude_rad, step, true);
    vary(&PlannedRun::peak_speed_rad_s, 2 * step, true);
  }
  if (run.experiment != "pcu-step") vary(&PlannedRun::delta_pressure_kgcm2, 1.5 * step, false);
  if (run.experiment == "constant-angle") vary(&PlannedRun::middle_rad, 0.3 * step, false);
  if (run.pressure_swing_kgcm2 > 0) {
    vary(&PlannedRun::pressure_swing_kgcm2, step, true);
    vary(&PlannedRun::pressure_period_s, 2 * step, true);
  }
  return all;
}

}  // namespace

Designer::Choice Designer::improve(Choice choice, const Information& before,
                                   const std::vector<std::size_t>& rivals) const {
  const double already = smallest(before, rivals);
  for (const double step : {0.3, 0.12}) {
    bool better = true;
    for (int round = 0; better && round < 2; ++round) {
      better = false;
      const std::vector<PlannedRun> near = neighbours(choice.run, step);
      Choice best = choice;
      for (const PlannedRun& run : near) {
        if (least_seconds(run) > options_.longest) continue;
        const std::optional<Information> gram = information(run);
        if (!gram) continue;
        const double score = score_of(already, smallest(before + *gram, rivals), options_.wanted, run);
        if (score <= best.score + 1e-9) continue;
        best = {run, *gram, score};
        better = true;
      }
      choice = std::move(best);
    }
  }
  return choice;
}

Designer::Choice Designer::lengthen(Choice choice, const Information& before,
                                    const std::vector<std::size_t>& rivals) const {
  const double already = smallest(before, rivals);
  double seconds =
      seconds_needed(already, smallest(before + choice.gram, rivals), options_.wanted, choice.run);
  for (;;) {
    PlannedRun run = choice.run;
    run.seconds = std::min(options_.longest, std::max(least_seconds(run), seconds));
    run = tidy(run);
    const std::optional<Information> gram = information(run);
    if (!gram) return choice;
    const bool reached = smallest(before + *gram, rivals) >= options_.wanted;
    choice = {run, *gram, choice.score};
    if (reached || run.seconds >= options_.longest) return choice;
    seconds = run.seconds + 5;
  }
}

NextExperiment Designer::design() const {
  const auto id = [&](std::size_t i) { return tie_.models[i].hypothesis->id(); };
  const auto term = [&](std::size_t i) { return std::string(tie_.models[i].hypothesis->info().term); };
  const std::vector<std::optional<Information>> grams = all_candidates();
  // Two of the longest runs of the best kind: who cannot be told apart even so needs another rig, not another run.
  std::vector<std::size_t> rivals, twins;
  std::vector<double> reach(tie_.models.size(), 0.0);
  for (std::size_t r = 1; r < tie_.models.size(); ++r) {
    const double already = separation(recorded_, 0, r);
    for (std::size_t i = 0; i < grams.size(); ++i) {
      if (!grams[i]) continue;
      const double after = separation(recorded_ + *grams[i], 0, r);
      const double gain = std::max(0.0, after * after - already * already);
      reach[r] = std::max(
          reach[r], std::sqrt(already * already + gain * 2 * options_.longest / candidates_[i].seconds));
    }
    (reach[r] >= options_.least ? rivals : twins).push_back(r);
  }
  NextExperiment next;
  next.separates_a = id(0);
  const auto give_up = [&](std::size_t rival) {
    next.runs.clear();
    next.separates_b = id(rival);
    next.separation_now = separation(recorded_, 0, rival);
    next.separation_expected = reach[rival];
    next.sentence = words_for_hardware(id(0), id(rival), term(0), term(rival), reach[rival]);
    return next;
  };
  if (rivals.empty()) return give_up(twins.front());

  Information sum = recorded_;
  for (int count = 0; count < kMostRuns; ++count) {
    const double already = smallest(sum, rivals);
    Choice best;
    best.score = -2 * kNothing;
    for (std::size_t i = 0; i < grams.size(); ++i) {
      if (!grams[i]) continue;
      const double score =
          score_of(already, smallest(sum + *grams[i], rivals), options_.wanted, candidates_[i]);
      if (score > best.score) best = {candidates_[i], *grams[i], score};
    }
    best = lengthen(improve(best, sum, rivals), sum, rivals);
    sum += best.gram;
    next.runs.push_back(best.run);
    if (smallest(sum, rivals) >= options_.enough) break;
  }
  std::size_t hardest = rivals.front();
  for (const std::size_t r : rivals)
    if (separation(sum, 0, r) < separation(sum, 0, hardest)) hardest = r;
  next.separates_b = id(hardest);
  next.separation_now = separation(recorded_, 0, hardest);
  next.separation_expected = separation(sum, 0, hardest);
  if (next.separation_expected < options_.least) return give_up(hardest);
  next.sentence =
      words_for_runs(next.runs, term(0), term(hardest), next.separation_now, next.separation_expected);
  if (!twins.empty())
    next.sentence += " " + words_for_hardware(id(0), id(twins.front()), term(0), term(twins.front()),
                                              reach[twins.front()]);
  return next;
}

std::optional<Tie> tie_of(const Predictor& predictor, const Library& library, const Found& found) {
  for (std::size_t s = 0; s < found.added.size() && s < found.steps.size(); ++s) {
    const Step& step = found.steps[s];
    Tie tie;
    const Hypothesis* added = &library.hypotheses[static_cast<std::size_t>(found.added[s])];
    // The unit by which the search ranked this step, and will rank it again with the planned run.
    tie.noise_unit = step.trials.empty() ? step.screen.noise_unit : step.trials.front().behind.unit;
    for (const Trial& t : step.trials) {
      if (!t.in_set) continue;
      const Hypothesis* h = &library.hypotheses[static_cast<std::size_t>(t.hypothesis)];
      tie.models.push_back({h, t.values});
      // Between two that hardly differ the unit is that of their rounding.
      if (t.behind.separation > 1) tie.noise_unit = std::max(tie.noise_unit, t.behind.unit);
    }
    if (tie.models.size() < 2) continue;
    tie.predictor = &predictor;
    tie.weights = found.weights;
    tie.stem = found.model;
    tie.stem.coordinates.clear();
    auto& effects = tie.stem.model.effects;
    for (std::size_t i = tie.stem.tolerances; i < effects.size(); ++i)
      if (effects[i].hypothesis == added) {
        if (tie.models.front().hypothesis == added) tie.models.front().values = effects[i].values;
        effects.erase(effects.begin() + static_cast<std::ptrdiff_t>(i));
        break;
      }
    return tie;
  }
  return std::nullopt;
}

std::optional<NextExperiment> next_experiment(const Predictor& predictor, const Library& library,
                                              const Found& found, const ExperimentOptions& options) {
  // The runs that can be asked for are the testbed's; another axis has its own.
  if (!predictor.data().baseline.terms.empty() || !std::isfinite(predictor.data().rig.wheel_radius))
    return std::nullopt;
  std::optional<Tie> tie = tie_of(predictor, library, found);
  if (!tie) return std::nullopt;
  return Designer(std::move(*tie), options).design();
}

}  // namespace isac::explain
