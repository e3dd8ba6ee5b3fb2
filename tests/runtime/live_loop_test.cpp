// The live loop's behaviours in virtual time (docs/faults.md gives the numbers): a cycle, a fault, a vent.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "control_bench.hpp"
#include "counted_new.hpp"

namespace isac::test {
namespace {

using control::FaultCode;
using control::RunState;
using runtime::LoopEnd;
using runtime::Phase;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(ControlLoop, starts_disarmed_and_opens_no_valve_before_it_is_armed) {
  Bench bench;
  bench.director.arms = false;
  bench.cycles(1000);
  EXPECT_EQ(bench.state(), RunState::kDisarmed);
  EXPECT_EQ(bench.card.writes, 0);
  EXPECT_EQ(bench.card.vents, 1000);  // every cycle anew
  bench.director.arms = true;
  bench.cycles(2);
  EXPECT_EQ(bench.state(), RunState::kArmed);
}

TEST(ControlLoop, refuses_to_arm_while_samples_are_not_plausible) {
  Bench bench;
  bench.card.change = [](card::Sample& sample) { sample.input[0] = 65535; };  // an empty slot
  bench.director.wanted.arm = false;
  bench.cycles(500);
  bench.director.arms = false;
  bench.director.wanted.arm = true;  // an operator who insists
  bench.cycles(500);
  EXPECT_EQ(bench.state(), RunState::kDisarmed);
  EXPECT_EQ(bench.card.writes, 0);
}

TEST(ControlLoop, gives_up_on_a_card_that_never_gets_plausible_and_says_what_it_saw) {
  Bench bench;
  bench.card.change = [](card::Sample& sample) { sample.input[2] = 65535; };
  const std::atomic<bool> stop{false};
  const LoopEnd end = bench.loop->run(bench.director, stop, nullptr, nullptr);
  EXPECT_EQ(end.why, LoopEnd::Why::kImplausible);
  EXPECT_EQ(end.cause.code, FaultCode::kInputCode);
  EXPECT_EQ(end.cause.joint, 2);  // the channel
  EXPECT_EQ(runtime::finding_words(end.cause),
            "channel 2: an input gave a code that its converter does not have (6.554e+04 counts, limit 4095 "
            "counts)");
  EXPECT_EQ(bench.card.writes, 0);
}

TEST(ControlLoop, gives_up_at_once_on_a_card_that_does_not_answer) {
  Bench bench;
  bench.card.fail_after = 0;
  const std::atomic<bool> stop{false};
  const LoopEnd end = bench.loop->run(bench.director, stop, nullptr, nullptr);
  EXPECT_EQ(end.why, LoopEnd::Why::kFault);
  EXPECT_EQ(end.cause.code, FaultCode::kReadFailed);
  EXPECT_EQ(end.cycles, 1);
  EXPECT_EQ(bench.card.writes, 0);
}

TEST(ControlLoop, brings_both_pressures_up_together_before_the_controller_takes_over) {
  Bench bench([](runtime::ControlSettings& s) { s.run_up = 1.0; });
  bench.cycles(102);
  ASSERT_EQ(bench.loop->row().phase, Phase::kRunUp);
  bench.cycles(1000);  // half of the run-up
  const auto& joint = bench.loop->row().joint[0];
  EXPECT_EQ(joint.p1_cmd, joint.p2_cmd);
  EXPECT_NEAR(joint.p1_cmd, 1.5 * kPascalPerKgfCm2,
              0.002 * 1.5 * kPascalPerKgfCm2);  // a cycle is a thousandth
  bench.cycles(1005);
  EXPECT_EQ(bench.loop->row().phase, Phase::kControl);
}

TEST(ControlLoop, skips_whole_periods_after_a_late_cycle_and_never_catches_up) {
  Bench bench;
  bench.run_in();
  const std::int64_t before = bench.loop->row().time_ns;
  bench.card.stall_ns = 7 * kPeriodNs + kPeriodNs / 4;
  bench.cycles(1);
  EXPECT_EQ(bench.loop->machine().late_ticks(), 1);
  EXPECT_EQ(bench.loop->machine().skipped_periods(), 7);
  bench.cycles(1);
  // The next cycle is due at a whole number of periods, at least most of a period after the late one.
  EXPECT_EQ(bench.loop->row().time_ns - before, 9 * kPeriodNs);
  EXPECT_EQ(bench.loop->machine().late_ticks(), 1);
  EXPECT_EQ(bench.state(), RunState::kArmed);  // one late cycle is no fault
}

TEST(ControlLoop, stops_when_it_comes_late_too_often) {
  Bench bench([](runtime::ControlSettings& s) { s.fault.overrun_limit = 5; });
  bench.run_in();
  int late = 0;
  while (bench.state() == RunState::kArmed && late < 50) {
    bench.card.stall_ns = 3 * kPeriodNs;
    bench.cycles(1);
    ++late;
  }
  EXPECT_EQ(late, 5);
  EXPECT_EQ(bench.cause().code, FaultCode::kOverrun);
  EXPECT_TRUE(bench.card.closed());
}

TEST(ControlLoop, takes_its_interval_from_the_samples_stamps) {
  Bench bench([](runtime::ControlSettings& s) { s.fault.overrun_limit = 1'000'000; });
  bench.run_in();
  // Every cycle comes two periods late, so three pass from sample to sample: a nominal interval would see three times the speed.
  const double counts_per_ns = 1e-9 * 8000 / (2 * kPi);  // at 1 rad/s
  const std::int64_t began = bench.card.now_ns;
  bench.card.change = [&](card::Sample& sample) {
    sample.encoder[0] =
        static_cast<std::uint32_t>(std::lround(static_cast<double>(sample.time_ns - began) * counts_per_ns));
  };
  bench.director.wanted.joint[0].angle = 0.1;
  double sum = 0;
  for (int n = 0; n < 150; ++n) {
    bench.card.stall_ns = 2 * kPeriodNs;
    bench.cycles(1);
    if (n >= 50) sum += bench.loop->row().joint[0].velocity;  // fifty cycles are seven filter times
  }
  EXPECT_NEAR(sum / 100, 1.0,
              0.03);  // an encoder step through the filter is 0.075 rad/s; a hundred of them average
}

TEST(ControlLoop, faults_on_a_command_that_is_no_number_and_vents_in_the_same_cycle) {
  Bench bench;
  bench.run_in();
  bench.director.wanted.joint[0].angle = kNan;
  bench.cycles(1);
  EXPECT_EQ(bench.state(), RunState::kFaulted);
  EXPECT_EQ(bench.cause().code, FaultCode::kCommandNotFinite);
  EXPECT_EQ(bench.cause().joint, 0);
  EXPECT_TRUE(bench.card.closed());
  EXPECT_EQ(bench.card.vented_at_ns, bench.card.now_ns);
}

TEST(ControlLoop, clamps_codes_to_what_the_card_has) {
  const runtime::CodeLine line{.channel = 0, .offset = 10, .gain = 100.0};
  EXPECT_EQ(line.code(1e9, 4095), 4095u);
  EXPECT_EQ(line.code(std::numeric_limits<double>::infinity(), 4095), 4095u);
  EXPECT_EQ(line.code(-1e9, 4095), 0u);
  EXPECT_EQ(line.code(kNan, 4095), 0u);
  EXPECT_EQ(line.code(149.0, 4095), 11u);
}

TEST(ControlLoop, warns_beyond_the_soft_limit_and_latches_beyond_the_hard_one) {
  Bench bench([](runtime::ControlSettings& s) { s.watch[0].following = 10.0; });
  bench.run_in();
  const auto lead_to = [&bench](double angle) {  // no faster than a joint may
    while (bench.card.encoder < Bench::counts(angle)) {
      bench.card.encoder += 3;
      bench.cycles(1);
    }
  };
  lead_to(1.20);  // 3/8 pi is 1.178
  bench.cycles(40);
  EXPECT_NE(bench.loop->row().warnings & control::kNearLimit, 0);
  EXPECT_EQ(bench.state(), RunState::kArmed);
  lead_to(1.30);
  bench.cycles(25);  // ten milliseconds are twenty cycles
  EXPECT_EQ(bench.state(), RunState::kFaulted);
  EXPECT_EQ(bench.cause().code, FaultCode::kAngleLimit);
  EXPECT_TRUE(bench.card.closed());
}

TEST(ControlLoop, vents_twenty_cycles_after_a_force_beyond_its_limit) {
  Bench bench([](runtime::ControlSettings& s) { s.watch[0].force.hard = 150; });
  bench.run_in();
  const std::int64_t began = bench.card.now_ns;
  bench.card.force_2 = FakeCard::force_code(160);
  bench.cycles(30);
  EXPECT_EQ(bench.cause().code, FaultCode::kForceLimit);
  EXPECT_EQ((bench.card.vented_at_ns - began) / kPeriodNs,
            21);  // seen in the first cycle, 10 ms without pause
}

TEST(ControlLoop, stops_a_joint_that_does_not_follow_and_names_it_once) {
  Bench bench;
  bench.run_in();
  bench.director.wanted.joint[0].angle = 0.6;  // the encoder stays at 0
  bench.cycles(990);
  EXPECT_EQ(bench.state(), RunState::kArmed);
  bench.cycles(20);
  ASSERT_EQ(bench.state(), RunState::kFaulted);
  EXPECT_EQ(bench.cause().code, FaultCode::kFollowingError);
  EXPECT_EQ(runtime::finding_words(bench.cause()),
            "joint 1: the joint does not follow (0.6 rad, limit 0.35 rad)");
}

TEST(ControlLoop, follows_a_counter_across_its_wrap_around) {
  Bench bench;
  bench.run_in();
  for (int k = 0; k < 100; ++k) {
    bench.card.encoder -= 3;  // below zero: 24 bits wrap
    bench.cycles(1);
  }
  EXPECT_EQ(bench.state(), RunState::kArmed);
  EXPECT_NEAR(bench.loop->row().joint[0].angle, -300 * 2 * kPi / 8000, 1e-12);
}

TEST(ControlLoop, faults_at_once_when_the_encoder_jumps) {
  Bench bench;
  bench.run_in();
  bench.card.encoder += 200;
  bench.cycles(1);
  EXPECT_EQ(bench.state(), RunState::kFaulted);
  EXPECT_EQ(bench.cause().code, FaultCode::kEncoderJump);
  EXPECT_TRUE(bench.card.closed());
}

TEST(ControlLoop, warns_of_an_encoder_that_stands_still_while_the_pressures_move) {
  Bench bench;
  bench.run_in();
  bench.director.wanted.joint[0].angle = 0.3;  // below the following error; the command integrates away
  bool warned = false;
  for (int k = 0; k < 3000 && bench.state() == RunState::kArmed; ++k) {
    bench.cycles(1);
    warned = warned || (bench.loop->row().warnings & control::kEncoderFrozen) != 0;
  }
  EXPECT_TRUE(warned);
  EXPECT_EQ(bench.state(), RunState::kArmed);
}

TEST(ControlLoop, faults_at_once_on_a_code_that_the_converter_does_not_have) {
  Bench bench;
  bench.run_in();
  bench.card.change = [](card::Sample& sample) { sample.input[4] = 65535; };
  bench.cycles(1);
  EXPECT_EQ(bench.cause().code, FaultCode::kInputCode);
  EXPECT_EQ(bench.cause().joint, 4);
  EXPECT_TRUE(bench.card.closed());
}

TEST(ControlLoop, faults_when_an_input_stays_at_the_end_of_its_range) {
  Bench bench([](runtime::ControlSettings& s) { s.samples_at_end = 50; });
  bench.run_in();
  bench.card.force_1 = 0;  // an open circuit; a force of 0 N is code 205
  bench.cycles(49);
  EXPECT_EQ(bench.state(), RunState::kArmed);
  bench.cycles(1);
  EXPECT_EQ(bench.cause().code, FaultCode::kInputAtEnd);
  EXPECT_EQ(bench.cause().joint, 0);
}

TEST(ControlLoop, vents_in_the_cycle_in_which_a_read_fails) {
  Bench bench;
  bench.run_in();
  bench.card.fail_after = bench.card.waits;
  bench.cycles(1);
  EXPECT_EQ(bench.state(), RunState::kFaulted);
  EXPECT_EQ(bench.cause().code, FaultCode::kReadFailed);
  EXPECT_TRUE(bench.card.closed());
  EXPECT_FALSE(bench.loop->row().answered);
  EXPECT_EQ(bench.card.vented_at_ns, bench.card.now_ns);
}

TEST(ControlLoop, vents_in_the_cycle_in_which_a_write_fails) {
  Bench bench;
  bench.run_in();
  bench.card.fail_write = true;
  bench.cycles(1);
  EXPECT_EQ(bench.state(), RunState::kFaulted);
  EXPECT_TRUE(bench.card.closed());
}

TEST(ControlLoop, turns_its_heartbeat_over_in_every_cycle_and_leaves_it_low_after_a_fault) {
  Bench bench({}, true);
  bench.cycles(20);  // whoever guards the supply must see the loop before anything is armed
  EXPECT_EQ(bench.card.beats, 20);
  bench.run_in();
  EXPECT_EQ(bench.card.beats, 220);
  EXPECT_EQ(bench.card.last_beat_ns, bench.card.now_ns);
  const std::int64_t last_good = bench.card.now_ns;
  bench.card.change = [](card::Sample& sample) { sample.input[4] = 65535; };
  bench.cycles(1);
  EXPECT_EQ(bench.state(), RunState::kFaulted);
  EXPECT_FALSE(bench.card.beat_level);
  bench.cycles(100);
  EXPECT_FALSE(bench.card.beat_level);
  EXPECT_LE(bench.card.last_beat_ns, last_good + kPeriodNs);  // no edge later than the cycle of the fault
}

TEST(ControlLoop, heartbeat_stands_still_while_nobody_runs_the_loop_and_is_low_after_its_end) {
  Bench bench({}, true);
  bench.run_in();
  const int beats = bench.card.beats;
  static_cast<void>(
      bench.card.wait_until(bench.card.now_ns + 100 * kPeriodNs));  // hung: nobody calls cycle()
  EXPECT_EQ(bench.card.beats, beats);
  bench.director.over = true;
  const std::atomic<bool> stop{false};
  EXPECT_EQ(bench.loop->run(bench.director, stop, nullptr, nullptr).why, runtime::LoopEnd::Why::kDone);
  EXPECT_FALSE(bench.card.beat_level);
  EXPECT_TRUE(bench.card.closed());
}

TEST(ControlLoop, heartbeat_that_cannot_be_written_vents_in_the_same_cycle) {
  Bench bench({}, true);
  bench.run_in();
  bench.card.fail_beat = true;
  bench.cycles(1);
  EXPECT_EQ(bench.state(), RunState::kFaulted);
  EXPECT_TRUE(bench.card.closed());
  Bench deaf({}, true);  // and where it never could, nothing is armed
  deaf.card.fail_beat = true;
  deaf.cycles(1000);
  EXPECT_EQ(deaf.state(), RunState::kDisarmed);
  EXPECT_EQ(deaf.card.writes, 0);
}

TEST(ControlLoop, faults_on_a_sample_that_took_too_long_to_read) {
  Bench bench;
  bench.run_in();
  bench.card.read_takes_ns = 6'000'000;  // 5 ms are allowed
  bench.cycles(1);
  EXPECT_EQ(bench.cause().code, FaultCode::kStaleSample);
  EXPECT_TRUE(bench.card.closed());
}

TEST(ControlLoop, keeps_the_first_cause_and_runs_again_only_after_an_acknowledge_and_a_new_arm) {
  Bench bench;
  bench.run_in();
  bench.card.change = [](card::Sample& sample) { sample.input[4] = 65535; };
  bench.cycles(1);
  bench.card.change = [](card::Sample& sample) { sample.input[6] = 65535; };
  bench.cycles(10);
  EXPECT_EQ(bench.cause().joint, 4);
  EXPECT_EQ(bench.loop->machine().later_findings(), 10);
  bench.card.change = nullptr;  // the cause is gone
  bench.cycles(500);
  EXPECT_EQ(bench.state(), RunState::kFaulted);
  EXPECT_TRUE(bench.card.closed());
  bench.director.arms = false;
  bench.director.wanted.arm = false;
  bench.director.wanted.acknowledge = true;
  bench.cycles(1);
  EXPECT_EQ(bench.state(), RunState::kDisarmed);
  EXPECT_TRUE(bench.card.closed());
  bench.cycles(200);
  bench.director.wanted.arm = true;
  bench.cycles(60);
  EXPECT_EQ(bench.state(), RunState::kArmed);
  EXPECT_EQ(bench.loop->row().phase, Phase::kControl);
  EXPECT_FALSE(bench.card.closed());
}

TEST(ControlLoop, vents_however_the_run_ends) {
  const std::atomic<bool> go{false}, stop{true};
  {
    Bench bench;
    bench.run_in();
    bench.director.over = true;
    EXPECT_EQ(bench.loop->run(bench.director, go, nullptr, nullptr).why, LoopEnd::Why::kDone);
    EXPECT_TRUE(bench.card.closed());
  }
  {
    Bench bench;
    bench.run_in();
    EXPECT_EQ(bench.loop->run(bench.director, stop, nullptr, nullptr).why, LoopEnd::Why::kStopped);
    EXPECT_TRUE(bench.card.closed());
  }
  {
    Bench bench;
    bench.run_in();
    bench.card.fail_after = bench.card.waits;
    bench.card.failure = Status::kEndOfData;
    EXPECT_EQ(bench.loop->run(bench.director, go, nullptr, nullptr).why, LoopEnd::Why::kCardEnded);
    EXPECT_TRUE(bench.card.closed());
  }
  {
    struct FullSink final : runtime::CycleSink {
      bool take(const runtime::CycleRow&) noexcept override { return false; }
    } full;
    Bench bench;
    bench.run_in();
    EXPECT_EQ(bench.loop->run(bench.director, go, nullptr, &full).why, LoopEnd::Why::kSink);
    EXPECT_TRUE(bench.card.closed());
  }
}

TEST(ControlLoop, refuses_a_measured_torque_without_force_sensors) {
  record::Rig rig;
  runtime::ControlSettings settings =
      runtime::testbed_control_settings(rig, {.structure = control::Structure::kCascade});
  ControlCard card;
  runtime::JointWiring wiring = runtime::wire_joints(rig, card.shape(), 1);
  wiring.joint[0].F1 = {};
  runtime::ControlLoop loop(card, wiring, settings);
  EXPECT_EQ(loop.configure(), Status::kNotPermitted);
  EXPECT_EQ(loop.failed_joint(), 0);
}

TEST(ControlLoop, allocates_nothing_in_ten_thousand_cycles) {
  Bench bench;
  bench.run_in();
  watch_allocations();
  for (int k = 0; k < 10000; ++k) {
    bench.director.wanted.joint[0].angle = 0.2 * std::sin(0.002 * k);
    bench.card.encoder = Bench::counts(0.2 * std::sin(0.002 * k));
    bench.cycles(1);
  }
  EXPECT_EQ(watched_allocations(), 0);
  watch_allocations();
  ::operator delete(::operator new(8));  // called by name, it may not be optimised away
  EXPECT_EQ(watched_allocations(), 1);   // the counter counts
  EXPECT_EQ(bench.state(), RunState::kArmed);
  EXPECT_EQ(bench.live.heart.beat.load(), 10200u);
}

}  // namespace
}  // namespace isac::test
