/// How many seconds of the rig a planned run saves, and whether what it settles on paper it settles in recordings.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "experiment_bench.hpp"
#include "isac/explain/experiment.hpp"

namespace isac::explain {
namespace {

using test::Bench;
using test::by_hand;
using test::clamped;
using test::TiedRig;

struct Pair {
  const char *truth, *rival;
  bool slow;  ///< recorded with slow pressures only
};

TEST(NextExperiment, needs_at_most_a_third_of_the_seconds_that_random_runs_need) {
  const Bench constant(TiedRig{}, test::constant_mean_pressure());
  const Bench slow(TiedRig{}, test::slow_pressures());
  const Pair pairs[] = {{"pressure_dependent_friction", "coulomb_friction", false},
                        {"lever_arm_variation", "encoder_gain", false},
                        {"crosstalk", "pressure_gain_error", false},
                        {"asymmetric_fill_vent", "flow_limit", true},
                        {"stribeck_friction", "coulomb_friction", false},
                        {"pressure_dependent_friction", "pressure_dependent_damping", false},
                        {"thermal_drift", "force_drift", false}};
  double ours_sum = 0, random_sum = 0, log_ratio = 0;
  int counted = 0;
  for (const Pair& pair : pairs) {
    const Bench& bench = pair.slow ? slow : constant;
    const std::optional<Tie> tie = bench.tie_between(pair.truth, pair.rival, 8.0);
    if (!tie) {
      std::printf("%-28s %-22s not testable with these recordings\n", pair.truth, pair.rival);
      continue;
    }
    const ExperimentOptions options;
    const Designer designer(*tie, options);
    const double now = designer.separation(designer.recorded(), 0, 1);
    const NextExperiment next = designer.design();
    if (now >= options.enough || next.runs.empty() || next.separation_expected < options.least) {
      std::printf("%-28s %-22s now %.1f: %s\n", pair.truth, pair.rival, now, next.sentence.c_str());
      continue;
    }
    const double target = std::min(options.wanted, next.separation_expected);
    double ours = 0;
    for (const PlannedRun& run : next.runs) ours += run.seconds;
    const double mean = test::random_seconds(designer, next, target, 200);
    std::printf("%-28s %-22s now %.1f, then %.1f; ours %.0f s, random %.0f s: %s\n", pair.truth, pair.rival,
                now, next.separation_expected, ours, mean, next.sentence.c_str());
    ours_sum += ours;
    random_sum += mean;
    log_ratio += std::log(mean / ours);
    ++counted;
  }
  ASSERT_EQ(counted, 7);  // a pair that is not tied, or that no run separates, would say nothing
  std::printf("%d ties: ours %.0f s, random %.0f s; geometric mean of the ratios %.1f\n", counted, ours_sum,
              random_sum, std::exp(log_ratio / counted));
  EXPECT_LE(ours_sum, random_sum / 3);
}

struct Hidden {
  const char* id;
  TiedRig rig;
  std::vector<PlannedRun> runs;
};

/// What the search says of recordings: the names that are left of its first step, best first, and what to record next.
struct Said {
  std::vector<std::string> left;
  std::optional<NextExperiment> next;
};

Said ask(const TiedRig& rig, const std::vector<series::Recording>& runs) {
  Prepared data = prepare(runs, rig.facts(), {}, 4.0);
  Library library = make_library(data);
  const Predictor predictor(data);
  ExplainOptions options;
  options.most_effects = 1;
  const Found found = search(predictor, library, data, options);
  Said said;
  if (!found.steps.empty())
    for (const Trial& t : found.steps.front().trials)
      if (t.in_set) said.left.push_back(library.hypotheses[static_cast<std::size_t>(t.hypothesis)].id());
  if (said.left.size() > 1) said.next = next_experiment(predictor, library, found, {});
  return said;
}

bool holds(const std::vector<std::string>& set, const std::string& id) {
  return std::find(set.begin(), set.end(), id) != set.end();
}

TEST(NextExperiment, settles_ties_in_noisy_recordings_made_without_the_model) {
  TiedRig uneven, more_uneven;
  uneven.asymmetry = 0.02;
  more_uneven.asymmetry = 0.05;
  uneven.pretension = more_uneven.pretension = 80;
  const Hidden hidden[] = {{"muscle_asymmetry", uneven, test::constant_mean_pressure()},
                           {"muscle_asymmetry", more_uneven, test::constant_mean_pressure()}};
  int tied = 0, settled = 0;
  for (const Hidden& h : hidden)
    for (std::uint32_t seed = 0; seed < 2; ++seed) {
      std::vector<series::Recording> runs = test::record_all(h.rig, h.runs, 1 + 40 * seed);
      const Said before = ask(h.rig, runs);
      if (!holds(before.left, h.id) || !before.next || before.next->runs.empty()) {
        std::printf("%s %u: not tied (%zu left)\n", h.id, seed, before.left.size());
        continue;
      }
      ++tied;
      const NextExperiment& next = *before.next;
      std::uint32_t number = 1 + 40 * seed + static_cast<std::uint32_t>(runs.size());
      for (const PlannedRun& run : next.runs) runs.push_back(test::record(h.rig, run, number++));
      const Said after = ask(h.rig, runs);
      const bool done = !after.left.empty() && after.left.front() == h.id &&
                        std::none_of(before.left.begin(), before.left.end(), [&](const std::string& id) {
                          return id != h.id && holds(after.left, id);
                        });
      settled += done ? 1 : 0;
      std::string left;
      for (const std::string& id : after.left) left += " " + id;
      std::printf("%s %u: %zu left; %s\n  then %zu left:%s%s\n", h.id, seed, before.left.size(),
                  next.sentence.c_str(), after.left.size(), left.c_str(), done ? "" : "  NOT SETTLED");
    }
  std::printf("%d of %d ties settled\n", settled, tied);
  EXPECT_EQ(tied, 4);
  EXPECT_EQ(settled, tied);
}

}  // namespace
}  // namespace isac::explain
