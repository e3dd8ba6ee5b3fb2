/// @file
/// The card: encoders and analogue inputs in, valve outputs out, in raw codes; the same for the simulated rig, a replayed
/// recording and hardware. What a code means is the calibration's business (record/rig.hpp), not the card's.
///
/// Use: open("sim:"), wait_until(t), read(sample), write(command) …; vent() before leaving. A card vents when destroyed.
/// Units: time in nanoseconds since open; codes are unsigned, 0 … max code of the channel.
/// Real time: read, write, vent and wait_until allocate nothing and throw nothing; `open` may do both.
/// Threads: one thread drives a card; vent() may be called from another.
/// Errors: calls return Status; open() throws isac::Error (usage for a wrong name, stopped for a card that is not there).
/// Source: seed C.4 (12 outputs 0…4095 → 4…20 mA, 6 encoders), E.1.4 (8 inputs, 12 bit, 0…10 V).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>

#include "isac/core/status.hpp"

namespace isac::card {

inline constexpr int kEncoders = 6;
inline constexpr int kInputs = 8;
inline constexpr int kOutputs = 12;

struct Shape {
  int encoders = 0, inputs = 0, outputs = 0;   ///< channels in use, from index 0
  std::uint32_t encoder_modulus = 1u << 24;    ///< counters wrap at this count
  std::uint32_t input_max_code = 4095;
  std::uint32_t output_max_code = 4095;
};

struct Sample {
  std::int64_t time_ns = 0;  ///< when the card was read, its own clock
  std::array<std::uint32_t, kEncoders> encoder{};
  std::array<std::uint32_t, kInputs> input{};
};

struct Command {
  std::array<std::uint32_t, kOutputs> output{};  ///< valve codes; 0 is vented
};

class Card {
 public:
  virtual ~Card() = default;
  [[nodiscard]] virtual Shape shape() const noexcept = 0;
  /// Sleeps (hardware) or simulates (sim) until the card's clock reaches `time_ns`.
  virtual Status wait_until(std::int64_t time_ns) noexcept = 0;
  virtual Status read(Sample& sample) noexcept = 0;
  /// A code above the channel's maximum is refused and nothing is written.
  virtual Status write(const Command& command) noexcept = 0;
  /// All valves to zero pressure; safe to call at any time, any number of times.
  virtual Status vent() noexcept = 0;
};

/// What the person at the joint is asked to do; on the simulated rig a simulated person does it.
struct Task {
  enum class Kind { kRest, kSweepByHand, kClamp, kRelease, kPose, kRemoveLoad, kHangWeight } kind = Kind::kRest;
  double amplitude_rad = 0;      ///< of the sweep, either side of the middle
  double speed_rad_s = 0;        ///< peak speed asked for; a bundle varies it up to this
  bool vary_speed = false;       ///< the five-minute bundle: all speeds
  double angle_rad = 0;          ///< where to clamp or pose
  double load_newton = 0;        ///< weight hung on a force sensor in calibration
};

class Person {
 public:
  virtual ~Person() = default;
  virtual void ask(const Task& task) = 0;
};

/// An opened rig: the card, and whoever moves the joint (null where prompts on the terminal must do).
struct Opened {
  std::unique_ptr<Card> card;
  std::unique_ptr<Person> person;
};

/// "sim:", "sim:seed=3,noise=white", "replay:FILE".
[[nodiscard]] Opened open(std::string_view name);

}  // namespace isac::card
