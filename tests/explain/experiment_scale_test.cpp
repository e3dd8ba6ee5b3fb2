/// At scale: every pair that the catalogue calls confusable and that some ordinary set of recordings leaves tied, what the
/// proposed run would settle of them, and in which share of the seconds that runs drawn at random need. Prints the table of
/// docs/explain.md.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <sstream>

#include "experiment_bench.hpp"

namespace isac::explain {
namespace {

using test::Bench;
using test::TiedRig;

constexpr double kShows = 8;  // sigma by which the true effect shows beside a refitted baseline
constexpr double kTied = 3;   // sigma below which two effects are tied
constexpr int kDraws = 100;

struct Row {
  std::string truth, rival, recordings, sentence;
  double now = 0, then = 0, ours = 0, random = 0;
};

/// Ids that the catalogue says an effect is mistaken for.
std::vector<std::string> rivals_of(const Hypothesis& h) {
  std::vector<std::string> ids;
  std::istringstream words(h.info().confused_with);
  for (std::string word; std::getline(words, word, ',');) {
    word.erase(0, word.find_first_not_of(' '));
    ids.push_back(word);
  }
  return ids;
}

TEST(NextExperiment, settles_nine_ties_in_ten_in_a_third_of_the_seconds_of_random_runs) {
  const struct {
    const char* name;
    std::vector<PlannedRun> runs;
  } days[] = {{"one mean pressure", test::constant_mean_pressure()},
              {"slow pressures", test::slow_pressures()},
              {"by hand only", {test::by_hand(20, 0.35, 0.3), test::by_hand(20, 0.4, 3.0)}}};
  std::vector<Row> settled;
  std::map<std::pair<std::string, std::string>, Row> hardware;
  std::set<std::pair<std::string, std::string>> seen;
  for (const auto& day : days) {
    const Bench bench(TiedRig{}, day.runs);
    std::set<std::string> tried;
    for (const Hypothesis& h : bench.library.hypotheses) {
      if (!tried.insert(h.id()).second) continue;
      for (const std::string& rival : rivals_of(h)) {
        // A general case mimics its special case always: parsimony decides there, not a recording.
        if (seen.count({h.id(), rival}) != 0 || seen.count({rival, h.id()}) != 0 || nests(rival, h.id()))
          continue;
        const std::optional<Tie> tie = bench.tie_between(h.id(), rival, kShows);
        if (!tie) continue;
        const ExperimentOptions options;
        const Designer designer(*tie, options);
        Row row;
        row.truth = h.id();
        row.rival = rival;
        row.recordings = day.name;
        row.now = designer.separation(designer.recorded(), 0, 1);
        if (!(row.now < kTied)) continue;
        const NextExperiment next = designer.design();
        row.then = next.separation_expected;
        row.sentence = next.sentence;
        if (next.runs.empty()) {
          hardware[{row.truth, row.rival}] = row;
          continue;
        }
        seen.insert({row.truth, row.rival});
        hardware.erase({row.truth, row.rival});
        hardware.erase({row.rival, row.truth});
        for (const PlannedRun& run : next.runs) row.ours += run.seconds;
        row.random = test::random_seconds(designer, next, std::min(options.wanted, row.then), kDraws);
        settled.push_back(row);
      }
    }
  }
  double ours = 0, random = 0, log_ratio = 0, share = 0;
  int enough = 0;
  std::printf(
      "| true effect, rival | recorded so far | sigma now | then | ours, s | random, s |\n| --- | --- | --- "
      "| --- | --- | --- |\n");
  for (const Row& row : settled) {
    std::printf("| %s, %s | %s | %.1f | %.1f | %.0f | %.0f |\n", row.truth.c_str(), row.rival.c_str(),
                row.recordings.c_str(), row.now, row.then, row.ours, row.random);
    ours += row.ours;
    random += row.random;
    log_ratio += std::log(row.random / row.ours);
    // The set's test rules a rival out at t > 1.645, t normal about half the separation with unit deviation.
    share += 0.5 * std::erfc((1.645 - 0.5 * row.then) / std::sqrt(2.0));
    enough += row.then >= ExperimentOptions{}.enough ? 1 : 0;
  }
  for (const auto& [pair, row] : hardware)
    std::printf("no run: %s, %s (%s): now %.1f, at best %.1f; %s\n", row.truth.c_str(), row.rival.c_str(),
                row.recordings.c_str(), row.now, row.then, row.sentence.c_str());
  const auto count = static_cast<double>(settled.size());
  std::printf(
      "%zu ties that a run can settle (and %zu that none can): %d beyond 5 sigma, %.1f %% settled on "
      "average; ours %.0f s, random %.0f "
      "s; geometric mean of the "
      "ratios %.1f\n",
      settled.size(), hardware.size(), enough, 100 * share / count, ours, random,
      std::exp(log_ratio / count));
  EXPECT_GE(settled.size(), 20U);
  EXPECT_GE(share, 0.9 * count);
  EXPECT_LE(ours, random / 3);
}

}  // namespace
}  // namespace isac::explain
