// isac-explain on the simulated rig, from the first recording to the name: nothing hidden, one effect, two that are tied until
// the sweep that was asked for is recorded (docs/tutorials/tell-two-effects-apart.md).
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "run_program.hpp"

namespace isac::test {
namespace {

using nlohmann::json;

std::vector<std::string> ids(const json& candidates) {
  std::vector<std::string> names;
  for (const json& one : candidates) names.push_back(one["id"]);
  return names;
}

bool holds(const std::vector<std::string>& list, const char* name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

/// All that an answer names or cannot rule out, by their ids.
std::vector<std::string> told_by(const json& answer) {
  std::vector<std::string> names = ids(answer["effects"]);
  for (const std::string& id : ids(answer["alternatives"])) names.push_back(id);
  std::sort(names.begin(), names.end());
  return names;
}

class ExplainOnTheRig : public testing::Test {
 protected:
  void log(const std::string& card, std::vector<std::string> words) {
    words.insert(words.begin(), "isac-log");
    words.insert(words.end(), {"--card", "sim:" + card, "--rig", rig_, "-o", folder_ / "dataset"});
    const auto run = run_program(words);
    ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  }
  void log_first_afternoon(const std::string& card) {
    log(card, {"--plan", std::string(ISAC_SOURCE_DIR) + "/docs/tutorials/tell-two-effects-apart/first.toml"});
  }
  json explain() {
    const auto run = run_program(
        {"isac-explain", folder_ / "dataset", "--rig", rig_, "--plan", folder_ / "next.toml", "--json", "-"});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out, nullptr, false);
  }
  const std::string rig_ = std::string(ISAC_SOURCE_DIR) + "/data/rigs/testbed.toml";
  ScratchFolder folder_;
};

class NothingHidden : public ExplainOnTheRig, public testing::WithParamInterface<int> {};

/// Five recordings are few: the slow noise of the simulated amplifiers may leave "unknown", but it is given no name.
TEST_P(NothingHidden, in_five_recordings_is_given_no_name) {
  log_first_afternoon("seed=" + std::to_string(GetParam()));
  const json few = explain();
  EXPECT_TRUE(few["effects"].empty()) << few["summary"];
  EXPECT_TRUE(few["alternatives"].empty()) << few["summary"];
}
INSTANTIATE_TEST_SUITE_P(Seeds, NothingHidden, testing::Values(1, 2, 5));

TEST_F(ExplainOnTheRig, names_nothing_in_all_sweeps_of_a_rig_without_an_effect) {
  log("seed=2003", {"all"});
  const json all = explain();
  EXPECT_TRUE(all["verdict"] == "none" || all["verdict"] == "immaterial") << all["summary"];
  EXPECT_TRUE(all["effects"].empty());
}

TEST_F(ExplainOnTheRig, names_a_hidden_stiffness_with_its_number_and_shrinks_the_gap_on_runs_it_never_saw) {
  log("seed=11,effect=cubic_stiffness:0.4", {"all"});
  const json found = explain();
  EXPECT_EQ(found["verdict"], "named") << found["summary"];
  ASSERT_EQ(ids(found["effects"]), std::vector<std::string>{"cubic_stiffness"});
  const json& k3 = found["effects"][0]["parameters"]["k3"];
  EXPECT_LT(k3["ci95"][0].get<double>(), 0.4);
  EXPECT_GT(k3["ci95"][1].get<double>(), 0.4);
  EXPECT_NEAR(k3["value"].get<double>(), 0.4, 0.004);  // one per cent, six of its standard errors
  // The sensors' own noise leaves about 0.0085 N m on these three runs.
  EXPECT_LT(found["gap"]["heldout_after"].get<double>(), 0.45 * found["gap"]["heldout_before"].get<double>());
  EXPECT_GT(found["gap"]["share_closed"].get<double>(), 0.8);
}

/// The simulated hand rests at each end of a stroke and trembles by half a step of the encoder, and the counter gives the step below. These
/// recordings are at one mean pressure, where friction that goes with the pressure is like one that does not.
TEST_F(ExplainOnTheRig, names_dry_friction_though_the_hand_trembles_where_it_turns) {
  const std::string effect = ",effect=pressure_dependent_friction:0.02:1";
  log_first_afternoon("seed=2" + effect);
  const json before = explain();
  EXPECT_EQ(told_by(before), (std::vector<std::string>{"coulomb_friction", "pressure_dependent_friction"}))
      << before["summary"];
  EXPECT_NE(before["warnings"].dump().find("slow_turns_left_out"), std::string::npos) << before["warnings"];
  EXPECT_GT(before["separation"]["expected_sigma"].get<double>(), 5);

  log("seed=102" + effect, {"--plan", folder_ / "next.toml"});
  const json after = explain();
  EXPECT_EQ(after["verdict"], "named") << after["summary"];
  ASSERT_EQ(ids(after["effects"]), std::vector<std::string>{"pressure_dependent_friction"});
  EXPECT_TRUE(holds(ids(after["rejected"]), "coulomb_friction"));
  EXPECT_NEAR(after["effects"][0]["parameters"]["T_c"]["value"].get<double>(), 0.02, 0.001);
}

TEST_F(ExplainOnTheRig, leaves_half_a_step_of_the_encoder_to_the_recorder_beside_an_effect_too) {
  log_first_afternoon("seed=1,effect=torque_ripple:0.01:0:16");
  const json found = explain();
  EXPECT_EQ(found["verdict"], "named") << found["summary"];
  ASSERT_EQ(ids(found["effects"]), std::vector<std::string>{"torque_ripple"});
  EXPECT_TRUE(found["alternatives"].empty()) << found["summary"];
  EXPECT_NE(found["summary"].get<std::string>().find("how the recorder counts"), std::string::npos)
      << found["summary"];
}

TEST_F(ExplainOnTheRig, tells_two_effects_apart_after_the_one_sweep_that_it_asks_for) {
  const std::string effect = ",effect=muscle_asymmetry:3.6e-6";
  log_first_afternoon("seed=5" + effect);
  const json before = explain();
  const std::vector<std::string> tied = told_by(before);
  EXPECT_TRUE(holds(tied, "muscle_asymmetry")) << before["summary"];
  EXPECT_TRUE(holds(tied, "torque_offset")) << before["summary"];
  EXPECT_LT(before["separation"]["now_sigma"].get<double>(), 1);
  EXPECT_GT(before["separation"]["expected_sigma"].get<double>(), 5);

  log("seed=15" + effect, {"--plan", folder_ / "next.toml"});
  const json after = explain();
  EXPECT_EQ(after["verdict"], "named") << after["summary"];
  ASSERT_EQ(ids(after["effects"]), std::vector<std::string>{"muscle_asymmetry"});
  EXPECT_TRUE(after["alternatives"].empty());
  // 3.6e-6 N/Pa at 98066.5 Pa per kg/cm².
  const json& b = after["effects"][0]["parameters"]["b"];
  EXPECT_LT(b["ci95"][0].get<double>(), 0.35304);
  EXPECT_GT(b["ci95"][1].get<double>(), 0.35304);
  EXPECT_TRUE(holds(ids(after["rejected"]), "torque_offset"));
}

// Half a step of the encoder is a third of what tells them apart, and pulls against it.
TEST_F(ExplainOnTheRig, tells_two_effects_apart_though_half_a_step_of_the_encoder_is_like_one_of_them) {
  const std::string effect = ",effect=muscle_asymmetry:-2.5e-6";
  log_first_afternoon("seed=1" + effect);
  const std::vector<std::string> tied = told_by(explain());
  EXPECT_TRUE(holds(tied, "muscle_asymmetry"));
  EXPECT_TRUE(holds(tied, "torque_offset"));
  log("seed=101" + effect, {"--plan", folder_ / "next.toml"});
  const json after = explain();
  ASSERT_EQ(ids(after["effects"]), std::vector<std::string>{"muscle_asymmetry"}) << after["summary"];
  EXPECT_TRUE(after["alternatives"].empty()) << after["summary"];
}

// A vented muscle in the valves' own sweep is no leave to lead a slack one, and friction with the pressure is another, not hardly more.
TEST_F(ExplainOnTheRig, tells_friction_with_the_pressure_after_all_sweeps) {
  const std::string effect = ",effect=pressure_dependent_friction:0.02:1";
  log("seed=11" + effect, {"all"});
  const std::vector<std::string> tied = told_by(explain());
  EXPECT_TRUE(holds(tied, "coulomb_friction"));
  EXPECT_TRUE(holds(tied, "pressure_dependent_friction"));
  log("seed=111" + effect, {"--plan", folder_ / "next.toml"});
  const json after = explain();
  EXPECT_EQ(after["verdict"], "named") << after["summary"];
  ASSERT_EQ(ids(after["effects"]), std::vector<std::string>{"pressure_dependent_friction"});
  EXPECT_TRUE(holds(ids(after["rejected"]), "coulomb_friction"));
  EXPECT_NEAR(after["effects"][0]["parameters"]["n"]["value"].get<double>(), 1, 0.2);
}

}  // namespace
}  // namespace isac::test
