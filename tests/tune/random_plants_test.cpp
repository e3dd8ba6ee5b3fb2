// Relay, gain ramp and steps on 200 random plants each whose ultimate gain and period are known in closed form.
#include "random_plants.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "isac/core/units.hpp"
#include "isac/tune/gain_ramp.hpp"
#include "isac/tune/plant_fit.hpp"
#include "isac/tune/relay.hpp"
#include "isac/tune/step_series.hpp"

namespace isac::tune {
namespace {

using test::KnownPlant;
constexpr double kInterval = 0.001, kKg = kPascalPerKgfCm2;
constexpr int kPlants = 200;

struct Score {
  int within = 0, wrong = 0, refused = 0;
  double worst = 0;
  int covered = 0, used = 0;
  double describing_low = 0, describing_high = 0;
};

/// Draws the plant, lets `run` excite it, compares.
template <class Run>
Score score_of(std::uint64_t seed, Run run) {
  Score score;
  for (int i = 0; i < kPlants; ++i) {
    simulate::Random random(seed + static_cast<std::uint64_t>(i), 1);
    KnownPlant plant = test::random_plant(random, i % 5 < 3 ? 0 : i % 5 - 2);
    const double w = plant.critical(), gain = 1 / plant.size(w), period = 2 * M_PI / w;
    const PlantFit fit = run(plant, gain, period, random);
    if (!fit.refusal.empty()) {
      ++score.refused;
      if (std::getenv("ISAC_TUNE_VERBOSE")) std::cout << i << " refused: " << fit.refusal << "\n";
      continue;
    }
    const Estimated &k = value_of(fit, "K_crit"), &t = value_of(fit, "T_crit");
    const double off = std::max(std::abs(k.value * kKg / gain - 1), std::abs(t.value / period - 1));
    ++(off <= 0.05 ? score.within : score.wrong);
    score.worst = std::max(score.worst, off);
    if (i % 5 < 3) {
      ++score.used;
      score.covered += k.ci_low * kKg <= gain && gain <= k.ci_high * kKg ? 1 : 0;
    }
    if (std::getenv("ISAC_TUNE_VERBOSE"))
      std::cout << i << " K " << k.value * kKg / gain << " +- " << k.std_error / k.value << " T "
                << t.value / period << " misfit " << fit.misfit << "\n";
  }
  std::cout << "within 5 %: " << score.within << ", wrong: " << score.wrong << ", refused: " << score.refused
            << ", worst " << score.worst
            << ", 95 % intervals of K_crit that hold it (plants of the fitted order): " << score.covered
            << "/" << score.used << "\n";
  return score;
}

PlantFit failed(const Experiment& experiment) {
  PlantFit fit;
  fit.refusal = experiment.failure();
  EXPECT_FALSE(fit.refusal.empty());
  return fit;
}

TEST(RandomPlants, relay_finds_gain_and_period_within_five_percent_or_refuses) {
  double low = 1, high = 1;
  const Score score = score_of(1000, [&](KnownPlant& plant, double gain, double, simulate::Random& random) {
    const double amplitude = 2e4, swing = 4 * amplitude / (M_PI * gain);
    plant.noise = swing / std::exp(random.uniform(std::log(15), std::log(100)));
    plant.step = plant.noise * random.uniform(0, 2);
    plant.load = amplitude * random.uniform(-0.4, 0.4);
    plant.saturation = amplitude * random.uniform(1.2, 2);
    RelayExperiment relay({.reach = plant.saturation, .settle = 0.5, .longest = 60, .interval = kInterval},
                          {.amplitude = amplitude, .least_hysteresis = 2 * plant.step});
    test::play(relay, plant, kInterval, random);
    if (relay.state() != Experiment::State::kDone) return failed(relay);
    const double describing = relay.describing_function().gain / gain;
    low = std::min(low, describing);
    high = std::max(high, describing);
    return fit_plant(relay.excited(),
                     {.time_scale = relay.describing_function().period, .noise = relay.noise()});
  });
  std::cout << "describing function over K_crit: " << low << " to " << high << "\n";
  EXPECT_GE(score.within, 0.95 * kPlants);
  EXPECT_EQ(score.wrong, 0);
}

TEST(RandomPlants, gain_ramp_finds_gain_and_period_within_five_percent_or_refuses) {
  const Score score =
      score_of(2000, [&](KnownPlant& plant, double gain, double period, simulate::Random& random) {
        const double kick = 0.03;
        plant.noise = kick / std::exp(random.uniform(std::log(30), std::log(200)));
        plant.step = plant.noise * random.uniform(0, 2);
        plant.load = 0.2 * kick * gain * random.uniform(-1, 1);
        plant.saturation = gain * kick * random.uniform(1.5, 4);
        GainRamp ramp({.reach = plant.saturation, .settle = 0.5, .longest = 120, .interval = kInterval},
                      {.first_gain = gain * random.uniform(0.05, 0.3), .kick = kick, .hold = 12 * period});
        test::play(ramp, plant, kInterval, random);
        if (ramp.state() != Experiment::State::kDone) return failed(ramp);
        PlantFit fit =
            fit_plant(ramp.excited(), {.time_scale = ramp.regressed()->period, .noise = ramp.noise()});
        if (fit.refusal.empty()) {
          fit.refusal =
              second_opinion(ramp, {value_of(fit, "K_crit").value * kKg, value_of(fit, "T_crit").value});
        }
        return fit;
      });
  // A P loop that still damps well says little about plants of a higher order than is fitted: one answer in twenty may be wrong.
  EXPECT_LE(score.wrong, 0.05 * (score.within + score.wrong));
  EXPECT_LE(score.worst, 0.15);
  EXPECT_GE(score.within, 0.8 * kPlants);
}

TEST(RandomPlants, steps_find_gain_and_period_within_five_percent_or_refuse) {
  const Score score = score_of(3000, [&](KnownPlant& plant, double, double period, simulate::Random& random) {
    const double height = 3e4;
    plant.noise = height * plant.gain / std::exp(random.uniform(std::log(100), std::log(1000)));
    plant.step = plant.noise * random.uniform(0, 2);
    plant.saturation = height * random.uniform(1.2, 2);
    StepSeries steps({.reach = plant.saturation, .settle = 0.5, .longest = 200, .interval = kInterval},
                     {.height = height, .hold = 6 * period});
    test::play(steps, plant, kInterval, random);
    if (steps.state() != Experiment::State::kDone) return failed(steps);
    return fit_plant(steps.excited(), {.time_scale = period, .noise = steps.noise()});
  });
  EXPECT_GE(score.within, 0.95 * kPlants);
  EXPECT_LE(score.wrong, 0.02 * kPlants);  // plants of a higher order than is fitted, see docs/tuning.md
  EXPECT_LE(score.worst, 0.10);
}

}  // namespace
}  // namespace isac::tune
