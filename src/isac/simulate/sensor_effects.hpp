/// @file
/// Hidden effects of the sensors, applied to what the amplifiers give before it is converted.
///
/// Order: skew between the signals (time_skew: φ(t − d); d < 0 holds forces and pressures back instead, which differs by
/// the time's origin only), then the catalogue's readings in the order of the configuration, then spikes.
/// Effects with states of their own move by the classical Runge-Kutta method on steps of 0.1 ms, readings in between on
/// straight lines. Units: SI. Real time: no heap and no lock after construction, noexcept. Threads: one.
/// Errors: construction throws isac::Error (usage). Source: models/effect_hooks.hpp, docs/effects.md.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "isac/models/effect_types.hpp"
#include "isac/simulate/hidden_effects.hpp"
#include "isac/simulate/random.hpp"
#include "isac/simulate/rig_config.hpp"

namespace isac::simulate {

using Readings = models::Readings<double>;

class SensorEffects {
 public:
  explicit SensorEffects(const RigConfig& config);

  [[nodiscard]] bool any() const noexcept {
    return !effects_.empty() || skew_ != 0 || spike_share_ > 0 || added_force_ != 0;
  }
  /// Follows the undisturbed signals; call at every step of the rig.
  void track(double time, const Readings& readings, double velocity) noexcept;
  /// What the sensors say at the time last tracked; once per sample.
  [[nodiscard]] Readings apply(double time, Readings readings) noexcept;

 private:
  struct Stateful {
    CompiledEffect effect;
    std::array<double, models::kMaxEffectStates> state{};
  };
  struct Past {
    double time = 0;
    Readings readings;
    double velocity = 0;
  };
  static constexpr std::size_t kPasts = 4096;

  void integrate(Stateful& e, const Readings& from, const Readings& to, double duration) noexcept;
  [[nodiscard]] Readings at(double time) const noexcept;

  std::vector<Stateful> effects_;
  Random random_;
  double skew_ = 0, spike_share_ = 0, spike_height_ = 0;
  double added_force_ = 0;  ///< N on F2, and its negative on F1: a constant added to the recorded torque
  std::vector<Past> past_;  ///< ring, used only with a skew
  std::size_t newest_ = 0, pasts_ = 0;
  Readings last_;
  double last_time_ = 0;
  bool started_ = false;
};

}  // namespace isac::simulate
