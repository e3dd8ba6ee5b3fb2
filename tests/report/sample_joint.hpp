/// @file
/// A joint fit as the report receives it, made without the estimate room: the seed's parameters, sweeps of a hand, and
/// noise. Test helper; the numbers in `fit` are the truth plus typical errors, not a fit's result.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/report/joint_report.hpp"

namespace isac::report::testing {

struct JointSample {
  estimate::JointFit fit;
  std::vector<estimate::JointRun> runs, heldout;
  estimate::JointFitOptions options;

  [[nodiscard]] JointReportInput input() const {
    return {.rig = "testbed",
            .created = "2003-06-17T10:00:00Z",
            .fit = &fit,
            .runs = runs,
            .heldout = heldout,
            .options = options,
            .terms = {},
            .next_steps = {}};
  }
};

inline constexpr double kA = -23450, kB = 174.2, kC = 0.0026, kD = 0.14, kRadius = 0.019;

/// One sweep: a hand moves the joint with amplitude 0.9 rad at wandering frequency; Δp in kg/cm².
inline void add_run(JointSample& sample, const std::string& name, double frequency, double delta,
                    double seconds, bool heldout, unsigned seed, double rate = 200) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  estimate::JointRun run;
  run.name = name;
  run.experiment = "constant-pressure";
  estimate::RunResidual rows;
  rows.name = name;
  rows.heldout = heldout;
  const auto n = static_cast<std::size_t>(seconds * rate);
  double phase = 0, wander = 0, coloured = 0, square = 0;
  const double amplitude = 0.9;
  for (std::size_t i = 0; i < n; ++i) {
    const double t = static_cast<double>(i) / rate;
    wander += (-0.4 * wander + 0.35 * std::sqrt(rate) * normal(random)) / rate;
    const double omega = 2 * kPi * frequency * std::exp(wander);
    phase += omega / rate;
    const double w = amplitude * omega * std::cos(phase);
    const double phi = amplitude * std::sin(phase);
    const double dp = (delta + 0.012 * w / (1 + std::abs(w)) + 0.004 * normal(random)) * kPascalPerKgfCm2;
    const double torque =
        kA * kRadius * kRadius * phi + kB * kRadius * dp / kPascalPerKgfCm2 - kC * w * w * w - kD * w;
    coloured += (-20 * coloured + 0.6 * std::sqrt(rate) * normal(random)) / rate;
    const double error = 0.01 * normal(random) + 0.12 * coloured;
    run.time.push_back(t);
    run.angle.push_back(std::round(phi * 8000 / (2 * kPi)) * 2 * kPi / 8000);
    run.velocity.push_back(w);
    run.delta_pressure.push_back(dp);
    run.mean_pressure.push_back((3.0 + 0.05 * phi * w / 6) * kPascalPerKgfCm2);
    run.output.push_back(torque + error);
    rows.predicted.push_back(torque);
    square += error * error;
  }
  rows.time = run.time;
  rows.angle = run.angle;
  rows.velocity = run.velocity;
  rows.delta_pressure = run.delta_pressure;
  rows.measured = run.output;
  rows.rmse = std::sqrt(square / static_cast<double>(n));
  sample.fit.runs.push_back(rows);
  (heldout ? sample.heldout : sample.runs).push_back(run);
}

inline Estimated estimated(const std::string& name, const std::string& unit, double value, double std_error) {
  return {.name = name,
          .unit = unit,
          .value = value,
          .std_error = std_error,
          .ci_low = value - 1.98 * std_error,
          .ci_high = value + 1.98 * std_error,
          .reason = {}};
}

inline void finish(JointSample& sample) {
  estimate::JointFit& fit = sample.fit;
  fit.converged = true;
  fit.parameters = {estimated("A", "N/m", -23441.7, 12.3), estimated("B", "N cm2/kg", 174.31, 0.082),
                    estimated("C", "N m s3", 0.002584, 0.000031), estimated("D", "N m s", 0.1407, 0.0012)};
  fit.correlation = {1,    -0.12, 0.03, -0.05, -0.12, 1,    0.01,  0.02,
                     0.03, 0.01,  1,    -0.86, -0.05, 0.02, -0.86, 1};
  fit.rmse = 0.0182;
  fit.nrmse = 0.0009;
  fit.heldout_rmse = 0.0191;
  fit.noise_floor = 0.0103;
  for (const auto& rows : fit.runs)
    if (!rows.heldout) fit.samples += rows.time.size();
  fit.outliers = 37;
  fit.blocks = 96;
  fit.block_seconds = 2.5;
  fit.differentiator = "Savitzky–Golay, 21 samples, order 3";
  fit.box = {.delta_pressure_low = -2 * kPascalPerKgfCm2,
             .delta_pressure_high = 2 * kPascalPerKgfCm2,
             .angle_low = -0.92,
             .angle_high = 0.92,
             .speed_low = -6.4,
             .speed_high = 6.4};
  fit.tests = {{"whiteness", 412.0, 0.0002, false,
                "The residual is not white over 0.1 s; the intervals allow for it, but a small effect with "
                "memory is left."},
               {"velocity", 1.3, 0.25, true, "Nothing is left over that depends on the velocity."}};
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  for (double w = -5.8; w < 5.9; w += 0.4) {
    fit.cut.velocity.push_back(w);
    fit.cut.std_error.push_back(0.008 + 0.004 * std::abs(w));
    fit.cut.torque_offset.push_back(-kC * w * w * w - kD * w + fit.cut.std_error.back() * normal(random));
  }
  fit.cut.C = estimated("C", "N m s3", 0.00265, 0.0001);
  fit.cut.D = estimated("D", "N m s", 0.138, 0.004);
  fit.warnings = {
      {"heldout_small", "Only one run was held out; a second one of another day would tell about drift."}};
}

/// Slow sweeps at five Δp, a fast one, the bundle, and a held-out fast one. `scale` shortens all of them.
inline JointSample joint_sample(double scale = 1.0) {
  JointSample sample;
  unsigned seed = 1;
  for (const double delta : {-2.0, -1.0, 0.0, 1.0, 2.0})
    add_run(sample, "slow_dp" + std::to_string(static_cast<int>(delta)) + ".csv", 0.05, delta, 60 * scale,
            false, seed++);
  add_run(sample, "fast.csv", 0.8, 0.0, 20 * scale, false, seed++);
  add_run(sample, "bundle.csv", 0.45, 0.0, 300 * scale, false, seed++);
  add_run(sample, "heldout/fast2.csv", 0.7, 0.5, 30 * scale, true, seed++);
  finish(sample);
  return sample;
}

}  // namespace isac::report::testing
