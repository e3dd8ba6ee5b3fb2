/// @file
/// A simulated card at the speed of the wall clock: waiting for a time takes that time.
///
/// Units, errors: as the card behind it. Real time: sleeps, allocates nothing. Threads: as card.hpp.
/// Example: `auto card = std::make_unique<PacedCard>(std::move(sim));`
#pragma once

#include <chrono>
#include <memory>
#include <thread>
#include <utility>

#include "isac/card/card.hpp"

namespace isac::runtime {

class PacedCard final : public card::Card {
 public:
  explicit PacedCard(std::unique_ptr<card::Card> card) : card_(std::move(card)) {}
  [[nodiscard]] card::Shape shape() const noexcept override { return card_->shape(); }
  Status wait_until(std::int64_t time_ns) noexcept override {
    std::this_thread::sleep_until(began_ + std::chrono::nanoseconds(time_ns));
    return card_->wait_until(time_ns);
  }
  Status read(card::Sample& sample) noexcept override { return card_->read(sample); }
  Status write(const card::Command& command) noexcept override { return card_->write(command); }
  Status vent() noexcept override { return card_->vent(); }
  Status beat(bool level) noexcept override { return card_->beat(level); }
  Status outputs(card::Command& command) const noexcept override { return card_->outputs(command); }

 private:
  std::unique_ptr<card::Card> card_;
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

}  // namespace isac::runtime
