// Intervals of the output-error fit over 200 seeds.
#include <gtest/gtest.h>

#include <cmath>

#include "isac/estimate/motion_fit.hpp"
#include "motion_data.hpp"

namespace isac::estimate {
namespace {

TEST(MotionFitCoverage, intervals_cover_the_truth_under_coloured_noise) {
  const Truth truth;
  int covered[kMotionParameters] = {}, draws = 0;
  double sum[kMotionParameters] = {};
  for (unsigned seed = 1000; seed < 1200; ++seed) {
    const MotionRun run = make_run(truth, seed, 10, 400, 1e-3, 0.8);
    MotionOptions options = options_for(truth);
    options.start = truth.p;  // the search is tested above; here the intervals are
    const MotionFit fit = fit_motion({&run, 1}, options);
    if (!fit.converged) continue;
    ++draws;
    for (int j = 1; j < kMotionParameters; ++j) {
      const double reported = truth.p[static_cast<std::size_t>(j)] * (j == kB ? kKgf : 1.0);
      const Estimated& parameter = fit.parameters[static_cast<std::size_t>(j)];
      covered[j] += parameter.ci_low <= reported && reported <= parameter.ci_high;
      sum[j] += (parameter.value - reported) / parameter.std_error;
    }
  }
  EXPECT_GE(draws, 198);
  for (int j = 1; j < kMotionParameters; ++j) {
    // 95 % nominal; 200 draws have a standard deviation of 1.5 %, so 91 … 99 % is three of them less a little.
    EXPECT_GE(covered[j], 0.91 * draws) << j;
    EXPECT_LE(covered[j], 0.99 * draws + 1) << j;
    EXPECT_LT(std::abs(sum[j] / draws), 0.3) << "bias in standard errors, parameter " << j;
  }
}

}  // namespace
}  // namespace isac::estimate
