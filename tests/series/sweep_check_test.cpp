// The verdict: a good recording passes, and each fault is found where exactly that is wrong.
#include "isac/series/sweep_check.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::series {
namespace {

constexpr double kKgf = kPascalPerKgfCm2;
constexpr double kRate = 500.0;
constexpr double kStep = 2.0 * kPi / 8000.0;

std::vector<double>& values(Recording& recording, const std::string& name) {
  for (Column& column : recording.columns) {
    if (column.name == name) return column.values;
  }
  throw std::logic_error(name);
}

/// A recording as the testbed gives it (A, B, D of the seed, muscles tensed to 95 N), quantised and noisy.
Recording simulate(double duration, const std::function<double(double)>& angle,
                   const std::function<double(double)>& p1, const std::function<double(double)>& p2,
                   double lag) {
  Recording recording;
  recording.source = "test.csv";
  for (const auto& [name, unit] : std::vector<std::pair<std::string, std::string>>{{"time", "s"},
                                                                                   {"angle", "rad"},
                                                                                   {"p1", "Pa"},
                                                                                   {"p2", "Pa"},
                                                                                   {"F1", "N"},
                                                                                   {"F2", "N"},
                                                                                   {"p1_cmd", "Pa"},
                                                                                   {"p2_cmd", "Pa"}}) {
    recording.columns.push_back({name, unit, {}});
  }
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 1.0);
  double held1 = p1(0.0), held2 = p2(0.0);
  for (int i = 0; i < static_cast<int>(duration * kRate); ++i) {
    const double t = i / kRate, phi = angle(t);
    held1 += (p1(t) - held1) * (1.0 / kRate) / lag;
    held2 += (p2(t) - held2) * (1.0 / kRate) / lag;
    const double speed = (angle(t + 1e-4) - angle(t - 1e-4)) / 2e-4;
    const double torque =
        -23450.0 * 0.019 * 0.019 * phi + 174.2 * 0.019 * 0.5 * (held2 - held1) / kKgf - 0.14 * speed;
    const double row[] = {t,
                          kStep * std::round(phi / kStep),
                          held1 + 400.0 * noise(random),
                          held2 + 400.0 * noise(random),
                          95.0 - 0.5 * torque / 0.019 + 0.3 * noise(random),
                          95.0 + 0.5 * torque / 0.019 + 0.3 * noise(random),
                          p1(t),
                          p2(t)};
    for (std::size_t c = 0; c < recording.columns.size(); ++c) recording.columns[c].values.push_back(row[c]);
  }
  return recording;
}

struct Case {
  Recording recording;
  SweepExpectation expected;
};

SweepExpectation common(const char* experiment, double duration) {
  SweepExpectation expected;
  expected.experiment = experiment;
  expected.duration = duration;
  expected.sample_period = 1.0 / kRate;
  expected.encoder_step = kStep;
  expected.highest_speed = 4.0 * kPi;
  expected.force_capacity = 200.0;
  expected.ranges = {{"F1", -10.0, 190.0, 0.05},
                     {"F2", -10.0, 190.0, 0.05},
                     {"p1", 0, 10 * kKgf, 0.0024 * kKgf},
                     {"p2", 0, 10 * kKgf, 0.0024 * kKgf}};
  return expected;
}

/// A hand's sweep: sine of peak speed v and amplitude a.
Case hand(double speed, double amplitude, double duration, bool slow) {
  const double omega = speed / amplitude;
  const auto held = [](double) { return 3.0 * kKgf; };
  Case made{simulate(
                duration, [=](double t) { return amplitude * std::sin(omega * t); }, held, held, 0.17),
            common("constant-pressure", duration)};
  made.expected.amplitude = amplitude;
  made.expected.speed = speed;
  made.expected.slow = slow;
  made.expected.held_delta_pressure = 0.0;
  return made;
}

Case slow_sweep() {
  return hand(0.1 * kPi, 0.35, 40.0, true);
}
Case fast_sweep() {
  return hand(2.0 * kPi, 0.35, 10.0, false);
}

/// Speeds grow and shrink through the whole range.
Case bundle() {
  const double amplitude = 0.35, top = 2.0 * kPi;
  const auto held = [](double) { return 3.0 * kKgf; };
  // Phase θ with θ̇ = (v/a)(1 + cos(2πt/60))/2: all speeds up to `top` once a minute.
  const auto phase = [=](double t) {
    return top / amplitude * (0.5 * t + 0.5 * 60.0 / (2.0 * kPi) * std::sin(2.0 * kPi * t / 60.0));
  };
  Case made{simulate(
                60.0, [=](double t) { return amplitude * std::sin(phase(t)); }, held, held, 0.17),
            common("constant-pressure", 60.0)};
  made.expected.amplitude = amplitude;
  made.expected.speed = top;
  made.expected.all_speeds = true;
  made.expected.held_delta_pressure = 0.0;
  return made;
}

Case valve_steps_held(double hold) {
  const auto command = [=](double t) {
    const int i = static_cast<int>(t / hold + 1e-9);
    return i % 2 == 0 ? kKgf : (1.0 + 0.5 * (i + 1)) * kKgf;
  };
  const double duration = 7.0 * hold;
  Case made{simulate(
                duration, [](double) { return 0.0; }, command, command, 0.17),
            common("pcu-step", duration)};
  made.expected.stepped = true;
  return made;
}

Case valve_steps() {
  return valve_steps_held(2.0);
}

Case clamped() {
  Case made = valve_steps();
  made.expected.experiment = "constant-angle";
  made.expected.clamped = true;
  return made;
}

Case free_joint() {
  const auto p1 = [](double t) { return (3.0 - std::sin(2.0 * t)) * kKgf; };
  const auto p2 = [](double t) { return (3.0 + std::sin(2.0 * t)) * kKgf; };
  Case made{simulate(
                10.0, [](double t) { return 0.39 * std::sin(2.0 * t - 0.3); }, p1, p2, 0.17),
            common("free", 10.0)};
  made.expected.moved_by_muscles = 0.1;
  return made;
}

Case poses() {
  const auto held = [](double) { return 3.0 * kKgf; };
  const auto angle = [](double t) {
    const double goal = 0.3 * std::floor(t / 4.0), before = std::max(0.0, goal - 0.3),
                 inside = std::fmod(t, 4.0);
    return before + (goal - before) * 0.5 * (1.0 - std::cos(kPi * std::min(inside / 1.5, 1.0)));
  };
  Case made{simulate(8.0, angle, held, held, 0.17), common("pose", 8.0)};
  made.expected.poses = {0.0, 0.3};
  return made;
}

TEST(SweepCheck, keeps_good_recordings_of_every_experiment_without_a_remark) {
  for (const auto& [name, made] : std::vector<std::pair<const char*, Case>>{{"slow", slow_sweep()},
                                                                            {"fast", fast_sweep()},
                                                                            {"bundle", bundle()},
                                                                            {"valve steps", valve_steps()},
                                                                            {"clamped", clamped()},
                                                                            {"free", free_joint()},
                                                                            {"poses", poses()}}) {
    const SweepVerdict verdict = check_sweep(made.recording, made.expected);
    EXPECT_TRUE(verdict.keep()) << name;
    for (const SweepRemark& remark : verdict.remarks) ADD_FAILURE() << name << ": " << remark.text;
  }
}

TEST(SweepCheck, states_what_the_sweep_covered) {
  const Case made = fast_sweep();
  const SweepFacts facts = check_sweep(made.recording, made.expected).facts;
  EXPECT_EQ(facts.rows, 5000u);
  EXPECT_NEAR(facts.duration, 10.0, 1e-9);
  EXPECT_NEAR(facts.angle_high, 0.35, kStep);
  EXPECT_NEAR(facts.angle_low, -0.35, kStep);
  // 99th percentile of a sine is its peak to 0.1 %; the 40 ms window takes sinc(ω 0.02) = 0.979 of it.
  EXPECT_NEAR(facts.speed_forward, 2.0 * kPi * 0.979, 0.03 * 2.0 * kPi);
  EXPECT_NEAR(facts.speed_backward, facts.speed_forward, 0.1);
}

struct Fault {
  const char* name;
  Case (*good)();
  void (*spoil)(Case&);
  const char* code;
  bool repeat = true;
};

class SweepCheckFinds : public testing::TestWithParam<Fault> {};

TEST_P(SweepCheckFinds, exactly_what_is_wrong) {
  Case made = GetParam().good();
  GetParam().spoil(made);
  const SweepVerdict verdict = check_sweep(made.recording, made.expected);
  ASSERT_EQ(verdict.remarks.size(), 1u) << [&] {
    std::string all;
    for (const SweepRemark& remark : verdict.remarks) all += remark.code + ": " + remark.text + "\n";
    return all;
  }();
  EXPECT_EQ(verdict.remarks[0].code, GetParam().code) << verdict.remarks[0].text;
  EXPECT_EQ(verdict.remarks[0].repeat, GetParam().repeat);
  EXPECT_EQ(verdict.keep(), !GetParam().repeat);
  EXPECT_NE(verdict.remarks[0].text.find_first_of("0123456789"), std::string::npos)
      << "a number belongs in: " << verdict.remarks[0].text;
}

void cut_rows(Case& made, std::size_t from, std::size_t count) {
  for (Column& column : made.recording.columns) {
    const auto first = column.values.begin() + static_cast<std::ptrdiff_t>(from);
    column.values.erase(first, first + static_cast<std::ptrdiff_t>(count));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Faults, SweepCheckFinds,
    testing::Values(
        Fault{"stopped_early", slow_sweep, [](Case& c) { cut_rows(c, 15000, 5000); }, "stopped_early"},
        Fault{"long_gap", slow_sweep, [](Case& c) { cut_rows(c, 7000, 20); }, "time_gaps"},
        Fault{"short_gap", slow_sweep, [](Case& c) { cut_rows(c, 7000, 1); }, "time_gaps", false},
        Fault{"many_dropped", slow_sweep, [](Case& c) { c.expected.dropped = 500; }, "samples_dropped"},
        Fault{"few_dropped", slow_sweep, [](Case& c) { c.expected.dropped = 3; }, "samples_dropped", false},
        Fault{"missing", slow_sweep,
              [](Case& c) { std::fill_n(values(c.recording, "F1").begin(), 400, std::nan("")); },
              "signal_missing"},
        Fault{"frozen", slow_sweep,
              [](Case& c) {
                std::fill(values(c.recording, "F2").begin(), values(c.recording, "F2").end(), 12.5);
              },
              "signal_frozen"},
        Fault{"force_top", fast_sweep,
              [](Case& c) {
                for (double& force : values(c.recording, "F2")) force = std::min(force + 40.0, 190.0);
              },
              "force_saturated"},
        Fault{"force_capacity", slow_sweep,
              [](Case& c) {
                c.expected.ranges.clear();
                for (double& force : values(c.recording, "F1")) force += 50.0;
              },
              "force_saturated"},
        Fault{"force_in_valve_steps", valve_steps,
              [](Case& c) {
                c.expected.force_capacity = 90.0, c.expected.ranges[1].high = 300.0;
                values(c.recording, "F2").assign(7000, 80.0);
                values(c.recording, "F2")[0] = 79.0;
              },
              "force_saturated", false},
        Fault{"slack", fast_sweep,
              [](Case& c) {
                for (double& force : values(c.recording, "F1")) force = std::max(force - 60.0, -10.0);
              },
              "muscle_slack"},
        Fault{"pressure_top", slow_sweep,
              [](Case& c) {  // a sensor whose range ends where p1 happens to stand
                for (SensorRange& range : c.expected.ranges) {
                  if (range.column == "p1") range.high = 2.99 * kKgf;
                }
              },
              "pressure_saturated"},
        Fault{"encoder_jump", slow_sweep,
              [](Case& c) {
                auto& angle = values(c.recording, "angle");
                for (std::size_t i = 9000; i < angle.size(); ++i) angle[i] += 12.0 * kStep;
              },
              "encoder_jumped"},
        Fault{"encoder_spike", fast_sweep, [](Case& c) { values(c.recording, "angle")[2500] += 0.2; },
              "encoder_jumped"},
        Fault{"small_range", slow_sweep, [](Case& c) { c.expected.amplitude = 0.6; }, "angle_range_small"},
        Fault{"too_slow", slow_sweep, [](Case& c) { c.expected.speed = 0.8, c.expected.slow = false; },
              "speed_too_low"},
        Fault{"too_fast", fast_sweep, [](Case& c) { c.expected.speed = 0.1 * kPi, c.expected.slow = true; },
              "speed_too_high"},
        Fault{"one_way", slow_sweep,
              [](Case& c) {  // creeps back at a twentieth of the speed
                auto& angle = values(c.recording, "angle");
                for (std::size_t i = 0; i < angle.size(); ++i) {
                  const double u = std::fmod(static_cast<double>(i) / 8000.0, 1.0);
                  angle[i] =
                      kStep *
                      std::round((u < 0.05 ? -0.35 + 14.0 * u : 0.35 - (u - 0.05) / 0.95 * 0.7) / kStep);
                }
                c.expected.slow = false;
              },
              "one_direction"},
        Fault{"speeds_missing", bundle, [](Case& c) { c.expected.speed = 9.0; }, "speeds_missing"},
        Fault{"pressure_off", slow_sweep, [](Case& c) { c.expected.held_delta_pressure = 0.5 * kKgf; },
              "pressure_not_reached"},
        Fault{"pressure_drifts", slow_sweep,
              [](Case& c) {
                auto& p2 = values(c.recording, "p2");
                for (std::size_t i = 0; i < p2.size(); ++i) {
                  p2[i] += 0.5 * kKgf * (static_cast<double>(i) / static_cast<double>(p2.size()) - 0.5);
                }
              },
              "pressure_not_held"},
        Fault{"pressure_peaks", fast_sweep,
              [](Case& c) {
                auto& p1 = values(c.recording, "p1");
                for (std::size_t i = 0; i < p1.size(); ++i)
                  p1[i] += 0.5 * kKgf * std::sin(0.04 * static_cast<double>(i));
              },
              "pressure_not_held"},
        Fault{"clamp", clamped,
              [](Case& c) {
                auto& angle = values(c.recording, "angle");
                for (std::size_t i = 0; i < angle.size(); ++i)
                  angle[i] += 0.05 * std::sin(0.002 * static_cast<double>(i));
              },
              "clamp_slipped"},
        Fault{"unsettled", [] { return valve_steps_held(0.4); }, [](Case&) {}, "not_settled"},
        Fault{"no_steps", valve_steps,
              [](Case& c) {
                for (const char* name : {"p1_cmd", "p2_cmd"}) {
                  auto& command = values(c.recording, name);
                  command.assign(command.size(), kKgf);
                }
              },
              "no_steps"},
        Fault{"valve_dead", valve_steps,
              [](Case& c) {
                for (double& p : values(c.recording, "p2")) p = kKgf + 0.1 * (p - kKgf);
              },
              "valve_did_not_follow"},
        Fault{"did_not_move", free_joint, [](Case& c) { c.expected.moved_by_muscles = 2.0; },
              "joint_did_not_move"},
        Fault{"pose_missing", poses, [](Case& c) { c.expected.poses.push_back(-0.3); }, "pose_missing"}),
    [](const testing::TestParamInfo<Fault>& fault) { return std::string(fault.param.name); });

TEST(SweepCheck, says_so_when_there_is_next_to_nothing) {
  Case made = slow_sweep();
  cut_rows(made, 5, 19995);
  const SweepVerdict verdict = check_sweep(made.recording, made.expected);
  ASSERT_FALSE(verdict.keep());
  EXPECT_EQ(verdict.remarks[0].code, "too_short");
}

TEST(SweepCheck, needs_an_angle) {
  Case made = slow_sweep();
  made.recording.columns.erase(made.recording.columns.begin() + 1);
  EXPECT_THROW(static_cast<void>(check_sweep(made.recording, made.expected)), Error);
}

TEST(SweepCheck, goes_without_pressures_where_the_rig_measures_none) {
  Case made = slow_sweep();
  std::erase_if(made.recording.columns, [](const Column& column) { return column.name[0] == 'p'; });
  EXPECT_TRUE(check_sweep(made.recording, made.expected).keep());
}

/// Four seconds of a force at 149 N, swinging by `swing` at half a hertz and drifting by `drift` N/s.
SweepVerdict level_verdict(double swing, double drift, double top) {
  Recording recording;
  recording.columns = {{"time", "s", {}}, {"angle", "rad", {}}, {"F1", "N", {}}};
  for (int i = 0; i < 2000; ++i) {
    const double t = 0.002 * i;
    recording.columns[0].values.push_back(t);
    recording.columns[1].values.push_back(0.0);
    recording.columns[2].values.push_back(149.0 + swing * std::sin(kPi * t) + drift * t);
  }
  SweepExpectation expected;
  expected.sample_period = 0.002;
  expected.held = {{"F1", 0.5}};
  expected.ranges = {{"F1", -10.0, top, 0.05}};
  return check_sweep(recording, expected);
}

TEST(SweepCheck, keeps_a_level_at_rest_and_no_level_that_swings_drifts_or_stands_at_the_end_of_the_range) {
  const SweepVerdict rest = level_verdict(0.0, 0.0, 190.0);
  EXPECT_TRUE(rest.keep());
  ASSERT_EQ(rest.facts.levels.size(), 1u);
  EXPECT_NEAR(rest.facts.levels[0].mean, 149.0, 1e-9);
  // A swing over whole periods drifts by nothing; its own scatter is swing/√2, against 1 N.
  EXPECT_EQ(level_verdict(2.0, 0.0, 190.0).remarks.at(0).code, "not_at_rest");
  EXPECT_TRUE(level_verdict(1.0, 0.0, 190.0).keep());
  EXPECT_EQ(level_verdict(0.0, 0.3, 190.0).remarks.at(0).code, "not_at_rest");  // halves 0.6 N apart
  EXPECT_TRUE(level_verdict(0.0, 0.2, 190.0).keep());                           // 0.4 N
  EXPECT_EQ(level_verdict(0.0, 0.0, 149.0).remarks.at(0).code, "level_saturated");
}

}  // namespace
}  // namespace isac::series
