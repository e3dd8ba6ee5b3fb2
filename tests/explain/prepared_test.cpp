// Which moments of a run count, where an encoder of finite steps does not tell which way a led joint goes.
#include "isac/explain/prepared.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "isac/core/units.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

constexpr double kInterval = 0.002;

/// A run of 20 s whose angle is given, read in steps.
Prepared prepared(const std::string& experiment, const std::function<double(double)>& angle) {
  const test::TiedRig rig;
  series::Recording run;
  run.source = "run.csv";
  run.metadata["experiment"] = experiment;
  const char* names[] = {"time", "angle", "p1", "p2", "F1", "F2"};
  const char* units[] = {"s", "rad", "Pa", "Pa", "N", "N"};
  for (int c = 0; c < 6; ++c) run.columns.push_back({names[c], units[c], {}});
  const double step = rig.facts().angle_step;
  for (int k = 0; k < 10000; ++k) {
    const double t = kInterval * k;
    const double row[] = {t, step * std::floor(angle(t) / step), rig.p0, rig.p0, 100, 100};
    for (std::size_t c = 0; c < 6; ++c) run.columns[c].values.push_back(row[c]);
  }
  return prepare({&run, 1}, rig.facts(), {}, 2.0);
}

/// There and back between ±0.3 rad at 0.6 rad/s, with a pause at each end in which the hand trembles by less than a step.
double led(double t, double pause) {
  const double stroke = 1.0, turn = std::fmod(t, 2 * (stroke + pause));
  const double at = turn < stroke + pause ? turn : turn - stroke - pause;
  const double way = turn < stroke + pause ? 1 : -1;
  const double s = std::min(at / stroke, 1.0);
  return way * 0.3 * (2 * (s * s * s * (10 - 15 * s + 6 * s * s)) - 1) + 2e-4 * std::sin(62.0 * t);
}

TEST(SlowTurns, of_a_led_joint_do_not_count_in_the_torque) {
  const Prepared data = prepared("constant-pressure", [](double t) { return led(t, 0.6); });
  const PreparedRun& run = data.runs.front();
  // Of each 1.6 s the pause of 0.6 s, and 0.2 s on both sides of it in which the joint creeps.
  EXPECT_NEAR(data.untold() / 20.0, 0.5, 0.15);
  for (std::size_t k = 500; k < 9500; ++k) {
    const double at = std::fmod(run.time[k], 1.6);
    if (at > 0.3 && at < 0.7) {
      EXPECT_EQ(run.loaded[k], 1) << run.time[k] << " s, in the middle of a stroke";
    }
    if (at > 1.1 && at < 1.5) {
      EXPECT_EQ(run.loaded[k], 0) << run.time[k] << " s, in a pause";
    }
  }
  EXPECT_EQ(std::count(run.usable.begin() + 500, run.usable.begin() + 9500, 0), 0)
      << "pressures are read as ever";
}

TEST(SlowTurns, are_left_out_at_both_ends_of_a_long_stand_and_its_middle_stays) {
  const Prepared data = prepared("constant-pressure", [](double t) { return led(t, 6.0); });
  const PreparedRun& run = data.runs.front();
  const auto counts_at = [&](double t) { return run.loaded[static_cast<std::size_t>(t / kInterval)] != 0; };
  EXPECT_FALSE(counts_at(1.2));
  EXPECT_TRUE(counts_at(4.0)) << "creep is seen there";
  EXPECT_FALSE(counts_at(6.8));
  EXPECT_TRUE(counts_at(7.5)) << "the next stroke";
}

TEST(SlowTurns, are_none_where_a_joint_turns_quickly_rests_throughout_or_is_free) {
  // Between ±0.3 rad at 1 Hz: ten times quicker than a turn that hides a direction.
  const auto quick = [](double t) { return 0.3 * std::sin(6.283185307179586 * t); };
  EXPECT_EQ(prepared("constant-pressure", quick).untold(), 0.0);
  EXPECT_EQ(prepared("constant-angle", [](double) { return 0.1; }).untold(), 0.0);
  EXPECT_EQ(prepared("free", [](double t) { return led(t, 0.6); }).untold(), 0.0);
}

// A valve that does not answer small errors keeps the pressure that it began with for as long as its command stands still, so where it began must be told
// better than slow noise of 0.3 s lets 2 s tell it: 0.0016 kg/cm2, half of a faint dead band.
TEST(FirstPressure, is_told_by_as_long_as_the_command_stands_still) {
  constexpr double kSlow = 0.003 * kPascalPerKgfCm2, kMemory = 0.3;
  const test::TiedRig rig;
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  double squares = 0;
  constexpr int kRuns = 60;
  for (int r = 0; r < kRuns; ++r) {
    series::Recording run;
    run.source = "run.csv";
    run.metadata["experiment"] = "constant-pressure";
    const char* names[] = {"time", "angle", "p1", "p2", "p1_cmd", "p2_cmd", "F1", "F2"};
    const char* units[] = {"s", "rad", "Pa", "Pa", "Pa", "Pa", "N", "N"};
    for (int c = 0; c < 8; ++c) run.columns.push_back({names[c], units[c], {}});
    const double stay = std::exp(-kInterval / kMemory);
    double slow = kSlow * normal(random);
    for (int k = 0; k < 15000; ++k) {
      const double row[] = {
          kInterval * k, 0.1 * std::sin(kInterval * k), rig.p0 + slow, rig.p0, rig.p0, rig.p0, 100, 100};
      for (std::size_t c = 0; c < 8; ++c) run.columns[c].values.push_back(row[c]);
      slow = stay * slow + kSlow * std::sqrt(1 - stay * stay) * normal(random);
    }
    const Prepared data = prepare({&run, 1}, rig.facts(), {}, 2.0);
    const double off = data.runs.front().first_pressure[0] - rig.p0;
    squares += off * off / kRuns;
  }
  // 20 s of it: 0.003 √(2 · 0.3/20) = 0.00052 kg/cm2; of one run in sixty the first two look unlike the others by chance.
  EXPECT_LT(std::sqrt(squares), 0.0009 * kPascalPerKgfCm2);
}

/// A free joint on its muscles, J φ̈ = k φ + b p − D φ̇ exactly, with a pressure that follows steps of its command by a lag.
series::Recording stepped(const RigFacts& rig) {
  constexpr double kStiffness = -8.5, kDamping = 0.14, kGain = 3.4e-5, kLag = 0.17;
  constexpr int kParts = 20;
  series::Recording run;
  run.source = "run.csv";
  run.metadata["experiment"] = "free";
  const char* names[] = {"time", "angle", "p1", "p2", "p1_cmd", "p2_cmd", "F1", "F2"};
  const char* units[] = {"s", "rad", "Pa", "Pa", "Pa", "Pa", "N", "N"};
  for (int c = 0; c < 8; ++c) run.columns.push_back({names[c], units[c], {}});
  double phi = 0, w = 0, p = 0;  // p: half of p2 − p1
  for (int k = 0; k < 15000; ++k) {
    const double command = (k / 1100 % 2 == 0 ? 1 : -1) * (0.4 + 0.1 * (k / 1100 % 3)) * kPascalPerKgfCm2;
    const double T = kStiffness * phi + kGain * p - kDamping * w, pull = T / (2 * rig.wheel_radius),
                 p0 = 3 * kPascalPerKgfCm2;
    const double row[] = {kInterval * k, phi,          p0 - p,     p0 + p,
                          p0 - command,  p0 + command, 100 - pull, 100 + pull};
    for (std::size_t c = 0; c < 8; ++c) run.columns[c].values.push_back(row[c]);
    for (int i = 0; i < kParts; ++i) {
      const double h = kInterval / kParts, half = std::exp(-0.5 * h / kLag),
                   middle = command + half * (p - command), end = command + half * (middle - command);
      const auto a = [&](double angle, double speed, double pressure) {
        return (kStiffness * angle + kGain * pressure - kDamping * speed) / rig.inertia;
      };
      const double a1 = a(phi, w, p), a2 = a(phi + 0.5 * h * w, w + 0.5 * h * a1, middle),
                   a3 = a(phi + 0.5 * h * w + 0.25 * h * h * a1, w + 0.5 * h * a2, middle),
                   a4 = a(phi + h * w + 0.5 * h * h * a2, w + h * a3, end);
      phi += h * w + h * h / 6 * (a1 + a2 + a3);
      w += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
      p = end;
    }
  }
  return run;
}

// Where a command jumps the torque bends at a sample, and what the kernel makes of its samples is not I g″ ∗ φ.
TEST(Motion, knows_what_a_torque_that_bends_where_a_command_jumps_is_off_by) {
  RigFacts rig = test::TiedRig{}.facts();
  rig.angle_step = std::nan("");
  series::Recording recording = stepped(rig);
  // Of the inertia, what the torque says it is too large by; of the torque as it was read, and with what it may be off by.
  struct TooLarge {
    double as_read = 0, mended = 0;
  };
  const auto too_large = [&rig](const series::Recording& read) {
    const Prepared data = prepare({&read, 1}, rig, {}, 2.0);
    const PreparedRun& run = data.runs.front();
    TooLarge sum;
    double squares = 0;
    for (std::size_t k = 100; k + 100 < run.time.size(); ++k) {
      const double a = run.slow_acceleration[k],
                   off = run.slow_torque_error.empty() ? 0.0 : run.slow_torque_error[k];
      sum.as_read += a * (run.slow_torque[k] / rig.inertia - a);
      sum.mended += a * ((run.slow_torque[k] + off) / rig.inertia - a);
      squares += a * a;
    }
    return TooLarge{sum.as_read / squares, sum.mended / squares};
  };
  const TooLarge exact = too_large(recording);
  EXPECT_LT(exact.as_read, -1e-4);
  EXPECT_NEAR(exact.mended, 0, 1e-5);
  // Noise of the sensors is no bend.
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (std::size_t c : {6U, 7U})
    for (double& force : recording.columns[c].values) force += 0.3 * normal(random);
  const TooLarge noisy = too_large(recording);
  EXPECT_NEAR(noisy.mended - noisy.as_read, -exact.as_read, 2e-5);
  // Nothing tells when a command jumps that is not recorded.
  recording.columns.erase(recording.columns.begin() + 4, recording.columns.begin() + 6);
  EXPECT_EQ(too_large(recording).mended, too_large(recording).as_read);
}

}  // namespace
}  // namespace isac::explain
