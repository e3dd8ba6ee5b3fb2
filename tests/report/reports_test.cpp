#include <gtest/gtest.h>

#include <cstdlib>

#include "isac/core/error.hpp"
#include "isac/report/joint_report.hpp"
#include "sample_fits.hpp"
#include "sample_joint.hpp"
#include "svg_check.hpp"

namespace {
using namespace isac::report;
using namespace isac::report::testing;

/// What every report must be, whatever it is about.
void expect_sound(const std::string& html) {
  EXPECT_EQ(xml_fault(html, true), "");
  EXPECT_EQ(html.rfind("<!DOCTYPE html>", 0), 0U);
  // The only addresses are the names of the two XML name spaces.
  EXPECT_EQ(occurrences(html, "http"), occurrences(html, "\"http://www.w3.org/2000/svg\"") +
                                           occurrences(html, "\"http://www.w3.org/1999/xlink\""));
  for (const char* outside : {"<script", "<link", "<img", "@import", "url("})
    EXPECT_EQ(html.find(outside), std::string::npos) << outside;
  EXPECT_EQ(occurrences(html, "<figure>"), occurrences(html, "<svg "));
  // Every figure holds curves: axes and grid alone are fewer strokes than this.
  for (std::size_t at = html.find("<svg "); at != std::string::npos; at = html.find("<svg ", at + 1)) {
    const std::string svg = html.substr(at, html.find("</svg>", at) - at);
    EXPECT_NE(svg.find("stroke='rgb("), std::string::npos) << svg.substr(0, 300);
  }
  for (const char* broken : {">nan<", ">-nan<", ">inf<", "NaN"})
    EXPECT_EQ(html.find(broken), std::string::npos) << broken;
}

TEST(JointReport, shows_everything_a_full_set_of_runs_holds) {
  const JointSample sample = joint_sample(0.2);
  const std::string html = render_joint_report(sample.input());
  expect_sound(html);
  EXPECT_NE(html.find("T = −23442 r² φ + 174.310 r Δp − 0.002584 φ̇³ − 0.1407 φ̇"), std::string::npos);
  for (const char* part : {"as a torque sensor", "Static model", "at constant pressure, measured",
                           "constant pressure differences", "Bundle:", "constant velocity",
                           "Cut of the bundle", "over each regressor", "over time, one run", "Whiteness",
                           "Where the parameters hold", "during fast movement", "Signals of bundle.csv",
                           "Correlation of the estimates", "What to do next", "Only one run was held out"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_EQ(html.find("Not shown"), std::string::npos);
  EXPECT_LT(html.size(), 3'000'000U);
}

TEST(JointReport, is_the_same_twice) {
  const JointSample sample = joint_sample(0.05);
  EXPECT_EQ(render_joint_report(sample.input()), render_joint_report(sample.input()));
}

TEST(JointReport, names_what_is_refused_and_the_sweep_that_mends_it) {
  JointSample sample;
  add_run(sample, "slow.csv", 0.05, 0.0, 20, false, 1);
  finish(sample);
  for (std::size_t k : {std::size_t{2}, std::size_t{3}}) {
    auto& parameter = sample.fit.parameters[k];
    parameter = {.name = parameter.name,
                 .unit = parameter.unit,
                 .identifiable = false,
                 .reason = "the joint never moves faster than 0.6 rad/s; record fast sweeps up to 6 rad/s."};
  }
  sample.fit.correlation.assign(16, std::nan(""));
  sample.fit.cut = {};
  const std::string html = render_joint_report(sample.input());
  expect_sound(html);
  EXPECT_NE(html.find("C: the joint never moves faster than 0.6 rad/s; record fast sweeps up to 6 rad/s."),
            std::string::npos);
  EXPECT_NE(html.find("For D: "), std::string::npos);
  EXPECT_NE(html.find("not identified"), std::string::npos);
  // Pictures whose experiment is missing are named with the reason.
  EXPECT_NE(html.find("Not shown, because the runs do not hold it"), std::string::npos);
  EXPECT_NE(html.find("C and D are not identified"), std::string::npos);
  EXPECT_NE(html.find("needs slow runs at two or more constant Δp"), std::string::npos);
}

TEST(JointReport, speaks_of_force_and_position_for_a_linear_axis_without_pressure) {
  JointSample sample;
  add_run(sample, "axis.csv", 0.5, 0.0, 20, false, 1);
  finish(sample);
  sample.options.position_unit = "m";
  sample.options.output_unit = "N";
  sample.fit.parameters = {estimated("inertia", "kg", 95.1, 0.3),
                           estimated("viscous_damping", "N s/m", 203.5, 2.1)};
  sample.fit.correlation = {1, 0.1, 0.1, 1};
  sample.runs[0].delta_pressure.clear();
  sample.runs[0].mean_pressure.clear();
  sample.fit.runs[0].delta_pressure.clear();
  sample.fit.box = {};
  sample.fit.cut = {};
  JointReportInput input = sample.input();
  input.terms = {{"inertia", "−J a"}};
  const std::string html = render_joint_report(input);
  expect_sound(html);
  EXPECT_NE(html.find("Position x (m)"), std::string::npos);
  EXPECT_NE(html.find("Force F (N)"), std::string::npos);
  EXPECT_EQ(html.find("kg/cm²)"), std::string::npos);
}

TEST(JointReport, survives_a_fit_without_a_row) {
  JointSample sample;
  finish(sample);
  expect_sound(render_joint_report(sample.input()));
}

TEST(JointReport, escapes_names_from_files) {
  JointSample sample;
  add_run(sample, "a<b>&\"'`{_^.csv", 0.5, 0.0, 10, false, 1);
  finish(sample);
  const std::string html = render_joint_report(sample.input());
  expect_sound(html);
  EXPECT_NE(html.find("a&lt;b&gt;&amp;&quot;&#39;`{_^.csv"), std::string::npos);
}

TEST(JointReport, sets_commands_as_code_and_keeps_a_sign_with_its_digits) {
  JointSample sample;
  add_run(sample, "slow_dp-1.5.csv", 0.5, 0.0, 10, false, 1);
  finish(sample);
  const std::string html = render_joint_report(sample.input());
  EXPECT_NE(html.find("<code>isac-identify "), std::string::npos);
  EXPECT_EQ(html.find('`'), std::string::npos);
  EXPECT_NE(html.find("slow_\u200bdp-\u20601.\u20605.\u200bcsv"), std::string::npos);
}

TEST(JointReport, refuses_a_pressure_unit_that_is_none) {
  const JointSample sample = joint_sample(0.02);
  JointReportInput input = sample.input();
  input.pressure_unit = "rad";
  EXPECT_THROW(static_cast<void>(render_joint_report(input)), isac::Error);
}

TEST(PcuReport, shows_filling_and_venting_apart_and_says_what_is_not_first_order) {
  const auto fit = pcu_sample();
  const std::string html = render_pcu_report({.fit = &fit});
  expect_sound(html);
  for (const char* part : {"Step responses, filling", "Step responses, venting", "misses it by 14 %",
                           "K_vent: no command", "Filling and venting differ", "T_fill"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
}

TEST(MuscleReport, ranks_the_models_and_draws_the_best) {
  const auto fit = muscle_sample();
  const std::string html = render_muscle_report({.fit = &fit});
  expect_sound(html);
  EXPECT_LT(html.find("M5 Kerscher"), html.find("M2 Bridgestone"));
  EXPECT_NE(html.find("Held-out runs"), std::string::npos);
  EXPECT_NE(html.find("ε = 22.0 %"), std::string::npos);
}

TEST(CalibrationReport, shows_line_residual_and_verdict_of_every_channel) {
  CalibrationReportInput input;
  input.channels = {channel_sample("p1", false), channel_sample("F2", true)};
  input.middles = {middle_sample()};
  const std::string html = render_calibration_report(input);
  expect_sound(html);
  EXPECT_NE(html.find("F2: the channel bends by 1.2 % of full scale."), std::string::npos);
  EXPECT_NE(html.find("4012.30"), std::string::npos);
}

TEST(CheckReport, draws_every_signal_counts_missing_samples_and_repeats_the_findings) {
  const std::vector<isac::series::Recording> recordings = {recording_sample(6000),
                                                           recording_sample(3000, "b.csv")};
  CheckReportInput input;
  input.recordings = recordings;
  input.findings = {{{"gap", "torque is missing for 0.8 s"}}};
  const std::string html = render_check_report(input);
  expect_sound(html);
  for (const char* part : {">angle (rad)<", ">p1 (kPa)<", ">torque (N\u00A0m)<", ">Missing (%)<",
                           "torque is missing for 0.8 s", "Nothing to remark", "Time step: median 2.0"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_NE(html.find("<td class=\"n\">399</td>"), std::string::npos);  // 6000/15 rows less one
}

TEST(CheckReport, draws_a_file_without_time_over_its_rows) {
  auto recording = recording_sample(500);
  recording.columns.erase(recording.columns.begin());
  CheckReportInput input;
  input.recordings = {&recording, 1};
  const std::string html = render_check_report(input);
  expect_sound(html);
  EXPECT_NE(html.find(">Row<"), std::string::npos);
}

TEST(Reports, are_not_made_at_all_without_gnuplot) {
  const std::string before = std::getenv("PATH");
  setenv("PATH", "/nonexistent", 1);
  CheckReportInput input;
  EXPECT_THROW(static_cast<void>(render_check_report(input)), isac::Error);
  const auto fit = pcu_sample();
  EXPECT_THROW(static_cast<void>(render_pcu_report({.fit = &fit})), isac::Error);
  setenv("PATH", before.c_str(), 1);
}

}  // namespace
