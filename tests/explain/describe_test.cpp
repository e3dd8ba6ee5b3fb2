#include "isac/explain/describe.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "isac/explain/explain.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/variable_words.hpp"
#include "isac/explain/where.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

using test::by_hand;
using test::clamped;
using test::TiedRig;

ExplainOptions options_for(const TiedRig& rig) {
  ExplainOptions options;
  options.rig = rig.facts();
  options.next_experiment = false;
  return options;
}

std::vector<PlannedRun> fitted_runs() {
  std::vector<PlannedRun> runs = {by_hand(20, 0.4, 1.5), by_hand(20, 0.5, 0.4, 0.3),
                                  by_hand(16, 0.3, 2.5, -0.2), clamped(16, 0.2, 0.6, 6),
                                  clamped(12, -0.3, 0.5, 5, "steps")};
  const double mean[] = {3.0, 2.5, 3.5, 3.3, 2.7};
  for (std::size_t i = 0; i < runs.size(); ++i) runs[i].mean_pressure_kgcm2 = mean[i];
  return runs;
}

bool says(const std::vector<Evidence>& evidence, const std::string& words) {
  for (const Evidence& line : evidence)
    if (line.sentence.find(words) != std::string::npos) return true;
  return false;
}

const Explanation& dry_friction() {
  static const Explanation e = [] {
    TiedRig rig;
    rig.dry = 0.03;
    const auto held = test::record_all(rig, {by_hand(15, 0.45, 1.0, 0.1)}, 50);
    return explain(test::record_all(rig, fitted_runs()), HeldOut(held), options_for(rig));
  }();
  return e;
}

TEST(Describe, says_what_is_missing_how_large_and_what_it_closes) {
  const Explanation& e = dry_friction();
  std::printf("%s\n", e.summary.c_str());
  ASSERT_FALSE(e.effects.empty());
  EXPECT_EQ(e.effects.front().id, "coulomb_friction");
  for (const char* words : {"Torque: the baseline misses ", "against a floor of ", "Coulomb friction",
                            "T_c = 0.0", " ± ", "held-out runs"})
    EXPECT_NE(e.summary.find(words), std::string::npos) << words;
  const Estimated& size = e.effects.front().parameters.front();
  EXPECT_GT(size.std_error, 0);
  EXPECT_LT(size.std_error, 0.003);                            // a tenth of what is there
  EXPECT_LT(std::abs(size.value - 0.03), 4 * size.std_error);  // one draw of noise
  EXPECT_LT(size.ci_low, size.value);
  EXPECT_GT(size.ci_high, size.value);
}

TEST(Describe, tells_the_evidence_in_numbers_of_this_data) {
  const Explanation& e = dry_friction();
  ASSERT_FALSE(e.effects.empty());
  const Candidate& named = e.effects.front();
  for (const Evidence& line : named.evidence)
    std::printf("%c %s\n", line.supports ? '+' : '-', line.sentence.c_str());
  EXPECT_TRUE(says(named.evidence, "A model fitted without it misses "));
  EXPECT_TRUE(says(named.evidence, "standard errors from its absence"));
  EXPECT_TRUE(says(named.evidence, "highest: it stays"));  // the loop's width does not go with the speed
  EXPECT_NEAR(named.closes, 1, 0.01);  // the projected refit and the joint one end that close
  for (const Candidate& c : e.rejected) EXPECT_FALSE(c.evidence.empty()) << c.id;
}

TEST(Describe, shows_the_gap_by_signal_by_step_and_by_run) {
  const Explanation& e = dry_friction();
  ASSERT_GE(e.waterfall.size(), 2U);
  EXPECT_EQ(e.waterfall.front().label, "baseline");
  EXPECT_DOUBLE_EQ(e.waterfall.front().rmse, e.gap.before);
  EXPECT_LT(e.waterfall.back().rmse, e.waterfall.front().rmse);
  EXPECT_LT(e.waterfall.back().heldout_rmse, e.waterfall.front().heldout_rmse);
  ASSERT_FALSE(e.signals.empty());
  EXPECT_EQ(e.signals.front().signal, "torque");
  EXPECT_LT(e.signals.front().p_value, 0.005);
  ASSERT_FALSE(e.traces.empty());
  EXPECT_TRUE(e.traces.front().heldout);
  for (const RunTrace& t : e.traces) {
    EXPECT_LE(t.time.size(), 2000U);
    EXPECT_EQ(t.time.size(), t.after.size());
  }
  for (const Estimated& b : e.base)
    if (b.name == "D") {
      EXPECT_GT(b.std_error, 0);
      EXPECT_NEAR(b.value, 0.14,
                  6 * b.std_error);  // the encoder's steps bias it by less than its error twice
    }
}

TEST(Where, finds_friction_in_the_muscle_while_the_joint_moves) {
  const Explanation& e = dry_friction();
  ASSERT_FALSE(e.where.empty());
  bool moving = false;
  for (const Region& r : e.where) {
    moving = moving || (r.variable == "direction" && r.low == -1 && r.high == 1 && r.share > 0.9);
    std::printf("%s %s %s %.3g %.3g %.2f\n", r.subsystem.c_str(), r.signal.c_str(), r.variable.c_str(), r.low,
                r.high, r.share);
    EXPECT_FALSE(in_words(r).empty());
    EXPECT_EQ(r.subsystem, "muscle");
    EXPECT_EQ(r.signal, "torque");
    EXPECT_GT(r.share, 0);
    EXPECT_LE(r.share, 1);
  }
  EXPECT_TRUE(moving);
}

TEST(CouldHide, bounds_what_the_data_would_not_show_and_names_no_effect_twice) {
  TiedRig rig;
  const Explanation e = explain(test::record_all(rig, fitted_runs()), HeldOut{}, options_for(rig));
  std::printf("%s\n", e.summary.c_str());
  ASSERT_EQ(e.verdict, Verdict::kNone);
  EXPECT_NE(e.summary.find("Nothing is missing"), std::string::npos);
  ASSERT_FALSE(e.could_hide.empty());
  for (std::size_t i = 0; i < e.could_hide.size(); ++i) {
    EXPECT_GT(e.could_hide[i].size, 0);
    for (std::size_t k = 0; k < i; ++k) EXPECT_NE(e.could_hide[i].id, e.could_hide[k].id);
    for (const std::string& id : e.not_testable) EXPECT_NE(e.could_hide[i].id, id);
    // Friction of 0.03 N m is seen in this data (the tests above): no more than half of it can hide.
    if (e.could_hide[i].id == "coulomb_friction") {
      EXPECT_LT(e.could_hide[i].size, 0.015);
    }
  }
  EXPECT_TRUE(e.where.empty());
}

TEST(Floor, holds_the_slow_part_of_the_noise_that_no_model_can_close) {
  TiedRig rig;
  auto runs = test::record_all(rig, fitted_runs());
  std::mt19937 random(31);
  std::normal_distribution<double> gauss;
  constexpr double kSlow = 0.010, kMemory = 0.2;  // N m, s
  for (series::Recording& run : runs) {
    const double stay = std::exp(-0.002 / kMemory);
    double z = kSlow * gauss(random);
    for (std::size_t k = 0; k < run.columns[0].values.size(); ++k) {
      run.columns[6].values[k] -= 0.5 * z / rig.radius;
      run.columns[7].values[k] += 0.5 * z / rig.radius;
      z = stay * z + kSlow * std::sqrt(1 - stay * stay) * gauss(random);
    }
  }
  const Explanation e = explain(runs, HeldOut(), options_for(rig));
  const double white = rig.radius * std::sqrt(2.0) * rig.force_noise;
  ASSERT_FALSE(e.signals.empty());
  // 84 s hold some 200 memories: the slow part's variance is known to a tenth, so the floor to 3 %; three of that.
  EXPECT_NEAR(e.signals.front().noise_floor, std::hypot(white, kSlow), 0.1 * std::hypot(white, kSlow));
}

TEST(RawEffects, names_hum_and_spikes_that_the_low_passed_rows_cannot_show) {
  TiedRig rig;
  auto runs = test::record_all(rig, fitted_runs()),
       held = test::record_all(rig, {by_hand(15, 0.45, 1.0)}, 60);
  std::mt19937 random(8);
  std::uniform_real_distribution<double> uniform(0, 6.283185307179586);
  for (auto* all : {&runs, &held})
    for (series::Recording& run : *all) {
      const double phase = uniform(random);
      for (std::size_t k = 0; k < run.columns[0].values.size(); ++k) {
        const double hum = 0.5 * std::sin(6.283185307179586 * 50 * run.columns[0].values[k] + phase);
        run.columns[6].values[k] -= 0.5 * hum;
        run.columns[7].values[k] += 0.5 * hum;
        if (k % 731 == 365) run.columns[7].values[k] += 12;
      }
    }
  const Explanation e = explain(runs, HeldOut(held), options_for(rig));
  std::printf("%s\n", e.summary.c_str());
  ASSERT_EQ(e.verdict, Verdict::kNamed);
  const auto find = [&](const char* id) {
    for (const Candidate& c : e.effects)
      if (c.id == id) return &c;
    return static_cast<const Candidate*>(nullptr);
  };
  ASSERT_EQ(e.effects.size(), 2U);
  ASSERT_NE(find("mains_hum"), nullptr);
  EXPECT_NEAR(find("mains_hum")->parameters[0].value, 0.5, 0.03);  // noise of 0.42 N in 42000 samples: 0.003
  EXPECT_NEAR(find("mains_hum")->parameters[2].value, 50,
              0.01);  // a fifth of the longest run's bin of 0.05 Hz
  ASSERT_NE(find("spikes"), nullptr);
  EXPECT_NEAR(find("spikes")->parameters[1].value, 12, 0.5);  // noise of 0.52 N, 57 spikes: 0.09
  EXPECT_NEAR(find("spikes")->parameters[0].value, 0.5 / 731, 1e-4);
  EXPECT_LT(e.gap.heldout_after, e.gap.heldout_before);
  EXPECT_NEAR(e.gap.heldout_after, 0.019 * std::sqrt(2.0) * 0.3, 0.0006);  // the forces' noise alone, and 7 %
  // Out of the catalogue it has no name, and is there all the same.
  ExplainOptions without = options_for(rig);
  without.excluded = {"spikes"};  // the larger of the two
  const Explanation unnamed = explain(runs, HeldOut(held), without);
  EXPECT_EQ(unnamed.verdict, Verdict::kUnknown);
  EXPECT_TRUE(unnamed.detected && unnamed.effects.empty());
  ASSERT_TRUE(unnamed.unknown.has_value());
  EXPECT_EQ(unnamed.unknown->signal, "torque");
  EXPECT_EQ(unnamed.gap.heldout_after, unnamed.gap.heldout_before);
}

/// Both pressures swing at 2.3 Hz by `size` Pa, and the forces by `per_pascal` of their difference.
void let_valves_hunt(double per_pascal, double size, std::vector<series::Recording>& runs, double& phase) {
  for (series::Recording& run : runs) {
    phase += 2.1;
    for (std::size_t k = 0; k < run.columns[0].values.size(); ++k) {
      const double turn = 6.283185307179586 * 2.3 * run.columns[0].values[k] + phase;
      const double p1 = size * std::sin(turn), p2 = size * std::sin(turn + 1.7);
      run.columns[2].values[k] += p1;
      run.columns[3].values[k] += p2;
      const double force = per_pascal * (p2 - p1);
      run.columns[6].values[k] -= force;
      run.columns[7].values[k] += force;
    }
  }
}

Explanation with_hunting_valves(double size, bool torque = true) {
  const TiedRig rig;
  const double per_pascal = torque ? 0.25 * rig.B : 0.0;
  auto runs = test::record_all(rig, fitted_runs()),
       held = test::record_all(rig, {by_hand(15, 0.45, 1.0)}, 60);
  double phase = 0;
  let_valves_hunt(per_pascal, size, runs, phase);
  let_valves_hunt(per_pascal, size, held, phase);
  return explain(runs, HeldOut(held), options_for(rig));
}

TEST(RawEffects, calls_a_valve_that_hunts_no_disturbance_from_outside) {
  const Explanation e = with_hunting_valves(0.006 * kPascalPerKgfCm2);
  ASSERT_EQ(to_string(e.verdict), std::string("unknown"));
  EXPECT_TRUE(e.effects.empty());
  EXPECT_EQ(e.unknown->subsystem, "pcu");
  EXPECT_EQ(e.unknown->depends_on, std::vector<std::string>{"time"});
  const auto line = std::find_if(e.where.begin(), e.where.end(),
                                 [](const auto& region) { return region.variable == "frequency"; });
  ASSERT_NE(line, e.where.end());
  EXPECT_NEAR(line->low, 2.3, 0.02);
  // It is told of the pressure, and not of the torque.
  EXPECT_EQ(e.gap.signal, e.unknown->signal) << e.summary;
  EXPECT_EQ(e.gap.unit, "kg/cm2") << e.summary;
  EXPECT_NEAR(e.gap.before, std::hypot(0.004, 0.006 / std::sqrt(2.0)), 0.0005) << e.summary;
}

// Noise of a real regulator has a line that holds two per cent of its power.
TEST(RawEffects, lets_a_valve_swing_within_its_noise) {
  const double size = 0.0008 * kPascalPerKgfCm2;
  const Explanation e = with_hunting_valves(size, false);
  EXPECT_EQ(to_string(e.verdict), std::string("none")) << e.summary;
  // Where the torque shows it, it is no disturbance from outside all the same.
  const Explanation shown = with_hunting_valves(size);
  EXPECT_EQ(to_string(shown.verdict), std::string("unknown")) << shown.summary;
}

TEST(ChangeSentence, tells_the_change_and_what_it_had_stood_in_for) {
  EXPECT_EQ(change_sentence({"D", "N m s", 0.2, 0.138, ""}, "friction"),
            "D fell by 31 %: it had stood in for friction.");
  EXPECT_EQ(change_sentence({"C", "N m s3", 0.0002, 0.0026, ""}, ""),
            "C rose from 0.000200 to 0.00260 N m s3.");
  EXPECT_EQ(change_sentence({"C", "N m s3", -0.001, 0.002, ""}, ""),
            "C changed its sign, from -0.00100 to 0.00200 N m s3.");
}

TEST(HowMuchWorse, says_no_sigma_where_there_is_none) {
  EXPECT_EQ(how_much_worse(0.4), "fits only 0.40 sigma worse");
  EXPECT_EQ(how_much_worse(4.4e-10), "fits as well");
  EXPECT_EQ(how_much_worse(-0.2), "fits as well");
}

TEST(VariableWords, call_a_variable_by_the_word_of_its_axis) {
  EXPECT_EQ(variable_in_words("delta_pressure"), "pressure difference Δp");
  EXPECT_EQ(variable_in_words("velocity"), "speed φ̇");
  EXPECT_EQ(variable_in_words("velocity", of_linear_axis("m/s")), "speed v");
  EXPECT_EQ(variable_in_words("angle", of_linear_axis("N")), "position x");
  EXPECT_EQ(variable_in_words("time"), "time");
  Explanation e;
  e.verdict = Verdict::kUnknown;
  e.gap.unit = "N m";
  e.unknown.emplace();
  e.unknown->depends_on = {"p1", "angle"};
  const std::string end = "it depends on pressure p1 and angle φ.";
  EXPECT_TRUE(summary_of(e).ends_with(end)) << summary_of(e);
  e.gap.unit = "N";
  EXPECT_TRUE(summary_of(e).ends_with("pressure p1 and position x.")) << summary_of(e);
}

TEST(Summary, says_which_name_came_nearest_to_an_unknown_effect_and_what_ruled_it_out) {
  Explanation e;
  e.verdict = Verdict::kUnknown;
  e.rejected.emplace_back().id = "second_order_lag";
  e.rejected.front().name = "second lag";
  e.trials = {{"second_order_lag", "fits best"},
              {"second_order_lag", "ruled out: 2.8 sigma behind another"},
              {"dead_time", "ruled out: 9.1 sigma behind second_order_lag"}};
  const std::string nearest = " Second lag came nearest and is ruled out: 2.8 sigma behind another.";
  EXPECT_TRUE(summary_of(e).ends_with(nearest)) << summary_of(e);
  e.trials.pop_back();
  e.trials.pop_back();  // nothing ruled it out that was told
  EXPECT_EQ(summary_of(e).find("nearest"), std::string::npos) << summary_of(e);
}

TEST(WithError, gives_as_many_places_as_the_error_has) {
  EXPECT_EQ(with_error("T_c", 0.009812, 0.00041, "N m"), "T_c = 0.0098 ± 0.0004 N m");
  EXPECT_EQ(with_error("g", 0.031234, 0.0012, "-"), "g = 0.0312 ± 0.0012");
  EXPECT_EQ(with_error("k", 23456, 120, "N/m"), "k = 23456 ± 120 N/m");
  EXPECT_EQ(with_error("b", 0.5, kNotKnown, "N"), "b = 0.500 N");
}

}  // namespace
}  // namespace isac::explain
