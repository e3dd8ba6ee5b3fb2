/// @file
/// Relay feedback (Åström and Hägglund 1984): the joint swings by itself, near its critical frequency, within ± amplitude.
///
///   u = bias + amplitude · s;  s = +1 once φ < φ_0 − ε, −1 once φ > φ_0 + ε, else as before         ε: against noise
///   bias += amplitude/2 · (t_up − t_down)/(t_up + t_down) after every cycle, so that a load or another φ_0 does not tilt the cycle
///   describing function     K_DF = 4 amplitude/(π √(a² − ε²)), T_DF = the cycle's period       a: amplitude of φ
/// K_DF supposes that φ is a sine and that the cycle lies at phase −π. With the joint's third-order lag it comes out up to 30 % too small
/// (docs/derivations/tuning.md); K_crit and T_crit are therefore taken from a plant fitted to the cycle (plant_fit.hpp).
///
/// Units: SI. Real time, threads, errors: as experiment.hpp; fails when the joint does not swing, or not evenly.
/// Example: `RelayExperiment relay({.reach = 3e4, …}, {.amplitude = 2e4});`
#pragma once

#include <limits>

#include "isac/tune/experiment.hpp"

namespace isac::tune {

struct RelaySettings {
  double amplitude = 0;  ///< Pa
  double hysteresis =
      std::numeric_limits<double>::quiet_NaN();  ///< rad, ε; NaN: four times the scatter at rest
  double least_hysteresis = 0;                   ///< rad, e.g. two steps of the encoder
  double offset = 0;                             ///< rad, φ_0 less the rest angle
  int cycles = 8;                                ///< that must be even before it ends
  int longest_cycles = 30;                       ///< then it fails
  bool compensate_bias = true;
};

struct DescribingFunction {
  double gain = std::numeric_limits<double>::quiet_NaN();       ///< Pa/rad
  double period = std::numeric_limits<double>::quiet_NaN();     ///< s
  double amplitude = std::numeric_limits<double>::quiet_NaN();  ///< rad
};

class RelayExperiment final : public Experiment {
 public:
  RelayExperiment(const ExperimentSettings& settings, const RelaySettings& relay);
  [[nodiscard]] int cycles() const noexcept { return cycles_; }
  [[nodiscard]] double hysteresis() const noexcept { return hysteresis_; }
  [[nodiscard]] double bias() const noexcept { return bias_; }
  /// Of the last even cycles.
  [[nodiscard]] DescribingFunction describing_function() const noexcept;

 private:
  double excite(double time, double angle) noexcept override;
  void end_cycle(double time) noexcept;

  RelaySettings relay_;
  double hysteresis_ = 0, bias_ = 0;
  bool started_ = false, up_ = true;
  double went_up_ = 0, went_down_ = 0, low_ = 0, high_ = 0;
  double period_ = 0, swing_ = 0, last_period_ = 0;  ///< smoothed over even cycles
  int cycles_ = 0, even_ = 0;
};

}  // namespace isac::tune
