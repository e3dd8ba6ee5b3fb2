/// @file
/// The controller of one joint: PID, PI-PI, PI-MBPI and PI-CMBPI, torque mode and hold, one pure step per tick.
///
///   each tick (2 kHz), in the order of the seed's figure 6.1:
///     T    = A r² φ + B r Δp_commanded − C φ̇³ − D φ̇           the actuator model (or the measured torque)     seed 5.3
///     Δp   = PI_τ(T_d + d_T − T),  |Δp| ≤ 2 kg/cm²                d_T: load of the reference                     seed D.2.1
///   each tenth tick (0.2 kHz), after it, for the ticks to come:
///     T_d  = PI_φ(φ_d − φ)                                        or the set torque, in torque mode
///   then the gate of limits.hpp, and p1 = p0 − Δp, p2 = p0 + Δp
///   kPid:  Δp = PID(φ_d − φ) each tick                                                                          seed 5.1
///
/// The outer loop's limits are "the maximum values the torque controller can adjust" (6.3), taken at the present angle and
/// speed: T(±Δp_max) of the model less the load, within ± limits.torque. So neither integral runs away behind the other.
/// Switching: on the first tick of another mode or of other settings both integrals are set so that torque asked for and
/// Δp go on from where they were (docs/derivations/controllers.md); without integral gains there is no memory to set. The
/// desired angle starts at the joint's own and from the next tick runs to the one asked for, no faster than limits.speed.
///
/// Units: SI. dt: seconds since the step before, from outside; the outer loop takes the sum of its ticks.
/// Real time: constant time, no heap, no lock, noexcept. Threads: one.
/// Errors: kNotFinite (an input or the command is not finite: never clamped), kOutOfRange (dt ≤ 0): the command then says
/// "vented", and the controller stays vented until it is given a mode again. configure(): kNotFinite, kOutOfRange, and the
/// settings stay. kNotPermitted: torque mode of a plain PID, any mode before settings. A plain PID has no torque to add the
/// load to and leaves it out.
/// Source: seed 5.1 to 5.4, 6.2, 6.3, D.2.1. Example: `controller.step(measured, reference, dt, command)`.
#pragma once

#include "isac/control/joint_settings.hpp"
#include "isac/control/predictor.hpp"

namespace isac::control {

template <class S>
class JointController {
 public:
  /// A controller that is vented and refuses to run until it is configured.
  constexpr JointController() noexcept = default;

  /// New settings, also while running: the next step goes on from the present Δp.
  [[nodiscard]] Status configure(const JointSettings<S>& settings) noexcept {
    if (const Status status = check(settings); !ok(status)) return status;
    if (settings.structure == Structure::kPid && mode_ == Mode::kTorque) return Status::kNotPermitted;
    settings_ = settings;
    configured_ = true;
    const JointLimits<S>& l = settings.limits;
    const bool direct = settings.structure == Structure::kPid;
    position_.configure({.gains = settings.position,
                         .low = direct ? -l.delta_pressure : -l.torque,
                         .high = direct ? l.delta_pressure : l.torque,
                         .anti_windup = settings.anti_windup,
                         .derivative_filter = settings.derivative_filter});
    torque_.configure({.gains = settings.torque,
                       .low = -l.delta_pressure,
                       .high = l.delta_pressure,
                       .anti_windup = settings.anti_windup});
    predictor_starts_ = true;  // another model has another past: it starts at rest where the joint is
    predictor_ =
        JointPredictor<S>({settings.muscle, settings.wheel_radius, settings.inertia, settings.valve});
    fresh_ = true;
    return Status::kOk;
  }

  [[nodiscard]] Status set_mode(Mode mode) noexcept {
    if (mode == mode_) return Status::kOk;
    if (mode != Mode::kVented && !configured_) return Status::kNotPermitted;
    if (mode == Mode::kTorque && settings_.structure == Structure::kPid) return Status::kNotPermitted;
    from_rest_ = from_rest_ || mode_ == Mode::kVented;
    mode_ = mode;
    fresh_ = new_mode_ = true;
    return Status::kOk;
  }

  [[nodiscard]] Mode mode() const noexcept { return mode_; }
  [[nodiscard]] const JointSettings<S>& settings() const noexcept { return settings_; }

  [[nodiscard]] Status step(const JointMeasurement<S>& now, const JointReference<S>& wanted, const S& dt,
                            JointCommand<S>& command) noexcept {
    command = JointCommand<S>{};
    const Status status = checked_step(now, wanted, dt, command);
    if (!ok(status)) {
      command = JointCommand<S>{};
      mode_ = Mode::kVented;
    }
    return status;
  }

 private:
  Status checked_step(const JointMeasurement<S>& now, const JointReference<S>& wanted, const S& dt,
                      JointCommand<S>& command) noexcept {
    if (!finite(now.angle, now.velocity, wanted.angle, wanted.torque, wanted.load, dt))
      return Status::kNotFinite;
    if (settings_.structure == Structure::kCascade && !finite(now.torque)) return Status::kNotFinite;
    if (!(dt > S(0.0))) return Status::kOutOfRange;
    if (mode_ == Mode::kVented) return Status::kOk;
    return run(now, wanted, dt, command);
  }

  Status run(const JointMeasurement<S>& now, const JointReference<S>& wanted, const S& dt,
             JointCommand<S>& command) noexcept {
    const JointLimits<S>& limits = settings_.limits;
    std::uint8_t limited = 0;
    if (fresh_) enter(now);
    const S feedback = settings_.structure == Structure::kCascade ? now.torque : model_torque(now, delta_);
    const S angle = now.angle + correction_;
    const S reference = next_reference(wanted.angle, dt, limited);
    if (fresh_) transfer(angle, reference, wanted.load);

    S delta{};
    if (settings_.structure == Structure::kPid) {
      if (const Status status = position_.step(reference, angle, dt, delta); !ok(status)) return status;
      if (position_.limited()) limited |= kDeltaPressureLimited;
      total_ = feedback;  // where a torque loop would take over
    } else {
      if (mode_ == Mode::kTorque) target_ = wanted.torque;
      const S asked = models::clamp<S>(target_ + wanted.load, -limits.torque, limits.torque);
      if (asked != target_ + wanted.load) limited |= kTorqueLimited;
      if (fresh_) torque_.transfer(delta_, asked, feedback);
      if (const Status status = torque_.step(asked, feedback, dt, delta); !ok(status)) return status;
      if (torque_.limited()) limited |= kDeltaPressureLimited;
      command.wanted_torque = total_ = asked;
      if (const Status status = outer(now, angle, reference, wanted.load, dt); !ok(status)) return status;
    }
    fresh_ = false;

    Conditioned<S> gate;
    if (const Status status = condition(limits, settings_.mean_pressure, delta_, delta, dt, gate);
        !ok(status))
      return status;
    delta_ = gate.delta_pressure;
    if (settings_.model_pressure == ModelPressure::kPredicted)
      predicted_ = models::valve_step(settings_.valve, predicted_, delta_, dt);
    if (settings_.predict_dead_time) {
      if (const Status status = predictor_.step(delta_, -wanted.load, dt, correction_); !ok(status))
        return status;
    }
    command.pressure = gate.pressure;
    command.delta_pressure = delta_;
    command.torque = feedback;
    command.limited = static_cast<std::uint8_t>(limited | gate.limited);
    command.vented = false;
    return Status::kOk;
  }

  /// The first tick after being vented, or of another mode or other settings.
  void enter(const JointMeasurement<S>& now) noexcept {
    if (from_rest_) {
      delta_ = predicted_ = S(0.0);
      position_.reset();
      torque_.reset();
    }
    if (from_rest_ || predictor_starts_) {
      predictor_.reset(now.angle, delta_);
      correction_ = S(0.0);
      predictor_starts_ = false;
    }
    if (new_mode_) {
      hold_ = models::clamp<S>(now.angle, settings_.limits.angle_low, settings_.limits.angle_high);
      reference_ = hold_;
      new_mode_ = false;
    }
    ticks_ = 0;
    outer_time_ = S(0.0);
  }

  void transfer(const S& angle, const S& reference, const S& load) noexcept {
    // From rest the position loop starts with nothing of its own, so that the load is carried from the first tick on.
    if (from_rest_) total_ = load;
    from_rest_ = false;
    if (settings_.structure == Structure::kPid) {
      position_.transfer(delta_, reference, angle);
    } else if (mode_ != Mode::kTorque) {
      position_.transfer(total_ - load, reference, angle);
      target_ = position_.output_now(reference, angle);
    }
  }

  Status outer(const JointMeasurement<S>& now, const S& angle, const S& reference, const S& load,
               const S& dt) noexcept {
    outer_time_ += dt;
    const bool due = ticks_ == 0;
    ticks_ = ticks_ + 1 >= settings_.outer_every ? 0 : ticks_ + 1;
    if (!due) return Status::kOk;
    const S interval = outer_time_;
    outer_time_ = S(0.0);
    if (mode_ == Mode::kTorque) return Status::kOk;
    const JointLimits<S>& l = settings_.limits;
    position_.set_limits(
        models::clamp<S>(model_torque_at(now, -l.delta_pressure), -l.torque, l.torque) - load,
        models::clamp<S>(model_torque_at(now, l.delta_pressure), -l.torque, l.torque) - load);
    return position_.step(reference, angle, interval, target_);
  }

  [[nodiscard]] S next_reference(const S& wanted, const S& dt, std::uint8_t& limited) noexcept {
    if (mode_ != Mode::kPosition) return hold_;
    if (fresh_) return reference_;  // the joint's own angle, or where the reference was
    const JointLimits<S>& l = settings_.limits;
    const S within = models::clamp<S>(wanted, l.angle_low, l.angle_high);
    if (within != wanted) limited |= kAngleLimited;
    reference_ = limit_change<S>(reference_, within, l.speed * dt);
    if (reference_ != within) limited |= kSpeedLimited;
    return reference_;
  }

  [[nodiscard]] S model_torque(const JointMeasurement<S>& now, const S& commanded) const noexcept {
    return model_torque_at(now,
                           settings_.model_pressure == ModelPressure::kPredicted ? predicted_ : commanded);
  }
  [[nodiscard]] S model_torque_at(const JointMeasurement<S>& now, const S& delta_pressure) const noexcept {
    return models::joint_torque(settings_.muscle, settings_.wheel_radius, now.angle, delta_pressure,
                                now.velocity);
  }

  JointSettings<S> settings_;
  Pid<S> position_, torque_;
  JointPredictor<S> predictor_;
  Mode mode_ = Mode::kVented;
  bool configured_ = false, fresh_ = false, new_mode_ = false, from_rest_ = true, predictor_starts_ = true;
  S delta_{};      ///< Pa, Δp of the last command
  S predicted_{};  ///< Pa, the same behind the valve's lag
  S target_{};     ///< N m, of the outer loop
  S total_{};      ///< N m, last asked of the inner loop
  S reference_{}, hold_{}, correction_{}, outer_time_{};
  int ticks_ = 0;
};

}  // namespace isac::control
