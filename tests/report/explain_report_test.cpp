#include "isac/report/explain_report.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "isac/core/error.hpp"
#include "isac/report/explain_figures.hpp"
#include "isac/report/explain_words.hpp"
#include "sample_explain.hpp"
#include "svg_check.hpp"

namespace {
using namespace isac::report;
using namespace isac::report::testing;
using isac::explain::Explanation;
using isac::explain::Verdict;

std::string page_of(const Explanation& e, const char* name) {
  ExplainReportInput input;
  input.head = {.title = "What is missing: testbed", .rig = "testbed", .created = "2003-05-01T14:30:00Z"};
  input.answer = &e;
  input.compensation = {"Coulomb friction: the controller feeds it forward on the desired motion."};
  input.params_file = "params.toml";
  input.plan_file = "plan.toml";
  std::string html = render_explain_report(input);
  // To look at what was made: ISAC_REPORT_FOLDER=/some/folder.
  if (const char* folder = std::getenv("ISAC_REPORT_FOLDER"))
    std::ofstream(std::string(folder) + "/" + name + ".html") << html;
  EXPECT_EQ(xml_fault(html, true), "") << name;
  for (const char* outside : {"<script", "<link", "<img", "@import", "url("})
    EXPECT_EQ(html.find(outside), std::string::npos) << outside;
  for (const char* broken : {">nan<", ">-nan<", ">inf<", "NaN"})
    EXPECT_EQ(html.find(broken), std::string::npos) << broken << " in " << name;
  return html;
}

void expect_parts(const std::string& html, std::initializer_list<const char*> parts) {
  for (const char* part : parts) EXPECT_NE(html.find(part), std::string::npos) << part;
}

TEST(ExplainReport, says_that_nothing_is_missing_and_what_could_still_hide) {
  const std::string html = page_of(none_sample(), "none");
  expect_parts(html, {"Nothing is missing: what the model leaves over cannot be told from noise.",
                      "What these data could still hide", "0.0042", "choked flow", "On 3 held-out runs"});
  for (const char* absent : {"In the controller and the simulator", "Next experiment", "Gap after"})
    EXPECT_EQ(html.find(absent), std::string::npos) << absent;
}

TEST(ExplainReport, calls_what_is_left_noise_where_nothing_is_missing) {
  Explanation e = none_sample();
  e.gap.noise_floor = 0.4 * e.gap.heldout_before;
  EXPECT_NE(gap_sentence(e).find("the rest is noise that remembers"), std::string::npos) << gap_sentence(e);
  EXPECT_EQ(gap_sentence(e).find("the noise floor is"), std::string::npos) << gap_sentence(e);
  e.gap.noise_floor = 0.9 * e.gap.heldout_before;
  EXPECT_NE(gap_sentence(e).find("the noise floor is"), std::string::npos) << gap_sentence(e);
}

TEST(ExplainReport, says_that_something_is_too_small_to_matter) {
  const std::string html = page_of(immaterial_sample(), "immaterial");
  expect_parts(html, {"too small against the noise floor to matter", "Immaterial", "p &lt; 0.001"});
}

TEST(ExplainReport, hands_on_a_named_effect_with_evidence_proof_and_use) {
  const std::string html = page_of(named_sample(), "named");
  expect_parts(html, {"Coulomb friction is missing from the model of the muscle (confidence 97 %).", "0.145",
                      "0.0107", "&gt; 99 % of what can be explained is closed",
                      "For it:", "Against it:", "the sign of the speed", "needs 0.02 rad after a reversal",
                      "slow_9.csv (held out", "D fell by 83 %", "sim:params=params.toml",
                      "Where the model is off", "Map of the mean residual", "81 % of what can be explained"});
  EXPECT_EQ(html.find("slow_1.csv (fitted)"), std::string::npos) << "a fitted run stands in the proof";
}

TEST(ExplainReport, speaks_in_names_and_says_by_how_much_the_baseline_moved) {
  Explanation e = named_sample();
  const std::string html = page_of(e, "words");
  expect_parts(html, {"ruled out: 4.1 sigma behind Coulomb friction", "−83<", "In words"});
  EXPECT_EQ(html.find("behind coulomb_friction"), std::string::npos);
  for (auto& change : e.base_changes) change.sentence.clear();
  const std::string short_page = page_of(e, "no_words");
  expect_parts(short_page, {"−83<"});
  EXPECT_EQ(short_page.find("In words"), std::string::npos) << "a column of dashes";
}

TEST(ExplainReport, shows_what_cannot_be_told_apart_and_the_experiment_that_would) {
  const std::string html = page_of(tied_sample(Verdict::kNotSeparable), "not_separable");
  expect_parts(html,
               {"these data cannot tell what: Coulomb friction and load-dependent Coulomb friction fit alike",
                "What to record next", "0.4 σ now, 9.2 σ expected", "isac-log --plan plan.toml", "steps",
                "constant-pressure"});
}

TEST(ExplainReport, says_a_direction_in_words_and_a_single_value_once) {
  const auto said = [](const char* variable, double low, double high, const char* unit) {
    return region_sentence({"muscle", "torque", variable, low, high, unit, 0.8});
  };
  EXPECT_EQ(said("direction", 0, 0, ""),
            "muscle, torque: standing still holds 80 % of what can be explained");
  EXPECT_EQ(said("direction", 1, 1, ""), "muscle, torque: moving up holds 80 % of what can be explained");
  EXPECT_EQ(said("direction", -1, 1, ""), "muscle, torque: while moving holds 80 % of what can be explained");
  EXPECT_EQ(said("frequency", 0.63, 0.63, "Hz"),
            "muscle, torque: frequency 0.630 Hz holds 80 % of what can be explained");
  EXPECT_NE(said("angle", 0.1, 0.2, "rad").find("from 0.100 to 0.200 rad"), std::string::npos);
}

TEST(ExplainReport, names_a_family_where_only_that_is_known) {
  const std::string html = page_of(tied_sample(Verdict::kFamily), "family");
  expect_parts(html,
               {"its kind is known: Coulomb friction and rate-independent hysteresis are not told apart"});
}

TEST(ExplainReport, shows_the_shape_of_what_has_no_name) {
  const std::string html = page_of(unknown_sample(), "unknown");
  expect_parts(html, {"no effect of the catalogue; it sits in the muscle and depends on angle φ and speed φ̇",
                      "not on mean pressure and time", "mean of measured less model in bins"});
  EXPECT_EQ(html.find("rms before and"), std::string::npos) << "nothing was added, so there is no after";
}

TEST(ExplainReport, shows_two_effects_one_after_the_other) {
  const std::string html = page_of(two_sample(), "two");
  expect_parts(html, {"Coulomb friction and transport delay of the tubes are missing from the model.",
                      "+ transport delay"});
}

TEST(ExplainReport, says_what_is_no_step_of_the_gap_that_it_shows) {
  constexpr const char* kElsewhere = "ransport delay of the tubes closes another signal";
  Explanation two = two_sample();
  EXPECT_EQ(page_of(two, "two").find(kElsewhere), std::string::npos);
  two.waterfall.erase(two.waterfall.begin() + 1);
  EXPECT_NE(page_of(two, "elsewhere").find(kElsewhere), std::string::npos);
}

TEST(ExplainReport, is_the_same_twice) {
  EXPECT_EQ(page_of(two_sample(), "two"), page_of(two_sample(), "two"));
}

TEST(ExplainReport, survives_an_explanation_that_knows_nothing_but_its_verdict) {
  for (const Verdict verdict : {Verdict::kNone, Verdict::kNamed, Verdict::kFamily, Verdict::kUnknown}) {
    Explanation e;
    e.verdict = verdict;
    page_of(e, "empty");
  }
}

TEST(ExplainReport, escapes_names_from_files) {
  Explanation e = named_sample();
  e.traces[1].run = "a<b>&\"'.csv";
  expect_parts(page_of(e, "escaped"), {"a&lt;b&gt;&amp;&quot;&#39;.csv"});
}

TEST(ExplainReport, needs_an_answer) {
  EXPECT_THROW(static_cast<void>(render_explain_report({})), isac::Error);
}

TEST(ExplainFigures, put_the_held_out_run_on_which_the_effect_shows_most_first) {
  Explanation e = named_sample();
  e.traces.push_back(trace_sample("heldout/quiet.csv", true, 0.01, 3, 3));
  std::rotate(e.traces.begin(), e.traces.end() - 1, e.traces.end());
  const auto figures = run_figures(e, 2);
  ASSERT_EQ(figures.size(), 2U);
  EXPECT_NE(figures[0].caption.find("slow_9.csv"), std::string::npos);
  EXPECT_NE(figures[1].caption.find("quiet.csv"), std::string::npos);
}

TEST(ExplainFigures, show_the_mean_residual_of_friction_over_speed) {
  // Before: ±0.3 N m by the sign of the speed, less the damping of 0.66 N m s that stood in for it.
  const Figure figure = profile_figure(named_sample(), "torque");
  ASSERT_FALSE(figure.panels.empty());
  const Curve& before = figure.panels[0].curves.front();
  ASSERT_GT(before.x.size(), 10U);
  for (std::size_t i = 0; i < before.x.size(); ++i) {
    if (std::abs(before.x[i]) < 0.05) continue;  // the bin that holds both signs
    // A bin is 0.88/28 = 0.031 rad/s wide, over which the damping's part changes by 0.021: half of it, and the mean noise.
    EXPECT_NEAR(before.y[i], -0.3 * std::copysign(1, before.x[i]) + 0.66 * before.x[i], 0.013) << before.x[i];
  }
}

TEST(ExplainFigures, speak_of_position_and_metres_for_a_linear_axis) {
  const Figure figure = profile_figure(named_sample(), "torque", "m");
  ASSERT_GE(figure.panels.size(), 2U);
  EXPECT_EQ(figure.panels[0].x.unit, "m/s");
  EXPECT_EQ(figure.panels[1].x.label, "Position x");
}

TEST(ExplainWords, say_why_there_is_no_proof_on_held_out_runs) {
  Explanation e = named_sample();
  e.gap.heldout_before = isac::explain::kNotKnown;
  EXPECT_NE(gap_sentence(e).find("the held-out ones do not show it"), std::string::npos) << gap_sentence(e);
  e.heldout_runs = 0;
  EXPECT_NE(gap_sentence(e).find("none was held out"), std::string::npos) << gap_sentence(e);
}

TEST(ExplainWords, never_say_that_something_is_certain) {
  EXPECT_EQ(percent(0.9999), "> 99 %");
  EXPECT_EQ(percent(1), "> 99 %");
  EXPECT_EQ(percent(0.0001), "< 1 %");
  EXPECT_EQ(percent(0), "< 1 %");
  EXPECT_EQ(percent(std::nan("")), "–");
  EXPECT_EQ(joined({"a", "b", "c"}), "a, b and c");
}

TEST(ExplainWords, write_equations_with_the_letters_of_the_report) {
  EXPECT_EQ(equation_in_words("-T_c sgn(w)"), "−T_c sgn(φ̇)");
  EXPECT_EQ(equation_in_words("-dI w'"), "−dI φ̈");
  EXPECT_EQ(equation_in_words("-k3 phi^3"), "−k3 φ³");
  EXPECT_EQ(equation_in_words("u -> u1 +- x, u <= p_s, -T_c (p_mean/p0)^n sgn(w)"),
            "u → u1 ± x, u ≤ p_s, −T_c (p_mean/p0)ⁿ sgn(φ̇)");
  EXPECT_EQ(equation_in_words("a sin(2 pi f t + psi)"), "a sin(2 π f t + ψ)");
}

TEST(ExplainWords, leave_an_explanation_its_own_summary) {
  Explanation e = named_sample();
  e.summary = "It is the chain.";
  EXPECT_EQ(verdict_sentence(e), "It is the chain.");
}

}  // namespace
