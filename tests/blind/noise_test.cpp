#include "noise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace blind {
namespace {

double covariance(const std::vector<double>& x, std::size_t lag) {
  double sum = 0.0;
  for (std::size_t k = lag; k < x.size(); ++k) sum += x[k] * x[k - lag];
  return sum / static_cast<double>(x.size() - lag);
}

/// A muscle pair at rest, for `rows` rows.
Signals at_rest(std::size_t rows, double angle) {
  const auto column = [&](double value) { return std::vector<double>(rows, value); };
  return {column(angle), column(3.0), column(3.0), column(360.0), column(360.0)};
}

/// What noise adds to r (F2 − F1).
std::vector<double> torque_noise(const Signals& noisy, double r) {
  std::vector<double> T(noisy.F1.size());
  for (std::size_t k = 0; k < T.size(); ++k) T[k] = r * (noisy.F2[k] - noisy.F1[k]);
  return T;
}

TEST(Noise, of_the_white_kind_has_the_stated_spread_and_no_memory) {
  Random random(3);
  const Rig rig;
  const Noise noise = draw_noise("white", rig, random, {});
  const auto T = torque_noise(add_noise(at_rest(100000, 0.1), noise, rig, random), rig.r);
  // The variance of 1e5 white values is known to 0.45 %, a correlation to 0.003: four of these.
  EXPECT_NEAR(covariance(T, 0) / std::pow(noise.torque_floor(rig.r), 2), 1.0, 0.018);
  for (const std::size_t lag : {1u, 5u, 50u})
    EXPECT_NEAR(covariance(T, lag) / covariance(T, 0), 0.0, 0.013) << lag;
}

TEST(Noise, of_the_coloured_kind_keeps_its_memory) {
  Random random(5);
  const double memory = 0.08;
  const std::vector<double> x = ornstein_uhlenbeck(400000, 2.0, memory, random);
  // 800 s hold 800/(2·0.08) = 5000 independent values: variance to 2 %, three of these.
  EXPECT_NEAR(covariance(x, 0), 4.0, 4.0 * 0.06);
  for (const std::size_t lag : {10u, 40u, 80u})
    EXPECT_NEAR(covariance(x, lag) / covariance(x, 0),
                std::exp(-static_cast<double>(lag) * kRowTime / memory), 0.05)
        << lag;
}

TEST(Noise, of_the_coloured_kind_falls_off_as_its_spectrum_says) {
  Random random(6);
  const double memory = 0.1, seconds = 800.0;
  const auto count = static_cast<std::size_t>(seconds * kRate);
  const std::vector<double> x = ornstein_uhlenbeck(count, 1.0, memory, random);
  // S(f) = 4 τ/(1 + (2π f τ)²): the mean over a band of 0.5 Hz, which is 400 lines, is known to 5 %.
  const auto band = [&](double from) {
    double power = 0.0;
    for (int line = 0; line < 40; ++line) {
      const double omega = 2.0 * std::numbers::pi * (from + line / seconds) * kRowTime;
      double re = 0.0, im = 0.0;
      for (std::size_t k = 0; k < count; ++k) {
        re += x[k] * std::cos(omega * static_cast<double>(k));
        im += x[k] * std::sin(omega * static_cast<double>(k));
      }
      power += 2.0 * (re * re + im * im) / (static_cast<double>(count) * kRate);
    }
    return power / 40.0;
  };
  for (const double f : {0.5, 2.0, 8.0}) {
    const double expected = 4.0 * memory / (1.0 + std::pow(2.0 * std::numbers::pi * (f + 0.025) * memory, 2));
    EXPECT_NEAR(band(f) / expected, 1.0, 0.55) << f;  // 40 lines: 16 %, three and a half of these
  }
}

TEST(Noise, states_the_floor_that_it_has_for_every_kind_without_recordings) {
  for (const char* kind : {"white", "coloured", "quantised"}) {
    Random random(11);
    const Rig rig;
    const Noise noise = draw_noise(kind, rig, random, {});
    double torque = 0.0, pressure = 0.0;
    const int runs = 60;
    for (int i = 0; i < runs; ++i) {
      const Signals clean = at_rest(5000, 0.1), noisy = add_noise(clean, noise, rig, random);
      torque += covariance(torque_noise(noisy, rig.r), 0) / runs;
      for (std::size_t k = 0; k < 5000; ++k) pressure += std::pow(noisy.p1[k] - 3.0, 2) / 5000 / runs;
    }
    // The slow wander gives few independent values: 60 runs, two zeros, so its variance is known to 13 %.
    EXPECT_NEAR(std::sqrt(torque) / noise.torque_floor(rig.r), 1.0, 0.15) << kind;
    EXPECT_NEAR(std::sqrt(pressure) / noise.pressure_floor(), 1.0, 0.05) << kind;
  }
}

TEST(Noise, of_the_quantised_kind_stands_on_the_steps_of_its_converters) {
  Random random(2);
  const Rig rig;
  const Noise noise = draw_noise("quantised", rig, random, {});
  const Signals noisy = add_noise(at_rest(2000, 0.1234), noise, rig, random);
  for (std::size_t k = 0; k < 2000; ++k) {
    const double force = noisy.F1[k] / noise.force_step, pressure = noisy.p2[k] / noise.pressure_step;
    ASSERT_NEAR(force, std::round(force), 1e-9);
    ASSERT_NEAR(pressure, std::round(pressure), 1e-9);
  }
}

TEST(Noise, lets_the_encoder_read_the_middle_of_the_step_it_is_in) {
  Random random(2);
  const double step = 2.0 * std::numbers::pi / 8000.0;
  for (const double angle : {-0.3, -1e-5, 1e-5, 0.77}) {
    const Rig rig;
    const double read = add_noise(at_rest(1, angle), Noise{}, rig, random).angle[0];
    EXPECT_LE(std::abs(read - angle), 0.5 * step * (1 + 1e-9));
    EXPECT_NEAR(read / step - 0.5, std::round(read / step - 0.5), 1e-9);
  }
}

TEST(Noise, refuses_a_kind_that_it_does_not_know) {
  Random random(1);
  EXPECT_THROW(draw_noise("pink", Rig{}, random, {}), std::invalid_argument);
}

}  // namespace
}  // namespace blind
