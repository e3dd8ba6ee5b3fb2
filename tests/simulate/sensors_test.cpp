// Sensors: conversion, noise, lag, calibration experiments.
#include "isac/simulate/sensors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace isac::simulate {
namespace {

constexpr double kP = kPascalPerKgfCm2;

PlantState still(double t, double f1, double f2, double angle) {
  PlantState s;
  s.time = t;
  s.pressure = {2 * kP, 4 * kP};
  s.force = {f1, f2};
  s.joint.angle = angle;
  return s;
}

RigConfig quiet() {
  RigConfig config;
  config.sensors.noise = NoiseKind::kNone;
  return config;
}

TEST(Sensors, codes_are_the_nearest_step_of_the_converter) {
  Sensors sensors(quiet());
  const double step = 200.0 / 4096;
  for (int k = 0; k < 400; ++k) {
    const double force = -9 + 0.49 * k;
    const PlantState s = still(0.002 * k, force, 100, 0);
    sensors.track(s);
    sensors.track(still(0.002 * k + 0.0019, force, 100, 0));  // twelve amplifier lags later
    const Codes codes = sensors.convert(s);
    // Half a step, and e^-12 of the change of 0.49 N.
    ASSERT_NEAR((codes.input[0] - 205.0) * step, force, 0.5 * step + 1e-5);
  }
}

TEST(Sensors, small_push_is_seen_and_overload_is_clipped) {
  Sensors sensors(quiet());
  const auto codes = [&](double t, double force) {
    sensors.track(still(t, force, force, 0));
    return sensors.convert(still(t, force, force, 0));
  };
  EXPECT_EQ(codes(0, -5).input[0], 103u);  // 205 − 5/200 · 4096 = 102.6
  EXPECT_EQ(codes(1, 300).input[2], 4095u);
  EXPECT_EQ(codes(2, -50).input[2], 0u);
  EXPECT_EQ(codes(3, 0).input[1], 0u);  // not connected
}

TEST(Sensors, encoder_counts_steps_downwards_to_minus_infinity_and_wraps) {
  Sensors sensors(quiet());
  const auto count = [&](double angle) { return sensors.convert(still(0, 0, 0, angle)).encoder; };
  const double step = 2 * kPi / 8000;
  EXPECT_EQ(count(0), 0u);
  EXPECT_EQ(count(0.9 * step), 0u);
  EXPECT_EQ(count(1.1 * step), 1u);
  EXPECT_EQ(count(-0.1 * step), Sensors::kEncoderModulus - 1);
  EXPECT_EQ(count(kPi), 4000u);
}

TEST(Sensors, amplifier_is_a_lag_of_one_kilohertz) {
  FirstOrderLag lag(1 / (2 * kPi * 1000));
  lag.reset(0, 0);
  // A ramp of 1 per ms from 0: y = u − m τ (1 − e^(−t/τ)).
  const double tau = 1 / (2 * kPi * 1000);
  EXPECT_NEAR(lag.update(0.0005, 0.5), 0.5 - 1000 * tau * (1 - std::exp(-0.0005 / tau)), 1e-12);
  EXPECT_NEAR(lag.update(0.002, 2.0), 2.0 - 1000 * tau, 1e-6);
  // A sine of 100 Hz, given every 20 µs: amplitude and phase of 1/(1 + jωτ).
  FirstOrderLag sine(tau);
  const double omega = 2 * kPi * 100;
  sine.reset(0, 0);
  double worst = 0;
  for (int k = 1; k < 2000; ++k) {
    const double t = 2e-5 * k, y = sine.update(t, std::sin(omega * t));
    const double exact = std::sin(omega * t - std::atan(omega * tau)) / std::hypot(1, omega * tau);
    if (t > 0.005) worst = std::max(worst, std::abs(y - exact));
  }
  EXPECT_LT(worst, (omega * 2e-5) * (omega * 2e-5) / 8);  // error of straight lines between the points
}

std::vector<double> noise_of(NoiseKind kind, double dt, int n, double slow_share = 0.5) {
  RigConfig config;
  config.sensors.noise = kind;
  config.sensors.slow_share = slow_share;
  config.seed = 17;
  Sensors sensors(config);
  std::vector<double> x;
  for (int k = 0; k < n; ++k) {
    const PlantState s = still(dt * k, 100, 100, 0);
    sensors.track(s);
    x.push_back((sensors.convert(s).input[0] - 205.0) * 200 / 4096 - 100);
  }
  return x;
}

double autocovariance(const std::vector<double>& x, std::size_t lag) {
  double mean = 0, sum = 0;
  for (const double v : x) mean += v / static_cast<double>(x.size());
  for (std::size_t k = lag; k < x.size(); ++k) sum += (x[k] - mean) * (x[k - lag] - mean);
  return sum / static_cast<double>(x.size() - lag);
}

TEST(Sensors, noise_has_the_variance_asked_for_and_white_noise_is_white) {
  const auto x = noise_of(NoiseKind::kWhite, 0.002, 100000);
  const double step = 200.0 / 4096;
  // σ² = 0.09 N² and the converter's step²/12; the estimate scatters by sqrt(2/n) = 0.45 %: five of that.
  EXPECT_NEAR(autocovariance(x, 0), 0.09 + step * step / 12, 0.09 * 0.023);
  for (const std::size_t lag : {1u, 2u, 10u})
    EXPECT_NEAR(autocovariance(x, lag), 0, 0.09 * 5 / std::sqrt(1e5)) << lag;
}

TEST(Sensors, coloured_noise_has_the_pole_of_its_slow_part) {
  const double dt = 0.002, pole = std::exp(-dt / 0.02);
  const auto x = noise_of(NoiseKind::kColoured, dt, 200000);
  // White part and converter sit at lag 0 only, so γ(k+1)/γ(k) is the pole from lag 1 on.
  const double estimate = std::pow(autocovariance(x, 6) / autocovariance(x, 1), 0.2);
  EXPECT_NEAR(estimate, pole, 0.01);  // Monte Carlo over seeds 1 … 20: standard deviation 0.002
  EXPECT_NEAR(autocovariance(x, 0), 0.09 + 0.0002, 0.09 * 0.05);
  EXPECT_NEAR(autocovariance(x, 1) / pole, 0.045, 0.045 * 0.1);
}

TEST(Sensors, coloured_noise_does_not_depend_on_the_spacing_of_samples) {
  const auto x = noise_of(NoiseKind::kColoured, 0.01, 100000, 1.0);
  EXPECT_NEAR(autocovariance(x, 1) / autocovariance(x, 0), std::exp(-0.5), 0.02);
}

TEST(Sensors, histogram_of_codes_is_that_of_a_normal_distribution) {
  const auto x = noise_of(NoiseKind::kWhite, 0.002, 100000);
  // Codes within ±σ of the mean: the normal distribution integrated over whole steps.
  const double step = 200.0 / 4096, sigma = 0.3;
  int inside = 0;
  for (const double v : x) inside += std::abs(v) < sigma;
  const double edge = (std::floor((sigma) / step) + 0.5) * step;
  const double expected = std::erf(edge / sigma / std::numbers::sqrt2);
  EXPECT_NEAR(inside / 1e5, expected, 0.01);  // binomial scatter 0.0015; 100 N is not a whole code: 0.005
}

TEST(Sensors, hum_stands_at_its_frequency) {
  RigConfig config;
  config.sensors.noise = NoiseKind::kWhite;
  config.sensors.force_noise = 0.05;
  config.sensors.force_hum = 1;
  Sensors sensors(config);
  double re = 0, im = 0;
  const int n = 5000;
  for (int k = 0; k < n; ++k) {
    const PlantState s = still(0.002 * k, 100, 100, 0);
    sensors.track(s);
    const double x = (sensors.convert(s).input[0] - 205.0) * 200 / 4096 - 100;
    re += x * std::cos(2 * kPi * 60 * 0.002 * k) * 2 / n;
    im += x * std::sin(2 * kPi * 60 * 0.002 * k) * 2 / n;
  }
  EXPECT_NEAR(std::hypot(re, im), 1, 0.01);  // 10 s are 600 whole periods; noise adds 0.05/sqrt(n/2) = 0.001
}

TEST(Sensors, hung_weight_and_supply_replace_the_rig_until_they_are_taken_off) {
  Sensors sensors(quiet());
  const auto codes = [&](double t) {
    sensors.track(still(t, 50, 60, 0));
    const PlantState s = still(t + 0.01, 50, 60, 0);  // sixty amplifier lags later
    sensors.track(s);
    return sensors.convert(s);
  };
  EXPECT_EQ(codes(0).input[0], 1229u);  // 205 + 50/200 · 4096
  sensors.hang_weight(149.1);
  sensors.connect_supply(5 * kP);
  EXPECT_EQ(codes(1).input[2], 3259u);  // 205 + 149.1/200 · 4096 = 3258.6
  EXPECT_EQ(codes(2).input[6], 2089u);  // 41 + 5/10 · 4096
  sensors.hang_weight(0.0);
  EXPECT_EQ(codes(3).input[0], 205u);
  sensors.hang_weight({});
  sensors.connect_supply({});
  EXPECT_EQ(codes(4).input[0], 1229u);
  EXPECT_EQ(codes(5).input[4], 860u);  // 41 + 2/10 · 4096 = 860.2
}

TEST(Sensors, miscalibrated_rig_differs_slightly_and_by_its_seed) {
  RigConfig config;
  const Wiring nominal = wiring_of(config);
  config.miscalibrated = true;
  const Wiring one = wiring_of(config);
  config.seed = 2;
  const Wiring two = wiring_of(config);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NE(one.force[i].gain, nominal.force[i].gain);
    EXPECT_NE(one.force[i].gain, two.force[i].gain);
    EXPECT_NEAR(one.force[i].gain / nominal.force[i].gain, 1, 0.03);
    EXPECT_NEAR(one.pressure[i].gain / nominal.pressure[i].gain, 1, 0.03);
    EXPECT_NEAR(one.valve[i].gain / nominal.valve[i].gain, 1, 0.03);
    EXPECT_NEAR(one.force[i].offset, nominal.force[i].offset, 25);
  }
  EXPECT_NE(one.encoder_middle, 0);
}

}  // namespace
}  // namespace isac::simulate
