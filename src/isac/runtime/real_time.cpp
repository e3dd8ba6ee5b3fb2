#include "isac/runtime/real_time.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <thread>

namespace isac::runtime {
namespace {

constexpr std::size_t kStackBytes = 256 * 1024;
constexpr std::size_t kPage = 4096;

/// Touches the stack that the loop will use, so that no page of it is missing later.
void touch_stack() noexcept {
  std::array<volatile unsigned char, kStackBytes> stack;
  for (std::size_t i = 0; i < stack.size(); i += kPage) stack[i] = 0;
}

}  // namespace

std::string RealTime::words() const {
  std::string text = fifo ? fmt::format("SCHED_FIFO {}", priority)
                          : fmt::format(
                                "no SCHED_FIFO ({}; run as root, or give the user an rtprio limit in "
                                "/etc/security/limits.d)",
                                std::strerror(fifo_error));
  text += locked
              ? ", memory locked"
              : fmt::format(", memory not locked ({}; raise the memlock limit)", std::strerror(lock_error));
  return text;
}

void keep_stacks_small() noexcept {
  pthread_attr_t attributes;
  if (pthread_attr_init(&attributes) != 0) return;
  pthread_attr_setstacksize(&attributes, 8 * kStackBytes);
  static_cast<void>(pthread_setattr_default_np(&attributes));  // where refused, the usual size
  pthread_attr_destroy(&attributes);
}

RealTime prepare_real_time(int priority) noexcept {
  RealTime result;
  result.priority = priority;
  mallopt(M_TRIM_THRESHOLD, -1);  // freed memory stays: giving it back costs page faults later
  mallopt(M_MMAP_MAX, 0);
  result.locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  if (!result.locked) result.lock_error = errno;
  touch_stack();
  sched_param wanted{};
  wanted.sched_priority = priority;
  result.fifo_error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &wanted);
  result.fifo = result.fifo_error == 0;
  return result;
}

double Jitter::quantile(double share) const noexcept {
  if (late.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double last = static_cast<double>(late.size() - 1);
  return late[static_cast<std::size_t>(std::clamp(share, 0.0, 1.0) * last)];
}

Jitter measure_jitter(double seconds, double rate, const std::atomic<bool>& stop) {
  using Clock = std::chrono::steady_clock;
  const auto count = static_cast<std::size_t>(std::max(1.0, seconds * rate));
  const std::chrono::nanoseconds period(std::llround(1e9 / rate));
  Jitter jitter;
  jitter.late.assign(count, 0.0);
  std::size_t taken = 0;
  auto next = Clock::now() + period;
  for (std::size_t slot = 0; slot < count && !stop.load(std::memory_order_relaxed); ++slot) {
    std::this_thread::sleep_until(next);
    const auto behind = Clock::now() - next;
    jitter.late[taken++] = std::chrono::duration<double, std::micro>(behind).count();
    if (behind > period) {
      const auto periods = behind / period;
      ++jitter.missed;
      jitter.skipped += periods;
      slot += static_cast<std::size_t>(periods);  // never a burst to catch up
      next += periods * period;
    }
    next += period;
  }
  jitter.late.resize(taken);
  std::sort(jitter.late.begin(), jitter.late.end());
  return jitter;
}

}  // namespace isac::runtime
