// isac-identify masses as a user calls it. Torques come from hand-written trigonometry (docs/errata.md: 4.12 z mended, 4.48 row 6
// mended), not from the toolkit's chain.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "run_program.hpp"

namespace isac::test {
namespace {
using nlohmann::json;

constexpr double kTruth[3] = {1.750, 0.450, 0.140};
constexpr double kDegree = 3.14159265358979323846 / 180;
const std::string kArm = std::string(ISAC_SOURCE_DIR) + "/data/arms/right_soft_arm.toml";

/// Torques of gravity by hand: τ = −∂V/∂θ of V = g (m1 z1 + m2 z2 + m3 z3), z1 = l1 + s2 l3/2, z2 = l1 + s2 l3 + c23 l4/2,
/// z3 = −(p6 c6 + s23 s4 s6) l5 + c23 l4 + s2 l3 + l1, p6 = −s23 c4 c5 − c23 s5.
std::vector<double> gravity(const std::vector<double>& t, const double* m) {
  const double g = 9.81, l3 = 0.330, l4 = 0.290, l5 = 0.160;
  const double c2 = std::cos(t[1]), s23 = std::sin(t[1] + t[2]), c23 = std::cos(t[1] + t[2]);
  const double s4 = std::sin(t[3]), c4 = std::cos(t[3]), s5 = std::sin(t[4]), c5 = std::cos(t[4]);
  const double s6 = std::sin(t[5]), c6 = std::cos(t[5]);
  const double p6 = -s23 * c4 * c5 - c23 * s5, p6_23 = -c23 * c4 * c5 + s23 * s5;
  const double wrist_23 = -(p6_23 * c6 + c23 * s4 * s6) * l5;  // of θ2 + θ3
  const double z1_2 = c2 * l3 / 2, z2_3 = -s23 * l4 / 2, z2_2 = c2 * l3 + z2_3;
  const double z3_3 = wrist_23 - s23 * l4, z3_2 = z3_3 + c2 * l3;
  const double z3_4 = -(s23 * s4 * c5 * c6 + s23 * c4 * s6) * l5;
  const double z3_5 = -((s23 * c4 * s5 - c23 * c5) * c6) * l5;
  const double z3_6 = -(-p6 * s6 + s23 * s4 * c6) * l5;  // 4.48 row 6, mended
  return {0,
          -g * (m[0] * z1_2 + m[1] * z2_2 + m[2] * z3_2),
          -g * (m[1] * z2_3 + m[2] * z3_3),
          -g * m[2] * z3_4,
          -g * m[2] * z3_5,
          -g * m[2] * z3_6};
}

json fit(const std::vector<std::string>& words, int expected_exit = 0) {
  std::vector<std::string> call{"isac-identify", "masses"};
  call.insert(call.end(), words.begin(), words.end());
  call.insert(call.end(), {"--json", "-"});
  const Run run = run_program(call);
  EXPECT_EQ(run.exit_code, expected_exit) << run.out << run.err;
  const json answer = json::parse(run.out, nullptr, false);
  EXPECT_FALSE(answer.is_discarded()) << run.out << run.err;
  return answer;
}

double value(const json& answer, const std::string& name) {
  return answer["parameters"][name]["value"].get<double>();
}
double std_error(const json& answer, const std::string& name) {
  return answer["parameters"][name]["std_error"].get<double>();
}
bool warns(const json& answer, const std::string& code) {
  for (const json& warning : answer["warnings"])
    if (warning["code"] == code) return true;
  return false;
}

/// A file of poses with arm angles in deg; `angles` and `torques` are the names in its header.
void write_poses(const std::string& path, const std::vector<std::vector<double>>& poses, double noise,
                 double sign, const std::string& angles = "theta{} [deg]",
                 const std::string& torques = "tau{} [N m]", const char* separator = ",") {
  const auto named = [](std::string pattern, int k) {
    return pattern.replace(pattern.find("{}"), 2, std::to_string(k));
  };
  std::mt19937 random(64);
  std::normal_distribution<double> normal;
  std::ofstream file(path);
  file.precision(12);
  file << "# experiment: pose\n";
  for (int k = 1; k <= 6; ++k) file << named(angles, k) << separator;
  for (int k = 1; k <= 6; ++k) file << named(torques, k) << (k < 6 ? separator : "\n");
  for (const auto& pose : poses) {
    const auto torque = gravity(pose, kTruth);
    for (int k = 0; k < 6; ++k) file << pose[k] / kDegree << separator;
    for (int k = 0; k < 6; ++k)
      file << sign * torque[k] + noise * normal(random) << (k < 5 ? separator : "\n");
  }
}

std::vector<std::vector<double>> some_poses(int count) {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> angle(-1.3, 1.3);
  std::vector<std::vector<double>> out(count, std::vector<double>(6));
  for (auto& pose : out)
    for (double& a : pose) a = angle(random);
  return out;
}

TEST(MassesProgram, gives_the_seeds_masses_from_the_pose_of_6_4) {
  const ScratchFolder folder;
  std::ofstream(folder / "pose.csv") << "theta1 [deg],theta2 [deg],theta3 [deg],theta4 [deg],theta5 "
                                        "[deg],theta6 [deg],tau2 [N m],tau3 [N m],tau5 [N m]\n"
                                        "0,-45,-45,0,90,0,-4.6117,-1.2581,-0.2197\n";
  const json answer = fit({folder / "pose.csv", "--arm", kArm});
  EXPECT_EQ(answer["schema"], "isac.masses/1");
  EXPECT_NEAR(value(answer, "m1"), 1.750, 5e-4);  // torques of four digits
  EXPECT_NEAR(value(answer, "m2"), 0.450, 5e-4);
  EXPECT_NEAR(value(answer, "m3"), 0.140, 5e-4);
  EXPECT_NEAR(std_error(answer, "m1"), 0.36, 0.005);
  EXPECT_NEAR(std_error(answer, "m2"), 0.21, 0.005);
  EXPECT_NEAR(std_error(answer, "m3"), 0.064, 0.0005);
  EXPECT_NEAR(answer["condition"].get<double>(), 38, 0.5);
  EXPECT_TRUE(warns(answer, "nothing_to_check_with"));
  EXPECT_EQ(answer["next_poses"].size(), 8u);
}

TEST(MassesProgram, recovers_the_masses_and_its_next_poses_are_as_good_as_it_says) {
  const ScratchFolder folder;
  write_poses(folder / "poses.csv", some_poses(20), 0.1, -1);
  const json answer = fit({folder / "poses.csv", "--arm", kArm, "-o", folder / "params.toml", "--report",
                           folder / "report.html"});
  EXPECT_EQ(answer["torques"], "actuator");
  const char* names[] = {"m1", "m2", "m3"};
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(value(answer, names[k]), kTruth[k], 4 * std_error(answer, names[k])) << names[k];
  EXPECT_NE(read_text(folder / "params.toml").find("[masses]"), std::string::npos);
  EXPECT_NE(read_text(folder / "report.html").find("Poses to hold next"), std::string::npos);
  std::vector<std::vector<double>> next;
  for (const json& pose : answer["next_poses"]) next.push_back(pose["theta"].get<std::vector<double>>());
  ASSERT_EQ(next.size(), 8u);
  write_poses(folder / "next.csv", next, 0, 1);
  const json designed =
      fit({folder / "next.csv", "--arm", kArm, "--torque-noise", "0.1 N m", "--squared", "--design", "0"});
  const double best[] = {0.051, 0.032, 0.0135};
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(value(designed, names[k]), kTruth[k], 1e-9);
    EXPECT_LT(std_error(designed, names[k]), 1.15 * best[k]);
    EXPECT_NEAR(std_error(designed, names[k]), answer["design"]["std_errors"][names[k]].get<double>(), 1e-9);
  }
  EXPECT_TRUE(designed["next_poses"].empty());
}

TEST(MassesProgram, reads_another_arm_through_its_file_and_maps) {
  const ScratchFolder folder;
  std::ofstream(folder / "arm.toml")
      << "format = \"isac.arm/1\"\nname = \"two links\"\n"
         "[[joint]]\nalpha = \"90 deg\"\n[[joint]]\na = \"0.4 m\"\n"
         "[[mass]]\nname = \"upper\"\nlink = 1\nposition = [\"0.2 m\", \"0 m\", \"0 m\"]\n"
         "[[mass]]\nname = \"lower\"\nlink = 2\nposition = [\"0.3 m\", \"0 m\", \"0 m\"]\n";
  std::ofstream file(folder / "foreign.csv");
  file.precision(12);
  file << "Shoulder (deg);Elbow (deg);Shoulder torque;Elbow torque\n";
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 12; ++i) {
    const double a = -1 + 0.17 * i, b = 1.2 - 0.23 * i, wrong = i == 4 ? 3.0 : 0;
    const double elbow = -9.81 * 1.3 * 0.3 * std::cos(a + b);
    const double shoulder = elbow - 9.81 * (2.1 * 0.2 + 1.3 * 0.4) * std::cos(a);
    file << a / kDegree << ";" << b / kDegree << ";" << shoulder + 0.02 * normal(random) + wrong << ";"
         << elbow + 0.02 * normal(random) << "\n";
  }
  file.close();
  const json answer = fit({folder / "foreign.csv", "--arm", folder / "arm.toml", "--map",
                           "theta1=\"Shoulder (deg)\":deg", "--map", "theta2=\"Elbow (deg)\":deg", "--map",
                           "tau1=\"Shoulder torque\":N m", "--map", "tau2=\"Elbow torque\":N m"});
  EXPECT_NEAR(value(answer, "upper"), 2.1, 5 * std_error(answer, "upper"));
  EXPECT_NEAR(value(answer, "lower"), 1.3, 5 * std_error(answer, "lower"));
  EXPECT_LT(std_error(answer, "upper"), 0.02);
  EXPECT_EQ(answer["residuals"].size(), 24u);
  EXPECT_TRUE(answer["poses"][4]["outlier"].get<bool>());
  EXPECT_TRUE(warns(answer, "pose_left_out"));
}

/// A planar arm of three links that another lab built, on its side: joints about z, gravity along −y.
TEST(MassesProgram, reads_a_three_link_arm_and_names_the_outlier_in_text_answer_and_report) {
  const ScratchFolder folder;
  std::ofstream(folder / "arm.toml")
      << "format = \"isac.arm/1\"\nname = \"three links\"\n"
         "[gravity]\ndirection = [0, -1, 0]\nacceleration = \"9.8 m/s2\"\n"
         "[[joint]]\n[[joint]]\na = \"0.5 m\"\n[[joint]]\na = \"300 mm\"\n"
         "[[mass]]\nname = \"thigh\"\nlink = 1\nposition = [\"0.25 m\", \"0 m\", \"0 m\"]\n"
         "[[mass]]\nname = \"shank\"\nlink = 2\nposition = [\"0.15 m\", \"0 m\", \"0 m\"]\n"
         "[[mass]]\nname = \"foot\"\nlink = 3\nposition = [\"80 mm\", \"0 m\", \"0 m\"]\n";
  std::ofstream file(folder / "lab.csv");
  file.precision(12);
  file << "Pose;q1 [grad];q2 [grad];q3 [grad];M1 in kgf cm;M2 in kgf cm;M3 in kgf cm\n";
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> angle(-80, 80);
  const double truth[] = {6.2, 3.1, 0.9}, kgf_cm = 0.0980665;
  for (int i = 0; i < 30; ++i) {
    const double q[] = {angle(random), angle(random), angle(random)};
    const double c1 = std::cos(q[0] * kDegree), c12 = std::cos((q[0] + q[1]) * kDegree),
                 c123 = std::cos((q[0] + q[1] + q[2]) * kDegree);
    // τ = −∂V/∂q of V = g Σ m y, written out
    const double t3 = -9.8 * truth[2] * 0.08 * c123;
    const double t2 = t3 - 9.8 * (truth[1] * 0.15 + truth[2] * 0.3) * c12;
    const double t1 = t2 - 9.8 * (truth[0] * 0.25 + (truth[1] + truth[2]) * 0.5) * c1;
    file << i + 1;
    for (const double a : q) file << ";" << a;
    for (const double t : {t1, t2 + (i == 17 ? 4.0 : 0), t3})
      file << ";" << (t + 0.05 * normal(random)) / kgf_cm;
    file << "\n";
  }
  file.close();
  std::vector<std::string> call = {folder / "lab.csv", "--arm", folder / "arm.toml", "--report",
                                   folder / "report.html"};
  for (int k = 1; k <= 3; ++k) {
    const std::string n = std::to_string(k);
    call.insert(call.end(), {"--map", "theta" + n + "=\"q" + n + " [grad]\":deg", "--map",
                             "tau" + n + "=\"M" + n + " in kgf cm\":kgf cm"});
  }
  const json answer = fit(call);
  EXPECT_EQ(answer["torques"], "gravity");
  const char* names[] = {"thigh", "shank", "foot"};
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(value(answer, names[k]), truth[k], 4 * std_error(answer, names[k])) << names[k];
    EXPECT_LT(std_error(answer, names[k]), 0.05) << names[k];
  }
  EXPECT_EQ(answer["residuals"].size(), 90u);
  for (const json& pose : answer["poses"]) EXPECT_EQ(pose["outlier"].get<bool>(), pose["name"] == "row 18");
  EXPECT_NEAR(answer["torque_noise"]["value"].get<double>(), 0.05, 0.01);
  const std::string page = read_text(folder / "report.html");
  EXPECT_NE(page.find("row 18"), std::string::npos);
  EXPECT_NE(page.find("left out"), std::string::npos);

  call.insert(call.begin(), {"isac-identify", "masses"});
  call.insert(call.end(), {"--design", "0"});
  const test::Run run = run_program(call);
  const auto row = run.out.find("row 18 ");
  ASSERT_NE(row, std::string::npos) << run.out;
  EXPECT_NE(run.out.substr(row, 120).find("on joint 2"), std::string::npos) << run.out;
  EXPECT_NE(run.out.substr(row, 120).find("left out"), std::string::npos) << run.out;
}

TEST(MassesProgram, joint_angles_and_arm_angles_give_the_same_masses) {
  const ScratchFolder folder;
  const auto poses = some_poses(6);
  std::ofstream file(folder / "phi.csv");
  file.precision(12);
  for (const char* family : {"phi", "tau"})
    for (int k = 1; k <= 6; ++k)
      file << family << k << (family[0] == 'p' ? " [rad]" : " [N m]")
           << (family[0] == 't' && k == 6 ? "\n" : ",");
  for (const auto& t : poses) {
    const auto g = gravity(t, kTruth);
    // φ3 = θ3 + θ4, φ4 = θ3 − θ4; τφ = Kᵀ τ: half sum and half difference.
    file << t[0] << "," << t[1] << "," << t[2] + t[3] << "," << t[2] - t[3] << "," << t[4] + t[5] << ","
         << t[4] - t[5] << ",";
    file << g[0] << "," << g[1] << "," << (g[2] + g[3]) / 2 << "," << (g[2] - g[3]) / 2 << ","
         << (g[4] + g[5]) / 2 << "," << (g[4] - g[5]) / 2 << "\n";
  }
  file.close();
  const json answer = fit({folder / "phi.csv", "--arm", kArm, "--design", "0"});
  EXPECT_NEAR(value(answer, "m1"), kTruth[0], 1e-9);
  EXPECT_NEAR(value(answer, "m2"), kTruth[1], 1e-9);
  EXPECT_NEAR(value(answer, "m3"), kTruth[2], 1e-9);
}

TEST(MassesProgram, says_no_and_says_what_is_wrong_with_the_right_exit_codes) {
  const ScratchFolder folder;
  std::ofstream(folder / "one.csv") << "theta1 [deg],theta2 [deg],theta3 [deg],theta4 [deg],theta5 "
                                       "[deg],theta6 [deg],tau2 [N m]\n0,-45,-45,0,90,0,-4.6\n";
  const json refused = fit({folder / "one.csv", "--arm", kArm}, 1);
  EXPECT_FALSE(refused["parameters"]["m1"]["identifiable"].get<bool>());
  EXPECT_TRUE(refused["parameters"]["m1"]["value"].is_null());
  std::ofstream(folder / "none.csv") << "theta1 [deg],tau2 [N m]\n0,1\n";
  EXPECT_EQ(fit({folder / "none.csv", "--arm", kArm}, 3)["error"]["code"], "column_missing");
  std::ofstream(folder / "bad.toml") << "format = \"isac.arm/1\"\n[[joint]]\nd = 1\n";
  const json bad = fit({folder / "one.csv", "--arm", folder / "bad.toml"}, 3);
  EXPECT_EQ(bad["error"]["line"], 3);
  EXPECT_EQ(run_program({"isac-identify", "masses", folder / "one.csv"}).exit_code, 2);
}

}  // namespace
}  // namespace isac::test
