// isac-explain as a person runs it: what it writes is what the other programs read.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "explain/additions.hpp"
#include "explain/answer.hpp"
#include "explain/plan.hpp"
#include "isac/card/sim_options.hpp"
#include "isac/control/deployed.hpp"
#include "isac/core/units.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/plan_file.hpp"
#include "isac/record/tables.hpp"
#include "run_program.hpp"

namespace isac {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kRig = R"(format = "isac.rig/1"
name = "testbed"

[joint]
chain_wheel_diameter = "38 mm"
initial_pressure = "3.0 kg/cm2"
inertia = "0.0085 kg m2"
)";

Estimated estimated(const char* name, const char* unit, double value) {
  Estimated e;
  e.name = name;
  e.unit = unit;
  e.value = value;
  return e;
}

explain::Candidate effect(const char* id, std::vector<Estimated> parameters) {
  explain::Candidate c;
  c.id = id;
  c.name = id;
  c.parameters = std::move(parameters);
  return c;
}

/// An answer with an effect that can be fed forward, one that the predictor carries, and one that nobody can compensate.
explain::Explanation three_effects() {
  explain::Explanation e;
  e.verdict = explain::Verdict::kNamed;
  e.base = {estimated("A", "N/m", -23000), estimated("B", "N cm2/kg", 170), estimated("C", "N m s3", 0.003),
            estimated("D", "N m s", 0.15), estimated("K_C", "-", 0.98),     estimated("T_C", "s", 0.2)};
  e.effects = {effect("coulomb_friction", {estimated("T_c", "N m", 0.31)}),
               effect("dead_time", {estimated("L", "s", 0.021)}),
               effect("hysteresis", {estimated("T_h", "N m", 0.2), estimated("phi_s", "rad", 0.01)})};
  return e;
}

apps::ExplainInputs inputs() {
  apps::ExplainInputs in;
  in.rig.name = "testbed";
  in.facts.wheel_radius = 0.019;
  in.facts.inertia = 0.0085;
  in.sources = {"sha256:0 a.csv"};
  return in;
}

class ExplainFiles : public testing::Test {
 protected:
  ExplainFiles() {
    record::write_atomically(
        file(), record::format_params(apps::params_of(three_effects(), inputs(), "2003-05-01T14:30:00Z")));
  }
  [[nodiscard]] std::string file() const { return folder_ / "params.toml"; }
  test::ScratchFolder folder_;
};

TEST_F(ExplainFiles, give_the_simulated_rig_the_effects_that_were_found) {
  const simulate::RigConfig rig = card::parse_sim("noise=none,params=" + file() + ",seed=4");
  EXPECT_EQ(rig.joint.A, -23000);
  EXPECT_DOUBLE_EQ(rig.joint.B, 170 / kPascalPerKgfCm2);
  EXPECT_EQ(rig.joint.wheel_radius, 0.019);
  EXPECT_EQ(rig.joint.inertia, 0.0085);
  EXPECT_EQ(rig.valves[1].gain, 0.98);
  EXPECT_EQ(rig.valves[0].fill_lag, 0.2);
  EXPECT_EQ(rig.valves[0].vent_lag, 0.2);
  EXPECT_EQ(rig.valves[0].dead_time, 0.021);
  EXPECT_EQ(rig.seed, 4U);
  ASSERT_EQ(rig.effects.size(), 2U) << "the transport delay is the valve's dead time, and counts once";
  EXPECT_EQ(rig.effects[0].id, "coulomb_friction");
  EXPECT_EQ(rig.effects[0].parameters, std::vector<double>{0.31});
  EXPECT_EQ(rig.effects[1].id, "hysteresis");
  EXPECT_EQ(rig.effects[1].parameters, (std::vector<double>{0.2, 0.01}));
}

TEST_F(ExplainFiles, give_the_controller_what_it_can_compensate) {
  const models::ParameterTable table = record::parameter_table(record::read_params(file()));
  ASSERT_EQ(table.joint_count, 1);
  EXPECT_EQ(table.effect_count, 3);
  EXPECT_EQ(table.joints[0][models::JointField::kValveDeadTime], 0.021);
  control::FeedForward<double> feed_forward;
  int left_out = 0;
  ASSERT_TRUE(ok(control::feed_forward_of(table, 0, feed_forward, left_out)));
  EXPECT_EQ(feed_forward.size(), 1);
  EXPECT_EQ(left_out, 2);
  // Desired motion faster than twice the dead zone: all of the friction is met.
  EXPECT_DOUBLE_EQ(feed_forward.torque({.velocity = 1.0}), 0.31);
  EXPECT_DOUBLE_EQ(feed_forward.torque({.velocity = -1.0}), -0.31);
}

TEST_F(ExplainFiles, are_exported_by_isac_identify) {
  const auto run = test::run_program({"isac-identify", "export", file(), "-o", folder_ / "tables"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  bool header = false;
  for (const auto& entry : fs::recursive_directory_iterator(folder_.path()))
    header = header || entry.path().extension() == ".h";
  EXPECT_TRUE(header);
}

TEST_F(ExplainFiles, make_isac_log_record_a_rig_that_has_them) {
  std::ofstream(folder_ / "rig.toml") << kRig;
  const auto run = test::run_program({"isac-log", "constant-pressure", "--slow", "--duration", "20 s",
                                      "--card", "sim:noise=none,jitter=off,params=" + file(), "--rig",
                                      folder_ / "rig.toml", "-o", folder_ / "out"});
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  const series::Recording recording =
      record::read_recording(fs::path(folder_ / "out") / "constant-pressure-slow_dp+0.00.csv");
  const auto &F1 = recording.column("F1").values, &F2 = recording.column("F2").values,
             &angle = recording.column("angle").values;
  // Torque on the way up less the one on the way down at the same angle, near the middle: −2 (T_c + T_h + D·0.3) or so.
  double up = 0, down = 0, n_up = 0, n_down = 0;
  for (std::size_t i = 50; i + 50 < angle.size(); ++i) {
    const double torque = (F2[i] - F1[i]) * 0.019 + 23000 * 0.019 * 0.019 * angle[i],
                 step = angle[i + 25] - angle[i - 25];
    if (std::abs(angle[i]) > 0.15 || std::abs(step) < 0.015) continue;
    (step > 0 ? up : down) += torque;
    (step > 0 ? n_up : n_down) += 1;
  }
  ASSERT_GT(std::min(n_up, n_down), 100);
  // Friction 0.31 and hysteresis 0.2 each way; damping 0.15 · (0.2 … 0.32 rad/s) comes on top, 0.03 … 0.05 each way.
  EXPECT_NEAR(0.5 * (down / n_down - up / n_up), 0.31 + 0.2 + 0.04, 0.03);
}

TEST(ExplainCompensation, says_of_every_effect_what_the_controller_does) {
  const auto sentences = apps::compensation_of(three_effects());
  ASSERT_EQ(sentences.size(), 3U);
  EXPECT_NE(sentences[0].find("feeds it forward"), std::string::npos);
  EXPECT_NE(sentences[1].find("predictor"), std::string::npos);
  EXPECT_NE(sentences[2].find("cannot be compensated; it has a memory"), std::string::npos);
}

/// The example of docs/formats.md has every key that is written, in the same order.
TEST(ExplainAnswer, has_the_keys_of_its_documented_example) {
  const std::string text = test::read_text(std::string(ISAC_SOURCE_DIR) + "/docs/formats.md");
  const auto begin = text.find("{\"schema\": \"isac.explain/1\""), end = text.find("\n```", begin);
  ASSERT_NE(begin, std::string::npos);
  const auto shown = nlohmann::ordered_json::parse(text.substr(begin, end - begin));
  explain::Explanation e = three_effects();
  e.signals.resize(1);
  e.where.resize(1);
  e.could_hide.resize(1);
  e.waterfall.resize(1);
  const auto written = nlohmann::ordered_json::parse(apps::format_explanation(e, {}));
  const auto keys = [](const nlohmann::ordered_json& object) {
    std::vector<std::string> names;
    for (const auto& [name, value] : object.items()) names.push_back(name);
    return names;
  };
  EXPECT_EQ(keys(written), keys(shown));
  for (const char* part : {"disagreement", "gap", "data", "fit"})
    EXPECT_EQ(keys(written[part]), keys(shown[part])) << part;
  EXPECT_EQ(keys(written["effects"][0]), keys(shown["effects"][0]));
  EXPECT_EQ(keys(written["disagreement"]["signals"][0]), keys(shown["disagreement"]["signals"][0]));
  EXPECT_EQ(keys(written["disagreement"]["where"][0]), keys(shown["disagreement"]["where"][0]));
  EXPECT_EQ(keys(written["could_hide"][0]), keys(shown["could_hide"][0]));
  EXPECT_EQ(keys(written["waterfall"][0]), keys(shown["waterfall"][0]));
  EXPECT_TRUE(written["gap"]["before"].is_null()) << "what is not known is null";
}

TEST(ExplainAnswer, tells_what_separates_two_candidates_and_how_the_unknown_looks) {
  explain::Explanation e;
  e.verdict = explain::Verdict::kUnknown;
  e.next_experiment.emplace();
  e.next_experiment->sentence = "Sweep slowly.";
  e.next_experiment->separates_a = "coulomb_friction";
  e.next_experiment->separates_b = "hysteresis";
  e.next_experiment->separation_expected = 7;
  e.unknown.emplace();
  e.unknown->at = {0, 1};
  e.unknown->shape = {0.1, std::nan("")};
  e.unknown->band = {0.01, 0.02};
  const json answer = json::parse(apps::format_explanation(e, {}));
  EXPECT_EQ(answer["verdict"], "unknown");
  EXPECT_EQ(answer["next_experiment"], "Sweep slowly.");
  EXPECT_EQ(answer["separation"]["between"], (json{"coulomb_friction", "hysteresis"}));
  EXPECT_TRUE(answer["separation"]["now_sigma"].is_null());
  EXPECT_TRUE(answer["unknown"]["shape"]["mean"][1].is_null());
  EXPECT_EQ(answer["unknown"]["shape"]["at"], (json{0.0, 1.0}));
}

TEST(ExplainPlan, keeps_what_was_asked_for_in_the_units_of_the_answer) {
  explain::Explanation e;
  EXPECT_TRUE(apps::plan_of(e).runs.empty());
  e.next_experiment.emplace();
  e.next_experiment->sentence = "Sweep slowly.";
  explain::PlannedRun run;
  run.experiment = "constant-pressure";
  run.mean_pressure_kgcm2 = 2;
  run.pressure_swing_kgcm2 = 0.5;
  run.waveform = "steps";
  e.next_experiment->runs = {run};
  const series::Plan back = record::parse_plan(record::format_plan(apps::plan_of(e)), "plan.toml");
  ASSERT_EQ(back.runs.size(), 1U);
  EXPECT_EQ(back.reason, "Sweep slowly.");
  EXPECT_EQ(back.runs[0].mean_pressure, 2 * kPascalPerKgfCm2);
  EXPECT_EQ(back.runs[0].pressure_swing, 0.5 * kPascalPerKgfCm2);
  EXPECT_TRUE(std::isnan(back.runs[0].middle));
  EXPECT_EQ(back.runs[0].waveform, "steps");
}

class PlannedLog : public testing::Test {
 protected:
  PlannedLog() { std::ofstream(folder_ / "rig.toml") << kRig; }
  [[nodiscard]] test::Run log(const std::string& runs, const std::vector<std::string>& more = {}) const {
    std::ofstream(folder_ / "plan.toml") << "format = \"isac.plan/1\"\n" << runs;
    std::vector<std::string> words = {"isac-log",      "--plan", folder_ / "plan.toml", "--card",
                                      "sim:",          "--rig",  folder_ / "rig.toml",  "-o",
                                      folder_ / "data"};
    words.insert(words.end(), more.begin(), more.end());
    return test::run_program(words);
  }
  [[nodiscard]] std::vector<std::string> recordings() const {
    std::vector<std::string> names;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder_ / "data", none))
      if (entry.path().extension() == ".csv") names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }
  test::ScratchFolder folder_;
};

TEST_F(PlannedLog, adds_its_recordings_to_a_dataset_plan_after_plan) {
  const std::string runs =
      "[[run]]\nexperiment = \"free\"\nduration = \"10 s\"\npressure_swing = \"0.5 kg/cm2\"\npressure_period "
      "= \"5 s\"\n"
      "[[run]]\nexperiment = \"constant-pressure\"\nduration = \"10 s\"\nmean_pressure = \"2.9 "
      "kg/cm2\"\namplitude = \"0.2 rad\"\npeak_speed = \"0.8 rad/s\"\n";
  const auto first = log(runs);
  EXPECT_EQ(first.exit_code, 0) << first.out << first.err;
  EXPECT_EQ(recordings(), (std::vector<std::string>{"plan1-1-free.csv", "plan1-2-constant-pressure.csv"}));
  EXPECT_TRUE(fs::exists(fs::path(folder_ / "data") / "rig.toml")) << "a new folder becomes a dataset";
  const auto second = log(runs);
  EXPECT_EQ(second.exit_code, 0) << second.out << second.err;
  EXPECT_EQ(recordings().size(), 4U);
  EXPECT_EQ(recordings().back(), "plan2-2-constant-pressure.csv");

  const series::Recording free = record::read_recording(fs::path(folder_ / "data") / "plan1-1-free.csv");
  EXPECT_EQ(free.meta("experiment"), "free");
  const auto &p1 = free.column("p1_cmd").values, &p2 = free.column("p2_cmd").values;
  double high = -1e9, low = 1e9;
  for (std::size_t i = 0; i < p1.size(); ++i) {
    high = std::max(high, 0.5 * (p2[i] - p1[i]));
    low = std::min(low, 0.5 * (p2[i] - p1[i]));
  }
  // One code of the valve is 5 kg/cm² / 4095; two valves, and the corner falls between two samples.
  EXPECT_NEAR(high, 0.5 * kPascalPerKgfCm2, 0.003 * kPascalPerKgfCm2);
  EXPECT_NEAR(low, -0.5 * kPascalPerKgfCm2, 0.003 * kPascalPerKgfCm2);
}

TEST_F(PlannedLog, refuses_a_plan_beyond_the_limits_before_a_valve_opens) {
  const auto run = log("[[run]]\nexperiment = \"free\"\nduration = \"10 s\"\npressure_swing = \"1 kg/cm2\"\n",
                       {"--limit-delta-pressure", "0.8 kg/cm2"});
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  EXPECT_NE(
      run.err.find(
          "plan.toml: run 1 ('free') asks for a pressure difference of 1 kg/cm2, beyond the limit of 0.8"),
      std::string::npos)
      << run.err;
  EXPECT_FALSE(fs::exists(folder_ / "data"));
}

TEST_F(PlannedLog, takes_an_experiment_or_a_plan_but_not_both) {
  const auto run = log("[[run]]\nexperiment = \"free\"\nduration = \"10 s\"\n", {"free"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.err.find("--plan"), std::string::npos) << run.err;
}

struct Bad {
  const char* name;
  std::vector<std::string> words;
  int exit_code;
  const char* says;
};

class ExplainRefuses : public testing::TestWithParam<Bad> {};

TEST_P(ExplainRefuses, in_one_sentence_and_leaves_no_file) {
  const test::ScratchFolder folder;
  std::vector<std::string> words = {"isac-explain"};
  for (std::string word : GetParam().words) {
    if (word.rfind("fixtures/", 0) == 0) word = std::string(ISAC_SOURCE_DIR) + "/" + word;
    words.push_back(word);
  }
  words.insert(words.end(), {"-o", folder / "params.toml", "--report", folder / "report.html", "--plan",
                             folder / "plan.toml"});
  const auto run = test::run_program(words);
  EXPECT_EQ(run.exit_code, GetParam().exit_code) << run.err;
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  EXPECT_EQ(run.err.rfind("isac-explain: ", 0), 0U) << run.err;
  EXPECT_NE(run.err.find(GetParam().says), std::string::npos) << run.err;
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

INSTANTIATE_TEST_SUITE_P(
    Calls, ExplainRefuses,
    testing::Values(
        Bad{"no_dataset", {}, 2, "dataset"}, Bad{"option", {"x.csv", "--fast"}, 2, "--fast"},
        Bad{"threads", {"x.csv", "--threads", "0"}, 2, "--threads"},
        Bad{"excluded", {"x.csv", "--exclude", "magnetism"}, 2, "'magnetism', which is no effect"},
        Bad{"no_file", {"none.csv", "--rig", "fixtures/rig/testbed.toml"}, 3, "none.csv"},
        Bad{"no_rig", {"fixtures/recordings/slow.csv"}, 3, "chain wheel is not known"},
        Bad{"bad_rig",
            {"fixtures/recordings/slow.csv", "--rig", "fixtures/bad/rig_syntax.toml"},
            3,
            "rig_syntax.toml:3:7: "},
        Bad{"bad_model",
            {"fixtures/recordings/slow.csv", "--model", "fixtures/bad/model_unknown_term.toml"},
            3,
            "model_unknown_term.toml"},
        Bad{"bad_recording",
            {"fixtures/bad/csv_row_short.csv", "--rig", "fixtures/rig/testbed.toml"},
            3,
            "csv_row_short.csv"}),
    [](const testing::TestParamInfo<Bad>& call) { return std::string(call.param.name); });

TEST(ExplainProgram, says_that_a_recording_of_a_moment_is_not_usable) {
  const test::ScratchFolder folder;
  std::ofstream file(folder / "moment.csv");
  file << "time [s],angle [rad],p1 [bar],p2 [bar],F1 [N],F2 [N]\n";
  for (int i = 0; i < 50; ++i) file << 0.002 * i << ",0.1,3,3,95,95\n";
  file.close();
  const auto run =
      test::run_program({"isac-explain", folder / "moment.csv", "--rig",
                         std::string(ISAC_SOURCE_DIR) + "/fixtures/rig/testbed.toml", "--json", "-"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_TRUE(json::parse(run.out)["error"]["text"].is_string());
}

}  // namespace
}  // namespace isac
