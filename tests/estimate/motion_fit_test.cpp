// Output-error identification of a free joint: exact sensitivities, recovery, coverage, and what motion alone cannot tell.
#include "isac/estimate/motion_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "isac/estimate/motion_pass.hpp"
#include "motion_data.hpp"

namespace isac::estimate {
namespace {

TEST(MotionFit, sensitivities_agree_with_central_differences) {
  Truth truth;
  truth.gravity = 0.8;
  const MotionRun run = make_run(truth, 3, 4, 500, 0);
  const MotionOptions options = options_for(truth);
  const motion::Prepared ready = motion::prepare(run, options);
  const motion::State state{truth.p, 0.05, -0.2};
  std::vector<motion::Sums> blocks;
  ASSERT_TRUE(motion::accumulate(ready, state, options, 0, blocks));
  std::vector<std::vector<double>> columns;
  const std::size_t n = ready.time.size();
  for (int lane = 0; lane < motion::kUsedLanes; ++lane) {
    const auto j = static_cast<std::size_t>(lane);
    const double size = lane < kMotionParameters ? std::abs(truth.p[j]) : 1.0;
    const double h = 1e-5 * size;
    std::vector<double> up(n), down(n), column(n);
    for (int side = 0; side < 2; ++side) {
      motion::State moved = state;
      const double shift = side == 0 ? h : -h;
      if (lane < kMotionParameters) moved.parameters[j] += shift;
      if (lane == motion::kInitialAngle) moved.angle += shift;
      if (lane == motion::kInitialSpeed) moved.speed += shift;
      ASSERT_TRUE(motion::predict(ready, moved, options, side == 0 ? up.data() : down.data()));
    }
    for (std::size_t i = 0; i < n; ++i) column[i] = (up[i] - down[i]) / (2 * h);
    columns.push_back(std::move(column));
  }
  for (int a = 0; a < motion::kUsedLanes; ++a) {
    for (int b = 0; b < motion::kUsedLanes; ++b) {
      double expected = 0;
      for (std::size_t i = 0; i < n; ++i)
        expected += columns[static_cast<std::size_t>(a)][i] * columns[static_cast<std::size_t>(b)][i];
      const double size = std::sqrt(blocks[0].gram[a][a] * blocks[0].gram[b][b]);
      // Central differences at 1e-5: curvature 1e-10 relative, amplified by the resonance; rounding 1e-11.
      EXPECT_NEAR(blocks[0].gram[a][b], expected, 1e-6 * size) << a << "," << b;
    }
  }
}

TEST(MotionFit, blocks_add_up_to_the_whole) {
  const Truth truth;
  const MotionRun run = make_run(truth, 4, 3, 500, 0.001);
  const MotionOptions options = options_for(truth);
  const motion::Prepared ready = motion::prepare(run, options);
  std::vector<motion::Sums> whole, parts;
  ASSERT_TRUE(motion::accumulate(ready, {truth.p, 0, 0}, options, 0, whole));
  ASSERT_TRUE(motion::accumulate(ready, {truth.p, 0, 0}, options, 100, parts));
  EXPECT_EQ(parts.size(), (ready.time.size() + 99) / 100);
  double square = 0, gram = 0;
  for (const auto& part : parts) {
    square += part.square;
    gram += part.gram[1][1];
  }
  EXPECT_NEAR(square, whole[0].square, 1e-12 * whole[0].square);
  EXPECT_NEAR(gram, whole[0].gram[1][1], 1e-12 * whole[0].gram[1][1]);
}

TEST(MotionFit, recovers_the_seeds_joint_from_command_and_angle_without_a_start) {
  const Truth truth;
  const std::vector<MotionRun> runs{make_run(truth, 11, 30, 500, 2e-4), make_run(truth, 12, 30, 500, 2e-4)};
  const MotionFit fit = fit_motion(runs, options_for(truth));
  ASSERT_TRUE(fit.converged) << fit.solver_summary;
  EXPECT_NEAR(fit.values[kA], truth.p[kA], 0.005 * 23450);
  EXPECT_NEAR(fit.values[kB], truth.p[kB], 0.005 * truth.p[kB]);
  EXPECT_NEAR(fit.values[kD], truth.p[kD], 0.05 * truth.p[kD]);
  EXPECT_NEAR(fit.values[kFriction], truth.p[kFriction], 0.05 * truth.p[kFriction]);
  EXPECT_NEAR(fit.values[kLag], truth.p[kLag], 0.005 * truth.p[kLag]);
  EXPECT_LT(fit.rmse, 1.1 * 2e-4);  // the noise that was put in, and a tenth for the fixed-step integration
  EXPECT_EQ(fit.parameters[kB].unit, "N cm2/kg");
  EXPECT_NEAR(fit.parameters[kB].value, 174.2, 1.0);
  EXPECT_EQ(fit.parameters[kInertia].std_error, 0) << "held";
}

TEST(MotionFit, a_held_command_is_delayed_exactly_by_any_dead_time) {
  MotionOptions options;
  options.dead_time = 0.0137;  // no multiple of the interval
  MotionRun run;
  for (int k = 0; k < 100; ++k) {
    run.time.push_back(0.01 * k);
    run.command.push_back(k < 20 ? 1.0 : 3.0);
    run.angle.push_back(0);
  }
  const motion::Prepared ready = motion::prepare(run, options);
  // The step of 0.20 s arrives at 0.2137 s: the interval from 0.21 s holds the old value for 37 % of its length.
  EXPECT_NEAR(ready.command_from[20], 1.0, 1e-12);
  EXPECT_NEAR(ready.command_from[21], 0.37 * 1.0 + 0.63 * 3.0, 1e-9);
  EXPECT_NEAR(ready.command_to[22], 3.0, 1e-12);
}

TEST(MotionFit, refuses_every_torque_when_nothing_fixes_their_scale) {
  const Truth truth;
  MotionOptions options = options_for(truth);
  options.fixed[kInertia] = false;
  options.start[kInertia] = std::nan("");
  const MotionRun run = make_run(truth, 5, 5, 500, 1e-4);
  const MotionFit fit = fit_motion({&run, 1}, options);
  for (const Estimated& parameter : fit.parameters) EXPECT_FALSE(parameter.identifiable) << parameter.name;
  EXPECT_NE(fit.parameters[kA].reason.find("inertia"), std::string::npos);
  EXPECT_TRUE(std::isnan(fit.parameters[kA].value));
}

TEST(MotionFit, refuses_the_pressure_side_when_the_valves_rest) {
  const Truth truth;
  MotionRun run = make_run(truth, 6, 5, 500, 1e-4);
  // A free decay: zero command throughout, the joint let go.
  run.command.assign(run.command.size(), 0.0);
  const MotionVector p = truth.p;
  MotionOptions options = options_for(truth);
  run.angle = simulate_motion(run, p, options, 0.4, 0);
  std::mt19937 random(1);
  std::normal_distribution<double> gauss(0, 1e-4);
  for (double& angle : run.angle) angle += gauss(random);
  const MotionFit fit = fit_motion({&run, 1}, options);
  EXPECT_FALSE(fit.parameters[kB].identifiable);
  EXPECT_FALSE(fit.parameters[kLag].identifiable);
  EXPECT_TRUE(fit.parameters[kA].identifiable);
  EXPECT_NEAR(fit.values[kA], p[kA], 0.01 * 23450);
}

TEST(MotionFit, throws_when_no_run_is_long_enough) {
  MotionRun run;
  run.name = "short";
  run.time = {0, 1};
  run.command = {0, 0};
  run.angle = {0, 0};
  EXPECT_ANY_THROW((void)fit_motion({&run, 1}, {}));
}

}  // namespace
}  // namespace isac::estimate
