/// @file
/// Synthetic steps of a valve unit with a known truth, for the tests of the step fit. Units: s, Pa.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/estimate/pcu_fit.hpp"

namespace isac::test {

struct StepScene {
  double gain = 1.0, lag_fill = 0.17, lag_vent = 0.17, dead_time = 0.0237;
  double sample_time = 0.002;
  double hold = 2.0;                          // s per level
  std::vector<double> commands = {0.5, 5.0};  // kg/cm2, one after the other
  double noise = 0.004;                       // kg/cm2, standard deviation
  double colour = 0.0;                        // of an AR(1) noise
  double quantum = 0.0;                       // kg/cm2
  double spike_share = 0.0, spike_size = 1.0;
  std::uint64_t seed = 1;
};

/// Exact response of the lag to the staircase (each level starts from where the pressure is), noise and quantum added.
inline estimate::PcuRun make_steps(const StepScene& scene) {
  estimate::PcuRun run;
  run.name = "synthetic p1";
  std::mt19937_64 engine(scene.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const auto rows = static_cast<std::size_t>(
      std::lround(scene.hold * static_cast<double>(scene.commands.size()) / scene.sample_time));
  double colour = normal(engine) * scene.noise;
  const double fresh = scene.noise * std::sqrt(1 - scene.colour * scene.colour);
  for (std::size_t i = 0; i < rows; ++i) {
    const double t = static_cast<double>(i) * scene.sample_time;
    const auto level = [&](double time) {
      const auto k = static_cast<std::size_t>(std::max(0.0, std::floor(time / scene.hold + 1e-9)));
      return std::min(k, scene.commands.size() - 1);
    };
    double p = scene.gain * scene.commands[0];
    const double delayed = t - scene.dead_time;
    for (std::size_t k = 1; k <= level(delayed); ++k) {
      const double begin = static_cast<double>(k) * scene.hold;
      const double end = std::min(delayed, begin + scene.hold);
      const double target = scene.gain * scene.commands[k];
      p = target + (p - target) * std::exp(-(end - begin) / (target > p ? scene.lag_fill : scene.lag_vent));
    }
    double y = p + colour;
    colour = scene.colour * colour + fresh * normal(engine);
    if (scene.spike_share > 0 && uniform(engine) < scene.spike_share)
      y += (uniform(engine) < 0.5 ? -1 : 1) * scene.spike_size;
    if (scene.quantum > 0) y = scene.quantum * std::floor(y / scene.quantum + 0.5);
    run.time.push_back(t);
    run.command.push_back(scene.commands[level(t)] * kPascalPerKgfCm2);
    run.pressure.push_back(y * kPascalPerKgfCm2);
  }
  return run;
}

}  // namespace isac::test
