// What the search must do before any benchmark: tests that hold, absences that are exact, parameters that come back.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <type_traits>

#include "isac/explain/explain.hpp"
#include "isac/explain/filters.hpp"
#include "isac/explain/refine.hpp"
#include "isac/explain/screen.hpp"
#include "isac/explain/search.hpp"
#include "prepared_day.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

/// Largest distance between the draws' distribution and the uniform one.
double kolmogorov_smirnov(std::vector<double> p) {
  std::sort(p.begin(), p.end());
  double distance = 0;
  const auto n = static_cast<double>(p.size());
  for (std::size_t i = 0; i < p.size(); ++i)
    distance = std::max({distance, std::abs(p[i] - static_cast<double>(i) / n),
                         std::abs(p[i] - static_cast<double>(i + 1) / n)});
  return distance;
}

enum class Noise { kWhite, kColoured, kUnequal, kOutliers };

/// p-value of a search among smooth functions, most of them alike, in noise that nothing is hidden in.
double p_value_of_noise(Noise kind, std::mt19937_64& random) {
  constexpr Eigen::Index kBlocks = 60, kRows = 40, kColumns = 12;
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform;
  Eigen::MatrixXd scores(kBlocks, kColumns);
  for (Eigen::Index b = 0; b < kBlocks; ++b) {
    Eigen::VectorXd noise(kRows);
    double state = gauss(random) * 3.2;  // of an AR(1) with 0.95: forgets within half a block
    const double size = kind == Noise::kUnequal ? (b % 7 == 0 ? 8.0 : 1.0) : 1.0;
    for (Eigen::Index i = 0; i < kRows; ++i) {
      state = 0.95 * state + gauss(random);
      noise[i] = size * (kind == Noise::kColoured ? state : gauss(random));
      if (kind == Noise::kOutliers && uniform(random) < 0.002) noise[i] += 30 * (uniform(random) - 0.5);
    }
    for (Eigen::Index k = 0; k < kColumns; ++k) {
      double score = 0;
      for (Eigen::Index i = 0; i < kRows; ++i)
        score += noise[i] * std::sin(0.05 * static_cast<double>((k + 1) * i) + 0.3 * static_cast<double>(b));
      scores(b, k) = score;
    }
  }
  return flip_test(scores, 199, random(), 0.01).p_value;
}

class FlipTest : public ::testing::TestWithParam<Noise> {};

TEST_P(FlipTest, gives_uniform_p_values_where_nothing_is_missing) {
  std::mt19937_64 random(11);
  std::vector<double> p;
  constexpr int kDraws = 2000;
  for (int draw = 0; draw < kDraws; ++draw) p.push_back(p_value_of_noise(GetParam(), random));
  // 1.63/√n is passed once in a hundred; the p-values come in steps of 1/200.
  EXPECT_LT(kolmogorov_smirnov(p), 1.63 / std::sqrt(kDraws) + 1.0 / 200);
}

std::string name_of(const ::testing::TestParamInfo<Noise>& info) {
  static constexpr const char* kNames[] = {"white", "coloured", "unequal", "outliers"};
  return kNames[static_cast<int>(info.param)];
}

INSTANTIATE_TEST_SUITE_P(InEveryNoise, FlipTest,
                         ::testing::Values(Noise::kWhite, Noise::kColoured, Noise::kUnequal,
                                           Noise::kOutliers),
                         name_of);

std::vector<PlannedRun> small_day() {
  PlannedRun steps{.experiment = "pcu-step",
                   .seconds = 12,
                   .mean_pressure_kgcm2 = 3,
                   .pressure_swing_kgcm2 = 1.2,
                   .pressure_period_s = 4,
                   .waveform = "steps"};
  PlannedRun free{.experiment = "free",
                  .seconds = 16,
                  .mean_pressure_kgcm2 = 3,
                  .pressure_swing_kgcm2 = 0.8,
                  .pressure_period_s = 4,
                  .waveform = "steps"};
  PlannedRun low = test::by_hand(14, 0.4, 1.2);
  low.mean_pressure_kgcm2 = 2.2;
  return {test::by_hand(16, 0.4, 0.5),
          test::by_hand(14, 0.4, 3.0),
          test::by_hand(14, 0.35, 1.0, 1.0),
          low,
          test::clamped(16, 0.1, 1.2, 6),
          free,
          steps};
}

const test::PreparedDay& quiet_day() {
  static const test::PreparedDay day(test::TiedRig{}, small_day());
  return day;
}

TEST(Hypotheses, leave_every_row_as_it_is_where_they_are_absent) {
  const test::PreparedDay& day = quiet_day();
  Eigen::VectorXd without = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(day.predictor.rows()));
  day.predictor.predict(day.baseline.model, kAllChains, without);
  for (const Hypothesis& h : day.library.hypotheses) {
    if (std::string_view(h.info().id) == "flow_limit" || std::string_view(h.info().id) == "force_saturation")
      continue;
    ModelPoint model = day.baseline.model;
    model.effects.push_back({&h, null_values(h, h.shapes.front())});
    Eigen::VectorXd with = Eigen::VectorXd::Zero(without.size());
    day.predictor.predict(model, kAllChains, with);
    // Effects with states of the valve unit are integrated in finer steps, which is all that may differ.
    const double allowed = h.info().where == models::Subsystem::kPcu && h.info().state_count > 0 ? 1e-4 : 0.0;
    EXPECT_LE((with - without).cwiseAbs().maxCoeff(), allowed * without.cwiseAbs().maxCoeff()) << h.info().id;
  }
}

TEST(Projection, takes_away_what_a_change_of_the_baseline_does_as_well) {
  const test::PreparedDay& day = quiet_day();
  const Around place = around(day.predictor, day.baseline, day.weights);
  for (std::size_t j = 0; j < day.predictor.base().size(); ++j) {
    ModelPoint changed = day.baseline.model;
    changed.base[j] *= 1.001;  // small: T_C is not linear
    Eigen::VectorXd there = place.here;
    day.predictor.predict(changed, kAllChains, there);
    Eigen::VectorXd change = there - place.here;
    for (std::size_t i = 0; i < day.predictor.rows(); ++i)
      change[static_cast<Eigen::Index>(i)] /= day.weights.sigma[static_cast<int>(day.data.rows[i].chain)];
    EXPECT_LT(place.project(change).norm(), 2e-3 * change.norm()) << day.predictor.base()[j].name;
  }
}

TEST(Responses, of_linear_effects_are_linear) {
  const test::PreparedDay& day = quiet_day();
  const Around place = around(day.predictor, day.baseline, day.weights);
  for (const Hypothesis& h : day.library.hypotheses) {
    if (!h.info().linear || h.info().hook != models::Hook::kTorque) continue;
    Values half = h.shapes.front();
    for (double& v : half) v *= 0.5;
    const Eigen::VectorXd full =
        response(day.predictor, day.baseline, place.here, {&h, h.shapes.front()}, day.weights);
    const Eigen::VectorXd part = response(day.predictor, day.baseline, place.here, {&h, half}, day.weights);
    EXPECT_LT((full - 2 * part).norm(), 1e-9 * full.norm()) << h.info().id;
  }
}

TEST(Responses, of_torques_at_one_sample_in_some_are_those_at_every_sample) {
  const test::PreparedDay& day = quiet_day();
  Eigen::VectorXd here = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(day.predictor.rows()));
  day.predictor.predict(day.baseline.model, kAllChains, here);
  int compared = 0;
  for (const Hypothesis& h : day.library.hypotheses) {
    if (!day.predictor.adds_up(day.baseline.model, h)) continue;
    for (const std::size_t shape : {std::size_t{0}, h.shapes.size() - 1}) {
      const Active effect{&h, h.shapes[shape]};
      Eigen::VectorXd alone = Eigen::VectorXd::Zero(here.size()), with = here;
      day.predictor.predict_addition(day.baseline.model, effect, alone);
      ModelPoint model = day.baseline.model;
      model.effects.push_back(effect);
      day.predictor.predict(model, kAllChains, with);  // every sample, with everything else
      EXPECT_LE((with - here - alone).norm(),
                1e-4 * alone.norm() + 1e-12 * here.norm())  // tension_loss has kinks
          << h.info().id << " " << shape;
      compared += alone.norm() > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(compared, 30);
}

TEST(Refine, finds_every_effect_that_the_data_holds_without_noise) {
  const test::PreparedDay& day = quiet_day();
  Around place = around(day.predictor, day.baseline, day.weights);
  int found = 0;
  for (const Hypothesis& h : day.library.hypotheses) {
    if (h.info().hook != models::Hook::kTorque || h.parameters() > 2 || h.clock == Clock::kDay) continue;
    const Values truth = h.shapes.front();
    const Eigen::VectorXd effect =
        place.project(response(day.predictor, day.baseline, place.here, {&h, truth}, day.weights));
    if (effect.norm() < 50) continue;  // hardly in this data: nothing to hold it by
    place.residual = -effect;
    Values start = truth;
    for (int i = 0; i < h.info().parameter_count; ++i) start[static_cast<std::size_t>(i)] *= 1.3;
    const Refined refined = refine(place, h, start, 40);
    // Where events make the loss a staircase, the search ends within a hundredth of the parameters.
    const bool events = h.info().state_count > 0;
    EXPECT_LT(refined.residual.norm(), (events ? 0.05 : 0.01) * effect.norm()) << h.info().id;
    for (int i = 0; i < h.info().parameter_count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (h.amplitude[k] && h.parameters() == 1) {
        EXPECT_NEAR(refined.values[k], truth[k], (events ? 0.01 : 1e-3) * std::abs(truth[k])) << h.info().id;
      }
    }
    ++found;
  }
  EXPECT_GE(found, 12);
}

TEST(Refine, lets_a_held_tolerance_come_back_as_far_as_its_bounds_let_it) {
  Around place;
  place.held.slopes = Eigen::MatrixXd::Zero(4, 1);
  place.held.slopes(0, 0) = 2;
  place.held.low = Eigen::VectorXd::Constant(1, -1);
  place.held.high = Eigen::VectorXd::Zero(1);  // at its upper bound
  place.held_gram = place.held.slopes.transpose() * place.held.slopes;
  const Eigen::Vector4d other(0, 3, 0, 1);
  const auto left = [&](double along) {
    const Eigen::Vector4d slope = place.held.slopes.col(0);
    return Eigen::Vector4d(place.release(other + along * slope));
  };
  EXPECT_LT((left(0.4) - other).norm(), 1e-8);
  EXPECT_NEAR(left(1.5)[0], 1.0, 1e-8);    // half a step further than it may
  EXPECT_NEAR(left(-0.4)[0], -0.8, 1e-8);  // the other way it stands already
}

TEST(HeldOutRuns, cannot_be_reached_but_by_the_proof) {
  static_assert(!std::is_convertible_v<HeldOut, std::vector<series::Recording>>);
  static_assert(!std::is_constructible_v<std::span<const series::Recording>, HeldOut>);
  const test::TiedRig rig{.dry = 0.03};
  const auto runs = test::record_all(rig, small_day());
  auto held = test::record_all(rig, {test::by_hand(12, 0.3, 1.5)}, 40);
  auto false_held = held;
  for (double& f : false_held.front().columns[7].values) f += 5;
  const ExplainOptions options{.rig = rig.facts(), .traces = false, .next_experiment = false};
  const Explanation honest = explain(runs, HeldOut(held), options),
                    lied_to = explain(runs, HeldOut(false_held), options);
  EXPECT_EQ(honest.p_value, lied_to.p_value);
  EXPECT_EQ(honest.gap.before, lied_to.gap.before);
  EXPECT_NE(honest.gap.heldout_before, lied_to.gap.heldout_before);
}

std::string first_of(const Explanation& e) {
  return e.effects.empty() ? std::string() : e.effects.front().id;
}

TEST(Explain, says_that_nothing_is_missing_where_nothing_is) {
  const test::TiedRig rig;
  const Explanation e =
      explain(test::record_all(rig, small_day()), HeldOut(), {.rig = rig.facts(), .traces = false});
  EXPECT_TRUE(e.verdict == Verdict::kNone || e.verdict == Verdict::kImmaterial)
      << to_string(e.verdict) << " " << first_of(e);
  EXPECT_TRUE(e.effects.empty());
}

TEST(Explain, names_dry_friction_and_shrinks_the_gap_on_runs_it_never_saw) {
  const test::TiedRig rig{.dry = 0.03};
  const Explanation e = explain(test::record_all(rig, small_day()),
                                HeldOut(test::record_all(rig, {test::by_hand(12, 0.3, 1.5)}, 40)),
                                {.rig = rig.facts(), .traces = false, .next_experiment = false});
  ASSERT_EQ(first_of(e), "coulomb_friction");
  EXPECT_NEAR(e.effects.front().parameters.front().value, 0.03,
              0.0015);  // 5 %: ten times its standard error here
  const auto beyond_floor = [&](double rms) { return rms * rms - e.gap.noise_floor * e.gap.noise_floor; };
  EXPECT_LT(beyond_floor(e.gap.heldout_after), 0.1 * beyond_floor(e.gap.heldout_before));
}

TEST(Explain, leaves_a_damping_by_the_root_of_the_speed_without_a_name) {
  const test::TiedRig rig;
  auto runs = test::record_all(rig, small_day());
  for (series::Recording& run : runs) {
    const std::vector<double> speed = low_pass_derivative(run.columns[1].values, 6, 0.002, 1);
    for (std::size_t k = 0; k < speed.size(); ++k) {
      if (run.metadata.at("experiment") != "constant-pressure") break;
      const double drag = 0.04 * std::copysign(std::sqrt(std::abs(speed[k])), speed[k]) / rig.radius;
      run.columns[6].values[k] += 0.5 * drag;
      run.columns[7].values[k] -= 0.5 * drag;
    }
  }
  const Explanation e =
      explain(runs, HeldOut(), {.rig = rig.facts(), .traces = false, .next_experiment = false});
  ASSERT_EQ(to_string(e.verdict), std::string("unknown")) << first_of(e);
  EXPECT_EQ(e.unknown->subsystem, "muscle");
  EXPECT_NE(std::find(e.unknown->depends_on.begin(), e.unknown->depends_on.end(), "velocity"),
            e.unknown->depends_on.end());
}

TEST(Explain, does_not_say_that_nothing_is_missing_where_only_held_out_runs_show_it) {
  const test::TiedRig rig, stiff{.dry = 0.08};
  const std::vector<PlannedRun> beyond = {test::by_hand(20, 0.35, 0.7), test::by_hand(20, 0.3, 1.5)};
  const auto answer = [&](const test::TiedRig& later) {
    return explain(test::record_all(rig, small_day()), HeldOut(test::record_all(later, beyond, 40)),
                   {.rig = rig.facts(), .traces = false, .next_experiment = false});
  };
  const Explanation same = answer(rig), other = answer(stiff);
  EXPECT_TRUE(same.verdict == Verdict::kNone || same.verdict == Verdict::kImmaterial) << same.summary;
  EXPECT_EQ(other.verdict, Verdict::kUnknown) << other.summary;
  EXPECT_TRUE(other.effects.empty());
  ASSERT_TRUE(other.unknown.has_value());
  EXPECT_EQ(other.unknown->signal, "torque");
  EXPECT_NE(other.summary.find("the fitted runs do not excite"), std::string::npos) << other.summary;
}

TEST(Explain, says_beside_a_name_that_closes_little_on_held_out_runs_that_it_may_be_none_of_the_catalogue) {
  // On the day after, friction is the least of what is off.
  const test::TiedRig rig{.dry = 0.03}, later{.dry = 0.03, .offset = 0.06};
  const std::vector<PlannedRun> beyond = {test::by_hand(20, 0.35, 0.7), test::by_hand(20, 0.3, 1.5)};
  const auto answer = [&](const test::TiedRig& heldout) {
    return explain(test::record_all(rig, small_day()), HeldOut(test::record_all(heldout, beyond, 40)),
                   {.rig = rig.facts(), .traces = false, .next_experiment = false});
  };
  const Explanation same = answer(rig), other = answer(later);
  EXPECT_EQ(same.verdict, Verdict::kNamed) << same.summary;
  EXPECT_TRUE(same.doubts.empty());
  EXPECT_EQ(other.verdict, Verdict::kNotSeparable) << other.summary;
  EXPECT_EQ(first_of(other), "coulomb_friction");
  ASSERT_EQ(other.alternatives.size(), 1U);
  EXPECT_EQ(other.alternatives.front().id, "unknown");
  EXPECT_GT(other.effects.front().confidence, other.alternatives.front().confidence);
  EXPECT_LT(other.effects.front().confidence, 0.95 * same.effects.front().confidence);
  ASSERT_EQ(other.doubts.size(), 1U);
  EXPECT_NE(other.summary.find("it may also be none of the catalogue. " + other.doubts.front()),
            std::string::npos)
      << other.summary;
}

TEST(Explain, takes_no_effect_for_noise_because_no_name_is_like_it) {
  const test::TiedRig rig{.angle_damping = 0.15};
  const std::vector<PlannedRun> day = {test::by_hand(40, 0.5, 1.5), test::by_hand(40, 0.5, 2.5),
                                       test::by_hand(40, 0.4, 1.0)};
  const std::vector<PlannedRun> beyond = {test::by_hand(20, 0.35, 0.7), test::by_hand(20, 0.3, 1.5)};
  std::string lines;
  const Explanation e = explain(test::record_all(rig, day), HeldOut(test::record_all(rig, beyond, 40)),
                                {.rig = rig.facts(),
                                 .traces = false,
                                 .next_experiment = false,
                                 .progress = [&](const std::string& line) { lines += line + "\n"; }});
  EXPECT_EQ(lines.find("no more than noise"), std::string::npos) << lines;
  EXPECT_EQ(e.verdict, Verdict::kUnknown) << e.summary;
  EXPECT_TRUE(e.effects.empty());
  ASSERT_TRUE(e.unknown.has_value());
  const std::vector<std::string>& on = e.unknown->depends_on;
  EXPECT_TRUE(std::count(on.begin(), on.end(), "velocity") == 1 &&
              std::count(on.begin(), on.end(), "angle") == 1)
      << e.summary;
}

TEST(Explain, gives_no_name_to_a_friction_that_comes_and_goes) {
  const test::TiedRig rig{.dry = 0.06, .dry_share = 0.15};
  const std::vector<PlannedRun> day = {test::by_hand(40, 0.5, 1.5), test::by_hand(40, 0.5, 2.5),
                                       test::by_hand(40, 0.4, 1.0)};
  const std::vector<PlannedRun> beyond = {test::by_hand(20, 0.35, 0.7), test::by_hand(20, 0.3, 1.5)};
  const Explanation e = explain(test::record_all(rig, day), HeldOut(test::record_all(rig, beyond, 40)),
                                {.rig = rig.facts(), .traces = false, .next_experiment = false});
  EXPECT_EQ(e.verdict, Verdict::kUnknown) << e.summary;
  EXPECT_TRUE(std::any_of(e.trials.begin(), e.trials.end(), [](const TrialNote& note) {
    return note.sentence.find("not the same throughout") != std::string::npos;
  })) << e.summary;
  ASSERT_TRUE(e.unknown.has_value());
  const std::vector<std::string>& on = e.unknown->depends_on;
  EXPECT_EQ(on, (std::vector<std::string>{"time", "velocity"})) << e.summary;
}

TEST(Explain, says_of_which_muscle_a_gain_is_bent_that_no_name_is_like) {
  const test::TiedRig rig{.bent_by = 0.15, .bent_from = 3.4 * kPascalPerKgfCm2};
  // Where the mean pressure stays, either muscle's pressure is the difference's: runs differ in it.
  std::vector<PlannedRun> day = {test::by_hand(30, 0.5, 1.5), test::by_hand(30, 0.3, 0.8, 0.7),
                                 test::by_hand(30, 0.3, 0.8, -0.7), test::clamped(40, 0.1, 1.3, 6),
                                 test::clamped(40, -0.1, 1.2, 9)};
  day[1].mean_pressure_kgcm2 = 2.6;
  day[3].mean_pressure_kgcm2 = 3.6;
  const std::vector<PlannedRun> beyond = {test::clamped(20, 0, 1.0, 8), test::by_hand(20, 0.3, 1.5)};
  const Explanation e = explain(test::record_all(rig, day), HeldOut(test::record_all(rig, beyond, 40)),
                                {.rig = rig.facts(), .traces = false, .next_experiment = false});
  EXPECT_EQ(e.verdict, Verdict::kUnknown) << e.summary;
  ASSERT_TRUE(e.unknown.has_value());
  EXPECT_EQ(e.unknown->depends_on, std::vector<std::string>{"p2"}) << e.summary;
  EXPECT_EQ(e.unknown->variable, "p2");
  EXPECT_EQ(std::count(e.unknown->independent.begin(), e.unknown->independent.end(), "delta_pressure"), 0);
  ASSERT_FALSE(e.unknown->at.empty());
  EXPECT_GT(e.unknown->at.back(), 3.8);  // kg/cm2
}

TEST(Explain, says_of_what_no_name_is_like_that_it_keeps_or_warms_with_the_speed_of_the_last_moments) {
  struct Case {
    test::TiedRig rig;
    std::vector<std::string> on;
  };
  const std::vector<PlannedRun> beyond = {test::by_hand(20, 0.35, 0.7), test::by_hand(20, 0.3, 1.5)};
  for (const Case& c :
       {Case{{.spring = 0.6}, {"memory", "velocity"}}, Case{{.warming = 0.06}, {"time", "velocity"}}}) {
    const Explanation e =
        explain(test::record_all(c.rig, small_day()), HeldOut(test::record_all(c.rig, beyond, 40)),
                {.rig = c.rig.facts(), .traces = false, .next_experiment = false});
    EXPECT_EQ(e.verdict, Verdict::kUnknown) << e.summary;
    ASSERT_TRUE(e.unknown.has_value()) << e.summary;
    EXPECT_EQ(e.unknown->depends_on, c.on) << e.summary;
  }
}

TEST(Explain, hears_a_valve_that_hunts_though_functions_of_the_signals_are_like_it) {
  const test::TiedRig rig{.hunting = 0.02 * kPascalPerKgfCm2};
  const std::vector<PlannedRun> day = {test::by_hand(30, 0.5, 1.5), test::clamped(30, 0.1, 1.3, 6),
                                       test::clamped(30, -0.1, 1.2, 9, "steps")};
  const std::vector<PlannedRun> beyond = {test::clamped(20, 0, 1.0, 8)};
  const Explanation e = explain(test::record_all(rig, day), HeldOut(test::record_all(rig, beyond, 40)),
                                {.rig = rig.facts(), .traces = false, .next_experiment = false});
  EXPECT_EQ(e.verdict, Verdict::kUnknown) << e.summary;
  ASSERT_TRUE(e.unknown.has_value());
  EXPECT_EQ(e.unknown->subsystem, "pcu") << e.summary;
  EXPECT_EQ(e.unknown->depends_on, std::vector<std::string>{"time"}) << e.summary;
}

TEST(Explain, answers_the_same_whatever_the_order_of_the_runs) {
  const test::TiedRig rig{.dry = 0.03};
  auto runs = test::record_all(rig, small_day());
  const ExplainOptions options{.rig = rig.facts(), .traces = false, .next_experiment = false};
  const Explanation forward = explain(runs, HeldOut(), options);
  std::reverse(runs.begin(), runs.end());
  const Explanation backward = explain(runs, HeldOut(), options);
  EXPECT_EQ(to_string(forward.verdict), std::string(to_string(backward.verdict)));
  EXPECT_EQ(first_of(forward), first_of(backward));
}

TEST(Explain, returns_both_of_two_effects_that_no_data_of_this_kind_can_tell_apart) {
  const test::TiedRig rig{.offset = 0.02};
  const Explanation e = explain(test::record_all(rig, small_day()), HeldOut(),
                                {.rig = rig.facts(), .traces = false, .next_experiment = false});
  std::vector<std::string> set;
  for (const Candidate& c : e.effects) set.push_back(c.id);
  for (const Candidate& c : e.alternatives) set.push_back(c.id);
  EXPECT_NE(std::find(set.begin(), set.end(), "torque_offset"), set.end());
  EXPECT_NE(std::find(set.begin(), set.end(), "encoder_offset"), set.end());
  EXPECT_NE(to_string(e.verdict), std::string("named"));
}

TEST(Explain, gives_no_other_effect_the_name_of_one_that_it_may_not_consider) {
  const test::TiedRig rig{.dry = 0.03};
  const Explanation e =
      explain(test::record_all(rig, small_day()), HeldOut(),
              {.rig = rig.facts(),
               .excluded = {"coulomb_friction", "stribeck_friction", "pressure_dependent_friction",
                            "hysteresis", "asymmetric_hysteresis"},
               .traces = false,
               .next_experiment = false});
  EXPECT_TRUE(e.verdict == Verdict::kUnknown || e.effects.size() != 1 || !e.alternatives.empty())
      << first_of(e);
}

}  // namespace
}  // namespace isac::explain
