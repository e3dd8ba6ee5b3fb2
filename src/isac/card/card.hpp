/// @file
/// The card: encoders and analogue inputs in, valve outputs out, in raw codes; the same for the simulated
/// rig, a replayed recording and hardware. What a code means is the calibration's business (record/rig.hpp),
/// not the card's.
///
/// Use: open("sim:"), wait_until(t), read(sample), write(command) …; vent() before leaving. A card vents when
/// destroyed. Units: time in nanoseconds since open; codes are unsigned, 0 … max code of the channel. Real
/// time: read, write, vent and wait_until allocate nothing and throw nothing; `open` may do both. Threads:
/// one thread drives a card; vent() may be called from another. Errors: calls return Status; open() throws
/// isac::Error (usage for a wrong name, stopped for a card that is not there). Source: seed C.4 (12 outputs
/// 0…4095 → 4…20 mA, 6 encoders), E.1.4 (8 inputs, 12 bit, 0…10 V).
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "isac/core/status.hpp"

namespace isac::card {

inline constexpr int kEncoders = 6;
inline constexpr int kInputs = 8;
inline constexpr int kOutputs = 12;

struct Shape {
  int encoders = 0, inputs = 0, outputs = 0;  ///< channels in use, from index 0
  std::uint32_t encoder_modulus = 1u << 24;   ///< counters wrap at this count
  std::uint32_t input_max_code = 4095;
  std::uint32_t output_max_code = 4095;
  bool heartbeat = false;  ///< there is a line for beat()
};

struct Sample {
  std::int64_t time_ns = 0;  ///< when the card was read, its own clock; strictly increases from read to read
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
  /// Sleeps (hardware) or simulates (sim) until the card's clock reaches `time_ns`; a time in the past
  /// returns at once.
  virtual Status wait_until(std::int64_t time_ns) noexcept = 0;
  virtual Status read(Sample& sample) noexcept = 0;
  /// A code above the channel's maximum is refused (kOutOfRange) and nothing is written; channels beyond the
  /// shape are ignored.
  virtual Status write(const Command& command) noexcept = 0;
  /// All valves to zero pressure; safe to call at any time, any number of times. A later write() opens them
  /// again.
  virtual Status vent() noexcept = 0;
  /// The heartbeat line high or low: a relay beside the computer shuts the valves' supply when it stands still. Who beats is
  /// the control loop; neither opening nor venting moves the line. kNotPermitted where there is none.
  virtual Status beat(bool level) noexcept {
    static_cast<void>(level);
    return Status::kNotPermitted;
  }
  /// What the outputs hold now; kNotPermitted where the card cannot tell.
  virtual Status outputs(Command& command) const noexcept {
    static_cast<void>(command);
    return Status::kNotPermitted;
  }
  /// The card's clock now, so that a late answer can be told from a late question; −1 where time stands still meanwhile.
  [[nodiscard]] virtual std::int64_t clock_ns() const noexcept { return -1; }
  /// After a failure, with the valves vented: the first channel of each device that does not answer and why, or nothing.
  /// Not for the loop: it allocates and may take a second per dead device.
  [[nodiscard]] virtual std::string diagnose() { return {}; }
};

/// What the person at the joint is asked to do; on the simulated rig a simulated person does it.
///
/// The force sensors of the testbed reach 200 N, that is about ±3.4 N m of torque. The person therefore
/// sweeps about the angle at which the joint would rest at the pressures now commanded (the lines of fig 3.7,
/// shifted sideways by Δp), and an amplitude up to 0.4 rad keeps the sensors in range at every Δp;
/// `middle_rad` asks for another middle. A person never goes past the end positions (±1.15 rad). A clamped
/// joint stays in range while |A r² φ + B r Δp| < 3.4 N m.
struct Task {
  enum class Kind {
    kRest,          ///< hands off: the joint is free
    kSweepByHand,   ///< to and fro until the next task
    kClamp,         ///< led to `angle_rad` and clamped there
    kRelease,       ///< clamp or hand let go: the joint is free
    kPose,          ///< led to `angle_rad` and held by hand
    kRemoveLoad,    ///< force sensors off the rig, lying flat, nothing acting on them
    kHangWeight,    ///< `load_newton` hung on both force sensors
    kConnectSupply  ///< pressure sensors connected to the supply, its regulator at `pressure_pascal` (seed
                    ///< E.3.2)
  } kind = Kind::kRest;
  double amplitude_rad = 0;  ///< of the sweep, either side of the middle
  double speed_rad_s = 0;    ///< peak speed asked for, not exceeded; a bundle varies it up to this
  bool vary_speed = false;   ///< the five-minute bundle: all speeds, all positions
  double angle_rad = 0;      ///< where to clamp or pose
  double load_newton = 0;    ///< weight hung on a force sensor in calibration
  double middle_rad = std::numeric_limits<double>::quiet_NaN();  ///< of the sweep; NaN: the rest angle
  double pressure_pascal = 0;                                    ///< kConnectSupply
};

class Person {
 public:
  virtual ~Person() = default;
  /// Throws isac::Error (usage) for a task that nobody can do: a number that is not finite, a sweep without speed.
  virtual void ask(const Task& task) = 0;
  /// True once the last task has been taken up: the joint is where it was asked to be and sweeps, holds or is
  /// free.
  [[nodiscard]] virtual bool ready() const { return true; }
};

/// An opened rig: the card, and whoever moves the joint (null where prompts on the terminal must do).
struct Opened {
  std::unique_ptr<Card> card;
  std::unique_ptr<Person> person;
  std::vector<std::string> remarks{};  ///< what whoever runs it should know, a sentence each
};

/// "sim:", "sim:seed=3,noise=white" (sim_options.hpp lists all), "replay:FILE".
[[nodiscard]] Opened open(std::string_view name);

/// One sentence per back end and its options, for `--help`.
[[nodiscard]] std::string open_help();

}  // namespace isac::card
