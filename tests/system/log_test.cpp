// isac-log as a person runs it, on the simulated rig.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "isac/core/units.hpp"
#include "isac/record/csv_reader.hpp"
#include "run_program.hpp"

namespace isac {
namespace {

namespace fs = std::filesystem;

constexpr double kKgf = kPascalPerKgfCm2;
constexpr const char* kRig = R"(format = "isac.rig/1"
name = "testbed"

[joint]
chain_wheel_diameter = "38 mm"
initial_pressure = "3.0 kg/cm2"
inertia = "0.0085 kg m2"
)";

class Log : public testing::Test {
 protected:
  Log() { std::ofstream(folder_ / "rig.toml") << kRig; }

  [[nodiscard]] std::vector<std::string> words(const std::vector<std::string>& more) const {
    std::vector<std::string> all = {"isac-log"};
    all.insert(all.end(), more.begin(), more.end());
    all.insert(all.end(), {"--rig", folder_ / "rig.toml", "-o", folder_ / "out"});
    return all;
  }
  [[nodiscard]] test::Run log(const std::vector<std::string>& more) const {
    return test::run_program(words(more));
  }
  [[nodiscard]] fs::path out(const std::string& name = {}) const { return fs::path(folder_ / "out") / name; }
  [[nodiscard]] static series::Recording read(const fs::path& file) { return record::read_recording(file); }

  /// Starts a long run at the pace of the wall clock and returns when its log has grown to `bytes`.
  [[nodiscard]] pid_t start_and_wait(const fs::path& file, std::uintmax_t bytes) const {
    std::vector<std::string> owned = words({"bundle", "--card", "sim:", "--pace", "real", "--rate", "1000"});
    owned[0] = std::string(ISAC_BIN_DIR) + "/isac-log";
    std::vector<char*> argv;
    for (std::string& word : owned) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    for (const int stream : {0, 1, 2})
      posix_spawn_file_actions_addopen(&actions, stream, "/dev/null", O_RDWR, 0);
    pid_t child = 0;
    EXPECT_EQ(posix_spawn(&child, argv[0], &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    std::error_code ignored;
    for (int i = 0; i < 3000; ++i) {  // half a minute: the lead-in takes five seconds on a quiet machine
      if (fs::exists(file, ignored) && fs::file_size(file, ignored) >= bytes) return child;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    ADD_FAILURE() << "the log did not grow";
    return child;
  }

  test::ScratchFolder folder_;
};

std::string first_line(const std::string& text) {
  return text.substr(0, text.find('\n'));
}
long lines(const std::string& text) {
  return std::count(text.begin(), text.end(), '\n');
}

TEST_F(Log, records_the_whole_of_chapter_three_into_a_dataset) {
  const test::Run run = log({"all", "--card", "sim:seed=5", "--json", folder_ / "verdict.json"});
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_EQ(test::read_text(out("rig.toml")), kRig);
  std::set<std::string> experiments, started;
  int files = 0;
  for (const fs::path& folder : {out(), out("heldout")}) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() != ".csv") continue;
      ++files;
      const series::Recording recording = read(entry.path());
      experiments.insert(recording.meta("experiment"));
      started.insert(recording.meta("started"));
      for (const char* name : {"time", "angle", "p1", "p2", "F1", "F2", "p1_cmd", "p2_cmd"}) {
        EXPECT_NE(recording.find(name), nullptr) << entry.path() << " " << name;
      }
    }
  }
  EXPECT_EQ(files, 19);
  EXPECT_EQ(started.size(), 19u);  // so that runs of one day can be put in order
  EXPECT_EQ(experiments, (std::set<std::string>{"constant-pressure", "constant-angle", "free", "pcu-step"}));
  const auto answer = nlohmann::json::parse(test::read_text(folder_ / "verdict.json"));
  EXPECT_EQ(answer["schema"], "isac.log/1");
  EXPECT_EQ(answer["verdict"], "keep");
  EXPECT_EQ(answer["recordings"].size(), 19u);
}

TEST_F(Log, records_torques_that_follow_the_joint_model_of_the_simulated_rig) {
  ASSERT_EQ(
      log({"constant-pressure", "--slow", "--card", "sim:", "--delta-pressure", "-1,1 kg/cm2"}).exit_code, 0);
  EXPECT_EQ(test::read_text(out("rig.toml")), kRig);  // the folder can be read as it is
  // Two levels, T = A r² φ + B r Δp: the slope gives A, the distance of the lines B. Damping at 0.1π rad/s is both ways.
  const double r = 0.019;
  double slope = 0.0, offset[2] = {};
  for (int level = 0; level < 2; ++level) {
    const series::Recording run =
        read(out(level == 0 ? "constant-pressure-slow_dp-1.00.csv" : "constant-pressure-slow_dp+1.00.csv"));
    const auto& phi = run.column("angle").values;
    const auto &F1 = run.column("F1").values, &F2 = run.column("F2").values;
    double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (std::size_t i = 0; i < phi.size(); ++i) {
      const double torque = (F2[i] - F1[i]) * r;
      n += 1, sx += phi[i], sy += torque, sxx += phi[i] * phi[i], sxy += phi[i] * torque;
    }
    const double k = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    slope += 0.5 * k;
    offset[level] = (sy - k * sx) / n;
  }
  EXPECT_NEAR(slope / (r * r), -23450.0, 0.02 * 23450.0);  // 2 %: uneven strokes leave some damping
  EXPECT_NEAR((offset[1] - offset[0]) / (2.0 * r), 174.2, 0.02 * 174.2);  // N cm²/kg
}

TEST_F(Log, survives_sigkill_in_the_middle_of_a_sweep) {
  const fs::path file = out("constant-pressure-bundle_dp+0.00.csv");
  const pid_t child = start_and_wait(file, 150000);
  kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  const series::Recording back = read(file);
  EXPECT_GT(back.rows(), 1500u);  // lines have about 75 characters
  EXPECT_EQ(back.meta("experiment"), "constant-pressure");
  EXPECT_EQ(test::read_text(file).find("# closed"), std::string::npos);
  for (const series::Column& column : back.columns) {  // whole rows only
    for (const double value : column.values) ASSERT_TRUE(std::isfinite(value)) << column.name;
  }
}

TEST_F(Log, stops_cleanly_on_ctrl_c_and_on_terminate) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const fs::path file = out("constant-pressure-bundle_dp+0.00.csv");
    const pid_t child = start_and_wait(file, 60000);
    kill(child, signal);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 1);  // it is too short to keep
    EXPECT_NE(test::read_text(file).find("# closed"), std::string::npos);
    fs::remove_all(out());
  }
}

TEST_F(Log, stops_at_a_safety_limit_with_code_4_and_one_sentence) {
  const test::Run run = log({"free", "--card", "sim:", "--limit-angle", "0.3 rad"});
  EXPECT_EQ(run.exit_code, 4);
  EXPECT_EQ(lines(run.err), 1) << run.err;
  EXPECT_NE(run.err.find("exceeded the limit of 0.30 rad"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("vented"), std::string::npos) << run.err;
  const auto angle = read(out("free.csv")).column("angle").values;  // what led to it is kept
  EXPECT_GT(std::abs(angle.back()), 0.25);
}

TEST_F(Log, asks_to_repeat_a_sweep_that_saturates_the_force_sensors) {
  const test::Run run =
      log({"constant-pressure", "--slow", "--card", "sim:", "--amplitude", "40 deg", "--json", "-"});
  EXPECT_EQ(run.exit_code, 1);
  const auto answer = nlohmann::json::parse(run.out);  // nothing but the answer on standard output
  EXPECT_EQ(answer["verdict"], "repeat");
  std::set<std::string> codes;
  for (const auto& remark : answer["recordings"][0]["remarks"]) codes.insert(remark["code"]);
  EXPECT_TRUE(codes.count("force_saturated")) << run.out;
  EXPECT_NE(run.err.find("repeat"), std::string::npos);  // the person still reads why
}

TEST_F(Log, asks_to_repeat_when_valve_steps_were_too_short) {
  const test::Run run = log({"pcu-step", "--card", "sim:", "--hold", "0.3 s"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_NE(run.out.find("holds twice as long"), std::string::npos) << run.out;
}

TEST_F(Log, gives_the_same_recording_for_the_same_seed) {
  ASSERT_EQ(log({"free", "--duration", "8", "--seed", "4"}).exit_code, 0);
  const series::Recording first = read(out("free.csv"));
  ASSERT_EQ(log({"free", "--duration", "8", "--seed", "4", "--overwrite"}).exit_code, 0);
  const series::Recording again = read(out("free.csv"));
  ASSERT_EQ(log({"free", "--duration", "8", "--seed", "5", "--overwrite"}).exit_code, 0);
  const series::Recording other = read(out("free.csv"));
  EXPECT_EQ(first.column("F1").values, again.column("F1").values);
  EXPECT_EQ(first.column("p2_cmd").values, again.column("p2_cmd").values);
  EXPECT_NE(first.column("F1").values, other.column("F1").values);
}

TEST_F(Log, never_replaces_a_recording_without_being_told) {
  ASSERT_EQ(log({"free", "--duration", "4"}).exit_code, 0);
  const std::string before = test::read_text(out("free.csv"));
  const test::Run run = log({"free", "--duration", "5"});
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_NE(run.err.find("--overwrite"), std::string::npos);
  EXPECT_EQ(test::read_text(out("free.csv")), before);
}

TEST_F(Log, replays_a_recording_as_a_card) {
  ASSERT_EQ(log({"pose", "--card", "sim:", "--hold", "2"}).exit_code, 0);
  fs::rename(out("pose.csv"), folder_ / "first.csv");
  const test::Run run = log({"pose", "--card", "replay:" + (folder_ / "first.csv"), "--hold", "2"});
  EXPECT_TRUE(run.exit_code == 0 || run.exit_code == 1) << run.err;
  const auto first = read(folder_ / "first.csv").column("angle").values,
             again = read(out("pose.csv")).column("angle").values;
  ASSERT_GT(again.size(), first.size() - 20);
  EXPECT_NEAR(*std::max_element(first.begin(), first.end()), *std::max_element(again.begin(), again.end()),
              1e-3);
}

struct Bad {
  const char* name;
  std::vector<std::string> words;
  int exit_code;
  const char* says;
};

class LogRefuses : public Log, public testing::WithParamInterface<Bad> {};

TEST_P(LogRefuses, a_bad_call_in_one_sentence_and_leaves_nothing_behind) {
  const test::Run run = log(GetParam().words);
  EXPECT_EQ(run.exit_code, GetParam().exit_code) << run.err;
  EXPECT_EQ(lines(run.err), 1) << run.err;
  EXPECT_EQ(first_line(run.err).rfind("isac-log: ", 0), 0u) << run.err;
  EXPECT_NE(run.err.find(GetParam().says), std::string::npos) << run.err;
  EXPECT_EQ(run.out, "");
  EXPECT_FALSE(fs::exists(out()));
}

INSTANTIATE_TEST_SUITE_P(
    Calls, LogRefuses,
    testing::Values(
        Bad{"experiment", {"sing"}, 2, "choose one of constant-pressure"},
        Bad{"no_experiment", {}, 2, "experiment is required"},
        Bad{"card", {"pose", "--card", "nope:"}, 2, "sim:"},
        Bad{"sim_option", {"pose", "--card", "sim:colour=red"}, 2, "colour"},
        Bad{"replay_file", {"pose", "--card", "replay:none.csv"}, 3, "none.csv"},
        Bad{"rate_negative", {"pose", "--rate", "-5"}, 2, "sample rate"},
        Bad{"rate_zero", {"pose", "--rate", "0"}, 2, "sample rate"},
        Bad{"rate_nan", {"pose", "--rate", "nan"}, 2, "sample rate"},
        Bad{"rate_word", {"pose", "--rate", "fast"}, 2, "--rate"},
        Bad{"limit_negative", {"pose", "--limit-force", "-3 N"}, 2, "--limit-force"},
        Bad{"limit_unit", {"pose", "--limit-speed", "3 kg"}, 2, "--limit-speed"},
        Bad{"limit_bare", {"pose", "--limit-pressure", "3"}, 2, "--limit-pressure"},
        Bad{"level_beyond", {"constant-pressure", "--delta-pressure", "-3,1 kg/cm2"}, 2, "-3 kg/cm2"},
        Bad{"level_words", {"constant-pressure", "--delta-pressure", "low,high"}, 2, "low,high"},
        Bad{"level_no_unit", {"constant-pressure", "--delta-pressure", "0,1"}, 2, "--delta-pressure"},
        Bad{"duration_negative", {"free", "--duration", "-1 s"}, 2, "duration"},
        Bad{"duration_endless", {"free", "--duration", "1e12"}, 2, "day"},
        Bad{"pace", {"free", "--pace", "warp"}, 2, "--pace"}, Bad{"option", {"free", "--fats"}, 2, "--fats"}),
    [](const testing::TestParamInfo<Bad>& call) { return std::string(call.param.name); });

TEST_F(Log, names_a_rig_file_or_folder_that_cannot_be) {
  const auto call = [](const std::string& rig, const std::string& folder) {
    return test::run_program({"isac-log", "pose", "--rig", rig, "-o", folder});
  };
  test::Run run = call(folder_ / "none.toml", folder_ / "out");
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_NE(run.err.find("none.toml"), std::string::npos) << run.err;
  EXPECT_FALSE(fs::exists(out()));
  run = call(folder_ / "rig.toml", (folder_ / "rig.toml") + "/out");
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_EQ(lines(run.err), 1) << run.err;
  run = call(folder_ / "rig.toml", "/proc/isac");
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_EQ(lines(run.err), 1) << run.err;
}

TEST_F(Log, says_so_when_the_disk_is_full_and_leaves_no_half_written_recording) {
  rlimit former{};
  getrlimit(RLIMIT_FSIZE, &former);
  rlimit small = former;
  small.rlim_cur = 100000;  // bytes, about 1300 rows
  setrlimit(RLIMIT_FSIZE, &small);
  const test::Run run = log({"free", "--card", "sim:"});
  setrlimit(RLIMIT_FSIZE, &former);
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_EQ(lines(run.err), 1) << run.err;
  EXPECT_NE(run.err.find("vented"), std::string::npos) << run.err;
  EXPECT_FALSE(fs::exists(out("free.csv")));
  EXPECT_TRUE(fs::exists(out("free.csv.incomplete")));  // named for what it is, and out of the way of *.csv
}

TEST_F(Log, says_errors_as_json_too) {
  const test::Run run = log({"free", "--limit-angle", "0.3 rad", "--json", "-"});
  EXPECT_EQ(run.exit_code, 4);
  EXPECT_EQ(nlohmann::json::parse(run.out)["error"]["code"], "limit");
}

TEST_F(Log, rewrites_one_line_of_progress_on_a_terminal_and_keeps_plain_lines_in_a_file) {
  winsize window{.ws_row = 30, .ws_col = 100, .ws_xpixel = 0, .ws_ypixel = 0};
  int terminal = -1;
  std::vector<std::string> owned =
      words({"constant-pressure", "--fast", "--duration", "3", "--pace", "real"});
  owned[0] = std::string(ISAC_BIN_DIR) + "/isac-log";
  std::vector<char*> argv;
  for (std::string& word : owned) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = forkpty(&terminal, nullptr, nullptr, &window);
  if (child == 0) {
    execv(argv[0], argv.data());
    _exit(127);
  }
  std::string shown;
  char buffer[4096];
  for (ssize_t got; (got = ::read(terminal, buffer, sizeof buffer)) > 0;)
    shown.append(buffer, static_cast<std::size_t>(got));
  int status = 0;
  waitpid(child, &status, 0);
  ::close(terminal);
  EXPECT_EQ(WEXITSTATUS(status), 0) << shown;
  EXPECT_NE(shown.find("\r\033[K"), std::string::npos);
  EXPECT_NE(shown.find("of 3.0 s ["), std::string::npos) << shown;
  EXPECT_NE(shown.find("\033[1;32mkeep"), std::string::npos) << shown;

  const test::Run plain = log({"constant-pressure", "--fast", "--duration", "20", "--overwrite"});
  EXPECT_EQ(plain.out.find('\033'), std::string::npos);
  EXPECT_EQ(plain.out.find('\r'), std::string::npos);
  EXPECT_NE(plain.out.find("Move the bar"), std::string::npos);
}

}  // namespace
}  // namespace isac
