#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "isac/core/error.hpp"
#include "isac/estimate/step_fit.hpp"
#include "isac/estimate/step_shapes.hpp"
#include "pcu_scenes.hpp"

namespace isac::estimate {
namespace {

using test::make_steps;
using test::StepScene;

const Estimated& get(const PcuFit& fit, const char* name) {
  return *fit.find(name);
}

bool warned(const PcuFit& fit, const std::string& code) {
  for (const Warning& w : fit.warnings)
    if (w.code == code) return true;
  return false;
}

TEST(StepResiduals, jacobian_equals_finite_differences) {
  std::vector<double> s, y;
  for (int i = 0; i < 400; ++i) {
    s.push_back(0.0013 * i - 0.05);
    y.push_back(0.3 + 0.01 * i);
  }
  const StepParameters p = {0.21, 3.1, 0.119, 0.02371};  // the kink lies between two rows
  std::vector<double> r(400), up(400), down(400), jacobian(1600);
  step_residuals(s, y, p, r.data(), jacobian.data());
  for (std::size_t k = 0; k < 4; ++k) {
    const double h = 1e-6 * std::abs(p[k]);
    StepParameters a = p, b = p;
    a[k] += h;
    b[k] -= h;
    step_residuals(s, y, a, up.data(), nullptr);
    step_residuals(s, y, b, down.data(), nullptr);
    for (std::size_t i = 0; i < 400;
         ++i)  // central differences of values ~3 at h ~1e-7: 1e-16·3/1e-7 ≈ 1e-8, times 1/T
      EXPECT_NEAR(jacobian[4 * i + k], (up[i] - down[i]) / (2 * h), 1e-6)
          << "row " << i << " parameter " << k;
  }
}

TEST(StepSearch, finds_the_global_minimum_that_a_dense_grid_finds) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const PcuRun run = make_steps({.sample_time = 0.01, .hold = 1.0, .noise = 0.3, .seed = seed});
    const StepData data = cut_step(run, 1.0, 0.0, 2.0, false);
    const auto [parameters, sse] = search_step(data, -std::numeric_limits<double>::infinity());
    double best = std::numeric_limits<double>::infinity();
    for (double lag = 0.05; lag < 0.4; lag *= 1.01)
      for (double onset = -0.05; onset < 0.12; onset += 0.0005) {
        double n = 0, g = 0, gg = 0, sy = 0, gy = 0, yy = 0;
        for (std::size_t i = 0; i < data.s.size(); ++i) {
          const double v = step_shape(StepShape::kFirstOrder, data.s[i] - onset, lag, 0, 0);
          const double y = data.y[i] * 1e-5;
          n += 1, g += v, gg += v * v, sy += y, gy += v * y, yy += y * y;
        }
        const double gain = (n * gy - g * sy) / (n * gg - g * g), low = (sy - gain * g) / n;
        best = std::min(best, (yy - low * sy - gain * gy) * 1e10);
      }
    EXPECT_LE(sse, best * (1 + 1e-9)) << "seed " << seed;  // the grid cannot beat the exact search
    EXPECT_GE(sse, best * 0.995) << "seed " << seed;       // and its meshes are fine enough to come close
  }
}

TEST(PcuFit, recovers_an_exact_step_to_solver_tolerance) {
  const PcuFit fit = fit_pcu(std::array{make_steps({.gain = 0.97, .noise = 0.0})});
  // Without noise only rounding (1e-10 of the pressure, through squared sums) and the tolerance of the solver remain.
  EXPECT_NEAR(get(fit, "K_C").value, 0.97, 1e-7);
  EXPECT_NEAR(get(fit, "T_C").value, 0.17, 1e-7);
  EXPECT_NEAR(get(fit, "dead_time").value, 0.0237, 1e-7);
  EXPECT_TRUE(fit.first_order);
  EXPECT_TRUE(fit.converged);
  EXPECT_FALSE(get(fit, "T_vent").identifiable);
}

TEST(PcuFit, answers_in_units_that_follow_the_scale_of_pressure) {
  PcuRun run = make_steps({.noise = 0.01, .colour = 0.6});
  const PcuFit pascal = fit_pcu(std::array{run});
  for (double& p : run.pressure) p = 1e-5 * p + 7;
  for (double& u : run.command) u *= 1e-5;
  const PcuFit bar = fit_pcu(std::array{run});
  for (const char* name : {"K_C", "T_C", "dead_time"}) {  // only rounding differs
    EXPECT_NEAR(get(bar, name).value, get(pascal, name).value, 1e-7) << name;
    EXPECT_NEAR(get(bar, name).std_error, get(pascal, name).std_error, 1e-4 * get(pascal, name).std_error)
        << name;
  }
}

TEST(PcuFit, tells_filling_from_venting) {
  const StepScene scene{
      .lag_fill = 0.12, .lag_vent = 0.21, .commands = {0.5, 4.5, 1.0, 5.0, 0.5}, .colour = 0.5};
  const PcuFit fit = fit_pcu(std::array{make_steps(scene)});
  ASSERT_EQ(fit.steps.size(), 4u);
  EXPECT_NEAR(get(fit, "T_fill").value, 0.12,
              4 * get(fit, "T_fill").std_error);  // 4 standard errors: once in 16 000
  EXPECT_NEAR(get(fit, "T_vent").value, 0.21, 4 * get(fit, "T_vent").std_error);
  EXPECT_TRUE(fit.directions_differ);
  EXPECT_TRUE(warned(fit, "directions_differ"));
  EXPECT_LT(get(fit, "T_fill").std_error, fit.steps[0].lag.std_error);  // two steps know more than one
}

TEST(PcuFit, pools_steps_of_several_records) {
  const std::array runs{make_steps({.seed = 1}), make_steps({.commands = {1.0, 4.0}, .seed = 2}),
                        make_steps({.commands = {2.0, 3.0}, .seed = 3})};
  const PcuFit fit = fit_pcu(runs);
  EXPECT_EQ(fit.steps.size(), 3u);
  EXPECT_LT(get(fit, "T_C").std_error, fit.steps[0].lag.std_error);
  EXPECT_NEAR(get(fit, "T_C").value, 0.17, 4 * get(fit, "T_C").std_error);
  EXPECT_FALSE(warned(fit, "steps_differ"));
}

TEST(PcuFit, widens_the_interval_when_steps_differ) {
  const std::array runs{make_steps({.lag_fill = 0.15, .seed = 1}), make_steps({.lag_fill = 0.17, .seed = 2}),
                        make_steps({.lag_fill = 0.19, .seed = 3})};
  const PcuFit fit = fit_pcu(runs);
  const Estimated& lag = get(fit, "T_C");
  EXPECT_TRUE(warned(fit, "steps_differ"));
  EXPECT_LT(lag.ci_low, 0.155);  // the spread 0.02 over √3 steps, times t(2) = 4.3, is ± 0.05
  EXPECT_GT(lag.ci_high, 0.185);
}

TEST(PcuFit, one_percent_of_spikes_moves_nothing_by_a_standard_error) {
  const StepScene scene{.colour = 0.5, .seed = 11};
  StepScene spiky = scene;
  spiky.spike_share = 0.01;
  PcuRun clean = make_steps(scene), hit = clean;
  std::mt19937_64 engine(5);
  std::uniform_real_distribution<double> uniform;
  for (double& p : hit.pressure)
    if (uniform(engine) < 0.01) p += (uniform(engine) < 0.5 ? -1.0 : 1.0) * kPascalPerKgfCm2;
  const PcuFit a = fit_pcu(std::array{clean}), b = fit_pcu(std::array{hit});
  EXPECT_TRUE(warned(b, "spikes"));
  for (const char* name : {"K_C", "T_C", "dead_time"})
    EXPECT_NEAR(get(b, name).value, get(a, name).value, get(a, name).std_error) << name;
}

TEST(PcuFit, dead_time_below_one_sample_is_given_as_a_range) {
  const PcuFit fit = fit_pcu(std::array{make_steps({.dead_time = 0.001, .sample_time = 0.005})});
  const Estimated& dead = get(fit, "dead_time");
  EXPECT_TRUE(warned(fit, "dead_time_below_sample"));
  EXPECT_TRUE(dead.identifiable);
  EXPECT_EQ(dead.ci_low, 0.0);
  EXPECT_GE(dead.ci_high, 0.005 - 1e-12);  // the median interval, to rounding
}

TEST(PcuFit, pure_fill_gives_the_lag_and_refuses_gain_and_dead_time) {
  PcuRun run = make_steps({.commands = {0.2, 5.0}});
  run.command.clear();
  const PcuFit fit = fit_pcu(std::array{run});
  EXPECT_NEAR(get(fit, "T_C").value, 0.17, 4 * get(fit, "T_C").std_error);
  EXPECT_FALSE(get(fit, "K_C").identifiable);
  EXPECT_NE(get(fit, "K_C").reason.find("record the command"), std::string::npos);
  EXPECT_FALSE(get(fit, "dead_time").identifiable);
  EXPECT_NE(get(fit, "dead_time").reason.find("step's time"), std::string::npos);
  EXPECT_NEAR(fit.steps[0].start.value, 2.0237, 4 * fit.steps[0].start.std_error);

  run.step_at = 2.0;
  run.step_command = 4.8 * kPascalPerKgfCm2;
  const PcuFit told = fit_pcu(std::array{run});
  EXPECT_NEAR(get(told, "dead_time").value, 0.0237, 4 * get(told, "dead_time").std_error);
  EXPECT_NEAR(get(told, "K_C").value, 1.0, 4 * get(told, "K_C").std_error);
}

TEST(PcuFit, refuses_a_valve_that_never_moves) {
  PcuRun run = make_steps({.colour = 0.5});
  const PcuRun still = make_steps({.commands = {1.0, 1.0}, .colour = 0.5});
  run.pressure = still.pressure;
  const PcuFit fit = fit_pcu(std::array{run});
  EXPECT_FALSE(get(fit, "T_C").identifiable);
  EXPECT_NE(get(fit, "T_C").reason.find("does not move"), std::string::npos) << get(fit, "T_C").reason;
  EXPECT_TRUE(warned(fit, "step_left_out"));

  std::fill(run.pressure.begin(), run.pressure.end(), 1e5);  // not even noise
  EXPECT_FALSE(get(fit_pcu(std::array{run}), "T_C").identifiable);
}

TEST(PcuFit, steps_that_follow_before_the_last_has_settled_leave_no_bias) {
  // Held for three lags each: 5 % of every step is still to come when the next begins.
  const PcuFit fit = fit_pcu(
      std::array{make_steps({.hold = 0.51, .commands = {1.0, 1.0, 4.0, 1.0, 4.0, 1.0}, .noise = 0.0})});
  for (const PcuStep& s : fit.steps) {
    EXPECT_NEAR(s.lag.value, 0.17, 1e-4) << s.step_time;  // without taking the tail off: 0.005 and more
    EXPECT_NEAR(s.gain.value, 1.0, 1e-3) << s.step_time;
  }
}

TEST(PcuFit, refuses_a_step_held_too_short) {
  const PcuFit fit = fit_pcu(std::array{make_steps({.hold = 0.2})});
  EXPECT_FALSE(get(fit, "T_C").identifiable);
  EXPECT_NE(get(fit, "T_C").reason.find("hold the command"), std::string::npos) << get(fit, "T_C").reason;
}

TEST(PcuFit, refuses_a_pressure_that_moves_before_its_command) {
  PcuRun run = make_steps({});
  for (std::size_t i = 0; i < run.time.size(); ++i) run.command[i] = run.time[i] < 2.3 ? 0.5 : 5.0;
  const PcuFit fit = fit_pcu(std::array{run});
  EXPECT_FALSE(get(fit, "dead_time").identifiable);
  EXPECT_NE(get(fit, "dead_time").reason.find("before the command"), std::string::npos);
}

TEST(PcuFit, refuses_swapped_channels) {
  PcuRun run = make_steps({});
  for (double& u : run.command) u = 5.5 * kPascalPerKgfCm2 - u;
  EXPECT_NE(get(fit_pcu(std::array{run}), "K_C").reason.find("swapped"), std::string::npos);
}

TEST(PcuFit, throws_one_sentence_for_data_that_hold_no_step) {
  PcuRun run = make_steps({});
  for (std::size_t i = 0; i < run.command.size(); ++i)
    run.command[i] = 1e5 * std::sin(0.01 * static_cast<double>(i));
  try {
    (void)fit_pcu(std::array{run});
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), "no_step");
    EXPECT_EQ(e.kind(), ErrorKind::kAnswerIsNo);
  }
  EXPECT_THROW((void)fit_pcu({}), Error);
  run.pressure.pop_back();
  EXPECT_THROW((void)fit_pcu(std::array{run}), Error);
}

TEST(PcuFit, survives_missing_rows_and_time_that_jitters) {
  PcuRun run = make_steps({.seed = 3});
  std::mt19937_64 engine(7);
  std::uniform_real_distribution<double> jitter(-4e-4, 4e-4);
  PcuRun uneven{.name = "uneven", .sha256 = {}, .time = {}, .command = {}, .pressure = {}};
  for (std::size_t i = 0; i < run.time.size(); ++i) {
    const double t = run.time[i] + jitter(engine);
    const double s = t - 2.0 - 0.0237;
    uneven.time.push_back(t);
    uneven.command.push_back(t >= 2.0 ? 5e5 : 1e5);
    uneven.pressure.push_back(i % 7 == 0 ? std::numeric_limits<double>::quiet_NaN()
                                         : 1e5 + (s > 0 ? 4e5 * (1 - std::exp(-s / 0.17)) : 0));
  }
  const PcuFit fit = fit_pcu(std::array{uneven});
  EXPECT_NEAR(get(fit, "T_C").value, 0.17,
              1e-6);  // no noise; the step's own time is known to one jitter only
  EXPECT_NEAR(get(fit, "dead_time").value, 0.0237, 0.0025);
}

struct ShapeCase {
  StepShape shape;
  double lag, second, share;
};

class StepShapes : public ::testing::TestWithParam<ShapeCase> {};

TEST_P(StepShapes, are_named_and_their_parameters_recovered) {
  const ShapeCase c = GetParam();
  PcuRun run;
  run.name = "shape";
  std::mt19937_64 engine(9);
  std::normal_distribution<double> noise(0, 300);
  for (int i = 0; i < 3000; ++i) {
    const double t = 0.002 * i;
    run.time.push_back(t);
    run.command.push_back(t >= 1 ? 5e5 : 0);
    run.pressure.push_back(5e5 * step_shape(c.shape, t - 1.02, c.lag, c.second, c.share) + noise(engine));
  }
  const PcuFit fit = fit_pcu(std::array{run}, {.first_order_tolerance = 0.03});
  const StepAdequacy& a = fit.steps[0].adequacy;
  EXPECT_FALSE(fit.first_order) << a.sentence;
  EXPECT_TRUE(warned(fit, "not_first_order"));
  ASSERT_EQ(a.best, c.shape) << a.sentence;
  const StepShapeFit& best = a.shapes[static_cast<std::size_t>(c.shape)];
  EXPECT_NEAR(best.lag, c.lag, 0.05 * c.lag)
      << a.sentence;  // noise of 0.06 % of the step: a few percent on shape parameters
  if (c.shape != StepShape::kFlowLimited) {
    EXPECT_NEAR(best.second_lag, c.second, 0.1 * c.second) << a.sentence;
  }
  if (c.shape != StepShape::kSecondOrder) {
    EXPECT_NEAR(best.share, c.share, 0.05) << a.sentence;
  }
}

INSTANTIATE_TEST_SUITE_P(Known, StepShapes,
                         ::testing::Values(ShapeCase{StepShape::kSecondOrder, 0.2, 0.1, 0},
                                           ShapeCase{StepShape::kFlowLimited, 0.15, 0, 0.6},
                                           ShapeCase{StepShape::kTwoRates, 0.6, 0.05, 0.4}));

TEST(StepShape, limits_agree) {
  for (double x = 0.01; x < 2; x += 0.1) {
    const double lag = step_shape(StepShape::kFirstOrder, x, 0.2, 0, 0);
    EXPECT_NEAR(step_shape(StepShape::kFlowLimited, x, 0.2, 0, 1e-12), lag, 1e-9);
    EXPECT_NEAR(step_shape(StepShape::kTwoRates, x, 0.2, 0.1, 0), lag, 1e-15);
    EXPECT_NEAR(step_shape(StepShape::kSecondOrder, x, 0.2, 1e-9, 0), lag, 1e-7);  // error ~ T2/T
    // Equal lags: the limit formula and the quotient beside it.
    EXPECT_NEAR(step_shape(StepShape::kSecondOrder, x, 0.2, 0.2, 0),
                step_shape(StepShape::kSecondOrder, x, 0.2, 0.2 * (1 - 2e-5), 0), 1e-5);
  }
}

}  // namespace
}  // namespace isac::estimate
