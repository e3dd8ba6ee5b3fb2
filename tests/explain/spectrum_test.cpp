#include "isac/explain/spectrum.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace isac::explain {
namespace {

constexpr double kTurn = 6.283185307179586;

enum class Noise { kWhite, kColoured, kQuantised };

std::vector<Series> noise_runs(std::mt19937& random, Noise noise, int runs, std::size_t samples) {
  std::normal_distribution<double> gauss;
  std::vector<Series> out;
  for (int r = 0; r < runs; ++r) {
    Series s;
    s.interval = 0.002;
    s.start = 0.4;
    double slow = 0;
    for (std::size_t k = 0; k < samples; ++k) {
      slow = 0.98 * slow + 0.2 * gauss(random);  // 0.1 s of memory, as strong as the white part
      const double v = gauss(random);
      s.value.push_back(noise == Noise::kWhite      ? v
                        : noise == Noise::kColoured ? 0.3 * v + slow
                                                    : std::round((0.5 * v + slow) / 0.8) * 0.8);
    }
    out.push_back(std::move(s));
  }
  return out;
}

void add_line(std::vector<Series>& runs, double frequency, double amplitude,
              const std::vector<double>& phase) {
  for (std::size_t r = 0; r < runs.size(); ++r)
    for (std::size_t k = 0; k < runs[r].value.size(); ++k)
      runs[r].value[k] +=
          amplitude *
          std::sin(kTurn * frequency * (runs[r].start + static_cast<double>(k) * runs[r].interval) +
                   phase[r]);
}

TEST(SpectralLines, raises_no_false_alarm_in_noise_of_any_colour) {
  for (const Noise noise : {Noise::kWhite, Noise::kColoured, Noise::kQuantised}) {
    std::mt19937 random(11);
    int alarms = 0;
    for (int trial = 0; trial < 500; ++trial)
      alarms += spectral_lines(noise_runs(random, noise, 1 + trial % 5, 2048), 0.005 / 3).empty() ? 0 : 1;
    EXPECT_LE(alarms, 5) << static_cast<int>(noise);  // 1 % of 500; 0.8 are expected of a third of 0.005
  }
}

TEST(SpectralLines, finds_the_line_its_amplitude_and_its_phase_under_coloured_noise) {
  std::mt19937 random(3);
  std::vector<Series> runs = noise_runs(random, Noise::kColoured, 4, 8192);
  const double frequency = 49.97, amplitude = 0.2, phase = 0.7;
  add_line(runs, frequency, amplitude, std::vector<double>(4, phase));
  const std::vector<SpectralLine> lines = spectral_lines(runs, 0.001);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].runs, 4U);
  EXPECT_TRUE(lines[0].repeats);
  // 16 s of noise of 0.3 and 4 runs: the frequency's standard error is below 1 mHz, the amplitude's 0.003.
  EXPECT_NEAR(lines[0].frequency, frequency, 0.004);
  EXPECT_NEAR(lines[0].amplitude, amplitude, 0.012);
  EXPECT_NEAR(std::atan2(lines[0].cosine, lines[0].sine), phase, 0.15);
  EXPECT_LT(lines[0].p_value, 1e-4);
}

TEST(SpectralLines, says_so_where_the_phase_is_another_one_in_every_run) {
  std::mt19937 random(4);
  std::vector<Series> runs = noise_runs(random, Noise::kWhite, 5, 4096);
  add_line(runs, 3.7, 0.5, {0.1, 2.3, 4.4, 5.5, 3.2});
  const std::vector<SpectralLine> lines = spectral_lines(runs, 0.001);
  ASSERT_FALSE(lines.empty());
  EXPECT_FALSE(lines[0].repeats);
  EXPECT_NEAR(lines[0].frequency, 3.7, 0.03);  // a fifth of a bin of 0.122 Hz
  EXPECT_NEAR(lines[0].amplitude, 0.5, 0.06);  // 0.5/√20480 · √2 · 5: five standard errors of one run's share
  for (std::size_t r = 0; r < 5; ++r)
    EXPECT_NEAR(std::hypot(phase_in(runs[r], 3.7).sine, phase_in(runs[r], 3.7).cosine), 1, 1e-12);
}

// Six phases by chance point the same way by half of their length on one day in twenty; a line that was believed to repeat then added to
// held-out runs what it should have taken out of them.
TEST(SpectralLines, phases_by_chance_seldom_pass_for_one_clock_and_one_clock_is_told_under_noise) {
  std::mt19937 random(21);
  std::uniform_real_distribution<double> turn(0, kTurn);
  int by_chance = 0, found = 0, told = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<Series> runs = noise_runs(random, Noise::kWhite, 6, 1024);
    std::vector<double> phases(6);
    for (double& phase : phases) phase = turn(random);
    add_line(runs, 31.0, 0.4, phases);
    if (const auto lines = spectral_lines(runs, 0.001); !lines.empty()) {
      ++found;
      by_chance += lines[0].repeats ? 1 : 0;
    }
    runs = noise_runs(random, Noise::kWhite, 6, 1024);
    add_line(runs, 31.0, 0.4, std::vector<double>(6, phases[0]));
    if (const auto lines = spectral_lines(runs, 0.001); !lines.empty()) told += lines[0].repeats ? 1 : 0;
  }
  EXPECT_GE(found, 290);
  EXPECT_LE(by_chance, 5) << "of " << found;  // 1.1 % at most by Rayleigh's test, 3.4 of 300
  EXPECT_GE(told, 285);
}

// Ten runs of a day. In six of them the motion has a line there, so they say nothing about it; the phases of the other four lie within 100 degrees by
// chance. A common phase takes something out of those four and adds more to the others.
TEST(SpectralLines, phases_of_few_runs_that_agree_are_held_against_those_of_all) {
  std::mt19937 random(8);
  std::vector<Series> runs = noise_runs(random, Noise::kWhite, 10, 4096);
  const std::vector<double> phase = {0.0, 0.6, 1.2, 1.8, 4.0, 4.6, 3.4, 5.2, 4.2, 3.8};
  for (std::size_t r = 4; r < runs.size(); ++r) {
    std::vector<double> angle;
    for (std::size_t k = 0; k < runs[r].value.size(); ++k)
      angle.push_back(std::sin(kTurn * 3.7 * 0.002 * static_cast<double>(k)));
    runs[r].drivers.push_back(std::move(angle));
  }
  add_line(runs, 3.7, 0.5, phase);
  const std::vector<SpectralLine> lines = spectral_lines(runs, 0.001);
  ASSERT_FALSE(lines.empty());
  EXPECT_EQ(lines[0].runs, 4U);
  EXPECT_FALSE(lines[0].repeats);
  EXPECT_NEAR(lines[0].amplitude, 0.5, 0.06);
  // Alike in all of them they are one clock's.
  runs = noise_runs(random, Noise::kWhite, 10, 4096);
  add_line(runs, 3.7, 0.5, std::vector<double>(10, 0.6));
  const std::vector<SpectralLine> alike = spectral_lines(runs, 0.001);
  ASSERT_FALSE(alike.empty());
  EXPECT_TRUE(alike[0].repeats);
}

// What a strong line leaks into the bins beside its own says as much as any: the cap makes them alike.
TEST(SpectralLines, finds_a_strong_line_where_it_is_and_not_a_bin_beside_it) {
  std::mt19937 random(6);
  for (const double frequency : {16.263, 7.518, 31.1}) {
    std::vector<Series> runs;
    std::vector<double> phase;
    for (const std::size_t samples : {20000U, 22500U, 25000U, 20000U, 22500U}) {
      runs.push_back(noise_runs(random, Noise::kColoured, 1, samples).front());
      phase.push_back(1.3 * static_cast<double>(samples % 7));
    }
    add_line(runs, frequency, 4.0, phase);
    const std::vector<SpectralLine> lines = spectral_lines(runs, 0.001);
    ASSERT_FALSE(lines.empty());
    EXPECT_NEAR(lines.front().frequency, frequency, 0.002);
    EXPECT_NEAR(lines.front().amplitude, 4.0, 0.08);
  }
}

TEST(SpectralLines, leaves_to_the_motion_what_the_motion_makes) {
  std::mt19937 random(5);
  std::vector<Series> runs = noise_runs(random, Noise::kWhite, 3, 8192);
  add_line(runs, 1.5, 1.0, {0, 0, 0});  // third harmonic of a sweep at 0.5 Hz
  EXPECT_FALSE(spectral_lines(runs, 0.001).empty());
  for (Series& run : runs) {
    std::vector<double> angle;
    for (std::size_t k = 0; k < run.value.size(); ++k)
      angle.push_back(std::sin(kTurn * 0.5 * static_cast<double>(k) * run.interval));
    run.drivers.push_back(std::move(angle));
  }
  EXPECT_TRUE(spectral_lines(runs, 0.001).empty());
}

TEST(SpectralLines, does_not_take_one_loud_run_for_a_line_of_all) {
  std::mt19937 random(6);
  std::vector<Series> runs = noise_runs(random, Noise::kWhite, 6, 4096), one(1);
  one[0] = runs[0];
  add_line(one, 20, 2.0, {0});
  runs[0] = one[0];
  EXPECT_TRUE(spectral_lines(runs, 0.001).empty());
}

TEST(Periodogram, holds_the_power_of_the_signal_by_parseval) {
  std::mt19937 random(7);
  std::normal_distribution<double> gauss;
  std::vector<double> x(1000);
  for (double& v : x) v = gauss(random);
  std::size_t n = 0;
  const std::vector<double> power = periodogram(x, &n);
  ASSERT_EQ(n, 1000U);
  ASSERT_EQ(power.size(), 501U);
  // Mean and trend by least squares, as the periodogram takes them out.
  double mean = 0, tilt = 0, tt = 0, squares = 0;
  for (std::size_t k = 0; k < n; ++k) mean += x[k] / 1000;
  for (std::size_t k = 0; k < n; ++k) {
    const double t = static_cast<double>(k) - 499.5;
    tilt += t * x[k];
    tt += t * t;
  }
  for (std::size_t k = 0; k < n; ++k)
    squares += std::pow(x[k] - mean - tilt / tt * (static_cast<double>(k) - 499.5), 2);
  double sum = power.front() + power.back();
  for (std::size_t k = 1; k < 500; ++k) sum += 2 * power[k];
  EXPECT_NEAR(sum / 1000, squares, 1e-9 * squares);  // rounding only
}

}  // namespace
}  // namespace isac::explain
