// Relay, gain ramp and steps on 200 random plants each whose ultimate gain and period are known in closed form.
#include "random_plants.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
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

/// What is asked for of every plant; its truth comes from random_plants.hpp.
constexpr std::array<const char*, 4> kAsked = {"K_crit", "T_crit", "T_L", "T_A"};

struct Score {
  int within = 0, wrong = 0, refused = 0;
  double worst = 0;
  std::array<int, kAsked.size()> covered{};
  int with_lead = 0;  // answers of the kind that is furthest from the fitted form
  std::array<int, kAsked.size()> covered_with_lead{};

  [[nodiscard]] int answers() const { return within + wrong; }
};

/// Draws the plant, lets `run` excite it, compares.
template <class Run>
Score score_of(std::uint64_t seed, Run run) {
  Score score;
  for (int i = 0; i < kPlants; ++i) {
    simulate::Random random(seed + static_cast<std::uint64_t>(i), 1);
    KnownPlant plant = test::random_plant(random, i % 5 < 3 ? 0 : i % 5 - 2);
    const double w = plant.critical(), gain = 1 / plant.size(w), period = 2 * M_PI / w;
    const test::KnownTangent tangent = test::tangent_of(plant);
    const PlantFit fit = run(plant, gain, period, random);
    if (!fit.refusal.empty()) {
      ++score.refused;
      continue;
    }
    const std::array<double, kAsked.size()> truth = {gain / kKg, period, tangent.latency, tangent.adjustment};
    double off = 0;
    for (std::size_t k = 0; k < kAsked.size(); ++k) {
      const Estimated& e = value_of(fit, kAsked[k]);
      const int holds = e.ci_low <= truth[k] && truth[k] <= e.ci_high ? 1 : 0;
      score.covered[k] += holds;
      score.covered_with_lead[k] += plant.lead > 0 ? holds : 0;
      if (k < 2) off = std::max(off, std::abs(e.value / truth[k] - 1));
    }
    ++(off <= 0.05 ? score.within : score.wrong);
    score.with_lead += plant.lead > 0 ? 1 : 0;
    score.worst = std::max(score.worst, off);
  }
  std::cout << "within 5 %: " << score.within << ", wrong: " << score.wrong << ", refused: " << score.refused
            << ", worst " << score.worst << "; 95 % intervals that hold the truth:";
  for (std::size_t k = 0; k < kAsked.size(); ++k)
    std::cout << " " << kAsked[k] << " " << score.covered[k] << "/" << score.answers() << " (with a lead "
              << score.covered_with_lead[k] << "/" << score.with_lead << ")";
  std::cout << "\n";
  return score;
}

/// Of 200 intervals that hold with 95 %, fewer than 92 % do once in 40 times; the seeds are fixed.
void expect_honest_intervals(const Score& score) {
  for (std::size_t k = 0; k < kAsked.size(); ++k)
    EXPECT_GE(score.covered[k], 0.92 * score.answers()) << kAsked[k];
}

PlantFit failed(const Experiment& experiment) {
  PlantFit fit;
  fit.refusal = experiment.failure();
  EXPECT_FALSE(fit.refusal.empty());
  return fit;
}

/// What is played must be what the truth is worked out from: half a part of a tick is five standard errors of T_L on a quiet joint.
TEST(RandomPlants, move_as_their_transfer_functions_say) {
  for (int i = 0; i < 30; ++i) {
    simulate::Random random(4000 + static_cast<std::uint64_t>(i), 1);
    const KnownPlant plant = test::random_plant(random, i % 3);
    const double w = plant.critical(), part = kInterval / test::kParts;
    test::PlantMotion motion(plant, part);
    const auto period = static_cast<int>(std::lround(2 * M_PI / (w * part)));
    const double played = 2 * M_PI / (period * part);  // rad/s, a whole number of parts to a period
    std::complex<double> harmonic = 0;
    constexpr int kSettle = 60;
    for (int k = 0; k < (kSettle + 1) * period; ++k) {
      // Held over a part, a sine comes half a part late; so it is taken from the part's middle.
      if (k >= kSettle * period) harmonic += motion.angle() * std::polar(2.0 / period, -played * k * part);
      motion.advance(std::cos(played * (k + 0.5) * part));
    }
    const double late = std::remainder(plant.phase(played) - std::arg(harmonic), 2 * M_PI) / played;
    EXPECT_NEAR(late, 0, 2e-6) << "s, plant " << i;
    EXPECT_NEAR(std::abs(harmonic) / plant.size(played), 1, 1e-4) << "plant " << i;
  }
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
  expect_honest_intervals(score);
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
  EXPECT_EQ(score.wrong, 0);
  EXPECT_GE(score.within, 0.8 * kPlants);  // the rest is refused: the growth of the swings says otherwise
  expect_honest_intervals(score);
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
  EXPECT_EQ(score.wrong, 0);
  EXPECT_GE(score.within, 0.95 * kPlants);  // the rest is refused: not known well enough
  expect_honest_intervals(score);
}

}  // namespace
}  // namespace isac::tune
