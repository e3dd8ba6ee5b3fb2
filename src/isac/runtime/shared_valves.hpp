/// @file
/// Valves of a simulated or replayed card that outlive the process which drives them, as real valves do.
///
/// A simulated rig lives in its process and dies with it. What it would leave behind on hardware, the codes that the valve
/// outputs hold, lies in shared memory: SharedValves in the child passes every command on and stores it there, ValveHandle
/// in the parent closes them. So a supervisor is tested on `sim:` by what it does to these words; a simulated joint after the
/// death of its process does not exist.
///
/// Units: codes. Real time: as the card behind it, plus a store per output. Threads: vent() from any. Errors: the card's.
/// Source: decision 0111. Example: tests/runtime/supervisor_test.cpp.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <utility>

#include "isac/card/card.hpp"

namespace isac::runtime {

struct ValveMemory {
  std::array<std::atomic<std::uint32_t>, card::kOutputs> code{};
  [[nodiscard]] bool closed() const noexcept {
    for (const auto& one : code)
      if (one.load(std::memory_order_acquire) != 0) return false;
    return true;
  }
  void close() noexcept {
    for (auto& one : code) one.store(0, std::memory_order_release);
  }
};

class SharedValves final : public card::Card {
 public:
  SharedValves(std::unique_ptr<card::Card> card, ValveMemory& memory)
      : card_(std::move(card)), memory_(memory), outputs_(static_cast<std::size_t>(card_->shape().outputs)) {}
  ~SharedValves() override { memory_.close(); }
  SharedValves(const SharedValves&) = delete;
  SharedValves& operator=(const SharedValves&) = delete;

  [[nodiscard]] card::Shape shape() const noexcept override { return card_->shape(); }
  Status wait_until(std::int64_t time_ns) noexcept override { return card_->wait_until(time_ns); }
  Status read(card::Sample& sample) noexcept override { return card_->read(sample); }
  Status write(const card::Command& command) noexcept override {
    const Status status = card_->write(command);
    if (!ok(status)) return status;
    for (std::size_t i = 0; i < outputs_; ++i)
      memory_.code[i].store(command.output[i], std::memory_order_release);
    return status;
  }
  Status vent() noexcept override {
    memory_.close();
    return card_->vent();
  }
  Status beat(bool level) noexcept override { return card_->beat(level); }
  Status outputs(card::Command& command) const noexcept override { return card_->outputs(command); }
  [[nodiscard]] std::int64_t clock_ns() const noexcept override { return card_->clock_ns(); }
  [[nodiscard]] std::string diagnose() override { return card_->diagnose(); }

 private:
  std::unique_ptr<card::Card> card_;
  ValveMemory& memory_;
  std::size_t outputs_;
};

/// The supervisor's own handle: it can close the valves and look at them, nothing else.
class ValveHandle final : public card::Card {
 public:
  ValveHandle(const card::Shape& shape, ValveMemory& memory) noexcept : shape_(shape), memory_(memory) {}
  [[nodiscard]] card::Shape shape() const noexcept override { return shape_; }
  Status wait_until(std::int64_t) noexcept override { return Status::kNotPermitted; }
  Status read(card::Sample&) noexcept override { return Status::kNotPermitted; }
  Status write(const card::Command&) noexcept override { return Status::kNotPermitted; }
  Status vent() noexcept override {
    memory_.close();
    return Status::kOk;
  }
  Status outputs(card::Command& command) const noexcept override {
    for (std::size_t i = 0; i < command.output.size(); ++i)
      command.output[i] = memory_.code[i].load(std::memory_order_acquire);
    return Status::kOk;
  }

 private:
  card::Shape shape_;
  ValveMemory& memory_;
};

}  // namespace isac::runtime
