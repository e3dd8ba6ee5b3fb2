/// @file
/// Steps of Δp about the centre: up, back, down, back, as often as asked; each held until the joint has come to rest.
///
///   Δp − centre = h, 0, −h, 0, h, …                                                          seed 4.2, figure 4.4
/// Units: SI. Real time, threads, errors: as experiment.hpp. Example: `StepSeries steps({.reach = 5e4, …}, {.height = 5e4});`
#pragma once

#include "isac/tune/experiment.hpp"

namespace isac::tune {

struct StepSettings {
  double height = 0;  ///< Pa
  double hold = 1.5;  ///< s, of each step: nine lags of the seed's valve unit
  int rounds = 2;     ///< of four steps
};

class StepSeries final : public Experiment {
 public:
  StepSeries(const ExperimentSettings& settings, const StepSettings& steps)
      : Experiment(settings), steps_(steps) {}

 private:
  double excite(double time, double angle) noexcept override {
    static_cast<void>(angle);
    const int number = static_cast<int>(time / steps_.hold);
    if (number >= 4 * steps_.rounds) finish();
    constexpr double kShape[4] = {1, 0, -1, 0};
    return kShape[number % 4] * steps_.height;
  }
  StepSettings steps_;
};

}  // namespace isac::tune
