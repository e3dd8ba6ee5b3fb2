// What a plan asks for is what the valves and the person are told, and nothing of it leaves the limits.
#include "isac/series/plan_programs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"

namespace isac::series {
namespace {

constexpr double kKgf = kPascalPerKgfCm2;

double delta(const Program& program, double time) {
  const Pressures p = program.at(time);
  return 0.5 * (p.p2 - p.p1);
}
double mean(const Program& program, double time) {
  const Pressures p = program.at(time);
  return 0.5 * (p.p2 + p.p1);
}

Program only(const PlanRun& run, const ExcitationOptions& options = {}) {
  return plan_programs({.runs = {run}}, options, 1).at(0);
}

std::string refusal(const PlanRun& run, const ExcitationOptions& options = {}) {
  try {
    static_cast<void>(only(run, options));
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kBadInput);
    return error.code() + ": " + error.text();
  }
  return {};
}

TEST(PlanPrograms, hold_the_pressures_of_a_sweep_by_hand) {
  const Program program = only({.experiment = "constant-pressure",
                                .duration = 60,
                                .delta_pressure = 0.5 * kKgf,
                                .mean_pressure = 2.5 * kKgf,
                                .amplitude = 0.3,
                                .middle = 0.1,
                                .peak_speed = 0.5});
  for (const double t : {0.0, 17.0, 60.0}) {
    EXPECT_DOUBLE_EQ(delta(program, t), 0.5 * kKgf);
    EXPECT_DOUBLE_EQ(mean(program, t), 2.5 * kKgf);
  }
  ASSERT_EQ(program.stages.size(), 1U);
  EXPECT_EQ(program.stages[0].ask.kind, Ask::Kind::kSweepByHand);
  EXPECT_EQ(program.stages[0].ask.middle, 0.1);
  EXPECT_EQ(program.stages[0].ask.speed, 0.5);
  EXPECT_TRUE(program.hand_moves);
  EXPECT_NE(program.stages[0].prompt.find("17 degrees either side of +6 degrees"), std::string::npos)
      << program.stages[0].prompt;
  EXPECT_EQ(program.name, "plan1-1-constant-pressure");
}

TEST(PlanPrograms, swing_what_each_experiment_swings) {
  const PlanRun swing{.experiment = "free",
                      .duration = 40,
                      .pressure_swing = 0.6 * kKgf,
                      .pressure_period = 8,
                      .waveform = "triangle"};
  const Program free = only(swing);
  EXPECT_DOUBLE_EQ(delta(free, 2), 0.6 * kKgf);
  EXPECT_NEAR(delta(free, 4), 0, 1e-9 * kKgf);
  EXPECT_DOUBLE_EQ(delta(free, 6), -0.6 * kKgf);
  EXPECT_DOUBLE_EQ(mean(free, 2), 3 * kKgf);

  PlanRun both = swing;
  both.experiment = "pcu-step";
  both.mean_pressure = 2 * kKgf;
  const Program valve = only(both);
  EXPECT_DOUBLE_EQ(mean(valve, 2), 2.6 * kKgf);
  EXPECT_NEAR(delta(valve, 2), 0, 1e-9 * kKgf);

  PlanRun by_hand = swing;
  by_hand.experiment = "constant-pressure";
  const Program sweep = only(by_hand);
  EXPECT_DOUBLE_EQ(mean(sweep, 6), 2.4 * kKgf);
  EXPECT_NEAR(delta(sweep, 6), 0, 1e-9 * kKgf);
}

TEST(PlanPrograms, step_for_half_a_period_each_and_hold_where_asked) {
  PlanRun run{.experiment = "constant-angle",
              .duration = 20,
              .pressure_swing = 0.5 * kKgf,
              .pressure_period = 4,
              .waveform = "steps"};
  const Program steps = only(run);
  EXPECT_EQ(delta(steps, 0.5), 0);
  for (const auto& [time, level] : {std::pair{1.5, 0.5}, {2.9, 0.5}, {3.1, -0.5}, {4.9, -0.5}, {5.1, 0.5}})
    EXPECT_DOUBLE_EQ(delta(steps, time), level * kKgf) << time;
  EXPECT_TRUE(steps.expected.stepped);
  run.waveform = "hold";
  EXPECT_EQ(delta(only(run), 7), 0);
}

TEST(PlanPrograms, follow_a_sine_to_a_five_hundredth) {
  const PlanRun run{.experiment = "free",
                    .duration = 10,
                    .pressure_swing = 1 * kKgf,
                    .pressure_period = 5,
                    .waveform = "sine"};
  const Program sine = only(run);
  // Chords between 48 knots per period miss by 1 − cos(π/48) = 0.21 % of the swing.
  for (double t = 0; t <= 10; t += 0.013)
    EXPECT_NEAR(delta(sine, t) / kKgf, std::sin(2 * kPi * t / 5), 0.0022) << t;
}

TEST(PlanPrograms, stay_inside_the_limits_for_every_shape) {
  const ExcitationOptions options;
  for (const char* experiment : {"constant-pressure", "constant-angle", "free", "pcu-step"}) {
    for (const char* waveform : {"", "triangle", "sine", "steps", "hold"}) {
      const Program program = only({.experiment = experiment,
                                    .duration = 33,
                                    .delta_pressure = -0.7 * kKgf,
                                    .mean_pressure = 2 * kKgf,
                                    .pressure_swing = 1.3 * kKgf,
                                    .pressure_period = 7.7,
                                    .waveform = waveform},
                                   options);
      for (double t = 0; t <= 33; t += 0.05) {
        const Pressures p = program.at(t);
        ASSERT_LE(std::max(p.p1, p.p2), options.pressure_limit) << experiment << waveform;
        ASSERT_GE(std::min(p.p1, p.p2), 0) << experiment << waveform;
        ASSERT_LE(std::abs(delta(program, t)), options.delta_pressure_limit * (1 + 1e-12))
            << experiment << waveform;
      }
    }
  }
}

TEST(PlanPrograms, refuse_what_would_leave_a_limit_and_name_run_and_limit) {
  EXPECT_NE(
      refusal({.experiment = "free", .delta_pressure = 1.5 * kKgf, .pressure_swing = 0.6 * kKgf})
          .find("run 1 ('free') asks for a pressure difference of 2.1 kg/cm2, beyond the limit of 2 kg/cm2"),
      std::string::npos);
  EXPECT_NE(refusal({.experiment = "pcu-step", .mean_pressure = 4.5 * kKgf, .pressure_swing = 1 * kKgf})
                .find("asks for 5.5 kg/cm2 in a muscle"),
            std::string::npos);
  EXPECT_NE(refusal({.experiment = "free", .delta_pressure = 1.5 * kKgf, .mean_pressure = 1 * kKgf})
                .find("none goes below zero"),
            std::string::npos);
  EXPECT_NE(refusal({.experiment = "constant-pressure", .amplitude = 1, .middle = -0.5})
                .find("leads the bar to 1.5 rad"),
            std::string::npos);
  EXPECT_NE(refusal({.experiment = "constant-pressure", .peak_speed = 7}).find("7 rad/s, beyond the limit"),
            std::string::npos);
  EXPECT_NE(refusal({.experiment = "constant-angle", .middle = 1.3}).find("plan_beyond_limit"),
            std::string::npos);
  EXPECT_NE(refusal({.experiment = "free", .duration = 7200}).find("plan_too_long"), std::string::npos);
  EXPECT_NE(
      refusal({.experiment = "free", .pressure_swing = kKgf, .pressure_period = 0.01}).find("plan_too_long"),
      std::string::npos);
  EXPECT_NE(refusal({.experiment = "pose"}).find("is none of constant-pressure"), std::string::npos);
  EXPECT_THROW(static_cast<void>(plan_programs({}, {}, 1)), Error);
}

TEST(PlanPrograms, number_their_files_by_plan_and_run) {
  const auto programs = plan_programs({.runs = {{.experiment = "free"}, {.experiment = "free"}}}, {}, 3);
  EXPECT_EQ(programs.at(0).name, "plan3-1-free");
  EXPECT_EQ(programs.at(1).name, "plan3-2-free");
}

}  // namespace
}  // namespace isac::series
