/// @file
/// Steps of Δp about the centre: up, back, down, back, each held until the joint has come to rest; then short ones.
///
///   Δp − centre = h, 0, −h, 0 for `hold` each                                                   seed 4.2, figure 4.4
///   then ± h three times for hold/8 and three times for hold/12 each half: without them a step says little about the
///   frequencies at which a loop swings (with `hold` of six periods T_crit the last swing at T_crit itself)
/// Units: SI. Real time, threads, errors: as experiment.hpp. Example: `StepSeries steps({.reach = 5e4, …}, {.height = 5e4});`
#pragma once

#include "isac/tune/experiment.hpp"

namespace isac::tune {

struct StepSettings {
  double height = 0;  ///< Pa
  double hold = 1.5;  ///< s, of each step: nine lags of the seed's valve unit
  int rounds = 3;     ///< of four steps and the short ones
};

class StepSeries final : public Experiment {
 public:
  StepSeries(const ExperimentSettings& settings, const StepSettings& steps)
      : Experiment(settings), steps_(steps) {}

 private:
  double excite(double time, double angle) noexcept override {
    static_cast<void>(angle);
    const int round = static_cast<int>(time / (kRound * steps_.hold));
    if (round >= steps_.rounds) finish();
    const double t = time / steps_.hold - kRound * round;
    if (t < 4) {
      constexpr double kShape[4] = {1, 0, -1, 0};
      return kShape[static_cast<int>(t)] * steps_.height;
    }
    const double half = t < 4.75 ? (t - 4) * 8 : (t - 4.75) * 12;
    return static_cast<int>(half) % 2 == 0 ? steps_.height : -steps_.height;
  }
  static constexpr double kRound = 4 + 6 / 8.0 + 6 / 12.0;  ///< holds
  StepSettings steps_;
};

}  // namespace isac::tune
