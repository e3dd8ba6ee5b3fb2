/// @file
/// One PID controller, parallel form (seed 5.1), with an integral that stops where the output does (seed D.2.1).
///
///   u(t) = K_P e + K_I ∫ e dt + K_D ḋ,   e = reference − measurement                              seed 5.1
///   I_k  = I_(k−1) + K_I e_k h                                        the integral term, in units of the output
///   ḋ_k  = (T_f ḋ_(k−1) + (d_k − d_(k−1)))/(T_f + h)                  first-order filter, backward Euler
///   d    = −measurement (no kick when the reference jumps) or e
///   u    = K_P e_k + I_k + K_D ḋ_k, then held within [low, high]
///
/// At a limit, by `anti_windup`:
///   kTakeBack         the seed's: if u has reached a limit, the increment of this cycle is taken back
///   kConditional      the same, but only an increment that drives further into the limit
///   kBackCalculation  I also moves by (u_held − u) h/T_t
/// The seed's rule also refuses increments that lead out of the limit, and can therefore stay there with an error left:
/// docs/derivations/controllers.md derives when, a test shows it.
///
/// The integral is kept as K_I ∫ e dt, so that gains may change while running without a jump of it.
/// Units: the caller's; h in s, from outside, may vary. Real time: constant time, no heap, no lock, noexcept. Threads: one.
/// Errors: kNotFinite (an input or the result is not finite), kOutOfRange (h ≤ 0): state and output stay as they were.
/// Example: `Pid<float> pid({.gains = {.proportional = 4, .integral = 8}}); pid.step(reference, angle, dt, torque);`
#pragma once

#include <cstdint>
#include <limits>

#include "isac/control/finite.hpp"
#include "isac/core/status.hpp"
#include "isac/models/scalar.hpp"

namespace isac::control {

template <class S>
struct PidGains {
  S proportional{};  ///< output per error
  S integral{};      ///< output per error and second
  S derivative{};    ///< output per error per second
};

enum class AntiWindup : std::uint8_t { kTakeBack, kConditional, kBackCalculation };

template <class S>
struct PidSettings {
  PidGains<S> gains{};
  S low = -std::numeric_limits<S>::infinity();
  S high = std::numeric_limits<S>::infinity();
  AntiWindup anti_windup = AntiWindup::kTakeBack;
  S tracking_time = S(0.1);  ///< s, T_t of back calculation
  bool derivative_on_measurement = true;
  S derivative_filter{};  ///< s, T_f; 0: the plain difference
};

/// kOutOfRange for limits in the wrong order, a negative integral gain or time; kNotFinite for gains that are none.
template <class S>
[[nodiscard]] Status check(const PidSettings<S>& settings) noexcept {
  const PidGains<S>& k = settings.gains;
  if (!finite(k.proportional, k.integral, k.derivative, settings.tracking_time, settings.derivative_filter))
    return Status::kNotFinite;
  const bool times = settings.tracking_time > S(0.0) && settings.derivative_filter >= S(0.0);
  return times && k.integral >= S(0.0) && settings.low <= settings.high ? Status::kOk : Status::kOutOfRange;
}

template <class S>
class Pid {
 public:
  constexpr Pid() noexcept = default;
  explicit constexpr Pid(const PidSettings<S>& settings) noexcept : settings_(settings) {}

  /// New gains and limits; the integral term stays.
  constexpr void configure(const PidSettings<S>& settings) noexcept { settings_ = settings; }
  constexpr void set_limits(const S& low, const S& high) noexcept {
    settings_.low = low;
    settings_.high = high;
  }
  [[nodiscard]] constexpr const PidSettings<S>& settings() const noexcept { return settings_; }

  /// Forgets everything but the settings.
  constexpr void reset() noexcept { *this = Pid(settings_); }

  /// Bumpless transfer: sets the integral so that at this reference and measurement the output is `output`. Without an
  /// integral gain there is no memory to set, and the integral becomes 0.
  constexpr void transfer(const S& output, const S& reference, const S& measurement) noexcept {
    rate_ = S(0.0);
    last_ = signal(reference, measurement);
    has_last_ = true;
    limited_ = false;
    integral_ = settings_.gains.integral > S(0.0)
                    ? S(output - settings_.gains.proportional * (reference - measurement))
                    : S(0.0);
  }

  /// What step() would give without an increment of integral and derivative.
  [[nodiscard]] constexpr S output_now(const S& reference, const S& measurement) const noexcept {
    return models::clamp<S>(settings_.gains.proportional * (reference - measurement) + integral_ +
                                settings_.gains.derivative * rate_,
                            settings_.low, settings_.high);
  }

  [[nodiscard]] constexpr Status step(const S& reference, const S& measurement, const S& dt,
                                      S& output) noexcept {
    if (!finite(reference, measurement, dt)) return Status::kNotFinite;
    if (!(dt > S(0.0))) return Status::kOutOfRange;
    const PidGains<S>& k = settings_.gains;
    const S error = reference - measurement;
    const S d = signal(reference, measurement);
    const bool differentiates = has_last_ && k.derivative != S(0.0);  // else the division is for nothing
    const S rate =
        differentiates
            ? S((settings_.derivative_filter * rate_ + (d - last_)) / (settings_.derivative_filter + dt))
            : S(0.0);
    const S increment = k.integral * error * dt;
    const S free = k.proportional * error + (integral_ + increment) + k.derivative * rate;
    if (!finite(free)) return Status::kNotFinite;

    const bool at_high = free >= settings_.high, at_low = free <= settings_.low;
    output = models::clamp<S>(free, settings_.low, settings_.high);
    limited_ = at_high || at_low;
    rate_ = rate;
    last_ = d;
    has_last_ = true;
    switch (settings_.anti_windup) {
      case AntiWindup::kTakeBack:
        if (!limited_) integral_ += increment;
        break;
      case AntiWindup::kConditional:
        if (!(at_high && increment > S(0.0)) && !(at_low && increment < S(0.0))) integral_ += increment;
        break;
      case AntiWindup::kBackCalculation: {
        const S share = dt < settings_.tracking_time ? S(dt / settings_.tracking_time) : S(1.0);
        integral_ += increment + (output - free) * share;
        break;
      }
    }
    return Status::kOk;
  }

  [[nodiscard]] constexpr const S& integral_term() const noexcept { return integral_; }
  /// Did the last output stand at a limit?
  [[nodiscard]] constexpr bool limited() const noexcept { return limited_; }

 private:
  [[nodiscard]] constexpr S signal(const S& reference, const S& measurement) const noexcept {
    return settings_.derivative_on_measurement ? S(-measurement) : S(reference - measurement);
  }

  PidSettings<S> settings_;
  S integral_{}, rate_{}, last_{};
  bool has_last_ = false, limited_ = false;
};

}  // namespace isac::control
