/// @file
/// Feed-forward of identified effects: the torque that meets friction, imbalance and the like before the loop sees them.
///
///   T_ff = −Σ effect_torque(φ_d, φ̇_d, φ̈_d)                the effects of models/effects.hpp, on the *desired* motion
///   dissipative effects are weighted by w(|φ̇_d|): 0 up to the dead zone v_0, 1 from 2 v_0, straight between
///
/// On the desired motion, because −T_c sgn(φ̇) of a measured speed is positive feedback of noise. Below v_0 the sign of a
/// friction that still sticks is not known, so nothing is added; the straight part keeps the torque continuous.
/// Effects that have states (hysteresis), belong to the valve, a sensor or the rig, are a constant of the recording, or
/// are the model itself (stiffness, pressure) are refused; so are end stop and slack muscle, against which nobody pushes.
///
/// Units: SI; parameters in SI in the catalogue's order. Real time: at most kMaxTableEffects equations, no heap, noexcept.
/// Threads: torque() is const, safe from any. Errors: kOutOfRange (effect that feed-forward cannot serve, or list full),
/// kNotFinite (a parameter). Source: docs/effects.md. Example: `ff.add(find_effect("coulomb_friction"), p, 1)`.
#pragma once

#include <array>
#include <cstddef>

#include "isac/control/finite.hpp"
#include "isac/core/status.hpp"
#include "isac/models/effects.hpp"
#include "isac/models/parameter_table.hpp"
#include "isac/models/scalar.hpp"

namespace isac::control {

/// May this effect of the catalogue be fed forward?
[[nodiscard]] constexpr bool feed_forward_serves(int effect) noexcept {
  if (!models::Catalogue::holds(effect)) return false;
  for (const int never : {models::find_effect("stiffness"), models::find_effect("pressure"),
                          models::find_effect("end_stop"), models::find_effect("tension_loss")})
    if (effect == never) return false;
  const models::EffectInfo& info = models::Catalogue::kInfos[effect];
  const bool of_the_joint =
      info.where == models::Subsystem::kMuscle || info.where == models::Subsystem::kJoint;
  return info.torque_term && info.hook == models::Hook::kTorque && info.state_count == 0 && of_the_joint &&
         !info.added_to_output;
}

template <class S>
class FeedForward {
 public:
  /// `dead_zone`, rad/s: |desired speed| up to which friction is left alone.
  explicit constexpr FeedForward(const S& dead_zone = S(0.02)) noexcept : dead_zone_(dead_zone) {}

  [[nodiscard]] constexpr Status add(int effect, const S* parameters, int count) noexcept {
    if (!feed_forward_serves(effect) || size_ == kCapacity) return Status::kOutOfRange;
    if (count != models::Catalogue::kInfos[effect].parameter_count) return Status::kOutOfRange;
    Term term{.effect = effect};
    for (int i = 0; i < count; ++i) {
      if (!finite(parameters[i])) return Status::kNotFinite;
      term.parameters[static_cast<std::size_t>(i)] = parameters[i];
    }
    terms_[static_cast<std::size_t>(size_++)] = term;
    return Status::kOk;
  }

  [[nodiscard]] constexpr int size() const noexcept { return size_; }

  /// T_ff, N m, at the desired point of the motion (its pressures are those now commanded).
  [[nodiscard]] S torque(const models::JointPoint<S>& desired) const noexcept {
    const S weight = friction_weight(desired.velocity);
    S sum{};
    for (int i = 0; i < size_; ++i) {
      const Term& term = terms_[static_cast<std::size_t>(i)];
      const S share = models::effect_torque<S>(term.effect, term.parameters.data(), desired);
      sum -= models::Catalogue::kInfos[term.effect].dissipative ? S(weight * share) : share;
    }
    return sum;
  }

  [[nodiscard]] constexpr S friction_weight(const S& desired_velocity) const noexcept {
    const S speed = models::magnitude(desired_velocity);
    if (speed <= dead_zone_) return S(0.0);
    return speed < S(2.0) * dead_zone_ ? S(speed / dead_zone_ - S(1.0)) : S(1.0);
  }

 private:
  static constexpr int kCapacity = models::kMaxTableEffects;
  struct Term {
    int effect = -1;
    std::array<S, models::kMaxEffectParameters> parameters{};
  };
  S dead_zone_;
  std::array<Term, static_cast<std::size_t>(kCapacity)> terms_{};
  int size_ = 0;
};

}  // namespace isac::control
