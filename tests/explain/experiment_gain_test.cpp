/// How many seconds of the rig a planned run saves, and whether what it settles on paper it settles in recordings.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

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
                        {"muscle_asymmetry", "torque_offset", false},
                        {"pressure_dependent_damping", "quadratic_damping", false},
                        {"dead_time", "second_order_lag", true},
                        {"valve_deadband", "valve_hysteresis", true},
                        {"asymmetric_fill_vent", "flow_limit", true},
                        {"stribeck_friction", "coulomb_friction", false},
                        {"hysteresis", "coulomb_friction", false},
                        {"cubic_stiffness", "tension_loss", false},
                        {"leak", "pressure_gain_error", true},
                        {"sensor_lag", "time_skew", false},
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
    if (next.runs.empty() || next.separation_expected < options.wanted) {
      std::printf("%-28s %-22s now %.1f: %s\n", pair.truth, pair.rival, now, next.sentence.c_str());
      continue;
    }
    double ours = 0;
    for (const PlannedRun& run : next.runs) ours += run.seconds;
    const double each = ours / static_cast<double>(next.runs.size());
    std::vector<std::pair<double, Designer::Information>> pool;
    for (PlannedRun run : designer.candidates()) {
      run.seconds = std::max(each, least_seconds(run));
      if (auto gram = designer.information(run)) pool.emplace_back(run.seconds, std::move(*gram));
    }
    std::mt19937 random(7);
    double mean = 0;
    constexpr int kDraws = 200;
    constexpr double kGivenUp = 1200;  // s: random runs that need longer count as if they were done then
    for (int draw = 0; draw < kDraws; ++draw) {
      Designer::Information sum = designer.recorded();
      double seconds = 0;
      while (seconds < kGivenUp && designer.separation(sum, 0, 1) < options.wanted) {
        const auto& one = pool[random() % pool.size()];
        sum += one.second;
        seconds += one.first;
      }
      mean += seconds / kDraws;
    }
    std::printf("%-28s %-22s now %.1f, then %.1f; ours %.0f s, random %.0f s: %s\n", pair.truth, pair.rival,
                now, next.separation_expected, ours, mean, next.sentence.c_str());
    ours_sum += ours;
    random_sum += mean;
    log_ratio += std::log(mean / ours);
    ++counted;
  }
  ASSERT_GE(counted, 6);
  std::printf("%d ties: ours %.0f s, random %.0f s; geometric mean of the ratios %.1f\n", counted, ours_sum,
              random_sum, std::exp(log_ratio / counted));
  EXPECT_LE(ours_sum, random_sum / 3);
}

}  // namespace
}  // namespace isac::explain
