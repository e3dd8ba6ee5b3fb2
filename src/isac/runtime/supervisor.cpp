#include "isac/runtime/supervisor.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <string>

#include "isac/core/error.hpp"

namespace isac::runtime {
namespace {

using Clock = std::chrono::steady_clock;

[[noreturn]] void refuse(const char* what) {
  throw Error(ErrorKind::kStopped, "no_supervisor",
              std::string(what) + " failed (" + std::strerror(errno) +
                  "), so nobody could close the valves if the loop died; close other programs and try again");
}

std::int64_t now_ns() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count();
}

/// The watcher runs above the loop, and from memory that is there. Where that is not permitted: ordinary.
void take_priority(int priority) noexcept {
  if (priority <= 0) return;
  static_cast<void>(mlockall(MCL_CURRENT));
  sched_param wanted{};
  wanted.sched_priority = priority;
  static_cast<void>(
      sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &wanted));  // where not permitted: ordinary
}

void give_priority_back() noexcept {
  const sched_param ordinary{};
  static_cast<void>(sched_setscheduler(0, SCHED_OTHER, &ordinary));
  static_cast<void>(munlockall());
}

[[noreturn]] void be_the_child(pid_t parent, const std::function<int()>& child) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent)
    _exit(static_cast<int>(ErrorKind::kStopped));  // it died before we asked to be told
  int code = static_cast<int>(ErrorKind::kStopped);
  try {
    code = child();
  } catch (...) {  // the body reports its own errors; this one has no place to go but the exit code
  }
  std::fflush(nullptr);
  _exit(code);
}

}  // namespace

SharedMemory::SharedMemory(std::size_t bytes) : bytes_(bytes) {
  data_ = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (data_ == MAP_FAILED) refuse("shared memory");
}

SharedMemory::~SharedMemory() {
  munmap(data_, bytes_);
}

SupervisorEnd supervise(card::Card& valves, Heartbeat& heart, const std::atomic<bool>& stop,
                        const SupervisorOptions& options, const std::function<int()>& child) {
  std::array<int, 2> pipe{};
  if (pipe2(pipe.data(), O_CLOEXEC) != 0) refuse("a pipe");
  std::fflush(nullptr);  // what stands in buffers would be written twice
  const pid_t parent = getpid();
  const pid_t pid = fork();
  if (pid < 0) {
    close(pipe[0]);
    close(pipe[1]);
    refuse("a process");
  }
  if (pid == 0) {
    close(pipe[0]);
    be_the_child(parent, child);
  }
  close(pipe[1]);
  take_priority(options.priority);

  SupervisorEnd end;
  BeatWatch watch(options.limits);
  const timespec nap{.tv_sec = 0, .tv_nsec = std::chrono::nanoseconds(options.poll).count()};
  for (;;) {
    pollfd hang_up{.fd = pipe[0], .events = POLLIN, .revents = 0};
    const int ready = ppoll(&hang_up, 1, &nap, nullptr);
    if (stop.load(std::memory_order_relaxed)) heart.stop.store(true, std::memory_order_relaxed);
    const auto stage = static_cast<Heartbeat::Stage>(heart.stage.load(std::memory_order_acquire));
    const std::int64_t now = now_ns();
    const bool hung =
        watch.check(now, heart.beat.load(std::memory_order_acquire), stage) == BeatWatch::Verdict::kHung;
    const bool died = ready > 0 && (hang_up.revents & (POLLHUP | POLLERR)) != 0;
    if (!died && !hung) continue;
    end.vent = valves.vent();
    const std::int64_t vented = now_ns();
    if (died && stage == Heartbeat::Stage::kLeft) break;
    end.why = died ? SupervisorEnd::Why::kDied : SupervisorEnd::Why::kHung;
    end.silent_ns = vented - watch.since();
    break;
  }
  if (end.why == SupervisorEnd::Why::kHung) kill(pid, SIGKILL);
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  close(pipe[0]);
  if (end.why != SupervisorEnd::Why::kLeft) end.vent = valves.vent();  // whatever it did in its last moment
  give_priority_back();
  if (WIFEXITED(status)) end.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) end.signal = WTERMSIG(status);
  return end;
}

}  // namespace isac::runtime
