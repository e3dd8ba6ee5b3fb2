#include "isac/card/comedi_clock.hpp"

#include <cerrno>
#include <ctime>

namespace isac::card {
namespace {

class SystemClock final : public ComediClock {
 public:
  SystemClock() { clock_gettime(CLOCK_MONOTONIC, &began_); }
  [[nodiscard]] std::int64_t now_ns() const noexcept override {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (now.tv_sec - began_.tv_sec) * kSecond + (now.tv_nsec - began_.tv_nsec);
  }
  void sleep_until(std::int64_t time_ns) noexcept override {
    if (time_ns <= now_ns()) return;
    const std::int64_t total = began_.tv_nsec + time_ns;
    timespec until{};
    until.tv_sec = began_.tv_sec + total / kSecond;
    until.tv_nsec = total % kSecond;
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
    }
  }

 private:
  static constexpr std::int64_t kSecond = 1'000'000'000;
  timespec began_{};
};

}  // namespace

std::unique_ptr<ComediClock> system_clock() {
  return std::make_unique<SystemClock>();
}

}  // namespace isac::card
