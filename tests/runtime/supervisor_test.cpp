// The supervisor on processes that end in every way. Wall-clock times are printed, never judged: this machine may be busy.
#include "isac/runtime/supervisor.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include "isac/runtime/shared_valves.hpp"

namespace isac::test {
namespace {

using runtime::BeatLimits;
using runtime::BeatWatch;
using runtime::Heartbeat;
using runtime::SupervisorEnd;
using Stage = Heartbeat::Stage;

constexpr std::int64_t kMs = 1'000'000;

TEST(BeatWatch, trusts_a_beat_and_not_silence) {
  BeatWatch watch({.beat = 10 * kMs});
  std::int64_t now = 5;
  for (std::uint64_t beat = 1; beat < 100; ++beat, now += kMs)
    ASSERT_EQ(watch.check(now, beat, Stage::kRunning), BeatWatch::Verdict::kTrusted);
  // Virtual time from the last beat to the verdict: the limit, and the poll in which it is passed.
  const std::int64_t last = now - kMs;
  while (watch.check(now, 99, Stage::kRunning) == BeatWatch::Verdict::kTrusted) now += kMs;
  EXPECT_EQ(now - last, 11 * kMs);
  EXPECT_EQ(watch.since(), last);
}

TEST(BeatWatch, grants_time_to_open_cards_and_to_close_files) {
  BeatWatch watch({.beat = 10 * kMs, .starting = 1000 * kMs, .leaving = 500 * kMs});
  EXPECT_EQ(watch.check(0, 0, Stage::kStarting), BeatWatch::Verdict::kTrusted);
  EXPECT_EQ(watch.check(1000 * kMs, 0, Stage::kStarting), BeatWatch::Verdict::kTrusted);
  EXPECT_EQ(watch.check(1001 * kMs, 0, Stage::kStarting), BeatWatch::Verdict::kHung);
  EXPECT_EQ(watch.check(1002 * kMs, 0, Stage::kRunning),
            BeatWatch::Verdict::kTrusted);  // a new stage, a new count
  EXPECT_EQ(watch.check(1013 * kMs, 0, Stage::kRunning), BeatWatch::Verdict::kHung);
  EXPECT_EQ(watch.check(1014 * kMs, 0, Stage::kLeft), BeatWatch::Verdict::kTrusted);
  EXPECT_EQ(watch.check(1515 * kMs, 0, Stage::kLeft), BeatWatch::Verdict::kHung);
}

struct Shared {
  Heartbeat heart;
  runtime::ValveMemory valves;
};

/// A child that opens the valves, beats for a while, and then does `last`.
class Supervised : public testing::Test {
 protected:
  SupervisorEnd run(const std::function<void(Shared&)>& last, const BeatLimits& limits) {
    runtime::SupervisorOptions options;
    options.limits = limits;
    const SupervisorEnd end = runtime::supervise(handle_, shared_.heart, stop_, options, [&] {
      shared_.heart.stage.store(static_cast<int>(Stage::kRunning));
      for (int k = 0; k < 20; ++k) {
        for (auto& code : shared_.valves.code) code.store(3000);
        shared_.heart.beat.fetch_add(1);
        std::this_thread::sleep_for(std::chrono::microseconds(500));
      }
      last(shared_);
      return 7;
    });
    std::printf("valves closed %.2f ms after the last beat seen (wall clock)\n",
                1e-6 * static_cast<double>(end.silent_ns));
    return end;
  }
  runtime::SharedMemory memory_{sizeof(Shared)};
  Shared& shared_ = *new (memory_.data()) Shared;
  runtime::ValveHandle handle_{card::Shape{.outputs = card::kOutputs}, shared_.valves};
  std::atomic<bool> stop_{false};
  static constexpr BeatLimits kPatient{.beat = 60'000 * kMs};  // so that only death can be the reason
};

TEST_F(Supervised, closes_the_valves_after_sigkill) {
  const auto end = run([](Shared&) { raise(SIGKILL); }, kPatient);
  EXPECT_EQ(end.why, SupervisorEnd::Why::kDied);
  EXPECT_EQ(end.signal, SIGKILL);
  EXPECT_TRUE(shared_.valves.closed());
}

TEST_F(Supervised, closes_the_valves_after_abort) {
  const auto end = run([](Shared&) { std::abort(); }, kPatient);
  EXPECT_EQ(end.why, SupervisorEnd::Why::kDied);
  EXPECT_NE(end.signal, 0);
  EXPECT_TRUE(shared_.valves.closed());
}

TEST_F(Supervised, closes_the_valves_after_an_invalid_access) {
  const auto end = run(
      [](Shared&) {
        std::signal(SIGSEGV, SIG_DFL);
        raise(SIGSEGV);
      },
      kPatient);
  EXPECT_EQ(end.why, SupervisorEnd::Why::kDied);
  EXPECT_TRUE(shared_.valves.closed());
}

TEST_F(Supervised, closes_the_valves_after_an_exception_that_nobody_caught) {
  const auto end = run([](Shared&) { throw std::runtime_error("lost"); }, kPatient);
  EXPECT_EQ(end.why, SupervisorEnd::Why::kDied);
  EXPECT_EQ(end.exit_code, 4);
  EXPECT_TRUE(shared_.valves.closed());
}

TEST_F(Supervised, closes_the_valves_when_the_child_leaves_without_a_word) {
  const auto end = run([](Shared&) { _exit(0); }, kPatient);
  EXPECT_EQ(end.why, SupervisorEnd::Why::kDied);
  EXPECT_TRUE(shared_.valves.closed());
}

TEST_F(Supervised, closes_the_valves_and_ends_a_child_that_hangs) {
  const auto end = run(
      [](Shared&) {
        for (;;) pause();
      },
      {.beat = 200 * kMs});
  EXPECT_EQ(end.why, SupervisorEnd::Why::kHung);
  EXPECT_EQ(end.signal, SIGKILL);
  EXPECT_TRUE(shared_.valves.closed());
}

TEST_F(Supervised, closes_the_valves_of_a_child_that_spins_and_writes_for_ever_without_a_beat) {
  const auto end = run(
      [](Shared& shared) {
        for (;;) shared.valves.code[0].store(3000);  // what it writes until its last moment
      },
      {.beat = 200 * kMs});
  EXPECT_EQ(end.why, SupervisorEnd::Why::kHung);
  EXPECT_TRUE(shared_.valves.closed());  // the second vent, after its death
}

TEST_F(Supervised, closes_the_valves_of_a_child_that_was_stopped) {
  const auto end = run([](Shared&) { raise(SIGSTOP); }, {.beat = 200 * kMs});
  EXPECT_EQ(end.why, SupervisorEnd::Why::kHung);
  EXPECT_TRUE(shared_.valves.closed());
}

TEST_F(Supervised, takes_a_clean_end_for_what_it_is) {
  const auto end = run(
      [](Shared& shared) {
        shared.valves.close();
        shared.heart.stage.store(static_cast<int>(Stage::kLeft));
        std::this_thread::sleep_for(std::chrono::milliseconds(50));  // files are being closed: no beat
      },
      {.beat = 20'000 * kMs});
  EXPECT_EQ(end.why, SupervisorEnd::Why::kLeft);
  EXPECT_EQ(end.exit_code, 7);
  EXPECT_EQ(end.silent_ns, 0);
  EXPECT_TRUE(shared_.valves.closed());
}

TEST_F(Supervised, passes_a_wish_to_stop_on) {
  stop_.store(true);
  const auto end = run(
      [](Shared& shared) {
        while (!shared.heart.stop.load()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        shared.heart.stage.store(static_cast<int>(Stage::kLeft));
      },
      kPatient);
  EXPECT_EQ(end.why, SupervisorEnd::Why::kLeft);
}

TEST_F(Supervised, child_is_told_when_its_supervisor_dies) {
  // A process in between plays the supervisor and is killed; its child must get SIGTERM and leave a mark.
  static std::atomic<int>* mark;
  runtime::SharedMemory marks(sizeof(std::atomic<int>));
  mark = new (marks.data()) std::atomic<int>{0};
  const pid_t between = fork();
  if (between == 0) {
    static_cast<void>(runtime::supervise(handle_, shared_.heart, stop_, {}, [&] {
      std::signal(SIGTERM, [](int) { mark->store(2); });
      mark->store(1);
      while (mark->load() != 2) pause();
      return 0;
    }));
    _exit(0);
  }
  while (mark->load() != 1) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  kill(between, SIGKILL);
  waitpid(between, nullptr, 0);
  for (int k = 0; k < 5000 && mark->load() != 2; ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(mark->load(), 2);
}

}  // namespace
}  // namespace isac::test
