// Bias and coverage of the 95 % intervals of a fitted muscle over 200 seeds: eight contractions, sixteen branches.
#include <gtest/gtest.h>

#include "muscle_scenes.hpp"

namespace isac::estimate {
namespace {

TEST(MuscleCoverage, of_the_bridgestone_constants) {
  constexpr int kSeeds = 200;
  const double truth[] = {30, 18};
  int covered[2] = {0, 0};
  double mean[2] = {0, 0}, spread[2] = {0, 0};
  for (int seed = 1; seed <= kSeeds; ++seed) {
    test::MuscleScene scene{.contractions = {0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.14}, .rows = 400};
    scene.seed = static_cast<unsigned>(seed);
    const MuscleFit fit = fit_muscle(test::make_muscle_runs(scene), {}, test::one_model("bridgestone"));
    for (int k = 0; k < 2; ++k) {
      const Estimated& e = fit.ranking.front().parameters[static_cast<std::size_t>(k)];
      covered[k] += e.ci_low <= truth[k] && truth[k] <= e.ci_high;
      mean[k] += (e.value - truth[k]) / kSeeds;
      spread[k] += std::pow(e.value - truth[k], 2) / kSeeds;
    }
  }
  for (int k = 0; k < 2; ++k) {
    const double share = covered[k] / static_cast<double>(kSeeds);
    std::printf("parameter %d, seeds 1 to %d: coverage %.1f %%, bias %.2g, spread %.2g\n", k, kSeeds,
                100 * share, mean[k], std::sqrt(spread[k]));
    // Sixteen groups make a sandwich lean a little; binomial noise of 200 draws is 1.5 %.
    EXPECT_GE(share, 0.90);
    EXPECT_LE(share, 0.99);
    EXPECT_LT(std::abs(mean[k]),
              4 * std::sqrt(spread[k] / kSeeds));  // mean of 200 within 4 of its standard errors
  }
}

}  // namespace
}  // namespace isac::estimate
