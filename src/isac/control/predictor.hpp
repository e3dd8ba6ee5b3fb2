/// @file
/// Dead-time predictor of Smith's type for one joint: where the joint would be if its tube had no dead time.
///
///   model:  p' = valve_step(p, u),  I φ̈_m = T(φ_m, p, φ̇_m) + T_ext            models/valve_unit, models/joint_torque
///   φ_fb(t) = φ(t) + φ_m(t) − φ_m(t − L)                                       what the position loop is fed back
///
/// With a right model the loop acts as if L were behind it: y(t) with predictor = y(t − L) of the loop without dead time
/// (docs/derivations/controllers.md; tested). At rest and for L = 0 the correction is exactly 0. A load that the model does
/// not know shifts φ_m and its past alike, so it leaves no error at rest. Needs a joint that is stable by itself (A < 0).
/// Semi-implicit Euler: its error is of order h/T_J (1.6 % at 2 kHz) and enters both terms.
///
/// Units: SI. Memory: kMaxDelaySteps numbers and their intervals, fixed. Real time: at most kMaxDelaySteps additions, no
/// heap, noexcept. Threads: one. Errors: kNotFinite, kOutOfRange (h ≤ 0, inertia ≤ 0); a delay longer than the buffer reaches
/// is cut to its length (reach()). Source: Smith 1957. Example: `predictor.step(delta_pressure, load, dt, correction)`.
#pragma once

#include <array>
#include <cstddef>

#include "isac/control/finite.hpp"
#include "isac/core/status.hpp"
#include "isac/models/joint_motion.hpp"
#include "isac/models/joint_torque.hpp"
#include "isac/models/valve_unit.hpp"

namespace isac::control {

/// A value as it was `delay` seconds ago, from samples at intervals that may vary; straight lines between them.
template <class S, std::size_t Capacity>
class DelayLine {
 public:
  constexpr void fill(const S& value) noexcept {
    value_.fill(value);
    interval_.fill(S(0.0));
    newest_ = 0;
  }
  /// Time went on by `dt` and the value is now `value`.
  constexpr void push(const S& value, const S& dt) noexcept {
    newest_ = newest_ + 1 == Capacity ? 0 : newest_ + 1;
    value_[newest_] = value;
    interval_[newest_] = dt;
  }
  [[nodiscard]] constexpr S at(const S& delay) const noexcept {
    S left = delay;
    std::size_t i = newest_;
    for (std::size_t n = 0; n + 1 < Capacity; ++n) {
      const std::size_t before = i == 0 ? Capacity - 1 : i - 1;
      const S step = interval_[i];
      if (left < step) return value_[i] + (value_[before] - value_[i]) * (left / step);
      left -= step;
      i = before;
      if (!(left > S(0.0))) break;
    }
    return value_[i];
  }
  /// Seconds back that the buffer knows.
  [[nodiscard]] constexpr S reach() const noexcept {
    S sum{};
    for (std::size_t i = 0; i < Capacity; ++i) sum += interval_[i];
    return sum - interval_[newest_ + 1 == Capacity ? 0 : newest_ + 1];
  }

 private:
  std::array<S, Capacity> value_{};
  std::array<S, Capacity> interval_{};
  std::size_t newest_ = 0;
};

inline constexpr std::size_t kMaxDelaySteps = 128;  ///< 64 ms at 2 kHz

template <class S>
struct PredictedJoint {
  models::JointCoefficients<S> muscle{};
  S wheel_radius{};              ///< m
  S inertia{};                   ///< kg m²
  models::ValveUnit<S> valve{};  ///< with the dead time that is predicted away
};

template <class S>
class JointPredictor {
 public:
  constexpr JointPredictor() noexcept = default;
  explicit constexpr JointPredictor(const PredictedJoint<S>& joint) noexcept : joint_(joint) {}

  /// The model stands still at this angle with the pressure difference `delta_pressure` in the muscles.
  constexpr void reset(const S& angle, const S& delta_pressure) noexcept {
    angle_ = angle;
    velocity_ = S(0.0);
    delta_pressure_ = joint_.valve.gain * delta_pressure;
    past_.fill(angle);
  }

  /// One step of the model under the Δp now commanded; `correction` is to be added to the measured angle.
  [[nodiscard]] Status step(const S& delta_pressure, const S& external_torque, const S& dt,
                            S& correction) noexcept {
    if (!finite(delta_pressure, external_torque, dt)) return Status::kNotFinite;
    if (!(dt > S(0.0)) || !(joint_.inertia > S(0.0))) return Status::kOutOfRange;
    delta_pressure_ = models::valve_step(joint_.valve, delta_pressure_, delta_pressure, dt);
    const S torque =
        models::joint_torque(joint_.muscle, joint_.wheel_radius, angle_, delta_pressure_, velocity_);
    velocity_ += models::joint_acceleration(joint_.inertia, torque, external_torque) * dt;
    angle_ += velocity_ * dt;
    if (!finite(angle_, velocity_)) return Status::kNotFinite;
    past_.push(angle_, dt);
    correction = angle_ - past_.at(joint_.valve.dead_time);
    return Status::kOk;
  }

  [[nodiscard]] constexpr S reach() const noexcept { return past_.reach(); }
  [[nodiscard]] constexpr const S& angle() const noexcept { return angle_; }

 private:
  PredictedJoint<S> joint_;
  S angle_{}, velocity_{}, delta_pressure_{};
  DelayLine<S, kMaxDelaySteps> past_;
};

}  // namespace isac::control
