#include "known_runs.hpp"

#include <gtest/gtest.h>

#include "catalogue.hpp"
#include "plant.hpp"

namespace blind {
namespace {

/// A free run and one that is led by hand, two seconds of each.
std::vector<RunPlan> short_runs(const Rig& rig) {
  Random random(12);
  std::vector<RunPlan> two;
  for (const bool free : {true, false}) {
    for (const RunPlan& run : draw_day(rig, random)) {
      if (run.free != free || run.experiment == "constant-angle" || run.experiment == "pcu-step") continue;
      two.push_back(run);
      for (auto* column : {&two.back().hand, &two.back().hand_velocity})
        if (!column->empty()) column->resize(1000);
      two.back().command_1.resize(1000);
      two.back().command_2.resize(1000);
      break;
    }
  }
  return two;
}

bool same(const Signals& a, const Signals& b) {
  return a.angle == b.angle && a.p1 == b.p1 && a.p2 == b.p2 && a.F1 == b.F1 && a.F2 == b.F2;
}

TEST(KnownRuns, say_of_every_effect_to_the_last_bit_what_a_simulation_says) {
  const Rig rig;
  const std::vector<RunPlan> runs = short_runs(rig);
  ASSERT_EQ(runs.size(), 2u);
  KnownRuns known(rig, runs, 1e-3);
  Random random(4);
  for (const Effect& effect : effects()) {
    Hidden hidden;
    hidden.seed = 77;
    effect.apply(hidden, effect.largest, effect.draw(random));
    for (std::size_t i = 0; i < runs.size(); ++i)
      EXPECT_TRUE(same(known.simulated(i, hidden), simulate(rig, runs[i], hidden, 1e-3))) << effect.id << i;
  }
}

TEST(KnownRuns, hand_out_the_bare_run_where_what_is_hidden_cannot_show) {
  const Rig rig;
  const std::vector<RunPlan> runs = short_runs(rig);
  KnownRuns known(rig, runs, 1e-3);
  Hidden hidden;
  hidden.gravity = 0.5;
  EXPECT_NE(&known.simulated(0, hidden), &known.bare(0)) << "a free joint hangs";
  EXPECT_EQ(&known.simulated(1, hidden), &known.bare(1)) << "a hand holds it";
}

}  // namespace
}  // namespace blind
