// The firmware's loop on the host: the story's faults are found, nothing is asked of the heap, damaged tables never arm.
#include <gtest/gtest.h>

#include <set>

#include "../runtime/counted_new.hpp"
#include "twin.hpp"

namespace {

using namespace isac::embedded;
using isac::Status;
using isac::control::RunState;

TEST(ArmLoop, finds_every_fault_of_the_story_and_vents_in_that_very_tick) {
  const isac::test::Twin twin = isac::test::run_twin(isac::test::exported_table());
  ASSERT_EQ(twin.status, Status::kOk);
  ASSERT_EQ(twin.ticks.size(), static_cast<std::size_t>(kStoryTicks));
  std::size_t blow = 0;
  int armed = 0, last_state = 0;
  std::set<float> pressures;
  for (std::size_t k = 0; k < twin.ticks.size(); ++k) {
    const TickRecord& tick = twin.ticks[k];
    const bool faulted = tick.state == static_cast<int>(RunState::kFaulted);
    if (faulted && last_state != static_cast<int>(RunState::kFaulted)) {
      ASSERT_LT(blow, kBlows.size());
      EXPECT_EQ(tick.fault, static_cast<int>(kBlows[blow].expected)) << k;
      ++blow;
    }
    if (tick.state == static_cast<int>(RunState::kArmed)) {
      ++armed;
      pressures.insert(tick.pressure.begin(), tick.pressure.end());
    } else {
      for (const float p : tick.pressure) ASSERT_EQ(p, 0.0f) << k;
    }
    last_state = tick.state;
  }
  EXPECT_EQ(blow, kBlows.size());
  EXPECT_GT(armed, 3000);
  EXPECT_GT(pressures.size(), 30000u);  // a story in which the controllers have something to say
}

TEST(ArmLoop, single_samples_fault_in_the_tick_of_the_blow) {
  const isac::test::Twin twin = isac::test::run_twin(isac::test::exported_table());
  for (std::size_t i = 0; i < 5; ++i) {  // overrun and following error need their time
    const auto at = static_cast<std::size_t>(kBlows[i].tick);
    EXPECT_EQ(twin.ticks[at - 1].state, static_cast<int>(RunState::kArmed)) << i;
    EXPECT_EQ(twin.ticks[at].state, static_cast<int>(RunState::kFaulted)) << i;
  }
}

TEST(ArmLoop, ten_thousand_ticks_ask_for_no_memory) {
  const auto table = isac::test::exported_table();
  auto loop = std::make_unique<ArmLoop>();
  auto arm = std::make_unique<SimulatedArm>();
  Story story;
  isac::test::watch_allocations();
  const Status status = loop->start(table);
  arm->start(*loop);
  int armed = 0;
  for (int k = 0; k < 10000; ++k) {
    Sample sample;
    Wanted wanted;
    story.at(k, *arm, sample, wanted);
    const Valves valves = loop->tick(sample, wanted);
    arm->step(valves.pressure, 5e-4f);
    armed += valves.state == RunState::kArmed;
  }
  EXPECT_EQ(isac::test::watched_allocations(), 0);
  EXPECT_EQ(status, Status::kOk);
  EXPECT_GT(armed, 4000);
}

TEST(ArmLoop, damaged_tables_are_refused_each_for_its_reason_and_nothing_arms) {
  for (const isac::test::DamagedTable& table : isac::test::damaged_tables()) {
    const isac::test::Twin twin = isac::test::run_twin(table.bytes, 1000);
    EXPECT_EQ(twin.status, table.expected) << table.what;
    isac::test::expect_vented(twin.ticks, table.what);
  }
}

TEST(ArmLoop, is_started_once) {
  const auto table = isac::test::exported_table();
  auto loop = std::make_unique<ArmLoop>();
  EXPECT_EQ(loop->start(table), Status::kOk);
  EXPECT_EQ(loop->start(table), Status::kNotPermitted);
  EXPECT_TRUE(loop->started());
  EXPECT_EQ(loop->effects_left_out(), 0);
}

}  // namespace
