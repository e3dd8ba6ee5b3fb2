#include "isac/runtime/stop_signals.hpp"

namespace isac::runtime {
namespace {

std::atomic<bool> stop_requested{false};
std::atomic<card::Card*> card_at_risk{nullptr};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<card::Card*>::is_always_lock_free);

void request_stop(int) {
  stop_requested.store(true, std::memory_order_relaxed);
}

void vent_and_die(int signal) {
  if (card::Card* card = card_at_risk.exchange(nullptr)) static_cast<void>(card->vent());
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

}  // namespace

StopSignals::StopSignals() {
  stop_requested.store(false);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    struct sigaction action {};
    sigemptyset(&action.sa_mask);
    switch (kSignals[i]) {
      case SIGINT:
      case SIGTERM:
      case SIGHUP:
        action.sa_handler = request_stop;
        break;
      case SIGPIPE:
      case SIGXFSZ:
        action.sa_handler = SIG_IGN;
        break;
      default:
        action.sa_handler = vent_and_die;
        break;
    }
    sigaction(kSignals[i], &action, &former_[i]);
  }
}

StopSignals::~StopSignals() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &former_[i], nullptr);
  card_at_risk.store(nullptr);
}

const std::atomic<bool>& StopSignals::requested() noexcept {
  return stop_requested;
}
void StopSignals::vent_on_death(card::Card* card) noexcept {
  card_at_risk.store(card);
}

}  // namespace isac::runtime
