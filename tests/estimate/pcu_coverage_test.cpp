// Bias and coverage of the 95 % intervals of the step fit: 600 seeds each, under noise as sensors have it.
#include <gtest/gtest.h>

#include <array>

#include "pcu_scenes.hpp"

namespace isac::estimate {
namespace {

constexpr int kSeeds = 600;  // with 200, a true coverage of 94.5 % falls below 92 % by chance once in fifteen

struct Tally {
  int covered = 0;
  double bias = 0, spread = 0, error = 0;
};

void check(const char* scene_name, test::StepScene scene, double lag_truth) {
  const char* names[] = {"K_C", "T_C", "dead_time"};
  const double truth[] = {scene.gain, lag_truth, scene.dead_time};
  Tally tally[3];
  for (int seed = 0; seed < kSeeds; ++seed) {
    scene.seed = 1000 + static_cast<std::uint64_t>(seed);
    const PcuFit fit = fit_pcu(std::array{test::make_steps(scene)});
    for (int k = 0; k < 3; ++k) {
      const Estimated& e = *fit.find(names[k]);
      tally[k].covered += e.ci_low <= truth[k] && truth[k] <= e.ci_high;
      tally[k].bias += (e.value - truth[k]) / kSeeds;
      tally[k].spread += std::pow(e.value - truth[k], 2) / kSeeds;
      tally[k].error += e.std_error / kSeeds;
    }
  }
  for (int k = 0; k < 3; ++k) {
    const double share = tally[k].covered / static_cast<double>(kSeeds);
    std::printf(
        "%s, %s, seeds 1000 to %d: coverage %.1f %%, bias %.2g, spread %.2g, mean standard error %.2g\n",
        scene_name, names[k], 999 + kSeeds, 100 * share, tally[k].bias, std::sqrt(tally[k].spread),
        tally[k].error);
    EXPECT_GE(share, 0.92) << scene_name << " " << names[k];  // what the toolkit promises
    EXPECT_LE(share, 0.98) << scene_name << " " << names[k];
    // The mean of 600 values lies within 4 of its standard errors; a bias of a sixth of the spread would show.
    EXPECT_LT(std::abs(tally[k].bias), 4 * std::sqrt(tally[k].spread / kSeeds))
        << scene_name << " " << names[k];
  }
}

TEST(PcuCoverage, white_noise) {
  check("white", {.sample_time = 0.004}, 0.17);
}
TEST(PcuCoverage, coloured_noise) {
  check("coloured", {.sample_time = 0.004, .colour = 0.8}, 0.17);
}
TEST(PcuCoverage, coloured_noise_and_twelve_bits) {
  check("coloured, 12 bit", {.sample_time = 0.004, .noise = 0.002, .colour = 0.6, .quantum = 5.0 / 4096},
        0.17);
}
TEST(PcuCoverage, four_steps_with_spikes) {
  check("four steps, 1 % spikes",
        {.sample_time = 0.004,
         .commands = {0.5, 4.5, 1, 5, 0.5},
         .colour = 0.5,
         .quantum = 5.0 / 4096,
         .spike_share = 0.01},
        0.17);
}
TEST(PcuCoverage, coarse_sampling) {
  check("20 ms rows", {.dead_time = 0.05, .sample_time = 0.02, .hold = 3.0, .noise = 0.01}, 0.17);
}

}  // namespace
}  // namespace isac::estimate
