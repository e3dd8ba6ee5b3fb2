/// @file
/// Synthetic recordings of a muscle with a known truth, for the tests of the muscle fit. Units: SI.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "isac/estimate/muscle_fit.hpp"
#include "isac/models/muscle_empirical.hpp"

namespace isac::test {

struct MuscleScene {
  models::BridgestoneMuscle<double> muscle{.diameter = 0.01, .a = 30, .b = 18};
  std::vector<double> contractions = {0.0, 0.05, 0.10, 0.15};
  double noise = 1.0;       // N
  double hysteresis = 0.0;  // N, exhausting above filling
  double zero = 0.0;        // N
  double floor = -1e9;      // N
  int rows = 800;
  unsigned seed = 1;
};

/// Pressure up to 600 kPa and down again at fixed contractions.
inline std::vector<estimate::MuscleRun> make_muscle_runs(const MuscleScene& scene) {
  std::mt19937_64 engine(scene.seed);
  std::normal_distribution<double> normal;
  std::vector<estimate::MuscleRun> runs;
  for (double contraction : scene.contractions) {
    estimate::MuscleRun run;
    run.name = "contraction " + std::to_string(contraction);
    run.rest_length = 0.2;
    run.force_zero = scene.zero;
    for (int i = 0; i < scene.rows; ++i) {
      const double x = 2.0 * i / scene.rows;
      const bool filling = x < 1;
      const double p = 6e5 * (filling ? x : 2 - x);
      const double f = std::max(0.0, models::force(scene.muscle, p, contraction)) +
                       (filling ? -0.5 : 0.5) * scene.hysteresis;
      run.time.push_back(0.01 * i);
      run.pressure.push_back(p);
      run.contraction.push_back(contraction);
      run.filling.push_back(filling ? 1 : 0);
      run.force.push_back(std::max(scene.floor, scene.zero + f + scene.noise * normal(engine)));
    }
    runs.push_back(run);
  }
  return runs;
}

inline estimate::MuscleFitOptions one_model(const char* id) {
  estimate::MuscleFitOptions options;
  options.models = {id};
  return options;
}

}  // namespace isac::test
