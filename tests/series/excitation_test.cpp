// Excitation programs: what is commanded stays inside the limits, begins from a held baseline, and is the same every time.
#include "isac/series/excitation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "isac/core/error.hpp"

namespace isac::series {
namespace {

constexpr double kKgf = kPascalPerKgfCm2;

double delta(const Program& program, double time) {
  const Pressures p = program.at(time);
  return 0.5 * (p.p2 - p.p1);
}

TEST(Excitation, keeps_every_program_of_every_experiment_inside_the_limits) {
  ExcitationOptions options;
  options.delta_pressures = {-1.5 * kKgf, 0.7 * kKgf};
  for (const ExperimentInfo& info : experiments()) {
    for (const Program& program : make_programs(info.name, options)) {
      ASSERT_FALSE(program.stages.empty()) << program.name;
      ASSERT_FALSE(program.stages.front().prompt.empty()) << program.name;
      EXPECT_EQ(program.stages.front().start, 0.0);
      for (int i = 0; i <= 4000; ++i) {
        const double t = program.duration * i / 4000.0;
        const Pressures p = program.at(t);
        ASSERT_LE(std::max(p.p1, p.p2), options.pressure_limit * (1 + 1e-12)) << program.name << " at " << t;
        ASSERT_GE(std::min(p.p1, p.p2), 0.0) << program.name << " at " << t;
        // The multisine's peak is found on a grid of cos(π/64), scaled down by 0.2 %.
        ASSERT_LE(std::abs(delta(program, t)), options.delta_pressure_limit) << program.name << " at " << t;
      }
    }
  }
}

TEST(Excitation, holds_the_asked_pressure_difference_about_the_initial_pressure) {
  ExcitationOptions options;
  options.delta_pressures = {-1.0 * kKgf, 0.0, 1.0 * kKgf};
  const auto programs = make_programs("constant-pressure", options);
  ASSERT_EQ(programs.size(), 6u);  // slow and fast, three levels
  for (const Program& program : programs) {
    EXPECT_EQ(program.experiment, "constant-pressure");
    for (const double t : {0.0, 1.0, program.duration}) {
      EXPECT_DOUBLE_EQ(delta(program, t), program.expected.held_delta_pressure);
      EXPECT_DOUBLE_EQ(program.at(t).p1 + program.at(t).p2, 2.0 * options.initial_pressure);
    }
  }
  EXPECT_EQ(programs[0].name, "constant-pressure-slow_dp-1.00");
  EXPECT_NEAR(programs[0].stages[0].ask.speed, 0.1 * kPi, 1e-15);  // seed 3.2
  EXPECT_NEAR(programs[3].stages[0].ask.speed, 2.0 * kPi, 1e-15);
  EXPECT_FALSE(programs[0].stages[0].ask.vary_speed);
}

TEST(Excitation, makes_the_bundle_five_minutes_of_all_speeds) {
  const auto programs = make_programs("bundle", {});
  ASSERT_EQ(programs.size(), 1u);
  EXPECT_EQ(programs[0].duration, 300.0);
  EXPECT_TRUE(programs[0].stages[0].ask.vary_speed);
  EXPECT_TRUE(programs[0].expected.all_speeds);
  EXPECT_EQ(programs[0].experiment, "constant-pressure");
}

TEST(Excitation, steps_both_valves_together_up_and_down_from_a_held_baseline) {
  ExcitationOptions options;
  options.heights = {2 * kKgf, 4 * kKgf};
  options.hold = 1.5;
  const Program program = make_programs("pcu-step", options).at(0);
  EXPECT_DOUBLE_EQ(program.duration, 5 * 1.5);
  const double expected[] = {1, 2, 1, 4, 1};
  for (int hold = 0; hold < 5; ++hold) {
    for (const double inside : {0.0, 0.7, 1.499}) {  // from its first instant on: a true step
      const Pressures p = program.at(1.5 * hold + inside);
      EXPECT_DOUBLE_EQ(p.p1, expected[hold] * kKgf) << hold << " " << inside;
      EXPECT_EQ(p.p1, p.p2);
    }
  }
}

TEST(Excitation, clamps_the_joint_and_makes_a_triangle_and_then_steps) {
  ExcitationOptions options;
  options.delta_pressures = {0.5 * kKgf, -0.5 * kKgf};
  const Program program = make_programs("constant-angle", options).at(0);
  EXPECT_EQ(program.stages[0].ask.kind, Ask::Kind::kClamp);
  EXPECT_EQ(delta(program, 0.0), 0.0);
  const double quarter = 0.45 * 40.0 / 8.0;
  EXPECT_NEAR(delta(program, 2.0 + quarter), 0.5 * kKgf, 1e-6);
  EXPECT_NEAR(delta(program, 2.0 + 0.5 * quarter), 0.25 * kKgf, 1e-6);  // half way up
  EXPECT_NEAR(delta(program, 2.0 + 3 * quarter), -0.5 * kKgf, 1e-6);
  EXPECT_NEAR(delta(program, 20.0 + 1.0), 0.5 * kKgf, 1e-6);  // the steps
  EXPECT_NEAR(delta(program, 39.9), 0.0, 1e-6);
}

TEST(Excitation, draws_the_multisine_from_the_seed_alone) {
  ExcitationOptions one, again, other;
  one.seed = again.seed = 7;
  other.seed = 8;
  const Program a = make_programs("free", one).at(0), b = make_programs("free", again).at(0),
                c = make_programs("free", other).at(0);
  double most = 0.0, apart = 0.0;
  for (double t = a.tones_from; t < a.tones_to; t += 0.01) {
    ASSERT_EQ(delta(a, t), delta(b, t));
    most = std::max(most, std::abs(delta(a, t)));
    apart = std::max(apart, std::abs(delta(a, t) - delta(c, t)));
  }
  EXPECT_NEAR(most, 1.5 * kKgf, 0.03 * kKgf);  // uses the range it was given
  EXPECT_GT(apart, 0.5 * kKgf);
  EXPECT_NEAR(delta(a, a.tones_from), 0.0, 1.0);  // fades in: no step of more than 1 Pa
}

TEST(Excitation, records_chapter_three_with_runs_that_no_fit_sees) {
  const auto programs = make_programs("testbed-bundle", {});
  std::set<std::string> experiments_seen, fitted;
  int heldout = 0;
  for (const Program& program : programs) {
    experiments_seen.insert(program.experiment);
    if (program.heldout) {
      ++heldout;
    } else {
      EXPECT_TRUE(fitted.insert(program.name).second) << program.name;
    }
  }
  EXPECT_EQ(experiments_seen,
            (std::set<std::string>{"constant-pressure", "constant-angle", "free", "pcu-step"}));
  EXPECT_EQ(heldout, 3);
  EXPECT_EQ(make_programs("all", {}).size(), programs.size());
}

TEST(Excitation, asks_for_each_pose_at_its_time) {
  ExcitationOptions options;
  options.angles = {0.1, -0.2};
  options.hold = 4.0;
  const Program program = make_programs("pose", options).at(0);
  ASSERT_EQ(program.stages.size(), 2u);
  EXPECT_EQ(program.stages[1].start, 4.0);
  EXPECT_EQ(program.stages[1].ask.angle, -0.2);
  EXPECT_EQ(program.stages[1].ask.kind, Ask::Kind::kPose);
}

struct Refusal {
  const char* experiment;
  void (*spoil)(ExcitationOptions&);
  const char* code;
};

class ExcitationRefuses : public testing::TestWithParam<Refusal> {};

TEST_P(ExcitationRefuses, what_the_limits_forbid) {
  ExcitationOptions options;
  GetParam().spoil(options);
  try {
    static_cast<void>(make_programs(GetParam().experiment, options));
    FAIL() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kUsage);
    EXPECT_EQ(error.code(), GetParam().code) << error.text();
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, ExcitationRefuses,
    testing::Values(
        Refusal{"sing", [](ExcitationOptions&) {}, "experiment_unknown"},
        Refusal{"constant-pressure", [](ExcitationOptions& o) { o.delta_pressures = {2.1 * kKgf}; },
                "delta_pressure_beyond_limit"},
        Refusal{"constant-pressure", [](ExcitationOptions& o) { o.delta_pressures = {NAN}; },
                "delta_pressure_beyond_limit"},
        Refusal{"bundle",
                [](ExcitationOptions& o) { o.initial_pressure = 4.5 * kKgf, o.delta_pressures = {kKgf}; },
                "delta_pressure_beyond_limit"},
        Refusal{"constant-pressure",
                [](ExcitationOptions& o) {
                  o.delta_pressures = {kKgf, kKgf};
                },
                "level_twice"},
        Refusal{"constant-pressure", [](ExcitationOptions& o) { o.amplitude = 1.3; }, "angle_beyond_limit"},
        Refusal{"constant-pressure", [](ExcitationOptions& o) { o.speed = 7.0; }, "speed_beyond_limit"},
        Refusal{"free", [](ExcitationOptions& o) { o.duration = -1.0; }, "not_positive"},
        Refusal{"bundle", [](ExcitationOptions& o) { o.duration = 1e12; }, "too_long"},
        Refusal{"constant-angle", [](ExcitationOptions& o) { o.angles = {-1.2}; }, "angle_beyond_limit"},
        Refusal{"pcu-step", [](ExcitationOptions& o) { o.heights = {5.5 * kKgf}; }, "step_beyond_limit"},
        Refusal{"pcu-step", [](ExcitationOptions& o) { o.base_pressure = -1.0; }, "baseline_beyond_limit"},
        Refusal{"pose", [](ExcitationOptions& o) { o.hold = 0.0; }, "not_positive"},
        Refusal{"free", [](ExcitationOptions& o) { o.pressure_limit = 2 * kKgf; }, "limits_nonsense"},
        Refusal{"free", [](ExcitationOptions& o) { o.angle_limit = NAN; }, "limits_nonsense"}));

TEST(Excitation, calibrates_every_signal_at_two_levels_or_more_and_vents_while_a_person_is_at_the_sensors) {
  ExcitationOptions options;
  options.weights = {50, 149.1};
  std::set<std::string> levels_of_p1, levels_of_F1, levels_of_F2, levels_of_valve;
  int from_either_side = 0;
  for (const Program& program : make_programs("calibrate", options)) {
    EXPECT_EQ(program.experiment, "calibration");
    const std::string& text = program.calibration;
    if (text.rfind("p1 =", 0) == 0) levels_of_p1.insert(text);
    if (text.rfind("F1 =", 0) == 0) levels_of_F1.insert(text);
    if (text.find("F2 =") != std::string::npos) levels_of_F2.insert(text);
    if (text.rfind("p1_cmd =", 0) == 0) levels_of_valve.insert(text);
    const Ask& ask = program.stages.front().ask;
    const bool hands_on = ask.kind == Ask::Kind::kHangWeight || ask.kind == Ask::Kind::kConnectSupply;
    if (hands_on) {
      EXPECT_TRUE(program.in_codes);
      EXPECT_EQ(program.at(1.0).p1, 0.0) << program.name;
      EXPECT_EQ(program.at(1.0).p2, 0.0) << program.name;
    }
    if (text.rfind("angle = middle", 0) == 0) {
      // It comes from the side that its line names: the lead begins beyond where it settles.
      const double aside = program.lead_at(0.0).p2 - program.at(0.0).p2;
      EXPECT_EQ(aside > 0, text.back() == '+') << program.name;
      EXPECT_EQ(program.lead_at(program.lead.back().time).p2, program.at(0.0).p2);
      ++from_either_side;
    }
  }
  EXPECT_EQ(levels_of_p1.size(), 5u);
  EXPECT_EQ(levels_of_F1.size(), 3u);
  EXPECT_EQ(levels_of_F2.size(), 3u);
  EXPECT_EQ(levels_of_valve.size(), 6u);
  EXPECT_EQ(from_either_side, 6);
}

}  // namespace
}  // namespace isac::series
