/// @file
/// The hand of a simulated person: a prescribed motion φ(t), twice continuously differentiable, never exactly periodic.
///
///   φ(t) = q(τ(t)) + E(t) Σ a_k sin(2π f_k t + ψ_k),   f_k in 8 … 12 Hz (tremor)
///   τ̇(t) = 1 + Σ w_k cos(2π g_k t + χ_k),  Σ|w_k| = 0.08 (the speed wanders)
///
/// q is a chain of fifth-order strokes (minimum jerk, Flash and Hogan 1985: x0 + d (10 s³ − 15 s⁴ + 6 s⁵), peak speed
/// 1.875 d/T) with pauses at the ends; E(t) lets the tremor in and out smoothly. The hand is a source of motion: what the
/// joint does to it cannot be measured at the testbed, so nothing is lost by taking it as infinitely stiff.
/// Promise: during a sweep |φ − middle| ≤ amplitude + tremor and |φ̇| ≤ the speed asked for, once ready().
/// Units: rad, s. Real time: no heap, no lock, noexcept. Threads: one. Errors: none.
/// Source: docs/derivations/simulated_rig.md, "The hand"; seed 3.2, 3.3.2.
#pragma once

#include <array>
#include <cstdint>

#include "isac/simulate/random.hpp"

namespace isac::simulate {

struct Motion {
  double angle = 0;         ///< rad
  double velocity = 0;      ///< rad/s
  double acceleration = 0;  ///< rad/s²
};

/// x(s) = Σ c_k s^k on 0 … T, at rest at its end; constant before 0 and after T.
class Quintic {
 public:
  Quintic() = default;
  /// From (x, v, a) at s = 0 to (target, 0, 0) at s = duration.
  Quintic(const Motion& from, double target, double duration) noexcept;
  [[nodiscard]] Motion at(double s) const noexcept;
  [[nodiscard]] double duration() const noexcept { return duration_; }

 private:
  std::array<double, 6> c_{};
  double duration_ = 0;
};

struct HandConfig {
  double tremor_peak = 0.0004;  ///< rad, Σ a_k: 0.1 mm at the end of a 0.3 m bar
  double wander = 0.08;         ///< Σ|w_k|
  double end_position = 1.15;   ///< rad, the person stops before the rig's ends
};

struct Sweep {
  double amplitude = 0.4;   ///< rad
  double middle = 0;        ///< rad
  double speed = 1;         ///< rad/s, peak
  bool vary_speed = false;  ///< strokes of all speeds and lengths
};

class Hand {
 public:
  Hand(const HandConfig& config, std::uint64_t seed) noexcept;

  /// Takes the joint at time t out of the motion `now`; `held` says that this hand already holds it.
  void sweep(double t, const Motion& now, bool held, const Sweep& sweep) noexcept;
  /// Leads the joint to `angle` and keeps it there; a clamp does not tremble.
  void hold(double t, const Motion& now, bool held, double angle, bool clamp) noexcept;

  /// Where the hand is. Valid from the time last given to forget_before() to one stroke ahead (at least 50 ms).
  [[nodiscard]] Motion at(double t) const noexcept;
  /// Strokes that ended before t are dropped and as many new ones planned.
  void forget_before(double t) noexcept;
  /// The lead-in of the last task is over.
  [[nodiscard]] bool ready(double t) const noexcept { return warp(t).angle >= lead_in_end_; }

 private:
  static constexpr int kTremors = 5, kWanders = 3, kPlanned = 3;
  struct Segment {
    double start = 0;  ///< in warped time
    Quintic path;
  };

  [[nodiscard]] Motion warp(double t) const noexcept;    ///< τ, τ̇, τ̈
  [[nodiscard]] Motion path(double tau) const noexcept;  ///< q and its derivatives by τ
  [[nodiscard]] Motion in_warped_time(double t, const Motion& now, bool held) const noexcept;
  void begin(double t, const Motion& now, bool held, double target, double speed, double tremor) noexcept;
  void plan(Segment& segment, const Segment& before) noexcept;
  [[nodiscard]] double stroke_speed_limit() const noexcept;

  HandConfig config_;
  Random random_;
  std::array<double, kTremors> tremor_amplitude_{}, tremor_omega_{}, tremor_phase_{};
  std::array<double, kWanders> wander_amplitude_{}, wander_omega_{}, wander_phase_{};
  double tremor_speed_ = 0;
  std::array<Segment, kPlanned> segments_{};
  Quintic envelope_;
  double envelope_start_ = 0;
  double lead_in_end_ = 0;
  bool sweeping_ = false;
  bool pause_next_ = false;
  Sweep sweep_;
  double side_ = 1;      ///< where the next stroke goes
  double fraction_ = 0;  ///< low-discrepancy sequence of speeds for the bundle
};

}  // namespace isac::simulate
