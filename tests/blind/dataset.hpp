/// @file
/// One dataset: rig and day drawn from a seed, effects hidden in it at the strength asked for, noise, files and label.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "baseline.hpp"
#include "catalogue.hpp"
#include "noise.hpp"

namespace blind {

struct Request {
  std::uint64_t seed = 1;
  std::vector<std::string> ids = {};  ///< empty: nothing is hidden
  double ratio = 0.75;                ///< gap left by the refitted base model over the noise floor
  std::string noise = "white";
  std::filesystem::path recordings = {};  ///< of `real` noise
  std::string day = "drawn";              ///< or "protocol": another joint, and a day by a written protocol
};

/// One hidden effect at its strength.
struct Hiding {
  const Effect* effect = nullptr;
  double amplitude = 0;
  Shape shape;
  double ratio = 0;    ///< reached, by this effect alone
  std::string signal;  ///< where it shows most: torque, pressure or balance
};

struct Dataset {
  Request request;
  Rig rig;
  std::vector<RunPlan> runs;
  Noise noise;
  std::vector<Hiding> hidings;
  std::string not_testable;  ///< the id that cannot reach the ratio with a plausible size; empty otherwise
  Hidden hidden;             ///< all hidings applied
  std::vector<Signals> clean;
  Baseline base;  ///< fitted to `clean`
  Gap gap, heldout_gap;
};

struct Strength {
  double ratio = 0;
  std::string signal;
};

/// Gap over floor of the signal where that is largest, over the fitted runs.
Strength strength_of(const Gap& gap, const Noise& noise, const Rig& rig);

/// The largest ratio that the effect reaches on these runs, and its amplitude scaled to `ratio` within 3 %. `ratio` of the
/// result stays below when even the largest plausible amplitude does not reach it.
Hiding hide(const Effect& effect, const Shape& shape, const Dataset& dataset, double ratio);

/// Everything but the files. Throws std::invalid_argument for an unknown id, day or kind of noise.
Dataset make_dataset(const Request& request);

/// Residual noise of the base model on the held-out runs, were the truth known: torque, pressure, balance.
Gap heldout_noise(const Dataset& dataset, const std::vector<Signals>& noisy);
/// Mean square that the true model takes out of these very held-out recordings, mean((g + n)²) − mean(n²): g the gap of the base model, n
/// the output's own noise (forces in torque and balance, each pressure in itself). In a few minutes 2 g·n does not average out.
Gap heldout_closes(const Dataset& dataset, const std::vector<Signals>& noisy);

/// rig.toml, *.csv and heldout/*.csv into `folder` (made if needed); returns the noisy signals.
std::vector<Signals> write_dataset(const Dataset& dataset, const std::filesystem::path& folder);

}  // namespace blind
