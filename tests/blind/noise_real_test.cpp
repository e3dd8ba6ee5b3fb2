#include <gtest/gtest.h>

#include <cstdlib>

#include "noise.hpp"
#include "oracle.hpp"

namespace blind {
namespace {

double covariance(const std::vector<double>& x, std::size_t lag) {
  double sum = 0.0;
  for (std::size_t k = lag; k < x.size(); ++k) sum += x[k] * x[k - lag];
  return sum / static_cast<double>(x.size() - lag);
}

TEST(NoiseReal, keeps_the_memory_of_the_recording_it_is_taken_from) {
  const char* folder = std::getenv("ISAC_REAL_DATA");
  if (folder == nullptr) GTEST_SKIP() << "set ISAC_REAL_DATA to the folder of measured recordings";
  Random random(4);
  const Noise noise = draw_noise("real", Rig{}, random, folder);
  EXPECT_NEAR(covariance(noise.recorded_force, 0), 1.0, 0.05);  // outliers are held at six
  const std::vector<double> drawn = block_bootstrap(noise.recorded_force, 200000, 250, random);
  // Blocks of 250 rows break one pair of neighbours in 250.
  EXPECT_NEAR(covariance(drawn, 1) / covariance(drawn, 0),
              covariance(noise.recorded_force, 1) / covariance(noise.recorded_force, 0), 0.06);
}

TEST(NoiseReal, is_weighed_by_the_oracle_with_the_memory_it_has) {
  const char* folder = std::getenv("ISAC_REAL_DATA");
  if (folder == nullptr) GTEST_SKIP() << "set ISAC_REAL_DATA to the folder of measured recordings";
  for (const std::uint64_t seed : {17u, 18u, 19u}) {
    const Dataset d = make_dataset({.seed = seed, .noise = "real", .recordings = folder});
    Random random(3);
    std::vector<Signals> noisy;
    for (const Signals& clean : d.clean) noisy.push_back(add_noise(clean, d.noise, d.rig, random));
    // White and one memory are a rough picture of a recorded noise: a tenth of sigma, a fifth of its square.
    EXPECT_NEAR(whitened_noise(d, noisy), 1.0, 0.2) << seed;
  }
}

}  // namespace
}  // namespace blind
