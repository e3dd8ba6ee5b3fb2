/// @file
/// Ziegler and Nichols's own experiment without its danger: the P gain is raised level by level, and the growth rate of the
/// swing, still negative, is regressed to zero before the joint ever swings by itself.
///
///   u = clamp(K (φ_0 + r − φ), ± reach),  r = ± kick, changed at the start of every level
///   a level ends when its swing has died into the noise, after `swings` half swings, or after `hold`
///   growth per period   g = ln|x_(n+2)/x_n| of half swings x_n about their mean; next K halfway to the root of g(K)
///   done when g > −0.35, or when the swing does not decay; each level is kept with K, g and its period
/// K_crit and T_crit: the plant fitted to the whole record (plant_fit.hpp); the regression of g to zero is the second opinion.
///
/// Units: SI. Real time, threads, errors: as experiment.hpp. Example: `GainRamp ramp({.reach = 3e4, …}, {.first_gain = 1e4, .kick = 0.02});`
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>

#include "isac/tune/experiment.hpp"
#include "isac/tune/loop.hpp"

namespace isac::tune {

struct GainRampSettings {
  double first_gain = 0;  ///< Pa/rad
  double factor = 1.5;    ///< from level to level while the swing cannot be measured
  double kick = 0.02;     ///< rad
  double hold = 3.0;      ///< s, of a level at most
  int swings = 10;        ///< half swings measured per level
};

struct RampLevel {
  double gain = 0;  ///< Pa/rad
  double growth =
      std::numeric_limits<double>::quiet_NaN();  ///< per period; NaN: too well damped to be measured
  double period = std::numeric_limits<double>::quiet_NaN();  ///< s
};

class GainRamp final : public Experiment {
 public:
  static constexpr int kMostLevels = 24;
  GainRamp(const ExperimentSettings& settings, const GainRampSettings& ramp);
  [[nodiscard]] int levels() const noexcept { return count_; }
  [[nodiscard]] const RampLevel& level(int i) const noexcept { return levels_[static_cast<std::size_t>(i)]; }
  /// Where the growth rate of the last levels crosses zero; nothing with fewer than two of them.
  [[nodiscard]] std::optional<Ultimate> regressed() const noexcept;

 private:
  double excite(double time, double angle) noexcept override;
  void begin_level(double time, double gain) noexcept;
  void end_level() noexcept;
  void watch(double time, double x) noexcept;
  [[nodiscard]] double threshold() const noexcept;

  GainRampSettings ramp_;
  std::array<RampLevel, kMostLevels> levels_{};
  int count_ = 0;
  double gain_ = 0, reference_ = 0, began_ = 0;
  bool started_ = false;
  // Turning points of φ within the level.
  static constexpr int kMostTurns = 16;
  std::array<double, kMostTurns> turn_time_{}, turn_{};
  int turns_ = 0;
  double extreme_ = 0, extreme_time_ = 0, direction_ = 1;
};

/// Why K_crit of the fitted plant is not believed: the levels' growth says another; empty: both agree to a quarter.
[[nodiscard]] std::string second_opinion(const GainRamp& ramp, const Ultimate& fitted);

}  // namespace isac::tune
