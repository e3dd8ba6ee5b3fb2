/// @file
/// What is watched at every sample: the joint's limits and its following error, its encoder, and the analogue inputs.
///
///   7   pressure, Δp, angle, speed, force, torque: beyond soft → warning, beyond hard for `persistence` → fault
///   8   |φ_d − φ| beyond `following` for `following_time` → fault, with the joint's index
///   9   |Δcount| beyond (v_max h k) in counts + 1 → fault at once; encoder unchanged for `frozen_time` while Δp moved by more
///       than `frozen_pressure` → warning
///   10  a code above its maximum → fault at once (an empty slot reads 65535); at 0 or at the maximum for `n` samples → fault
///
/// "For a time": without a pause, so that one noisy sample stops nothing. A value that is not finite is a fault at once.
/// Quantities a rig does not measure are left at 0, with the limit left unlimited.
/// Units: SI, counts. h from outside, s. Real time: constant time, no heap, noexcept. Threads: one per object.
/// Errors: findings, no statuses. Source: decision 0090; seed 3.5, E.1.1; LinuxCNC. Example: tests/control/watches_test.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "isac/control/fault.hpp"
#include "isac/control/finite.hpp"
#include "isac/models/scalar.hpp"

namespace isac::control {

namespace detail {
template <class S>
[[nodiscard]] constexpr Finding finding(FaultCode code, int joint, const S& value, const S& limit) noexcept {
  return {.code = code,
          .joint = static_cast<std::int8_t>(joint),
          .value = static_cast<float>(value),
          .limit = static_cast<float>(limit)};
}
}  // namespace detail

/// Soft and hard limit of a magnitude.
template <class S>
struct Bound {
  S soft = std::numeric_limits<S>::infinity();
  S hard = std::numeric_limits<S>::infinity();
};

template <class S>
struct JointWatchSettings {
  Bound<S> pressure{}, delta_pressure{}, angle{}, speed{}, force{}, torque{};
  S persistence = S(0.010);  ///< s
  S following = std::numeric_limits<S>::infinity();
  S following_time = S(0.1);  ///< s
};

template <class S>
struct WatchedJoint {
  S pressure_1{}, pressure_2{};  ///< Pa, measured, or commanded where there is no sensor
  S angle{}, speed{};
  S force_1{}, force_2{};
  S torque{};
  S desired_angle{};
  bool follows = false;  ///< a position is being controlled: the following error counts
};

template <class S>
class JointWatch {
 public:
  constexpr JointWatch() noexcept = default;
  constexpr JointWatch(const JointWatchSettings<S>& settings, int joint) noexcept
      : settings_(settings), joint_(joint) {}

  /// The first finding of this sample; `warnings` gets flags added.
  [[nodiscard]] constexpr Finding check(const WatchedJoint<S>& now, const S& dt,
                                        std::uint8_t& warnings) noexcept {
    if (!finite(now.pressure_1, now.pressure_2, now.angle, now.speed, now.force_1, now.force_2, now.torque))
      return detail::finding<S>(FaultCode::kSensorNotFinite, joint_, S(0.0), S(0.0));
    if (!finite(now.desired_angle) || !finite(dt))
      return detail::finding<S>(FaultCode::kCommandNotFinite, joint_, S(0.0), S(0.0));
    using models::magnitude;
    const auto larger = [](const S& a, const S& b) { return a > b ? a : b; };
    struct Limit {
      FaultCode code;
      S value;
      const Bound<S>* bound;
    };
    const std::array<Limit, kLimits> limits = {{
        {FaultCode::kPressureLimit, larger(now.pressure_1, now.pressure_2), &settings_.pressure},
        {FaultCode::kDeltaPressureLimit, magnitude<S>((now.pressure_2 - now.pressure_1) / S(2.0)),
         &settings_.delta_pressure},
        {FaultCode::kAngleLimit, magnitude(now.angle), &settings_.angle},
        {FaultCode::kSpeedLimit, magnitude(now.speed), &settings_.speed},
        {FaultCode::kForceLimit, larger(magnitude(now.force_1), magnitude(now.force_2)), &settings_.force},
        {FaultCode::kTorqueLimit, magnitude(now.torque), &settings_.torque},
    }};
    Finding first;
    for (std::size_t i = 0; i < kLimits; ++i) {
      if (limits[i].value > limits[i].bound->soft) warnings |= kNearLimit;
      const bool beyond = limits[i].value > limits[i].bound->hard;
      if (beyond_long_enough(beyond, dt, settings_.persistence, since_[i]) && !first.found())
        first = detail::finding<S>(limits[i].code, joint_, limits[i].value, limits[i].bound->hard);
    }
    const S behind = magnitude<S>(now.desired_angle - now.angle);
    if (beyond_long_enough(now.follows && behind > settings_.following, dt, settings_.following_time,
                           since_[kLimits]) &&
        !first.found())
      first = detail::finding<S>(FaultCode::kFollowingError, joint_, behind, settings_.following);
    return first;
  }

 private:
  static constexpr std::size_t kLimits = 6;

  /// `since` < 0: not beyond; otherwise how long it has been.
  [[nodiscard]] static constexpr bool beyond_long_enough(bool beyond, const S& dt, const S& allowed,
                                                         S& since) noexcept {
    since = !beyond ? S(-1.0) : (since < S(0.0) ? S(0.0) : S(since + dt));
    return beyond && since >= allowed;
  }

  JointWatchSettings<S> settings_;
  int joint_ = 0;
  std::array<S, kLimits + 1> since_ = {S(-1), S(-1), S(-1), S(-1), S(-1), S(-1), S(-1)};
};

template <class S>
struct EncoderWatchSettings {
  std::uint32_t modulus = 1u << 24;                        ///< the counter wraps at this count
  S counts_per_radian{};                                   ///< magnitude
  S largest_speed{};                                       ///< rad/s
  S margin = S(2.0);                                       ///< k
  S frozen_time = S(0.5);                                  ///< s
  S frozen_pressure = std::numeric_limits<S>::infinity();  ///< Pa of Δp
};

/// Unwraps a counter of N bits and watches it.
template <class S>
class EncoderWatch {
 public:
  constexpr EncoderWatch() noexcept = default;
  constexpr EncoderWatch(const EncoderWatchSettings<S>& settings, int joint) noexcept
      : settings_(settings), joint_(joint) {}

  /// Counts since the first sample, turns and wrap-arounds included; a sample that is a finding moves nothing.
  /// After a jump the angle is no longer known: the finding stays until the count comes back or restart().
  [[nodiscard]] constexpr std::int64_t position() const noexcept { return position_; }

  /// Takes the next count as the new zero: after a jump, when the joint has been led to a known place again.
  constexpr void restart() noexcept { *this = EncoderWatch(settings_, joint_); }

  [[nodiscard]] constexpr Finding check(std::uint32_t count, const S& delta_pressure, const S& dt,
                                        std::uint8_t& warnings) noexcept {
    if (count >= settings_.modulus)
      return detail::finding<S>(FaultCode::kInputCode, joint_, S(count), S(settings_.modulus));
    if (!has_last_) {
      last_ = count;
      has_last_ = true;
      low_ = high_ = delta_pressure;
      return {};
    }
    const std::int64_t turn = settings_.modulus;
    std::int64_t step = static_cast<std::int64_t>(count) - static_cast<std::int64_t>(last_);
    if (step > turn / 2) step -= turn;
    if (step < -(turn / 2)) step += turn;
    const S largest = settings_.largest_speed * dt * settings_.margin * settings_.counts_per_radian + S(1.0);
    const S size = models::magnitude<S>(static_cast<S>(step));
    if (size > largest) return detail::finding<S>(FaultCode::kEncoderJump, joint_, size, largest);
    position_ += step;
    last_ = count;
    if (step != 0) {
      still_ = S(0.0);
      low_ = high_ = delta_pressure;
    } else {
      still_ += dt;
      if (delta_pressure < low_) low_ = delta_pressure;
      if (delta_pressure > high_) high_ = delta_pressure;
      if (still_ >= settings_.frozen_time && high_ - low_ > settings_.frozen_pressure)
        warnings |= kEncoderFrozen;
    }
    return {};
  }

 private:
  EncoderWatchSettings<S> settings_;
  int joint_ = 0;
  std::uint32_t last_ = 0;
  std::int64_t position_ = 0;
  S still_{}, low_{}, high_{};
  bool has_last_ = false;
};

/// One analogue input.
class InputWatch {
 public:
  /// `zero_is_an_end`: false for a sensor whose smallest value is code 0 (gauge pressure of a vented muscle).
  explicit constexpr InputWatch(std::uint32_t max_code = 4095, int samples_at_end = 200,
                                bool zero_is_an_end = true) noexcept
      : max_code_(max_code), samples_at_end_(samples_at_end), zero_is_an_end_(zero_is_an_end) {}

  /// `answered`: did the card's read succeed? `channel` is named in the finding's `joint`.
  [[nodiscard]] constexpr Finding check(std::uint32_t code, bool answered, int channel) noexcept {
    if (!answered) return detail::finding<float>(FaultCode::kReadFailed, channel, 0, 0);
    const float value = static_cast<float>(code), limit = static_cast<float>(max_code_);
    if (code > max_code_) return detail::finding<float>(FaultCode::kInputCode, channel, value, limit);
    at_end_ = (code == 0 && zero_is_an_end_) || code == max_code_ ? at_end_ + 1 : 0;
    if (at_end_ < samples_at_end_) return {};
    at_end_ = samples_at_end_;
    return detail::finding<float>(FaultCode::kInputAtEnd, channel, value, limit);
  }

 private:
  std::uint32_t max_code_;
  int samples_at_end_;
  bool zero_is_an_end_;
  int at_end_ = 0;
};

}  // namespace isac::control
