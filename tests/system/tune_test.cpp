// isac-tune as a person runs it, on the simulated rig.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <thread>

#include "isac/control/deployed.hpp"
#include "isac/control/joint_controller.hpp"
#include "isac/core/units.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/record/tables.hpp"
#include "tune_folder.hpp"

namespace isac {
namespace {

using test::kTuneParams;
using Tune = test::TuneFolder;
namespace fs = std::filesystem;

long lines(const std::string& text) {
  return std::count(text.begin(), text.end(), '\n');
}

TEST_F(Tune, relay_on_the_rig_ends_in_gains_that_a_controller_takes) {
  const test::Run run =
      tune({"--method", "relay", "--card", "sim:seed=4", "-o", folder_ / "params.toml", "--log",
            folder_ / "relay.csv", "--report", folder_ / "tune.html", "--json", folder_ / "answer.json",
            "--rule", "procedure", "--overshoot", "40", "--draws", "30"});
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  const auto a = answer();
  EXPECT_EQ(a["schema"], "isac.tune/1");
  EXPECT_EQ(a["verdict"], "tuned");
  EXPECT_NEAR(a["parameters"]["K_crit"]["value"].get<double>(), 8.11, 0.05 * 8.11);
  EXPECT_NEAR(a["parameters"]["T_crit"]["value"].get<double>(), 0.190, 0.05 * 0.190);
  EXPECT_GE(a["figures"]["within_limits_share"].get<double>(), 0.95);
  EXPECT_TRUE(a["hurwitz"]["stable"].get<bool>());
  // The log holds every tick, from vented valves on.
  const series::Recording log = record::read_recording(folder_ / "relay.csv");
  EXPECT_EQ(log.meta("tuning"), "relay");
  EXPECT_GT(log.column("time").values.size(), 3000u);
  EXPECT_NEAR(log.column("p1").values.front(), 0.0,
              0.02 * kPascalPerKgfCm2);  // five times the sensor's noise
  // From the file into the controller.
  control::JointSettings<double> settings;
  ASSERT_TRUE(ok(control::settings_of(record::parameter_table(record::read_params(folder_ / "params.toml")),
                                      0, settings)));
  control::JointController<double> controller;
  EXPECT_TRUE(ok(controller.configure(settings)));
  EXPECT_NEAR(settings.position.proportional, a["gains"]["K_P_position"]["value"].get<double>(), 1e-9);
  EXPECT_NEAR(settings.torque.integral / kPascalPerKgfCm2, a["gains"]["K_I_torque"]["value"].get<double>(),
              1e-9);
  EXPECT_NE(settings.position.proportional, 4.0);
  EXPECT_EQ(test::read_text(folder_ / "params.toml.bak"), kTuneParams);
  const std::string report = test::read_text(folder_ / "tune.html");
  for (const char* word : {"<svg", "What the experiment found", "Step before and after", "Margins"})
    EXPECT_NE(report.find(word), std::string::npos) << word;
}

TEST_F(Tune, gains_that_do_not_hold_their_limits_leave_the_file_as_it_was) {
  const test::Run run = tune({"--method", "model", "--rule", "ziegler-nichols", "-o", folder_ / "params.toml",
                              "--json", folder_ / "answer.json", "--draws", "40"});
  EXPECT_EQ(run.exit_code, 1) << run.out << run.err;
  EXPECT_EQ(test::read_text(folder_ / "params.toml"), kTuneParams);
  EXPECT_EQ(answer()["verdict"], "kept");
  EXPECT_NE(answer()["reason"].get<std::string>().find("overshoot"), std::string::npos);
  // P2 of the model stands in the answer all the same.
  EXPECT_NEAR(answer()["plant"]["joint_T_L"]["value"].get<double>(), 0.0143, 1e-4);
  EXPECT_NEAR(answer()["plant"]["T_J"]["value"].get<double>(), 0.0317, 1e-4);
}

TEST_F(Tune, a_relay_too_small_to_be_seen_is_refused_with_a_reason_and_the_gains_stay) {
  const test::Run run = tune({"--method", "relay", "--amplitude", "0.003 kg/cm2", "--longest", "10 s", "-o",
                              folder_ / "params.toml", "--json", folder_ / "answer.json", "--log",
                              folder_ / "log.csv", "--report", folder_ / "report.html"});
  EXPECT_EQ(run.exit_code, 1) << run.out << run.err;
  EXPECT_EQ(answer()["verdict"], "kept");
  EXPECT_FALSE(answer()["reason"].get<std::string>().empty());
  const std::string report =
      test::read_text(folder_ / "report.html");  // what was tried is drawn all the same
  EXPECT_NE(report.find("What the experiment saw"), std::string::npos);
  EXPECT_NE(report.find("<svg"), std::string::npos);
  EXPECT_EQ(test::read_text(folder_ / "params.toml"), kTuneParams);
  EXPECT_TRUE(fs::exists(folder_ / "log.csv"));
}

TEST_F(Tune, a_safety_limit_vents_keeps_the_log_and_says_which) {
  std::ofstream(folder_ / "rig.toml", std::ios::app) << "\n[limits]\nspeed = \"0.3 rad/s\"\n";
  const test::Run run =
      tune({"--method", "relay", "--log", folder_ / "log.csv", "-o", folder_ / "params.toml"});
  EXPECT_EQ(run.exit_code, 4) << run.out << run.err;
  EXPECT_NE(run.err.find("speed"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("vented"), std::string::npos) << run.err;
  EXPECT_EQ(lines(run.err), 1);
  EXPECT_GT(record::read_recording(folder_ / "log.csv").column("time").values.size(), 1000u);
  EXPECT_EQ(test::read_text(folder_ / "params.toml"), kTuneParams);
}

TEST_F(Tune, ctrl_c_in_the_middle_leaves_a_whole_log_and_the_old_gains) {
  // Bytes of the log after which it is stopped: the steps while they settle, the relay while the joint swings.
  const struct {
    const char* method;
    std::uintmax_t bytes;
  } cases[] = {{"step", 200000}, {"relay", 270000}};
  for (const auto& c : cases) {
    const std::string log = folder_ / (std::string(c.method) + ".csv");
    std::vector<std::string> owned =
        words({"--method", c.method, "--pace", "real", "--log", log, "-o", folder_ / "params.toml"});
    owned[0] = std::string(ISAC_BIN_DIR) + "/isac-tune";
    std::vector<char*> argv;
    for (std::string& word : owned) argv.push_back(word.data());
    argv.push_back(nullptr);
    const std::string err = folder_ / "err";
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    for (const int stream : {0, 1})
      posix_spawn_file_actions_addopen(&actions, stream, "/dev/null", O_RDWR, 0);
    posix_spawn_file_actions_addopen(&actions, 2, err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    pid_t child = 0;
    ASSERT_EQ(posix_spawn(&child, argv[0], &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    std::error_code none;
    for (int i = 0; i < 3000; ++i) {
      const auto size = fs::file_size(log, none);
      if (!none && size > c.bytes) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    kill(child, SIGINT);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status)) << c.method;
    EXPECT_EQ(WEXITSTATUS(status), 1) << c.method;
    const std::string text = test::read_text(err);
    EXPECT_NE(text.find("stopped by hand; the valves are vented"), std::string::npos) << text;
    EXPECT_EQ(lines(text), 1) << text;
    EXPECT_NE(test::read_text(log).find("# closed:"), std::string::npos) << c.method;
    EXPECT_GT(record::read_recording(log).column("time").values.size(), 500u) << c.method;
    EXPECT_EQ(test::read_text(folder_ / "params.toml"), kTuneParams) << c.method;
  }
}

TEST_F(Tune, bad_calls_get_one_sentence_and_their_exit_code) {
  const struct {
    std::vector<std::string> words;
    int code;
    const char* says;
  } calls[] = {{{"--method", "relay", "--amplitude", "3 kg/cm2"}, 2, "amplitude"},
               {{"--method", "relay", "--amplitude", "20"}, 2, "--amplitude"},
               {{"--method", "dance"}, 2, "dance"},
               {{"--method", "relay", "--rate", "7"}, 2, "rate"},
               {{"--method", "model"}, 1, "isac-identify joint"},
               {{"--method", "model", "--params", folder_ / "params.toml", "--joint", "knee"}, 2, "knee"},
               {{"--method", "relay", "--card", "sim:nonsense=1"}, 2, "nonsense"},
               {{"--method", "relay", "--log", folder_ / "nowhere/log.csv"}, 2, "nowhere"}};
  for (const auto& call : calls) {
    const test::Run run = tune(call.words);
    EXPECT_EQ(run.exit_code, call.code) << run.out << run.err;
    EXPECT_NE(run.err.find(call.says), std::string::npos) << run.err;
    EXPECT_EQ(lines(run.err), 1) << run.err;
  }
  std::ofstream(folder_ / "torn.toml") << "format = \"isac.params/1\"\n[[joint]\n";
  EXPECT_EQ(tune({"--method", "model", "--params", folder_ / "torn.toml"}).exit_code, 3);
}

}  // namespace
}  // namespace isac
