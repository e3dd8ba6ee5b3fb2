// The fault state machine: every transition by a table, and its promises over random walks.
#include "isac/control/fault_machine.hpp"

#include <gtest/gtest.h>

#include <random>

#include "isac/control/joint_controller.hpp"

namespace {

using namespace isac::control;

constexpr FaultSettings kSettings{
    .period = 500'000, .stale_after = 2'000'000, .plausible_ticks = 3, .overrun_limit = 4};
constexpr Finding kFound{.code = FaultCode::kAngleLimit, .joint = 2, .value = 1.3f, .limit = 1.2f};

/// Drives a machine on time, one sample a tick.
struct Driver {
  FaultMachine machine{kSettings};
  TickInputs in{.now = 0, .sampled = 0};
  RunState tick(std::int64_t periods = 1) {
    in.now += periods * kSettings.period;
    in.sampled = in.now - 100'000;
    return machine.begin(in);
  }
  void good(int n) {
    for (int i = 0; i < n; ++i) tick();
  }
  RunState arm() {
    in.arm = false;
    tick();
    in.arm = true;
    return tick();
  }
  void to(RunState state) {
    if (state == RunState::kDisarmed) {
      in.arm = false;
      good(5);
      return;
    }
    good(5);
    ASSERT_EQ(arm(), RunState::kArmed);
    in.arm = false;
    if (state == RunState::kFaulted) machine.report(kFound);
    ASSERT_EQ(machine.state(), state);
  }
};

struct Row {
  const char* what;
  RunState from;
  bool arm, disarm, acknowledge, finding;
  RunState to;
};

class Transition : public ::testing::TestWithParam<Row> {};

TEST_P(Transition, is_as_the_table_says) {
  const Row& row = GetParam();
  Driver d;
  d.to(row.from);
  d.in.arm = d.in.acknowledge = d.in.disarm = false;
  d.tick();
  d.in.arm = row.arm;
  d.in.disarm = row.disarm;
  d.in.acknowledge = row.acknowledge;
  d.in.finding = row.finding ? kFound : Finding{};
  EXPECT_EQ(d.tick(), row.to) << row.what;
  EXPECT_EQ(d.machine.vents(), row.to != RunState::kArmed);
  EXPECT_EQ(d.machine.arm_refused(), row.arm && row.to != RunState::kArmed);
}

constexpr auto D = RunState::kDisarmed, A = RunState::kArmed, F = RunState::kFaulted;
INSTANTIATE_TEST_SUITE_P(
    All, Transition,
    ::testing::Values(Row{"disarmed stays", D, false, false, false, false, D},
                      Row{"an edge arms", D, true, false, false, false, A},
                      Row{"disarm wins over arm", D, true, true, false, false, D},
                      Row{"not with a finding", D, true, false, false, true, D},
                      Row{"acknowledge arms nothing", D, false, false, true, false, D},
                      Row{"a finding while disarmed latches nothing", D, false, false, false, true, D},
                      Row{"armed stays", A, false, false, false, false, A},
                      Row{"a second edge changes nothing", A, true, false, false, false, A},
                      Row{"disarm", A, false, true, false, false, D},
                      Row{"finding", A, false, false, false, true, F},
                      Row{"a finding wins over disarm", A, false, true, false, true, F},
                      Row{"acknowledge does not hide a finding", A, false, false, true, true, F},
                      Row{"a fault stays", F, false, false, false, false, F},
                      Row{"arm does not clear it", F, true, false, false, false, F},
                      Row{"disarm does not clear it", F, false, true, false, false, F},
                      Row{"acknowledge does", F, false, false, true, false, D},
                      Row{"not while the cause is there", F, false, false, true, true, F},
                      Row{"acknowledge and arm at once only acknowledge", F, true, false, true, false, D}));

TEST(FaultMachine, starts_disarmed_and_a_switch_held_from_the_start_is_no_edge) {
  FaultMachine machine(kSettings);
  EXPECT_TRUE(machine.vents());
  Driver d;
  d.in.arm = true;
  for (int k = 0; k < 100; ++k) EXPECT_EQ(d.tick(), RunState::kDisarmed);
  EXPECT_EQ(d.arm(), RunState::kArmed);
}

TEST(FaultMachine, a_switch_held_from_the_start_is_no_edge_even_without_a_plausibility_time) {
  FaultMachine machine({.plausible_ticks = 0});
  EXPECT_EQ(machine.begin({.now = 1, .sampled = 1, .arm = true}), RunState::kDisarmed);
  EXPECT_EQ(machine.begin({.now = 500'001, .sampled = 500'001, .arm = false}), RunState::kDisarmed);
  EXPECT_EQ(machine.begin({.now = 1'000'001, .sampled = 1'000'001, .arm = true}), RunState::kArmed);
}

TEST(FaultMachine, arms_only_after_enough_good_samples_in_a_row_and_an_early_edge_is_spent) {
  Driver d;
  d.tick();
  d.in.arm = true;
  EXPECT_EQ(d.tick(), RunState::kDisarmed);
  EXPECT_TRUE(d.machine.arm_refused());
  for (int k = 0; k < 10; ++k) EXPECT_EQ(d.tick(), RunState::kDisarmed);  // held
  d.in.arm = false;
  d.in.finding = kFound;
  d.tick();
  d.in.finding = {};
  d.good(1);
  d.in.arm = true;
  EXPECT_EQ(d.tick(), RunState::kDisarmed);  // one good sample of three since the finding
  d.good(2);
  EXPECT_EQ(d.arm(), RunState::kArmed);
}

TEST(FaultMachine, keeps_the_first_cause_and_counts_the_rest) {
  Driver d;
  d.to(RunState::kArmed);
  d.machine.report(kFound);
  d.machine.report({.code = FaultCode::kOverrun});
  d.in.finding = {.code = FaultCode::kEncoderJump, .joint = 0};
  d.tick();
  EXPECT_EQ(d.machine.cause(), kFound);
  EXPECT_EQ(d.machine.later_findings(), 2);
}

TEST(FaultMachine, tells_a_fault_once) {
  Driver d;
  EXPECT_FALSE(d.machine.take_report());
  d.to(RunState::kFaulted);
  EXPECT_TRUE(d.machine.take_report());
  EXPECT_FALSE(d.machine.take_report());
  d.tick();
  EXPECT_FALSE(d.machine.take_report());
}

TEST(FaultMachine, an_arm_switch_held_through_a_fault_does_not_arm_again) {
  Driver d;
  d.good(5);
  ASSERT_EQ(d.arm(), RunState::kArmed);  // and stays on
  d.machine.report(kFound);
  d.in.acknowledge = true;
  EXPECT_EQ(d.tick(), RunState::kDisarmed);
  d.good(20);
  EXPECT_EQ(d.machine.state(), RunState::kDisarmed);
  EXPECT_EQ(d.arm(), RunState::kArmed);
}

TEST(FaultMachine, a_held_acknowledge_lets_only_one_fault_go) {
  Driver d;
  d.to(RunState::kFaulted);
  d.in.acknowledge = true;
  d.tick();
  d.good(5);
  ASSERT_EQ(d.arm(), RunState::kArmed);
  d.machine.report(kFound);
  d.good(5);
  EXPECT_EQ(d.machine.state(), RunState::kFaulted);
}

TEST(FaultMachine, late_ticks_leak_away_and_only_many_in_a_short_time_are_a_fault) {
  Driver d;
  d.to(RunState::kArmed);
  for (int k = 0; k < 200; ++k)
    EXPECT_EQ(d.tick(k % 2 == 0 ? 2 : 1), RunState::kArmed);  // every other one late
  EXPECT_EQ(d.machine.late_ticks(), 100);
  EXPECT_EQ(d.machine.skipped_periods(), 100);
  d.good(10);
  EXPECT_EQ(d.tick(3), RunState::kArmed);
  EXPECT_TRUE(d.machine.late());
  EXPECT_EQ(d.tick(3), RunState::kArmed);
  EXPECT_EQ(d.tick(3), RunState::kArmed);
  EXPECT_EQ(d.tick(3), RunState::kFaulted);  // the fourth in a row
  EXPECT_EQ(d.machine.cause().code, FaultCode::kOverrun);
  EXPECT_EQ(d.machine.skipped_periods(), 108);
}

TEST(FaultMachine, a_little_jitter_is_not_late) {
  Driver d;
  d.to(RunState::kArmed);
  for (int k = 0; k < 1000; ++k) {
    d.in.now += k % 2 == 0 ? 200'000 : -200'000;  // ± 0.4 periods
    d.tick();
    EXPECT_FALSE(d.machine.late());
  }
  EXPECT_EQ(d.machine.state(), RunState::kArmed);
}

TEST(FaultMachine, a_sample_that_is_old_or_is_the_last_one_again_is_a_fault) {
  for (const bool repeated : {true, false}) {
    Driver d;
    d.to(RunState::kArmed);
    d.in.now += kSettings.period;
    if (!repeated) d.in.now += 5 * kSettings.period;
    d.in.sampled += repeated ? 0 : 1;  // newer than the last, but 3 ms old
    EXPECT_EQ(d.machine.begin(d.in), RunState::kFaulted);
    EXPECT_EQ(d.machine.cause().code, FaultCode::kStaleSample);
  }
}

TEST(FaultMachine, a_clock_that_stands_still_is_a_fault) {
  Driver d;
  d.to(RunState::kArmed);
  d.in.sampled += 1;
  EXPECT_EQ(d.machine.begin(d.in), RunState::kFaulted);
}

TEST(FaultMachine, a_command_that_is_no_number_vents_in_the_same_tick) {
  // The controller and the machine as a loop joins them.
  Driver d;
  d.to(RunState::kArmed);
  JointController<float> controller;
  ASSERT_EQ(controller.configure(testbed_settings<float>()), isac::Status::kOk);
  ASSERT_EQ(controller.set_mode(Mode::kPosition), isac::Status::kOk);
  JointCommand<float> u;
  d.tick();
  const isac::Status status =
      controller.step({}, {.angle = std::numeric_limits<float>::quiet_NaN()}, 5e-4f, u);
  if (!isac::ok(status)) d.machine.report({.code = FaultCode::kCommandNotFinite, .joint = 0});
  EXPECT_TRUE(d.machine.vents());
  EXPECT_TRUE(u.vented);
  EXPECT_EQ(d.machine.cause().code, FaultCode::kCommandNotFinite);
}

TEST(FaultMachine, keeps_its_promises_over_random_walks) {
  std::mt19937 random(20261121);
  const auto chance = [&random](int of) { return std::uniform_int_distribution<int>(1, of)(random) == 1; };
  int times_armed = 0, times_faulted = 0, times_let_go = 0;
  for (int walk = 0; walk < 100; ++walk) {
    Driver d;
    bool last_arm = true, last_acknowledge = true;
    int good_in_a_row = 0;
    RunState before = d.machine.state();
    Finding cause;
    for (int k = 0; k < 1000; ++k) {
      d.in.arm = chance(4) ? !d.in.arm : d.in.arm;
      d.in.acknowledge = chance(6);
      d.in.disarm = chance(40);
      d.in.finding = chance(25) ? Finding{.code = static_cast<FaultCode>(1 + k % 15),
                                          .joint = static_cast<std::int8_t>(k % 6)}
                                : Finding{};
      const bool arm_edge = d.in.arm && !last_arm, acknowledge_edge = d.in.acknowledge && !last_acknowledge;
      const RunState now = d.tick(chance(10) ? 3 : 1);
      // Never armed without an edge, with a finding, or before three good ticks.
      if (now == RunState::kArmed && before != RunState::kArmed) {
        ASSERT_EQ(before, RunState::kDisarmed);
        ASSERT_TRUE(arm_edge && !d.in.finding.found() && !d.in.disarm);
        ASSERT_GE(good_in_a_row, kSettings.plausible_ticks);
        ++times_armed;
      }
      if (now == RunState::kFaulted && before != RunState::kFaulted) {
        ASSERT_EQ(before, RunState::kArmed);
        cause = d.machine.cause();
        ASSERT_TRUE(cause.found());
        ++times_faulted;
      }
      if (before == RunState::kFaulted && now != RunState::kFaulted) {
        ASSERT_EQ(now, RunState::kDisarmed);
        ASSERT_TRUE(acknowledge_edge);
        ++times_let_go;
      }
      ASSERT_EQ(d.machine.vents(), now != RunState::kArmed);
      if (now == RunState::kFaulted) {
        ASSERT_EQ(d.machine.cause(), cause);
      }
      good_in_a_row = d.in.finding.found() ? 0 : good_in_a_row + 1;
      last_arm = d.in.arm;
      last_acknowledge = d.in.acknowledge;
      before = now;
      if (chance(60)) {
        d.machine.report(kFound);
        good_in_a_row = 0;
        if (before == RunState::kArmed) {
          cause = kFound;
          before = RunState::kFaulted;
          ASSERT_TRUE(d.machine.vents());
        }
      }
    }
  }
  EXPECT_GT(times_armed, 1000);  // the walk did go everywhere
  EXPECT_GT(times_faulted, 500);
  EXPECT_GT(times_let_go, 500);
}

TEST(FaultCode, every_code_has_words_of_its_own) {
  for (int i = 0; i <= static_cast<int>(FaultCode::kOperator); ++i) {
    EXPECT_STRNE(describe(static_cast<FaultCode>(i)), "unknown fault");
    for (int j = 0; j < i; ++j)
      EXPECT_STRNE(describe(static_cast<FaultCode>(i)), describe(static_cast<FaultCode>(j)));
  }
}

}  // namespace
