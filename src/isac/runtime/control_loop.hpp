/// @file
/// The live loop: control::ArmController on a card, with watches and the fault machine before it and the valves behind it.
///
/// One cycle, in this order (docs/derivations/loop.md; seed 6.2, figure 6.1):
///   wait → read → codes, limits, encoder, following error (control/watches) → fault machine → disarmed or faulted: vent
///   armed: pressures rise to p0 during `run_up`, then controller → rate limit, finite check, clamp → codes → write
/// Where the card has a heartbeat line, each cycle without a fault turns it over, and its end, a fault or a dead loop leaves it.
/// Everything but "armed" vents, in every cycle anew. dt is the difference of two samples' stamps. A cycle that comes late
/// skips whole periods, counts them, and never catches up in a burst. A read or write that fails vents in the same cycle.
///
/// Units: SI; card time in ns. Real time: cycle() and run() allocate nothing, take no lock, write no file and end no process;
/// what a card or a simulated rig does inside its own calls is the card's promise. Threads: one thread runs a loop; `Live`
/// and `Switches` are for others. Errors: configure() says why settings are refused; how a run ended is in LoopEnd.
/// Source: seed 6.2; decisions 0090, 0110. Example: `ControlLoop loop(card, wiring, settings); loop.run(...)`.
#pragma once

#include <atomic>
#include <cstdint>

#include "isac/card/card.hpp"
#include "isac/control/arm_controller.hpp"
#include "isac/control/fault_machine.hpp"
#include "isac/control/velocity_estimate.hpp"
#include "isac/control/watches.hpp"
#include "isac/runtime/cycle_row.hpp"
#include "isac/runtime/heartbeat.hpp"
#include "isac/runtime/joint_wiring.hpp"

namespace isac::runtime {

struct ControlSettings {
  PerJoint<control::JointSettings<double>> joint;
  PerJoint<control::FeedForward<double>> feed_forward;
  PerJoint<control::JointWatchSettings<double>> watch;
  PerJoint<control::EncoderWatchSettings<double>> encoder;  ///< modulus and counts come from the wiring
  control::FaultSettings fault;                             ///< its period is the loop's
  int samples_at_end = 200;                                 ///< of an analogue input at an end of its range
  double run_up = 1.5;             ///< s from vented to p0: eight lags of the valve unit
  double velocity_filter = 0.010;  ///< s

  // PI-CMBPI (seed 5.4) of an arm; without: nothing is compensated.
  bool compensate = false;
  models::Chain<double, kMaxJoints> chain;
  models::Coupling<double, kMaxJoints> coupling{};
  control::InertiaShare inertia = control::InertiaShare::kFirstJoint;
};

/// Where the loop stands, for whoever decides what is wanted next.
struct Moment {
  std::int64_t cycle = 0, time_ns = 0;
  double control_time = 0;  ///< s since the controller took over; 0 before
  Phase phase = Phase::kChecking;
  bool plausible = false;  ///< enough good samples in a row to arm
  PerJoint<double> angle{};
};

struct Wanted {
  bool arm = false;  ///< level of the switch; its edge arms
  bool acknowledge = false;
  control::Mode mode = control::Mode::kHold;
  PerJoint<JointAim> joint;
};

/// Decides what is wanted. at() is called in the loop: no heap, no lock. False: the run is over.
class Director {
 public:
  virtual ~Director() = default;
  [[nodiscard]] virtual bool at(const Moment& now, Wanted& wanted) noexcept = 0;
};

/// Takes every cycle. Called in the loop: no heap, no lock, no file. False: it cannot take any more.
class CycleSink {
 public:
  virtual ~CycleSink() = default;
  [[nodiscard]] virtual bool take(const CycleRow& row) noexcept = 0;
};

/// What the loop shows of itself while it runs; lies in memory that a supervisor shares.
struct Live {
  Heartbeat heart;
  std::atomic<std::int64_t> time_ns{0};
  std::atomic<std::int64_t> late{0}, skipped{0};
  std::atomic<int> phase{0};
  PerJoint<std::atomic<double>> angle{}, aim{}, delta_pressure{};
};

struct LoopEnd {
  enum class Why : std::uint8_t {
    kDone,         ///< the director had nothing more
    kStopped,      ///< a person or another process asked for the end
    kFault,        ///< latched; `cause` says which
    kCardEnded,    ///< a replayed recording has nothing more
    kImplausible,  ///< could not be armed within `patience`; `cause` is the last finding
    kSink          ///< the log can take no more
  } why = Why::kDone;
  control::Finding cause;
  Status status = Status::kOk;  ///< what the card answered last
  std::int64_t cycles = 0, late = 0, skipped = 0;
  std::int64_t ended_ns = 0;         ///< loop time of the last sample
  std::int64_t longest_late_ns = 0;  ///< of a sample behind its time
};

class ControlLoop {
 public:
  static constexpr double kPatience = 5.0;  ///< s of checking before the loop gives up on an implausible card

  ControlLoop(card::Card& card, const JointWiring& wiring, const ControlSettings& settings) noexcept;

  /// kOk, or why the settings of joint `failed_joint()` cannot drive it.
  [[nodiscard]] Status configure() noexcept;
  [[nodiscard]] int failed_joint() const noexcept { return failed_; }

  /// Runs until the director, `stop`, a fault or the card ends it, and vents. `live` and `sink` may be null.
  [[nodiscard]] LoopEnd run(Director& director, const std::atomic<bool>& stop, Live* live,
                            CycleSink* sink) noexcept;

  /// One cycle. False: the director, the sink or the card's data have come to an end (run() ends at a fault too).
  [[nodiscard]] bool cycle(Director& director, Live* live, CycleSink* sink) noexcept;
  [[nodiscard]] const CycleRow& row() const noexcept { return row_; }
  [[nodiscard]] const control::FaultMachine& machine() const noexcept { return machine_; }
  [[nodiscard]] const LoopEnd& end() const noexcept { return end_; }

 private:
  using Controller = control::ArmController<double, kMaxJoints>;

  [[nodiscard]] Status sample(double& dt) noexcept;
  void measure(double dt) noexcept;
  [[nodiscard]] control::Finding watch(double dt) noexcept;
  void judge(const control::Finding& found, bool answered) noexcept;
  void act(double dt) noexcept;
  void control(double dt) noexcept;
  void write_out() noexcept;
  void close_valves() noexcept;
  void beat() noexcept;
  void show(Live* live) const noexcept;

  card::Card& card_;
  JointWiring wiring_;
  ControlSettings settings_;
  std::int64_t period_ns_;
  control::FaultMachine machine_;
  Controller controller_;
  PerJoint<control::JointWatch<double>> joint_watch_;
  PerJoint<control::EncoderWatch<double>> encoder_watch_;
  PerJoint<control::VelocityEstimate<double>> velocity_;
  PerJoint<double> first_count_{};  ///< count of the first sample, unwrapped to the middle
  std::array<control::InputWatch, card::kInputs> input_watch_;
  std::array<bool, card::kInputs> input_used_{};

  CycleRow row_;
  Wanted wanted_;
  LoopEnd end_;
  std::int64_t next_ns_ = 0, first_ns_ = 0, last_ns_ = 0, armed_ns_ = 0, control_ns_ = 0;
  std::int64_t good_cycles_ = 0, bad_cycles_ = 0;
  bool has_sample_ = false, in_control_ = false, beat_ = false;
  int failed_ = -1;
};

}  // namespace isac::runtime
