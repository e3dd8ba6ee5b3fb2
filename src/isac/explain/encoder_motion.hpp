/// @file
/// Velocity, acceleration and standing still of a joint that an encoder reads, with few of its steps.
///
///   quiet: w = g_w′ ∗ φ, u = 1 − g_w∗, α = σ²/σ_w²      w + (1 − α) u w + ½ (1 − α)(2 − α) u² w ≈ g′ ∗ φ,  σ_w > σ
///
/// where what it differs by from g′ ∗ φ, and the smooth part of that, is no more than the steps make; second and fourth moments are g's. Steps make
/// white noise of variance step²/12, or at a speed v of which few pass within the kernel the teeth of a saw: 2 v² Σ_k H(2π k v/step)² of a velocity, H
/// the low-pass.
/// Units: σ in samples, intervals s, angles rad. Threads: pure. Errors: none; ends are continued by their last value.
/// Source: docs/derivations/explain.md, "The encoder's noise in φ̇", "Slow turns".
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace isac::explain {

inline constexpr double kSlowestStep = 0.05;  ///< s per encoder step: slower is standing still

/// g′ ∗ φ, and a wider kernel without its bend where what the two differ by is the encoder's steps: damping times their noise would pass
/// for less damping, and what D φ̇ then lacks for friction. Wider still in slow turns, where the steps are teeth of a saw that the first wide one
/// passes. (No step known: g′ ∗ φ.)
[[nodiscard]] std::vector<double> quiet_velocity(std::span<const double> raw_angle, double sigma_samples,
                                                 double interval, double angle_step);
/// g″ ∗ φ by the same way: the steps are in the balance of the motion twice, where an inertia is looked for.
[[nodiscard]] std::vector<double> quiet_acceleration(std::span<const double> raw_angle, double sigma_samples,
                                                     double interval, double angle_step);
/// Where the speed is even and near half a step of the encoder for each sample, or a multiple of that: there the steps beat with the clock,
/// slowly enough to pass any kernel. (None where no step is known.)
[[nodiscard]] std::vector<unsigned char> beats_with_clock(std::span<const double> velocity, double interval,
                                                          double angle_step);
/// Takes such beats out of a low-passed angle and its velocity: within an even stroke a parabola through 0.6 s of it, or through as much as there is
/// on one side, sees the motion as it is.
void hush_beats(std::span<const double> raw_angle, double interval, double angle_step,
                std::vector<double>& angle, std::vector<double>& velocity);
/// An angle and its two derivatives, low-passed; sample `lead` is the first of the recording.
struct Motion {
  std::vector<double> angle, velocity, acceleration;
  std::size_t lead = 0;
  bool from_rest = false;  ///< the recording begins before the joint moves, or as it is let go
};
/// g ∗ φ, g′ ∗ φ and g″ ∗ φ by the same way, all three where g″ ∗ φ is more than the steps make of it: what swings on a spring answers the
/// encoder's steps with its resonance for as long as the joint moves at all. (No step known: as the kernel leaves them.) A joint that is let go
/// at the first sample moves in g ∗ φ before that: the kernel's reach before the recording is there too, the joint at rest in it.
[[nodiscard]] Motion quiet_motion(std::span<const double> raw_angle, double sigma_samples, double interval,
                                  double angle_step);
/// Velocity that can be told from standing still; slower than one step in kSlowestStep is none.
[[nodiscard]] std::vector<double> dry_velocity(std::span<const double> raw_angle,
                                               std::span<const double> velocity, double interval,
                                               double angle_step);

}  // namespace isac::explain
