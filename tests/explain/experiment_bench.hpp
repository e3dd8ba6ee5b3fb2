/// @file
/// Recordings, the baseline fitted to them, and effects tried in its surroundings: what a designer of experiments is given.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "isac/explain/experiment.hpp"
#include "tied_data.hpp"

namespace isac::test {

/// Nothing but the initial mean pressure, and pressures that move slowly.
inline std::vector<explain::PlannedRun> constant_mean_pressure() {
  return {by_hand(20, 0.35, 0.3), by_hand(20, 0.3, 0.3, 0.8), by_hand(20, 0.4, 3.0),
          by_hand(20, 0.3, 3.0, -0.8), clamped(16, 0.1, 1.0, 8)};
}

inline std::vector<explain::PlannedRun> slow_pressures() {
  return {by_hand(20, 0.35, 0.3), by_hand(20, 0.4, 3.0), clamped(24, 0.1, 0.5, 12)};
}

struct Bench {
  explain::Prepared data;
  explain::Library library;
  explain::Predictor predictor;
  explain::Weights weights;
  explain::Fit stem;

  Bench(const TiedRig& rig, const std::vector<explain::PlannedRun>& runs)
      : data(explain::prepare(record_all(rig, runs), rig.facts(), {}, 4.0)),
        library(explain::make_library(data)),
        predictor(data) {
    // Of a low-passed row: 0.3 N in both sensors at 19 mm, and 0.004 kg/cm2, through a Gaussian of 6 ms at 500 Hz.
    constexpr double kSigma[] = {0.0025, 120, 120, 0.005};
    std::copy(std::begin(kSigma), std::end(kSigma), weights.sigma);
    stem = explain::fit_baseline(predictor, library.tolerances, weights);
  }

  [[nodiscard]] const explain::Hypothesis* find(const std::string& id) const {
    for (const explain::Hypothesis& h : library.hypotheses)
      if (h.id() == id) return &h;
    return nullptr;
  }

  /// The effect refitted to what `place` has left over, from all of its shapes.
  [[nodiscard]] static explain::Active fitted(const explain::Around& place, const explain::Hypothesis& h) {
    explain::Refined best;
    best.loss = std::numeric_limits<double>::infinity();
    for (const explain::Values& shape : h.shapes) {
      explain::Refined now = explain::refine(place, h, shape);
      if (now.loss < best.loss) best = std::move(now);
    }
    return {&h, best.values};
  }

  [[nodiscard]] explain::Tie tie(const std::vector<std::string>& ids) const {
    explain::Tie out;
    out.predictor = &predictor;
    out.stem = stem;
    out.weights = weights;
    const explain::Around place = explain::around(predictor, stem, weights);
    for (const std::string& id : ids) {
      const explain::Hypothesis* h = find(id);
      EXPECT_NE(h, nullptr) << id;
      if (h != nullptr) out.models.push_back(fitted(place, *h));
    }
    return out;
  }

  /// A tie without noise: `truth` as large as shows by `sigma` beside a refitted baseline, and the rival that mimics it best.
  [[nodiscard]] std::optional<explain::Tie> tie_between(const std::string& truth, const std::string& rival,
                                                        double sigma) const {
    const explain::Hypothesis *t = find(truth), *r = find(rival);
    if (t == nullptr || r == nullptr) return std::nullopt;
    explain::Around place = explain::around(predictor, stem, weights);
    const auto left = [&](const explain::Values& values) {
      return Eigen::VectorXd(
          place.project(explain::response(predictor, stem, place.here, {t, values}, weights)));
    };
    explain::Active active{t, t->shapes[t->shapes.size() / 2]};
    const auto scaled = [&](double factor) {
      explain::Values v = active.values;
      for (std::size_t k = 0; k < v.size(); ++k) {
        const double null = t->info().parameters[k].null_value;
        if (t->free[k] && t->amplitude[k]) v[k] = null + factor * (v[k] - null);
      }
      return v;
    };
    double low = 1e-4, high = 10;
    if (left(scaled(high)).norm() < sigma) return std::nullopt;
    for (int i = 0; i < 30; ++i) {
      const double middle = std::sqrt(low * high);
      (left(scaled(middle)).norm() < sigma ? low : high) = middle;
    }
    active.values = scaled(high);
    place.residual = -left(active.values);
    explain::Tie out;
    out.predictor = &predictor;
    out.stem = stem;
    out.weights = weights;
    out.models = {active, fitted(place, *r)};
    return out;
  }
};

/// Seconds that runs drawn at random, each as long as one of the proposed, need for as much; the mean of `draws` such days.
inline double random_seconds(const explain::Designer& designer, const explain::NextExperiment& next,
                             double target, int draws) {
  constexpr double kGivenUp = 1200;  // s: random runs that need longer count as if they were done then
  double ours = 0;
  for (const explain::PlannedRun& run : next.runs) ours += run.seconds;
  const double each = ours / static_cast<double>(next.runs.size());
  std::vector<std::pair<double, explain::Designer::Information>> pool;
  for (explain::PlannedRun run : designer.candidates()) {
    run.seconds = std::max(each, explain::least_seconds(run));
    if (auto gram = designer.information(run)) pool.emplace_back(run.seconds, std::move(*gram));
  }
  std::mt19937 random(7);
  double mean = 0;
  for (int draw = 0; draw < draws; ++draw) {
    explain::Designer::Information sum = designer.recorded();
    double seconds = 0;
    while (seconds < kGivenUp && designer.separation(sum, 0, 1) < target) {
      const auto& one = pool[random() % pool.size()];
      sum += one.second;
      seconds += one.first;
    }
    mean += seconds / draws;
  }
  return mean;
}

}  // namespace isac::test
