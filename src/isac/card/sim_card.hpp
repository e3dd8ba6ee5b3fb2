/// @file
/// The card of the simulated testbed, in virtual time: a second passes when a caller waits for it, not before.
///
/// wait_until(t) moves the rig on to t and, with jitter, a little further: the sample is taken late, as on a computer that
/// does other things too, and its stamp is read a moment after it. A dropped wake-up comes one whole period late. Reading
/// takes a microsecond of virtual time.
/// Units: as card.hpp. Real time: as card.hpp (allocates nothing after construction; its cost is the integrator's).
/// Threads: one drives; vent() may come from another and acts within 10 ms of virtual time.
/// Errors: construction throws isac::Error (usage). Source: docs/derivations/simulated_rig.md, "Time".
#pragma once

#include <atomic>
#include <memory>

#include "isac/card/card.hpp"
#include "isac/simulate/random.hpp"
#include "isac/simulate/rig.hpp"

namespace isac::card {

class SimCard final : public Card {
 public:
  explicit SimCard(std::shared_ptr<simulate::Rig> rig);
  ~SimCard() override;
  SimCard(const SimCard&) = delete;
  SimCard& operator=(const SimCard&) = delete;

  [[nodiscard]] Shape shape() const noexcept override;
  Status wait_until(std::int64_t time_ns) noexcept override;
  Status read(Sample& sample) noexcept override;
  Status write(const Command& command) noexcept override;
  Status vent() noexcept override;
  Status outputs(Command& command) const noexcept override;

 private:
  Status advance(std::int64_t time_ns) noexcept;
  Status apply_vent() noexcept;
  std::int64_t lateness(std::int64_t period_ns) noexcept;

  std::shared_ptr<simulate::Rig> rig_;
  simulate::Random random_;
  Command outputs_;
  std::int64_t now_ns_ = 0, last_target_ns_ = 0, last_stamp_ns_ = -1;
  std::atomic<bool> vent_asked_{false};
};

/// The person at the simulated testbed. Shares the rig with the card; used from the thread that drives the card.
class SimPerson final : public Person {
 public:
  explicit SimPerson(std::shared_ptr<simulate::Rig> rig) : rig_(std::move(rig)) {}
  void ask(const Task& task) override;
  [[nodiscard]] bool ready() const override { return rig_->ready(); }

 private:
  std::shared_ptr<simulate::Rig> rig_;
};

/// Card and person on one rig.
[[nodiscard]] Opened open_sim(std::shared_ptr<simulate::Rig> rig);

}  // namespace isac::card
