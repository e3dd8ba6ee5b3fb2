/// @file
/// Results of the smaller fits as the report receives them, made without the estimate room. Test helper; the numbers are
/// the truth plus typical errors, not a fit's result.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::report::testing {

inline Estimated number_of(const std::string& name, const std::string& unit, double value, double std_error) {
  return {.name = name,
          .unit = unit,
          .value = value,
          .std_error = std_error,
          .ci_low = value - 1.98 * std_error,
          .ci_high = value + 1.98 * std_error,
          .reason = {}};
}

inline estimate::PcuStep pcu_step(const std::string& run, double from, double to, double lag,
                                  bool first_order, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  estimate::PcuStep step;
  step.run = run;
  step.direction = to > from ? estimate::StepDirection::kFilling : estimate::StepDirection::kVenting;
  step.step_time = 1.0;
  step.level_from = from * kPascalPerKgfCm2;
  step.level_to = to * kPascalPerKgfCm2;
  step.gain = number_of("K_C", "-", 0.998, 0.001);
  step.lag = number_of("T_C", "s", lag, 0.0012);
  step.dead_time = number_of("dead_time", "s", 0.012, 0.0004);
  step.start = number_of("start", "s", 1.012, 0.0004);
  step.rmse = 0.011 * kPascalPerKgfCm2;
  step.adequacy.first_order = first_order;
  step.adequacy.sentence =
      first_order ? "a first-order lag describes it to 0.8 % of the step."
                  : "the rise begins with a constant slope; the first-order curve misses it by 14 %.";
  for (double t = 0.8; t < 2.6; t += 0.004) {
    const double s = t - step.start.value;
    const double share = s > 0 ? 1 - std::exp(-s / lag) : 0;
    const double bend = first_order || s < 0 ? 0 : 0.12 * std::sin(3 * s) * std::exp(-3 * s);
    step.time.push_back(t);
    step.predicted.push_back((from + (to - from) * share) * kPascalPerKgfCm2);
    step.measured.push_back(step.predicted.back() +
                            ((to - from) * bend + 0.011 * normal(random)) * kPascalPerKgfCm2);
  }
  step.samples = step.time.size();
  return step;
}

inline estimate::PcuFit pcu_sample() {
  estimate::PcuFit fit;
  fit.converged = true;
  fit.steps = {pcu_step("a.csv p1", 0, 5, 0.171, true, 1), pcu_step("a.csv p1", 5, 0.4, 0.224, true, 2),
               pcu_step("b.csv p1", 1, 3, 0.169, true, 3), pcu_step("b.csv p1", 3, 1, 0.226, false, 4)};
  fit.parameters = {number_of("K_C", "-", 0.9984, 0.0011), number_of("T_C", "s", 0.1974, 0.0009),
                    number_of("dead_time", "s", 0.0121, 0.0003), number_of("T_fill", "s", 0.1704, 0.0008),
                    number_of("T_vent", "s", 0.2251, 0.0010)};
  Estimated refused;
  refused.name = "K_vent";
  refused.unit = "-";
  refused.identifiable = false;
  refused.reason = "no command was recorded for the venting steps; log p1_cmd.";
  fit.parameters.push_back(refused);
  fit.rmse = 0.0113 * kPascalPerKgfCm2;
  fit.nrmse = 0.0023;
  fit.first_order = false;
  fit.directions_differ = true;
  return fit;
}

inline estimate::MuscleFit muscle_sample() {
  estimate::MuscleFit fit;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const double kMisfit[] = {4, 11, 25};
  const char* kNames[] = {"M5 Kerscher", "M2 Bridgestone", "M1 Schulte"};
  const char* kIds[] = {"kerscher", "bridgestone", "schulte"};
  for (int m = 0; m < 3; ++m) {
    estimate::MuscleModelResult model;
    model.id = kIds[m];
    model.name = kNames[m];
    model.equation = "F = A0 (a (1 − ε)² − b) p";
    model.parameters = {number_of("a", "-", 4.21 + m, 0.02), number_of("b", "-", 1.13, 0.01)};
    model.train_rmse = kMisfit[m];
    model.heldout_rmse = 1.2 * kMisfit[m];
    for (int k = 0; k < 6; ++k) {
      estimate::MuscleRunResult run;
      run.name = "isometric.csv";
      run.heldout = k >= 4;
      for (double p = 0; p < 6e5; p += 1e4) {
        const double e = 0.04 * k + 0.02 * (k >= 4);
        run.pressure.push_back(p);
        run.contraction.push_back(e);
        run.measured.push_back(std::max(0.0, 7.85e-5 * p * (4.2 * (1 - e) * (1 - e) - 1.13) * 6 - 20) +
                               3 * normal(random));
        run.predicted.push_back(run.measured.back() + kMisfit[m] * std::sin(p / 1e5) + normal(random));
      }
      model.runs.push_back(run);
    }
    fit.ranking.push_back(model);
  }
  fit.hysteresis = {{"isometric.csv", 9.2, 17.4, 2.1e5}};
  return fit;
}

inline estimate::ChannelCalibration channel_sample(const std::string& name, bool curved) {
  estimate::ChannelCalibration channel;
  channel.name = name;
  channel.offset = number_of("offset", "count", 204.6, 0.3);
  channel.gain = number_of("gain", "count/Pa", 0.00742, 0.000002);
  channel.sensitivity = number_of("sensitivity", "Pa/count", 134.8, 0.04);
  channel.full_scale = number_of("full_scale", "count", 3640, 0.8);
  channel.linearity = curved ? estimate::Linearity::kCurved : estimate::Linearity::kLinear;
  channel.nonlinearity = curved ? 0.012 : 0.0004;
  channel.sentence =
      curved ? "the channel bends by 1.2 % of full scale." : "the channel is a line to 0.04 % of full scale.";
  for (int k = 0; k <= 5; ++k) {
    const double reference = k * kPascalPerKgfCm2;
    const double residual = curved ? 20 * (k - 2.5) * (k - 2.5) / 6.25 - 10 : 0.4 * (k % 2 == 0 ? 1 : -1);
    channel.levels.push_back({.reference = reference,
                              .mean = 204.6 + 0.00742 * reference + residual,
                              .std_error = 0.35,
                              .residual = residual,
                              .samples = 2500,
                              .averages = 100});
  }
  return channel;
}

inline estimate::MiddleCalibration middle_sample() {
  return {.middle = number_of("EncMiddlePosition", "count", 4012.3, 0.8),
          .side_difference = number_of("side_difference", "count", 2.1, 1.6),
          .approaches = {4013, 4011, 4014, 4012, 4011, 4013},
          .warnings = {}};
}

inline series::Recording recording_sample(std::size_t rows, const std::string& source = "runs/slow 1.csv") {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  series::Recording out{
      .source = source, .sha256 = {}, .metadata = {{"experiment", "constant-pressure"}}, .columns = {}};
  out.columns = {{"time", "s", {}}, {"angle", "rad", {}}, {"p1", "Pa", {}}, {"torque", "N m", {}}};
  double t = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    t += 0.002 * (1 + 0.03 * normal(random)) + (i % 4001 == 4000 ? 0.02 : 0.0);
    const double phase = 2 * kPi * 12.0 * static_cast<double>(i) / static_cast<double>(rows);
    out.columns[0].values.push_back(t);
    out.columns[1].values.push_back(0.9 * std::sin(phase));
    out.columns[2].values.push_back(3 * kPascalPerKgfCm2 + 500 * normal(random));
    const bool gone = i > rows / 2 && i < rows / 2 + rows / 15;
    out.columns[3].values.push_back(gone ? std::nan("") : -7 * std::sin(phase) + 0.05 * normal(random));
  }
  return out;
}

}  // namespace isac::report::testing
