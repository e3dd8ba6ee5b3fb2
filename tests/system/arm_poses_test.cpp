// The whole circle on the simulated arm, as a user walks it: plan poses, hold them, identify the masses.
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "run_program.hpp"

namespace isac::test {
namespace {
using nlohmann::json;

const std::string kArm = std::string(ISAC_SOURCE_DIR) + "/data/arms/right_soft_arm.toml";
constexpr std::array kTruth = {1.750, 0.450, 0.140};
constexpr std::array kNames = {"m1", "m2", "m3"};

/// The arm file with masses that somebody guessed: the program must not live on what it is to find.
std::string guessed_arm(const ScratchFolder& folder) {
  std::string text = read_text(kArm);
  for (const auto& [from, to] :
       {std::pair{"1.750 kg", "1.4 kg"}, std::pair{"0.450 kg", "0.6 kg"}, std::pair{"0.140 kg", "0.10 kg"}}) {
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, std::string(from).size(), to);
  }
  std::ofstream(folder / "guessed.toml") << text;
  return folder / "guessed.toml";
}

json answer_of(const Run& run, int expected_exit) {
  EXPECT_EQ(run.exit_code, expected_exit) << run.out << run.err;
  const json answer = json::parse(run.out, nullptr, false);
  EXPECT_FALSE(answer.is_discarded()) << run.out << run.err;
  return answer;
}

TEST(ArmPoses, plan_hold_identify_gives_the_masses_within_their_intervals) {
  const ScratchFolder folder;
  const std::string arm = guessed_arm(folder), plan = folder / "plan.csv";
  test::Run run = run_program({"isac-identify", "masses", "--arm", arm, "--design", "8", "--plan", plan});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.out.find("next 8 poses"), std::string::npos);

  run = run_program({"isac-log", "--arm", arm, "--plan", plan, "--card", "sim:arm=" + kArm + ",friction=0.01",
                     "-o", folder / "run", "--json", "-"});
  const json logged = answer_of(run, 0);
  EXPECT_EQ(logged["verdict"], "keep");
  ASSERT_EQ(logged["recordings"][0]["poses"].size(), 16u);  // each from below and from above
  for (const json& pose : logged["recordings"][0]["poses"]) {
    EXPECT_TRUE(pose["at_rest"].get<bool>());
    // 0.3 deg beside the plan, 0.25 deg not waited for, and what a joint creeps on until the others are there (below 1.5 deg).
    EXPECT_LT(pose["distance"]["value"].get<double>(), 0.036);
  }

  run = run_program(
      {"isac-identify", "masses", folder / "run/poses.csv", "--arm", arm, "--design", "0", "--json", "-"});
  const json answer = answer_of(run, 0);
  for (std::size_t k = 0; k < kNames.size(); ++k) {
    const json& mass = answer["parameters"][kNames[k]];
    EXPECT_LE(mass["ci95"][0].get<double>(), kTruth[k]) << kNames[k];
    EXPECT_GE(mass["ci95"][1].get<double>(), kTruth[k]) << kNames[k];
    EXPECT_LT(mass["std_error"].get<double>(),
              0.003);  // ten and more times better than with the seed's 0.1 N m
  }
  // Friction is 1 % of 2 B r kg/cm2: 0.96, 0.24, 0.067, 0.066, 0.021, 0.020 N m; half the difference of the sides shows it less
  // what the sides' angles differ (a degree at most, which is what joint 1 needs).
  EXPECT_NEAR(answer["friction"][2].get<double>(), 0.067, 0.01);
  EXPECT_NEAR(answer["friction"][4].get<double>(), 0.021, 0.003);
}

/// Five poses far apart, by hand: elbow and wrist turned to either side.
std::string plan_by_hand(const ScratchFolder& folder) {
  std::ofstream(folder / "hand.csv")
      << "theta1 [deg],theta2 [deg],theta3 [deg],theta4 [deg],theta5 [deg],theta6 [deg]\n"
         "0,40,30,15,0,50\n0,-5,-45,0,45,0\n20,65,-10,10,-50,0\n-20,-60,30,10,45,0\n"
         "0,10,-15,-15,-20,-25\n";
  return folder / "hand.csv";
}

json explained(const ScratchFolder& folder, const std::string& arm, const std::string& card,
               bool report = false) {
  const test::Run logged = run_program({"isac-log", "--arm", kArm, "--plan", plan_by_hand(folder), "--card",
                                        card, "-o", folder / "run", "--overwrite"});
  EXPECT_EQ(logged.exit_code, 0) << logged.err;
  std::vector<std::string> call = {"isac-explain", folder / "run/poses.csv", "--arm", arm, "--json", "-"};
  if (report) call.insert(call.end(), {"--report", folder / "hidden.html"});
  return answer_of(run_program(call), 0);
}

TEST(ArmPoses, explain_names_what_is_hidden_in_the_simulated_arm) {
  const ScratchFolder folder;
  EXPECT_EQ(explained(folder, kArm, "sim:friction=0.01")["verdict"], "none");

  const json load = explained(folder, kArm, "sim:friction=0.01,load=0.05", true);
  EXPECT_EQ(load["verdict"], "named");
  EXPECT_EQ(load["effects"][0]["id"], "hand_load");
  EXPECT_NEAR(load["effects"][0]["parameters"]["load"]["value"].get<double>(), 0.05, 0.001);
  EXPECT_EQ(load["lookalikes"], json::array({"m3"}));
  EXPECT_NE(read_text(folder / "hidden.html").find("a load in the hand"), std::string::npos);

  const json pull = explained(folder, kArm, "sim:friction=0.01,pull=3:0.3");
  EXPECT_EQ(pull["verdict"], "named");
  EXPECT_EQ(pull["effects"][0]["id"], "joint_pull");
  EXPECT_EQ(pull["effects"][0]["joint"], 3);

  const json zero = explained(folder, kArm, "sim:friction=0.01,zero=2:0.02");
  EXPECT_EQ(zero["verdict"], "named");
  EXPECT_EQ(zero["effects"][0]["id"], "angle_zero");
  EXPECT_NEAR(zero["effects"][0]["parameters"]["zero"]["value"].get<double>(), -0.02,
              0.001);  // reads too much

  std::string text = read_text(kArm);
  text.replace(text.find("-0.330 m"), 8, "-0.300 m");  // somebody measured 3 cm too little
  std::ofstream(folder / "short.toml") << text;
  const json length = explained(folder, folder / "short.toml", "sim:friction=0.01");
  EXPECT_EQ(length["verdict"], "named");
  EXPECT_EQ(length["effects"][0]["id"], "link_length");
  EXPECT_NEAR(length["effects"][0]["parameters"]["length_error"]["value"].get<double>(), -0.03, 0.003);
  EXPECT_EQ(length["lookalikes"], json::array({"m1"}));
}

TEST(ArmPoses, an_unplanned_arm_is_told_what_to_do) {
  const ScratchFolder folder;
  EXPECT_EQ(run_program({"isac-log", "--arm", kArm, "-o", folder / "run"}).exit_code, 2);
  const test::Run run = run_program({"isac-identify", "masses", "--arm", kArm});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.err.find("--plan"), std::string::npos) << run.err;
}

TEST(ArmPoses, a_limit_stops_the_arm_and_says_which) {
  const ScratchFolder folder;
  std::ofstream(folder / "plan.csv")
      << "theta1 [deg],theta2 [deg],theta3 [deg],theta4 [deg],theta5 [deg],theta6 [deg]\n"
         "0,5,0,0,0,0\n0,-60,0,0,0,0\n";
  const std::vector<std::string> call = {"isac-log",          "--arm", kArm,           "--plan",
                                         folder / "plan.csv", "-o",    folder / "run", "--limit-speed",
                                         "0.3 rad/s"};
  const test::Run run = run_program(call);
  EXPECT_EQ(run.exit_code, 4) << run.out << run.err;
  EXPECT_NE(run.err.find("joint 2 turned with"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("rows until then are in"), std::string::npos) << run.err;
  EXPECT_EQ(run_program(call).exit_code, 3);  // a recording is never overwritten unasked
}

TEST(ArmPoses, a_pose_at_a_limit_is_moved_inwards_and_that_is_said) {
  const ScratchFolder folder;
  std::ofstream(folder / "plan.csv")
      << "theta1 [deg],theta2 [deg],theta3 [deg],theta4 [deg],theta5 [deg],theta6 [deg]\n"
         "85,0,0,0,0,0\n";
  const test::Run run =
      run_program({"isac-log", "--arm", kArm, "--plan", folder / "plan.csv", "-o", folder / "run"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.out.find("joint 1 goes to 76.5 instead of 85.0 deg"), std::string::npos) << run.out;
}

TEST(ArmPoses, a_pose_beyond_the_muscles_is_left_out_and_that_is_said) {
  const ScratchFolder folder;
  std::ofstream(folder / "plan.csv")
      << "theta1 [deg],theta2 [deg],theta3 [deg],theta4 [deg],theta5 [deg],theta6 [deg]\n"
         "0,0,20,0,0,0\n0,75,0,0,0,0\n";  // 16.9 N m/rad of muscle 2 alone ask for 1.8 kg/cm2
  const test::Run run = run_program({"isac-log", "--arm", kArm, "--plan", folder / "plan.csv", "-o",
                                     folder / "run", "--limit-delta-pressure", "1.5 kg/cm2"});
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_NE(run.out.find("joint 2's muscles are at the limit of their pressure: left out"), std::string::npos)
      << run.out;
  const std::string rows = read_text(folder / "run/poses.csv");
  EXPECT_NE(rows.find(",1,-1,"), std::string::npos);
  EXPECT_EQ(rows.find(",2,-1,"), std::string::npos);
}

TEST(ArmPoses, an_arm_without_actuators_cannot_be_held) {
  const ScratchFolder folder;
  std::string text = read_text(kArm);
  text.resize(text.find("[[actuator]]"));
  std::ofstream(folder / "bare.toml") << text;
  std::ofstream(folder / "plan.csv")
      << "theta1 [deg],theta2 [deg],theta3 [deg],theta4 [deg],theta5 [deg],theta6 [deg]\n"
         "0,5,0,0,0,0\n";
  const test::Run run = run_program({"isac-log", "--arm", folder / "bare.toml", "--plan", folder / "plan.csv",
                                     "-o", folder / "run", "--card", "sim:arm=" + kArm});
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_NE(run.err.find("[[actuator]]"), std::string::npos) << run.err;
}

}  // namespace
}  // namespace isac::test
