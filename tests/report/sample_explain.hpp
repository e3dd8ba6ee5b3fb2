/// @file
/// Hand-made explanations of every verdict, with traces of a joint that has (or lacks) Coulomb friction.
#pragma once

#include <cmath>
#include <random>

#include "isac/explain/explanation.hpp"

namespace isac::report::testing {

inline Estimated number_sample(const char* name, const char* unit, double value, double std_error) {
  Estimated e;
  e.name = name;
  e.unit = unit;
  e.value = value;
  e.std_error = std_error;
  e.ci_low = value - 1.98 * std_error;
  e.ci_high = value + 1.98 * std_error;
  return e;
}

inline explain::RunTrace trace_sample(const std::string& name, bool heldout, double friction,
                                      double mean_pressure, std::uint64_t seed) {
  explain::RunTrace trace;
  trace.run = name;
  trace.signal = "torque";
  trace.unit = "N m";
  trace.heldout = heldout;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 0.01);
  for (int i = 0; i < 3000; ++i) {
    const double t = 0.01 * i, w = 1.1, angle = 0.4 * std::sin(w * t), speed = 0.4 * w * std::cos(w * t);
    const double delta = 0.5 * std::sin(0.21 * t);
    const double smooth = -8.4 * angle + 3.3 * delta - 0.14 * speed;
    trace.time.push_back(t);
    trace.angle.push_back(angle);
    trace.velocity.push_back(speed);
    trace.delta_pressure.push_back(delta);
    trace.mean_pressure.push_back(mean_pressure);
    trace.measured.push_back(smooth - friction * std::copysign(1, speed) + noise(random));
    trace.before.push_back(smooth - 2.2 * friction * speed);
    trace.after.push_back(smooth - friction * std::copysign(1, speed));
  }
  return trace;
}

inline explain::Candidate candidate_sample(const char* id, const char* name, const char* subsystem,
                                           double confidence, double behind) {
  explain::Candidate c;
  c.id = id;
  c.name = name;
  c.subsystem = subsystem;
  c.confidence = confidence;
  c.behind_best = behind;
  c.closes = 0.97 - 0.02 * behind;
  return c;
}

inline explain::Candidate coulomb_sample() {
  explain::Candidate c = candidate_sample("coulomb_friction", "Coulomb friction", "muscle", 0.972, 0);
  c.equation = "-T_c sgn(w)";
  c.parameters = {number_sample("T_c", "N m", 0.301, 0.004)};
  c.evidence = {
      {true, "The residual has the sign of the speed, and its size does not change from 0.05 to 1.2 rad/s."},
      {true, "It is there within one sample of each reversal."},
      {false,
       "The loops are 4 % wider at Δp = 1.5 kg/cm² than at 0, which Coulomb friction does not explain."}};
  return c;
}

/// What all verdicts share: data, floors, limits.
inline explain::Explanation plain_sample(double friction) {
  explain::Explanation e;
  e.p_value = 0.41;
  e.signals = {{.signal = "torque",
                .unit = "N m",
                .rmse = 0.0101,
                .noise_floor = 0.0100,
                .p_value = 0.41,
                .floor_from = "holds"},
               {.signal = "p1",
                .unit = "kg/cm2",
                .rmse = 0.0041,
                .noise_floor = 0.0040,
                .p_value = 0.78,
                .floor_from = "repeats"}};
  e.gap = {.signal = "torque",
           .unit = "N m",
           .before = 0.0101,
           .noise_floor = 0.0100,
           .heldout_before = 0.0103,
           .heldout_zero_model = 2.61};
  e.could_hide = {{.id = "creep", .size = 0.031, .unit = "N m/rad"},
                  {.id = "coulomb_friction", .size = 0.0042, .unit = "N m"}};
  e.not_testable = {"flow_limit", "valve_hysteresis", "gravity_imbalance"};
  e.base = {number_sample("A", "N/m", -23442, 31), number_sample("B", "N cm2/kg", 174.2, 0.4),
            number_sample("D", "N m s", 0.141, 0.006)};
  e.traces = {trace_sample("slow_1.csv", false, friction, 3.0, 1),
              trace_sample("heldout/slow_9.csv", true, friction, 3.0, 2)};
  e.samples = 60000;
  e.blocks = 150;
  e.fitted_runs = 15;
  e.heldout_runs = 3;
  e.seconds = 600;
  e.block_seconds = 4;
  return e;
}

inline explain::Explanation none_sample() {
  explain::Explanation e = plain_sample(0);
  e.verdict = explain::Verdict::kNone;
  return e;
}

inline explain::Explanation immaterial_sample() {
  explain::Explanation e = plain_sample(0.0005);
  e.verdict = explain::Verdict::kImmaterial;
  e.detected = true;
  e.p_value = 0.0005;
  return e;
}

inline explain::Explanation named_sample() {
  explain::Explanation e = plain_sample(0.3);
  e.verdict = explain::Verdict::kNamed;
  e.detected = true;
  e.p_value = 0.0005;
  e.signals[0] = {.signal = "torque",
                  .unit = "N m",
                  .rmse = 0.142,
                  .noise_floor = 0.0100,
                  .p_value = 0.0005,
                  .after = 0.0104,
                  .floor_from = "holds"};
  e.where = {{.subsystem = "muscle",
              .signal = "torque",
              .variable = "velocity",
              .low = -0.1,
              .high = 0.1,
              .unit = "rad/s",
              .share = 0.81}};
  e.effects = {coulomb_sample()};
  e.rejected = {candidate_sample("hysteresis", "rate-independent hysteresis", "muscle", 0.02, 4.1),
                candidate_sample("stribeck_friction", "Stribeck friction", "muscle", 0.005, 5.3)};
  e.rejected[0].evidence = {
      {false, "A hysteresis needs 0.02 rad after a reversal to build up; the residual is there at once."}};
  e.gap = {.signal = "torque",
           .unit = "N m",
           .before = 0.142,
           .after = 0.0104,
           .noise_floor = 0.0100,
           .heldout_before = 0.145,
           .heldout_after = 0.0107,
           .heldout_zero_model = 2.61,
           .share_closed = 0.997};
  e.waterfall = {{.label = "baseline refitted", .rmse = 0.142, .heldout_rmse = 0.145},
                 {.label = "+ Coulomb friction", .rmse = 0.0104, .heldout_rmse = 0.0107}};
  e.base_changes = {{"D", "N m s", 0.81, 0.141, "D fell by 83 %: it had stood in for friction."}};
  e.trials = {{"hysteresis", "ruled out: 4.1 sigma behind coulomb_friction"},
              {"", "nothing more is significant"}};
  return e;
}

inline explain::Explanation tied_sample(explain::Verdict verdict) {
  explain::Explanation e = named_sample();
  e.verdict = verdict;
  e.effects[0].confidence = 0.55;
  const bool family = verdict == explain::Verdict::kFamily;
  e.alternatives = {family
                        ? candidate_sample("hysteresis", "rate-independent hysteresis", "muscle", 0.40, 0.4)
                        : candidate_sample("pressure_dependent_friction", "load-dependent Coulomb friction",
                                           "muscle", 0.44, 0.1)};
  e.alternatives[0].parameters = {number_sample("T_c", "N m", 0.3, 0.01), number_sample("n", "-", 1.2, 0.9)};
  e.alternatives[0].evidence = {{false, "The mean pressure never changed, so its exponent is not known."}};
  e.next_experiment.emplace();
  e.next_experiment->sentence =
      "Sweep the bar slowly for 60 s at mean pressures of 2, 3 and 4 kg/cm²: load-dependent friction grows "
      "with it.";
  e.next_experiment->separates_a = "coulomb_friction";
  e.next_experiment->separates_b = "pressure_dependent_friction";
  e.next_experiment->separation_now = 0.4;
  e.next_experiment->separation_expected = 9.2;
  for (const double mean : {2.0, 3.0, 4.0})
    e.next_experiment->runs.push_back({.experiment = "constant-pressure",
                                       .seconds = 60,
                                       .mean_pressure_kgcm2 = mean,
                                       .amplitude_rad = 0.35,
                                       .waveform = "triangle"});
  e.next_experiment->runs.push_back(
      {.experiment = "free", .seconds = 40, .pressure_swing_kgcm2 = 0.6, .waveform = "steps"});
  return e;
}

inline explain::Explanation unknown_sample() {
  explain::Explanation e = named_sample();
  e.verdict = explain::Verdict::kUnknown;
  e.effects.clear();
  e.base_changes.clear();
  e.waterfall.clear();
  e.gap.after = e.gap.heldout_after = e.gap.share_closed = explain::kNotKnown;
  for (explain::RunTrace& trace : e.traces) trace.after.clear();
  e.unknown.emplace();
  e.unknown->subsystem = "muscle";
  e.unknown->signal = "torque";
  e.unknown->depends_on = {"angle", "velocity"};
  e.unknown->independent = {"mean_pressure", "time"};
  e.unknown->share = 0.83;
  e.unknown->variable = "angle";
  e.unknown->variable_unit = "rad";
  e.unknown->unit = "N m";
  for (int i = -20; i <= 20; ++i) {
    e.unknown->at.push_back(0.02 * i);
    e.unknown->shape.push_back(0.1 * std::sin(0.3 * i));
    e.unknown->band.push_back(0.02);
  }
  return e;
}

inline explain::Explanation two_sample() {
  explain::Explanation e = named_sample();
  e.effects.push_back(candidate_sample("dead_time", "transport delay of the tubes", "pcu", 0.991, 0));
  e.effects.back().equation = "u(t - L)";
  e.effects.back().parameters = {number_sample("L", "s", 0.0214, 0.0003)};
  e.waterfall.insert(e.waterfall.begin() + 1,
                     {.label = "+ transport delay of the tubes", .rmse = 0.09, .heldout_rmse = 0.093});
  return e;
}

}  // namespace isac::report::testing
