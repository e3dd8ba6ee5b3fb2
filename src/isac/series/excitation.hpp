/// @file
/// Excitation: what the valves are told over time, and what the person at the joint is asked to do, for every
/// experiment of the seed's chapter 3 and for the valve unit's steps (seed 4.1).
///
/// A program is a list of stages (a prompt and a task for the person) beside a piecewise linear command of
/// both pressures (two knots at the same time are a step), with an optional multisine in Δp on top:
///   p1(t) = k1(t) − m(t),  p2(t) = k2(t) + m(t),  m(t) = Σ a_i sin(2π f_i t + ψ_i) inside [tones_from,
///   tones_to]
/// so that Δp = (p2 − p1)/2 as in docs/errata.md. Programs are deterministic; phases come from `seed` and
/// nothing else.
///
/// Ranges by default are those the seed's force sensors (200 N) can show on its testbed: a hand's sweep of 0.3 of the angle
/// limit either side of where the bar rests, and 0.45 of the Δp that limits leave room for on the clamped joint.
///
/// `calibrate` (seed E.3, Calibration_x0) is a set of its own: one recording per level of a reference, see
/// calibration_programs.hpp.
///
/// Units: SI. Real time: Program::at allocates nothing and throws nothing, O(log knots). Threads: values.
/// Errors: make_programs throws isac::Error (usage) that names the number, the limit it breaks and the mend.
/// Source: seed 3.2, 3.3 (slow 0.1π rad/s, fast to 2π rad/s, five-minute bundle), 3.4, 3.5 (ranges), 4.1
/// (valve steps), E.3 (calibration). Example: `for (const auto& program : make_programs("constant-pressure", options)) …`
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/series/sweep_check.hpp"

namespace isac::series {

/// What the person does during a stage.
struct Ask {
  enum class Kind {
    kRest,
    kSweepByHand,
    kClamp,
    kRelease,
    kPose,
    kRemoveLoad,    ///< force sensors off the rig, nothing acting on them
    kHangWeight,    ///< `load` on a force sensor
    kConnectSupply  ///< both pressure sensors on the supply at `pressure`
  } kind = Kind::kRest;
  double amplitude = 0;                                      ///< rad, either side of where the bar rests
  double speed = 0;                                          ///< rad/s, peak
  bool vary_speed = false;                                   ///< all speeds up to `speed`
  double angle = 0;                                          ///< rad, where to clamp or hold
  double load = 0;                                           ///< N
  double pressure = 0;                                       ///< Pa
  double middle = std::numeric_limits<double>::quiet_NaN();  ///< rad, of a sweep; NaN: where the bar rests
};

struct Stage {
  double start = 0;  ///< s
  Ask ask;
  std::string prompt;  ///< one plain sentence
};

struct Knot {
  double time = 0, p1 = 0, p2 = 0;  ///< s, Pa, Pa; codes of the valves where the program says so
};

struct Tone {
  double frequency = 0, amplitude = 0, phase = 0;  ///< Hz, Pa, rad
};

struct Pressures {
  double p1 = 0, p2 = 0;  ///< Pa, or codes
};

/// One recording to be made.
struct Program {
  std::string name;           ///< stem of the file
  std::string experiment;     ///< `# experiment:`
  std::string sweep;          ///< "slow", "fast", "bundle" or empty
  bool heldout = false;       ///< belongs into the dataset's heldout folder
  double duration = 0;        ///< s
  bool hand_moves = false;    ///< a person moves the joint, so the speed limit allows for a hand that wanders
  std::vector<Stage> stages;  ///< the first starts at 0
  std::vector<Knot> knots;    ///< at least one; times never decrease
  std::vector<Knot> lead;     ///< played before the recording begins; empty: none
  bool in_codes = false;      ///< knots and lead are valve codes: a valve is calibrated in what it is told
  std::string calibration;    ///< `# calibration:`, what the recording is a level of; empty: none
  std::vector<Tone> tones;
  double tones_from = 0, tones_to = 0;
  SweepExpectation expected;

  [[nodiscard]] Pressures at(double time) const noexcept;
  /// The same of `lead`, which must not be empty.
  [[nodiscard]] Pressures lead_at(double time) const noexcept;
};

struct ExcitationOptions {
  double initial_pressure = 3.0 * kPascalPerKgfCm2;      ///< Pa, p0
  double delta_pressure_limit = 2.0 * kPascalPerKgfCm2;  ///< Pa
  double pressure_limit = 5.0 * kPascalPerKgfCm2;        ///< Pa
  double angle_limit = 0.375 * kPi;                      ///< rad
  double speed_limit = 2.0 * kPi;                        ///< rad/s, what a hand is asked for at most

  // NaN or empty: the experiment's own choice.
  double duration = std::numeric_limits<double>::quiet_NaN();   ///< s, of each recording
  double amplitude = std::numeric_limits<double>::quiet_NaN();  ///< rad, of a hand's sweep
  double speed = std::numeric_limits<double>::quiet_NaN();      ///< rad/s; replaces slow and fast
  double hold = std::numeric_limits<double>::quiet_NaN();       ///< s, of each step or pose
  std::vector<double> delta_pressures;                          ///< Pa; levels or step heights
  std::vector<double> heights;                                  ///< Pa; valve steps
  std::vector<double> angles;                                   ///< rad; clamps or poses
  bool slow = true, fast = true;                                ///< which constant-pressure sweeps
  double base_pressure = 1.0 * kPascalPerKgfCm2;                ///< Pa, from which valve steps start
  std::vector<double> weights;                                  ///< N, hung on each force sensor
  std::vector<double> supplies;                                 ///< Pa, levels of the supply's regulator
  double force_limit = 200.0;                                   ///< N, capacity of the force sensors
  std::uint64_t seed = 1;
};

inline constexpr double kSlowSpeed = 0.1 * kPi;  ///< rad/s, quasi-static (seed 3.2)
inline constexpr double kFastSpeed = 2.0 * kPi;  ///< rad/s, the fastest sweep (seed 3.2)

/// The names `make_programs` knows, with one line on each for a help text.
struct ExperimentInfo {
  const char* name;
  const char* what;
};
[[nodiscard]] const std::vector<ExperimentInfo>& experiments();

/// The recordings an experiment consists of, in the order to make them.
[[nodiscard]] std::vector<Program> make_programs(std::string_view experiment,
                                                 const ExcitationOptions& options);

}  // namespace isac::series
