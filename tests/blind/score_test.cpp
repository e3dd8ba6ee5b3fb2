#include "score.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "ledger.hpp"
#include "numbers.hpp"

namespace blind {
namespace {

Case single(const std::string& truth) {
  Case one;
  one.truth.kind = "single";
  one.truth.noise = "white";
  one.truth.side = "process";
  one.truth.signal = "torque";
  one.truth.ratio = 0.75;
  one.truth.ids = {truth};
  one.truth.gap = {{"driven", 0.01}, {"pressure", 0.0}, {"balance", 0.0}};
  one.truth.gap_noise = {{"driven", 0.02}, {"pressure", 0.004}, {"balance", 0.01}};
  return one;
}

Answer named(std::vector<std::string> effects, std::vector<std::string> alternatives = {}) {
  Answer a;
  a.verdict = alternatives.empty() ? "named" : "not_separable";
  a.detected = true;
  a.confidences.assign(effects.size(), 0.9);
  a.subsystems.assign(effects.size(), "muscle");
  a.effects = std::move(effects);
  a.alternatives = std::move(alternatives);
  return a;
}

TEST(Score, credits_the_name_that_is_right) {
  Case one = single("creep");
  one.answer = named({"creep"});
  const Judgement j = judge_case(one);
  EXPECT_TRUE(j.first && j.first_three && j.in_set && j.right_side);
  EXPECT_FALSE(j.single_wrong);
  EXPECT_EQ(j.set_size, 1);
}

TEST(Score, counts_a_single_wrong_name_but_not_one_with_alternatives) {
  Case one = single("creep");
  one.answer = named({"hysteresis"});
  EXPECT_TRUE(judge_case(one).single_wrong);
  one.answer = named({"hysteresis"}, {"creep"});
  const Judgement j = judge_case(one);
  EXPECT_FALSE(j.single_wrong);
  EXPECT_FALSE(j.first);
  EXPECT_TRUE(j.first_three && j.in_set);
  EXPECT_EQ(j.set_size, 2);
}

TEST(Score, gives_nothing_for_a_single_name_where_the_oracle_says_that_two_cannot_be_told_apart) {
  Case one = single("inertia_error");
  one.truth.nearest_equal = "encoder_gain";
  one.truth.equals = {"encoder_gain"};
  one.answer = named({"inertia_error"});
  Judgement j = judge_case(one);
  EXPECT_FALSE(j.first || j.first_three || j.in_set);
  one.answer = named({"encoder_gain"}, {"inertia_error"});
  j = judge_case(one);
  EXPECT_TRUE(j.first && j.first_three && j.in_set);
}

TEST(Score, wants_an_unknown_effect_left_unnamed_with_its_variables) {
  Case one = single("angle_friction");
  one.truth.kind = "unknown";
  one.truth.depends_on = {"velocity", "angle"};
  one.answer.verdict = "unknown";
  one.answer.detected = true;
  one.answer.depends_on = {"angle", "velocity"};
  EXPECT_TRUE(judge_case(one).left_unnamed);
  EXPECT_TRUE(judge_case(one).right_variables);
  one.answer.depends_on = {"angle"};
  EXPECT_FALSE(judge_case(one).right_variables);
  one.answer.depends_on = {"angle", "velocity", "p1", "p2"};
  EXPECT_FALSE(judge_case(one).right_variables) << "naming everything is no answer";
  one.answer = named({"coulomb_friction"});
  EXPECT_TRUE(judge_case(one).single_wrong);
}

TEST(Score, wants_both_of_two_effects) {
  Case one = single("creep");
  one.truth.kind = "pair";
  one.truth.ids = {"creep", "leak"};
  one.answer = named({"leak", "creep"});
  EXPECT_TRUE(judge_case(one).all_named);
  one.answer = named({"leak"}, {"creep"});
  EXPECT_FALSE(judge_case(one).all_named);
  EXPECT_TRUE(judge_case(one).one_named);
  EXPECT_TRUE(judge_case(one).in_set);
  EXPECT_FALSE(judge_case(one).both_told);
  // Where nobody can tell one of them from a rival, the set is right, and names alone are not.
  one.truth.nearest_equal = "thermal_drift";
  EXPECT_FALSE(judge_case(one).both_told) << "the rival is not in it";
  one.answer = named({"leak", "thermal_drift"}, {"creep"});
  EXPECT_TRUE(judge_case(one).both_told);
  one.answer = named({"leak", "creep"});
  EXPECT_FALSE(judge_case(one).both_told);
  // Where one of them is all that anybody can see, the set of both.
  one.truth.nearest_equal.clear();
  one.truth.alone = "leak";
  EXPECT_TRUE(judge_case(one).both_told);
  one.answer = named({"leak"}, {"creep"});
  EXPECT_TRUE(judge_case(one).both_told);
  EXPECT_FALSE(judge_case(one).all_named);
  one.answer = named({"leak"});
  EXPECT_FALSE(judge_case(one).both_told);
}

TEST(Score, measures_the_closed_gap_against_what_the_true_model_closes) {
  Case one = single("creep");
  one.answer = named({"creep"});
  one.answer.signal = "torque";
  one.answer.heldout_before = std::sqrt(0.01 * 0.01 + 0.02 * 0.02);
  one.answer.heldout_after = 0.02;  // down to the noise: all of it
  EXPECT_NEAR(judge_case(one).closed, 1.0, 1e-12);
  one.answer.heldout_after = one.answer.heldout_before;
  EXPECT_NEAR(judge_case(one).closed, 0.0, 1e-12);
  // Noise that happens to point the same way as the gap makes the true model close more.
  one.answer.heldout_after = 0.02;
  one.truth.gap_closes["driven"] = 1.25 * 0.01 * 0.01;
  EXPECT_NEAR(judge_case(one).closed, 0.8, 1e-12);
}

TEST(Score, measures_the_closed_gap_against_the_same_day_with_nothing_hidden) {
  Case one = single("creep");
  one.answer = named({"creep"});
  one.answer.signal = "torque";
  one.answer.heldout_before = 0.05;
  one.answer.heldout_after = 0.04;
  one.floor = {{"torque", 0.03}, {"p1", 0.01}};
  EXPECT_NEAR(judge_case(one).closed, (25.0 - 16.0) / (25.0 - 9.0), 1e-12);
  one.answer.heldout_before = 0.0302;  // hardly above it: nothing to be measured by
  EXPECT_EQ(judge_case(one).closed, -1.0);
}

TEST(Score, tells_a_held_out_rms_that_rises_by_the_noises_doing_from_one_that_rises_in_earnest) {
  Case one = single("creep");
  one.truth.ratio = 0.75;
  one.answer = named({"creep"});
  one.answer.signal = "torque";
  one.answer.heldout_before = 0.03;
  one.answer.heldout_after = 0.031;
  const auto worse = [&] {
    const std::string text = report({one});
    const std::size_t row = text.find("| clear |", text.find("## Gap closed"));
    return text.substr(row, text.find('\n', row) - row);
  };
  const std::string all = share(1, 1), none = share(0, 1);
  EXPECT_TRUE(worse().ends_with(all + " | " + all + " |")) << worse();
  one.truth.gap_closes["driven"] = -7e-5;  // the true model's rises more: 0.031² − 0.03² = 6.1e-5
  EXPECT_TRUE(worse().ends_with(all + " | " + none + " |")) << worse();
  one.truth.gap_closes["driven"] = -5e-5;
  EXPECT_TRUE(worse().ends_with(all + " | " + all + " |")) << worse();
  one.answer.freed_before = 0.021;
  one.answer.freed_after = 0.02;
  EXPECT_TRUE(worse().ends_with(all + " | " + none + " |")) << worse();
}

TEST(Score, reads_a_line_of_results_and_survives_an_answer_that_is_none) {
  const std::string label =
      R"({"schema":"isac.blind/1","kind":"single","noise":"white","side":"process","signal":"torque",)"
      R"("ratio_asked":0.75,"testable":true,"ids":["creep"],"subsystems":["muscle"],"depends_on":[],)"
      R"("gap":{"torque":{"heldout_before":0.01,"heldout_noise":0.02}},)"
      R"("oracle":{"none":9,"rivals":{"leak":9.1,"hysteresis":1.5,"coulomb_friction":2.5}}})";
  const Case one = read_case(R"({"key":"k","label":)" + label +
                             R"(,"exit":0,"seconds":1.5,"answer":"Segmentation fault"})");
  EXPECT_EQ(one.truth.nearest_equal, "hysteresis");
  EXPECT_TRUE(one.floor.empty());
  const Case twin = read_case(
      R"({"key":"k","label":)" + label +
      R"(,"bare":"{\"disagreement\":{\"signals\":[{\"signal\":\"p1\",\"heldout\":0.25},{\"signal\":\"p2\",\"heldout\":null}]}}"})");
  EXPECT_EQ(twin.floor, (std::map<std::string, double>{{"p1", 0.25}}));
  EXPECT_FALSE(one.answer.failed.empty());
  EXPECT_NE(report({one}).find("without an answer: 1"), std::string::npos);
  EXPECT_THROW(read_case("nonsense"), std::runtime_error);
}

TEST(Score, puts_confidences_against_what_came_true) {
  std::vector<Case> cases;
  for (int i = 0; i < 10; ++i) {
    cases.push_back(single("creep"));
    cases.back().answer = named({i < 9 ? "creep" : "leak"});
  }
  // Nine of ten right at a stated 0.9: no error.
  EXPECT_NE(report(cases).find("Expected calibration error: 0.000"), std::string::npos);
}

TEST(Score, counts_false_alarms_by_kind_of_noise) {
  std::vector<Case> cases(4);
  for (int i = 0; i < 4; ++i) {
    Case& one = cases[static_cast<std::size_t>(i)];
    one.truth.kind = "none";
    one.truth.noise = "coloured";
    one.answer.verdict = "none";
    if (i == 0) one.answer = named({"creep"});
  }
  EXPECT_NE(report(cases).find("| coloured | 3/4 = 75.0 %"), std::string::npos) << report(cases);
}

TEST(Score, tells_how_a_dataset_ended_whose_effect_has_no_name_any_more) {
  std::vector<Case> cases(4, single("creep"));
  for (Case& one : cases) one.truth.kind = "left_out";
  cases[0].answer.verdict = "unknown";
  cases[0].answer.detected = true;
  cases[1].answer = named({"hysteresis"}, {"leak"});
  cases[2].answer = named({"hysteresis", "leak"});  // two names are no less sure than one
  cases[3].answer.verdict = "none";
  cases.push_back(cases[2]);
  cases[4].truth.equals = {"hysteresis"};  // nobody can tell the two apart
  const std::string text = report(cases);
  const std::string fifth = " 1/5 = 20.0 % (3.6 to 62.4) |";
  EXPECT_NE(text.find("| white |" + fifth + fifth + fifth + fifth + fifth), std::string::npos) << text;
  EXPECT_NE(text.find("creep as hysteresis (1)"), std::string::npos) << text;
  EXPECT_EQ(text.find("Confusion matrix: hidden, and named first\n\n| hidden | datasets | right | also named "
                      "(datasets) |\n|---|---|---|---|\n| creep"),
            std::string::npos)
      << "no name could be right";
}

TEST(Score, reads_from_a_line_that_the_effect_was_left_out) {
  const std::string label =
      R"({"kind":"single","noise":"white","side":"process","ratio_asked":0.75,"testable":true,"ids":["creep"],)"
      R"("subsystems":["muscle"],"depends_on":[],"gap":{},"oracle":null})";
  EXPECT_EQ(read_case(R"({"key":"k","label":)" + label + "}").truth.kind, "single");
  EXPECT_EQ(read_case(R"({"key":"k","label":)" + label + R"(,"excluded":["creep"]})").truth.kind, "left_out");
}

TEST(Score, counts_p_values_on_their_grid_and_equal_ones_together) {
  // Each value of the grid once: uniform to the last step.
  std::vector<double> p;
  for (int k = 1; k <= 200; ++k) p.push_back(k / 200.0);
  EXPECT_NEAR(p_distance(p).small, 0.0, 1e-12);
  EXPECT_NEAR(p_distance(p).large, 0.0, 1e-12);
  // A test that says 1 every second time (a doubled and capped p) is silent too often, and never alarms too often.
  for (double& value : p) value = value > 0.5 ? 1.0 : value;
  EXPECT_NEAR(p_distance(p).small, 0.0, 1e-12);
  EXPECT_NEAR(p_distance(p).large, 0.495, 1e-12);  // 0.995, the step before 1, against the half that is below
  // Twice as many small ones as promised: at p = 1/2 all are there.
  for (std::size_t i = 0; i < p.size(); ++i) p[i] = static_cast<double>(i + 1) / 400.0;
  EXPECT_NEAR(p_distance(p).small, 0.5, 1e-12);
  EXPECT_NEAR(p_distance(p).large, 0.0, 1e-12);
  // Without a grid both ends of every step count.
  EXPECT_NEAR(p_distance({0.5 + 1e-6 / 3}).large, 0.5, 1e-5);
  EXPECT_NEAR(p_distance({1.0, 1.0, 1.0}).large, 0.99, 1e-12)
      << "a test that is always silent is not uniform";
  // Kolmogorov's table at n = 20, 5 %: 0.294.
  EXPECT_NEAR(p_distance(std::vector<double>(20, 0.5)).limit, 0.294, 0.002);
}

TEST(Score, puts_every_baseline_beside_the_answer_on_the_same_dataset) {
  Case one = single("creep");
  one.answer = named({"creep"});
  one.baselines["B1"] = named({"hysteresis", "creep"});
  Case none = single("creep");
  none.truth.kind = "none";
  none.truth.ids = {};
  none.answer.verdict = "none";
  none.baselines["B1"] = named({"creep"});
  const std::string table = methods_table({one, none});
  // Columns: quiet, detected, first, in the set, names, wrong.
  EXPECT_NE(
      table.find("| isac-explain | 1/1 = 100.0 % (20.7 to 100.0) | 1/1 = 100.0 % (20.7 to 100.0) | 1/1"),
      std::string::npos)
      << table;
  EXPECT_NE(
      table.find(
          "| B1 | 0/1 = 0.0 % (0.0 to 79.3) | 1/1 = 100.0 % (20.7 to 100.0) | 0/1 = 0.0 % (0.0 to 79.3) | "
          "1/1 = 100.0 % (20.7 to 100.0) | 2.0 | 1/1"),
      std::string::npos)
      << table;
  one.baselines.clear();
  none.baselines.clear();
  EXPECT_TRUE(methods_table({one, none}).empty());
}

TEST(Score, holds_stated_confidences_against_what_was_right) {
  std::vector<Case> cases(6, single("creep"));
  for (Case& one : cases) one.answer = named({"creep"});
  for (Case& one : cases) one.answer.confidences = {0.96};
  cases[1].answer.confidences = {1.0};  // belongs to the highest tenth
  cases[2].answer.effects = {"leak"};
  cases[3].truth.kind = "unknown";  // no name can be right
  cases[3].answer.confidences = {0.44};
  cases[4].truth.kind = "left_out";  // does not count
  cases[5].truth.testable = false;   // nor does this
  const Reliability names = reliability(cases);
  ASSERT_EQ(names.bins.size(), 2u);
  EXPECT_NEAR(names.bins[0].low, 0.4, 1e-12);
  EXPECT_EQ(names.bins[0].right, 0.0);
  EXPECT_NEAR(names.bins[1].stated, (0.96 + 1.0 + 0.96) / 3, 1e-12);
  EXPECT_EQ(names.bins[1].right, 2.0);
  EXPECT_EQ(names.bins[1].count, 3.0);
  EXPECT_NEAR(names.error, (0.44 + std::abs(2.92 - 2.0)) / 4, 1e-12);
  EXPECT_TRUE(reliability({}).bins.empty());
}

TEST(Score, joins_what_baselines_said_alone_to_the_answer_about_the_same_dataset) {
  std::vector<Case> cases(4, single("creep"));
  for (std::size_t i = 0; i < 4; ++i) cases[i].truth.key = "clear/white/creep/9312." + std::to_string(i % 2);
  cases[0].answer = named({"creep"});
  cases[1].answer.failed = kNotAsked;  // of a dataset that nobody answered: stays
  cases[1].baselines["B1"] = named({"leak"});
  cases[2].answer.failed = kNotAsked;
  cases[2].baselines["B1"] = named({"hysteresis"});
  cases.pop_back();
  join_asked_alone(cases);
  ASSERT_EQ(cases.size(), 2u);
  EXPECT_EQ(cases[0].answer.effects, std::vector<std::string>{"creep"});
  EXPECT_EQ(cases[0].baselines["B1"].effects, std::vector<std::string>{"hysteresis"});
  EXPECT_EQ(cases[1].answer.failed, kNotAsked);
}

TEST(Score, reads_the_seed_of_a_dataset_from_its_key) {
  EXPECT_EQ(seed_of_key("clear/white/leak/9312.0"), "9312");
  EXPECT_EQ(seed_of_key("none/white//5101.17"), "5101");
  EXPECT_EQ(seed_of_key("k"), "");
}

TEST(Ledger, is_scored_as_the_whole_answer_is) {
  std::vector<Case> cases(5, single("creep"));
  for (std::size_t i = 0; i < cases.size(); ++i)
    cases[i].truth.key = "clear/white/creep/1." + std::to_string(i);
  cases[0].answer = named({"creep"});
  cases[0].answer.signal = "torque";
  cases[0].answer.heldout_before = 0.0223;
  cases[0].answer.heldout_after = 0.0201;
  cases[0].answer.freed_before = 0.0121;
  cases[0].answer.freed_after = 0.0111;
  cases[0].answer.seconds = 3.25;
  cases[1] = cases[0];
  cases[1].floor = {{"torque", 0.02}};
  cases[1].baselines["B1"] = named({"hysteresis"}, {"creep"});
  cases[2].truth.nearest_equal = "hysteresis";
  cases[2].truth.equals = {"hysteresis"};
  cases[2].answer = named({"creep"}, {"hysteresis"});
  cases[3].truth.kind = "none";
  cases[3].truth.ids = {};
  cases[3].answer.verdict = "none";
  cases[3].answer.p_value = 1.0 / 4900;
  cases[4].answer.failed = "killed: too slow";
  std::vector<Case> kept;
  for (const Case& one : cases) {
    kept.push_back(read_case(ledger_line(one, "0.1.0")));
    EXPECT_EQ(judge_case(kept.back()).closed, judge_case(one).closed);
  }
  EXPECT_EQ(report(kept), report(cases));
  EXPECT_EQ(kept[3].answer.p_value, cases[3].answer.p_value);
  EXPECT_NE(report(kept).find("| creep | 4 | 3 |"), std::string::npos) << report(kept);
  Case untestable = single("leak");
  untestable.truth.testable = false;
  EXPECT_FALSE(read_case(ledger_line(untestable, "0.1.0")).truth.testable);
  EXPECT_THROW(read_case(R"({"key":"k","truth":{"kind":"none","noise":"white"}})"), std::runtime_error);
  EXPECT_THROW(
      read_case(R"({"key":"k","truth":{"kind":"none","noise":"white"},"answer":{"effects":["leak"]}})"),
      std::runtime_error);
}

}  // namespace
}  // namespace blind
