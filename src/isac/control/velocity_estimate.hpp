/// @file
/// Joint velocity from encoder angles: the difference through a first-order filter.
///
///   ω_k = (T_f ω_(k−1) + (φ_k − φ_(k−1)))/(T_f + h)      backward Euler of T_f ω̇ + ω = φ̇
///
/// The seed derives velocity from encoder steps (5.1.1). One step of 8000 a turn is 0.785 mrad: at 2 kHz the plain
/// difference is a train of pulses of 1.57 rad/s; T_f = 10 ms leaves 0.075 rad/s of each, for a lag of 10 ms.
/// Units: rad, s, rad/s. Real time: constant time, no heap, noexcept. Threads: one.
/// Errors: kNotFinite, kOutOfRange (h ≤ 0); the estimate stays as it was. Example: `speed.step(angle, dt, omega)`.
#pragma once

#include "isac/control/finite.hpp"
#include "isac/core/status.hpp"

namespace isac::control {

template <class S>
class VelocityEstimate {
 public:
  explicit constexpr VelocityEstimate(const S& filter_time = S(0.010)) noexcept : filter_(filter_time) {}

  constexpr void reset() noexcept { *this = VelocityEstimate(filter_); }

  [[nodiscard]] constexpr Status step(const S& angle, const S& dt, S& velocity) noexcept {
    if (!finite(angle, dt)) return Status::kNotFinite;
    if (!(dt > S(0.0))) return Status::kOutOfRange;
    if (has_last_) velocity_ = (filter_ * velocity_ + (angle - last_)) / (filter_ + dt);
    last_ = angle;
    has_last_ = true;
    velocity = velocity_;
    return Status::kOk;
  }

 private:
  S filter_;
  S last_{}, velocity_{};
  bool has_last_ = false;
};

}  // namespace isac::control
