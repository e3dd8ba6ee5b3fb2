#include "isac/runtime/stop_signals.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fake_rig.hpp"

namespace isac::runtime {
namespace {

TEST(StopSignals, turns_an_interrupt_into_a_flag_and_gives_the_handler_back) {
  struct sigaction before {};
  sigaction(SIGINT, nullptr, &before);
  {
    const StopSignals signals;
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
      const StopSignals again;  // clears the flag
      EXPECT_FALSE(StopSignals::requested());
      std::raise(signal);
      EXPECT_TRUE(StopSignals::requested());
    }
  }
  struct sigaction after {};
  sigaction(SIGINT, nullptr, &after);
  EXPECT_EQ(before.sa_handler, after.sa_handler);
}

/// Tells the test's process that it was vented, over a pipe.
class PipeCard : public test::FakeCard {
 public:
  explicit PipeCard(int pipe) : pipe_(pipe) {}
  Status vent() noexcept override { return ::write(pipe_, "v", 1) == 1 ? Status::kOk : Status::kDeviceError; }

 private:
  int pipe_;
};

TEST(StopSignals, vents_before_the_process_dies_of_a_fault) {
  for (const int signal : {SIGABRT, SIGFPE, SIGBUS, SIGILL}) {
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    const pid_t child = ::fork();
    if (child == 0) {
      PipeCard card(ends[1]);
      const StopSignals signals;
      StopSignals::vent_on_death(&card);
      std::raise(signal);
      _exit(0);  // not reached
    }
    ::close(ends[1]);
    char got = 0;
    EXPECT_EQ(::read(ends[0], &got, 1), 1) << signal;
    EXPECT_EQ(got, 'v');
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(WTERMSIG(status), signal);
    ::close(ends[0]);
  }
}

}  // namespace
}  // namespace isac::runtime
