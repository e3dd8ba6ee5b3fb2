/// @file
/// A dataset made ready for explaining: every run on an even grid, low-passed once, cut into blocks of time.
///
///   x̃ = g ∗ x,  φ̇ = g′ ∗ φ,  φ̈ = g″ ∗ φ,   g a Gaussian of standard deviation `smooth`
///
/// All signals of a chain pass the same kernel, so that a linear model of them is left as it is. Velocity near zero is what an
/// encoder of finite steps can tell: slower than one step in a tenth of a second is standing still (`dry_velocity`).
/// Held-out runs are a type of their own (HeldOut): only the proof at the end can open them.
/// Units: SI. Threads: values. Errors: throws isac::Error (no usable data) if no run has what any chain needs.
/// Source: docs/derivations/explain.md.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "isac/explain/encoder_motion.hpp"
#include "isac/series/recording.hpp"

namespace isac::explain {

/// What is known of the rig beforehand; NaN where not.
struct RigFacts {
  double wheel_radius = std::numeric_limits<double>::quiet_NaN();    ///< m
  double initial_pressure = 3.0 * 98066.5;                           ///< Pa, p0
  double inertia = std::numeric_limits<double>::quiet_NaN();         ///< kg m²
  double angle_step = std::numeric_limits<double>::quiet_NaN();      ///< rad of the encoder
  double force_lag = std::numeric_limits<double>::quiet_NaN();       ///< s, of the force amplifiers
  double force_noise = std::numeric_limits<double>::quiet_NaN();     ///< N, data sheet
  double pressure_noise = std::numeric_limits<double>::quiet_NaN();  ///< Pa, data sheet
};

/// The baseline: the seed's joint (no terms given), or a sum of catalogue terms that makes a recorded output.
struct BaselineModel {
  std::vector<std::string> terms;  ///< ids; empty: A, B, C, D, the valve unit's lag and I φ̈ = T
  std::string output = "torque", output_unit = "N m";
  std::string position = "angle", position_unit = "rad";
  /// The output drives the axis: output = −Σ term (constants of the output keep their sign).
  bool driven = false;
};

enum class Chain : unsigned char { kTorque = 0, kPressure1 = 1, kPressure2 = 2, kMotion = 3 };
inline constexpr int kChains = 4;
inline constexpr double kAtomSeconds = 2.0;  ///< the shortest block

struct PreparedRun {
  bool recorded = true;  ///< false: planned, its signals are a model's
  std::string name, experiment, sha256;
  double interval = 0;    ///< s
  double day_offset = 0;  ///< s from the first run's start to this one's
  bool has_torque = false, has_pressure = false, has_command = false, is_free = false;
  std::vector<double> time;                           ///< s
  std::vector<double> raw_angle;                      ///< rad as read
  std::vector<double> angle, velocity, acceleration;  ///< low-passed
  std::vector<double> dry_velocity;     ///< velocity that an encoder can tell from standing still
  std::vector<double> raw_pressure[2];  ///< Pa as read
  double mean_pressure_error =
      0;  ///< Pa, of the whole run's mean of (p2 − p1)/2, where its noise was taken out of the rest
  /// Pa, what one deviation of the valves' fitted lag makes of (p2 − p1)/2 there; empty: nothing was taken out.
  std::vector<double> lag_pressure_error;
  std::vector<double> smooth_pressure[2];  ///< Pa, low-passed: what the valve unit's model is held against
  /// Pa, what enters the torque: low-passed more where the pressure rests, so that its noise does not pass for torque.
  std::vector<double> pressure[2];
  double first_pressure[2] = {0, 0};  ///< Pa, where each began, from as long as its command stood still
  std::vector<double> command[2];     ///< Pa as recorded
  std::vector<double> force[2];       ///< N as read; empty where only the torque is known
  std::vector<double> common_force;   ///< N, half the sum of the two, low-passed
  std::vector<double> torque;         ///< N m (or the output's unit) as read
  std::vector<double> smooth_torque;  ///< low-passed for the torque chain
  std::vector<double> slow_torque, slow_acceleration;  ///< low-passed for the motion chain
  /// By how much slow_torque may be off where a command jumps and the torque's slope with it, by J: a sum of samples by the kernel g is
  /// Σ g T Δt = ∫ g T dt − J Δt² ½ B₂(x) g, x of a sample after one, ½ B₂ = 1/12 at x = 0 and −1/24 at ½ (Euler and Maclaurin), while g″ ∗ φ of the
  /// angle, whose third derivative jumps, is exact. J Δt²/12 g, N m; empty where no command is known.
  std::vector<double> slow_torque_error;
  Motion swing;  ///< of a free joint, for what swings on it (filters.hpp, `quiet_motion`); may be empty
  /// 0 where a force sensor hangs slack, which cannot read a push, and where a led joint's direction is untold.
  std::vector<unsigned char> loaded;
  double untold =
      0;  ///< s of a led run's slow turns, in which the encoder does not tell its direction: left out of the torque
  std::vector<unsigned char> usable;  ///< 0 beside gaps and edges
};

/// One row of the stacked residual.
struct Row {
  unsigned run = 0, sample = 0, atom = 0, block = 0;
  Chain chain = Chain::kTorque;
};

struct Smoothing {
  double torque = 0.006, motion = 0.020;  ///< s, standard deviation of the Gaussian
};

struct Prepared {
  RigFacts rig;
  BaselineModel baseline;
  Smoothing smoothing;
  std::vector<PreparedRun> runs;
  std::vector<Row> rows;               ///< by run, then by chain, then by time
  std::vector<std::size_t> run_begin;  ///< rows of run i: [run_begin[i], run_begin[i + 1])
  std::size_t atoms = 0, blocks = 0;   ///< a block is a number of atoms of one run, one after another
  std::vector<unsigned> block_of_atom;
  double block_seconds = 0;
  double first_start =
      std::numeric_limits<double>::quiet_NaN();  ///< s since 1970 of the day's first run, where known
  int stride = 1;                                ///< samples per row
  bool with_free_torque = false;                 ///< see add_torque_of_free_runs

  [[nodiscard]] bool has(Chain chain) const noexcept;
  [[nodiscard]] double untold() const noexcept;  ///< s, of all runs
};

/// Runs that no fit, test or choice has seen. Only prove() (proof.hpp) opens them.
class HeldOut {
 public:
  HeldOut() = default;
  explicit HeldOut(std::vector<series::Recording> runs) : runs_(std::move(runs)) {}
  [[nodiscard]] std::size_t size() const noexcept { return runs_.size(); }
  /// s since 1970 of the first of them, NaN where none says: the day's clock is not evidence.
  [[nodiscard]] double first_start() const;

 private:
  friend class Proof;
  std::vector<series::Recording> runs_;
};

/// rad/s, below which a hand that leads the joint may leave its direction untold; 0 where the encoder's step is not known.
[[nodiscard]] double told_speed(double angle_step) noexcept;

/// The day's clock begins with the first of `runs`, or at `first_start` if that is earlier.
[[nodiscard]] Prepared prepare(std::span<const series::Recording> runs, const RigFacts& rig,
                               const BaselineModel& baseline, double block_seconds,
                               double first_start = std::numeric_limits<double>::quiet_NaN());
/// Free runs give rows of the torque as well, though driven ones would suffice: beside a zero of the force sensors that wanders they tell more
/// together with the motion (weights.hpp, `one_zero`) than the joint's own noise in the angle biases. False if there are none to add.
[[nodiscard]] bool can_add_torque_of_free_runs(const Prepared& data);
void add_torque_of_free_runs(Prepared& data);
/// Joins atoms to blocks of about this length anew.
void cut_blocks(Prepared& data, double block_seconds);

}  // namespace isac::explain
