// isac-run as a user runs it: modes, replay bit for bit, faults, and every way a process can end.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "isac/record/csv_reader.hpp"
#include "run_program.hpp"

namespace isac::test {
namespace {

using Json = nlohmann::json;
using record::read_recording;

Json answer_of(const std::string& path) {
  return Json::parse(read_text(path));
}

Run run(std::vector<std::string> words) {
  words.insert(words.begin(), "isac-run");
  return run_program(words);
}

/// The program in the background, so that it can be sent signals.
class Background {
 public:
  explicit Background(const std::vector<std::string>& words, const std::string& out) {
    std::vector<std::string> owned = words;
    owned.insert(owned.begin(), std::string(ISAC_BIN_DIR) + "/isac-run");
    std::vector<char*> argv;
    for (std::string& word : owned) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, 1, out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&actions, 1, 2);
    EXPECT_EQ(posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
  }
  ~Background() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
  }
  Background(const Background&) = delete;
  Background& operator=(const Background&) = delete;
  [[nodiscard]] pid_t pid() const { return pid_; }
  /// The process of the loop: the program's only child.
  [[nodiscard]] pid_t loop() const {
    const std::string task = std::to_string(pid_);
    std::ifstream children("/proc/" + task + "/task/" + task + "/children");
    pid_t child = 0;
    children >> child;
    return child;
  }
  int wait() {
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

 private:
  pid_t pid_ = 0;
};

/// Waits until the log has some hundred rows: the run-up has begun.
bool valves_are_open(const std::string& log) {
  for (int k = 0; k < 1500; ++k) {
    std::error_code missing;
    if (std::filesystem::file_size(log, missing) > 150'000 && !missing) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

/// Runs at the wall clock's pace and takes a minute, unless something ends it.
std::vector<std::string> long_run(const ScratchFolder& folder, const char* heartbeat = "20 s") {
  return {"position", "--sine", "0.1 rad",          "--card", "sim:",
          "--pace",   "real",   "--duration",       "60 s",   "--heartbeat",
          heartbeat,  "-o",     folder / "run.csv", "--json", folder / "run.json"};
}

TEST(IsacRun, step_arrives) {
  const ScratchFolder folder;
  const auto r = run({"position", "--step", "0.2 rad", "--duration", "4 s", "-o", folder / "run.csv",
                      "--json", folder / "run.json"});
  ASSERT_EQ(r.exit_code, 0) << r.err << r.out;
  const auto read = read_recording(folder / "run.csv");
  EXPECT_EQ(read.meta("experiment"), "closed-loop");
  EXPECT_NEAR(read.column("angle").values.back(), 0.2,
              0.02);  // slow integral of the seed's gains: a tenth of the step
  const Json json = answer_of(folder / "run.json");
  EXPECT_EQ(json["schema"], "isac.run/1");
  EXPECT_EQ(json["ended"], "done");
  EXPECT_TRUE(json["fault"].is_null());
  EXPECT_EQ(json["rows"].get<std::size_t>(), read.rows());
}

TEST(IsacRun, answer_has_the_keys_that_the_page_shows) {
  const ScratchFolder folder;
  ASSERT_EQ(run({"position", "--step", "0.3 rad", "--json", folder / "run.json"}).exit_code, 0);
  const std::string page = read_text(std::string(ISAC_SOURCE_DIR) + "/docs/how-to/run.md");
  const std::size_t begin = page.find("```json\n") + 8;
  const Json shown = Json::parse(page.substr(begin, page.find("```", begin) - begin));
  const Json said = answer_of(folder / "run.json");
  const auto keys = [](const Json& object) {
    std::vector<std::string> names;
    for (const auto& [name, value] : object.items()) names.push_back(name);
    return names;
  };
  EXPECT_EQ(keys(said), keys(shown));
  for (const char* part : {"duration", "longest_late", "supervisor"})
    EXPECT_EQ(keys(said[part]), keys(shown[part]));
}

TEST(IsacRun, every_mode_runs_on_the_simulated_rig) {
  const ScratchFolder folder;
  std::ofstream(folder / "points.csv") << "time [s],angle [deg]\n0,0\n1,10\n2,-5\n";
  const std::vector<std::vector<std::string>> calls = {
      {"position", "--sine", "0.15 rad", "--duration", "2 s"},
      {"position", "--csv", folder / "points.csv"},
      {"trajectory", folder / "points.csv"},
      {"torque", "--torque", "0.5 N m", "--duration", "1 s"},
      {"hand", "--duration", "1 s"},
      {"position", "--step", "5 deg", "--controller", "pi", "--duration", "1 s"}};
  int number = 0;
  for (auto call : calls) {
    const std::string log = folder / ("run" + std::to_string(number++) + ".csv");
    call.insert(call.end(), {"-o", log});
    const auto made = run(call);
    EXPECT_EQ(made.exit_code, 0) << call[0] << made.err << made.out;
    const auto replayed = run({"replay", log});
    EXPECT_EQ(replayed.exit_code, 0) << replayed.err << replayed.out;
    EXPECT_NE(replayed.out.find("all equal to the last bit"), std::string::npos) << replayed.out;
  }
}

TEST(IsacRun, replay_with_other_parameters_says_that_commands_differ) {
  const ScratchFolder folder;
  ASSERT_EQ(run({"position", "--step", "0.1 rad", "--duration", "1 s", "-o", folder / "run.csv"}).exit_code,
            0);
  std::ofstream(folder / "rig.toml") << "format = \"isac.rig/1\"\n[joint]\nchain_wheel_diameter = \"38 mm\"\n"
                                        "[limits]\nspeed = \"0.05 rad/s\"\n";
  const auto other = run({"replay", folder / "run.csv", "--rig", folder / "rig.toml", "--json",
                          folder / "out.json", "--flight", folder / "again.csv"});
  EXPECT_EQ(other.exit_code == 1 || other.exit_code == 4, true)
      << other.out;  // slower, or beyond that rig's limit
}

TEST(IsacRun, replay_of_a_changed_command_is_answered_with_no) {
  const ScratchFolder folder;
  ASSERT_EQ(run({"position", "--step", "0.1 rad", "--duration", "1 s", "-o", folder / "run.csv"}).exit_code,
            0);
  std::string text = read_text(folder / "run.csv");
  const std::size_t row = text.find("\n1.9");  // a row under control
  ASSERT_NE(row, std::string::npos);
  const std::size_t cell = text.find(',', text.find(',', text.find(',', row) + 1) + 1) + 1;  // p1_cmd
  text[cell + 3] = text[cell + 3] == '5' ? '6' : '5';
  std::ofstream(folder / "changed.csv") << text;
  const auto r = run({"replay", folder / "changed.csv", "--json", folder / "out.json"});
  EXPECT_EQ(r.exit_code, 1) << r.out;
  EXPECT_EQ(answer_of(folder / "out.json")["replay"]["different"], 1);
}

TEST(IsacRun, recorded_measurements_drive_the_controller_on_the_replay_card) {
  const ScratchFolder folder;
  ASSERT_EQ(run({"position", "--step", "0.1 rad", "--duration", "1 s", "-o", folder / "run.csv"}).exit_code,
            0);
  const auto r = run({"hand", "--card", "replay:" + (folder / "run.csv"), "--json", folder / "out.json"});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(answer_of(folder / "out.json")["ended"], "card_ended");
}

TEST(IsacRun, runs_of_the_same_seed_are_the_same) {
  const ScratchFolder folder;
  for (const char* name : {"a.csv", "b.csv"})
    ASSERT_EQ(run({"position", "--step", "0.1 rad", "--card", "sim:seed=5", "--duration", "1 s", "-o",
                   folder / name})
                  .exit_code,
              0);
  const auto rows = [&](const char* name) {
    const std::string text = read_text(folder / name);
    return text.substr(text.find("\ntime"), text.rfind("# closed:") - text.find("\ntime"));
  };
  EXPECT_EQ(rows("a.csv"), rows("b.csv"));
}

TEST(IsacRun, fault_ends_it_with_4_the_reason_and_the_last_cycles) {
  const ScratchFolder folder;
  const auto r = run({"position", "--step", "0.5 rad", "--following", "0.05 rad", "-o", folder / "run.csv",
                      "--json", folder / "run.json"});
  EXPECT_EQ(r.exit_code, 4);
  EXPECT_NE(r.out.find("joint 1: the joint does not follow"), std::string::npos) << r.out;
  const Json json = answer_of(folder / "run.json");
  EXPECT_EQ(json["ended"], "fault");
  EXPECT_EQ(json["flight"], folder / "run.flight.csv");
  const auto flight = read_recording(folder / "run.flight.csv");
  const auto log = read_recording(folder / "run.csv");
  EXPECT_GE(flight.rows(), 50u);
  EXPECT_EQ(flight.column("time").values.back(), log.column("time").values.back());
  EXPECT_NE(flight.column("fault").values.back(), 0.0);
  EXPECT_EQ(flight.column("ao0").values.back(), 0.0);  // vented in that very cycle
  EXPECT_GT(flight.column("ao0").values[flight.rows() - 2], 0.0);
  EXPECT_EQ(log.meta("closed").empty(), false);
  const auto replayed = run({"replay", folder / "run.csv", "--flight",
                             folder / "again.csv"});  // the fault comes back, at the same command
  EXPECT_EQ(replayed.exit_code, 4);
  EXPECT_NE(replayed.out.find("all equal to the last bit"), std::string::npos) << replayed.out;
}

TEST(IsacRun, interrupt_ends_it_cleanly) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const ScratchFolder folder;
    Background program(long_run(folder), folder / "out");
    ASSERT_TRUE(valves_are_open(folder / "run.csv")) << read_text(folder / "out");
    kill(program.pid(), signal);
    EXPECT_EQ(program.wait(), 0) << read_text(folder / "out");
    const Json json = answer_of(folder / "run.json");
    EXPECT_EQ(json["ended"], "stopped");
    EXPECT_EQ(json["supervisor"]["vented"], true);
    EXPECT_FALSE(read_recording(folder / "run.csv").meta("closed").empty());
  }
}

TEST(IsacRun, waits_for_a_person_to_permit_the_arming) {
  const ScratchFolder folder;
  // Nobody at the keyboard: it never arms, and leaves. Somebody who presses Enter: it runs.
  const auto alone = run({"hand", "--ask", "--pace", "real", "--duration", "0.1 s", "-o",
                          folder / "alone.csv", "--json", folder / "alone.json"});
  EXPECT_EQ(alone.exit_code, 0) << alone.err;
  EXPECT_EQ(answer_of(folder / "alone.json")["ended"], "stopped");
  const auto log = read_recording(folder / "alone.csv");
  for (const double state : log.column("state").values) ASSERT_EQ(state, 0.0);
  const std::string call = "(sleep 0.3; echo) | " ISAC_BIN_DIR
                           "/isac-run hand --ask --pace real --heartbeat '20 s' --duration '0.1 s' --json " +
                           (folder / "run.json") + " > /dev/null";
  EXPECT_EQ(std::system(call.c_str()), 0);
  EXPECT_EQ(answer_of(folder / "run.json")["ended"], "done");
}

TEST(IsacRun, killed_loop_is_vented_by_the_supervisor_and_its_last_cycles_are_kept) {
  for (const int signal : {SIGKILL, SIGABRT, SIGSEGV}) {
    const ScratchFolder folder;
    Background program(long_run(folder), folder / "out");
    ASSERT_TRUE(valves_are_open(folder / "run.csv")) << read_text(folder / "out");
    kill(program.loop(), signal);
    EXPECT_EQ(program.wait(), 4) << read_text(folder / "out");
    const Json json = answer_of(folder / "run.json");
    EXPECT_EQ(json["ended"], "died");
    EXPECT_EQ(json["supervisor"]["vented"], true);
    EXPECT_EQ(json["supervisor"]["signal"], signal);
    const auto flight = read_recording(folder / "run.flight.csv");
    EXPECT_GE(flight.rows(), 50u);
    const auto log = read_recording(folder / "run.csv");  // whole lines up to the end
    EXPECT_TRUE(log.meta("closed").empty());
    EXPECT_GE(flight.column("time").values.back(), log.column("time").values.back());
  }
}

TEST(IsacRun, hung_loop_is_vented_by_the_supervisor) {
  const ScratchFolder folder;
  Background program(long_run(folder, "2 s"), folder / "out");
  ASSERT_TRUE(valves_are_open(folder / "run.csv")) << read_text(folder / "out");
  kill(program.loop(), SIGSTOP);
  EXPECT_EQ(program.wait(), 4) << read_text(folder / "out");
  const Json json = answer_of(folder / "run.json");
  EXPECT_EQ(json["ended"], "hung");
  EXPECT_EQ(json["supervisor"]["vented"], true);
  EXPECT_GE(read_recording(folder / "run.flight.csv").rows(), 50u);
}

TEST(IsacRun, loop_stops_and_closes_its_valves_and_log_when_its_supervisor_is_killed) {
  const ScratchFolder folder;
  Background program(long_run(folder), folder / "out");
  ASSERT_TRUE(valves_are_open(folder / "run.csv")) << read_text(folder / "out");
  kill(program.pid(), SIGKILL);
  EXPECT_EQ(program.wait(), -SIGKILL);
  const auto closed = [&] { return read_text(folder / "run.csv").find("# closed:") != std::string::npos; };
  for (int k = 0; k < 1000 && !closed(); ++k) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_TRUE(closed());
}

TEST(IsacRun, packed_table_and_params_file_drive_alike) {
  const ScratchFolder folder;
  std::ofstream(folder / "params.toml") << R"(format = "isac.params/1"
created = "2003-05-01T12:00:00Z"
[[joint]]
label = "testbed"
constants = { wheel_radius_m = 0.019, initial_pressure_Pa = 294199.5, inertia_kg_m2 = 0.0085 }
[joint.parameters]
A = { value = -23450.0, unit = "N/m", std_error = 100.0, ci95 = [-23650.0, -23250.0], identifiable = true }
B = { value = 174.2, unit = "N cm2/kg", std_error = 1.0, ci95 = [172.0, 176.0], identifiable = true }
C = { value = 0.0026, unit = "N m s3", std_error = 0.0001, ci95 = [0.0024, 0.0028], identifiable = true }
D = { value = 0.14, unit = "N m s", std_error = 0.01, ci95 = [0.12, 0.16], identifiable = true }
[gains]
[gains.parameters]
K_P_position = { value = 4.0, unit = "N m/rad", std_error = nan, ci95 = [nan, nan], identifiable = true }
K_I_position = { value = 8.0, unit = "N m/rad s", std_error = nan, ci95 = [nan, nan], identifiable = true }
K_P_torque = { value = 0.1, unit = "kg/cm2/N m", std_error = nan, ci95 = [nan, nan], identifiable = true }
K_I_torque = { value = 10.0, unit = "kg/cm2/N m s", std_error = nan, ci95 = [nan, nan], identifiable = true }
)";
  const auto exported =
      run_program({"isac-identify", "export", folder / "params.toml", "-o", folder.path().string()});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  std::vector<std::vector<double>> commands;
  for (const std::string params : {"params.toml", "isac_parameters.bin"}) {
    const std::string log = folder / (params + ".csv");
    const auto made =
        run({"position", "--step", "0.1 rad", "--duration", "1 s", "--params", folder / params, "-o", log});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    commands.push_back(read_recording(log).column("p1_cmd").values);
  }
  EXPECT_EQ(commands[0], commands[1]);
}

TEST(IsacRun, refuses_what_cannot_be_run_and_touches_nothing) {
  const ScratchFolder folder;
  std::ofstream(folder / "bad.bin") << std::string("ISACPRM\0\1\0", 10) + std::string(300, 'x');
  std::ofstream(folder / "far.csv") << "time [s],angle [deg]\n0,0\n1,80\n";
  std::ofstream(folder / "there.csv") << "time [s]\n";
  const struct {
    std::vector<std::string> words;
    int exit_code;
    const char* says;
  } cases[] = {
      {{"position"}, 2, "position needs one of"},
      {{"position", "--step", "0.1"}, 2, "--step"},
      {{"position", "--step", "2 rad"}, 2, "may go to"},
      {{"position", "--step", "0.1 rad", "--card", "sim:nonsense=1"}, 2, "nonsense"},
      {{"position", "--step", "0.1 rad", "--rate", "7"}, 2, "--rate"},
      {{"position", "--step", "0.1 rad", "--joint", "2"}, 2, "--joint"},
      {{"position", "--step", "0.1 rad", "--card", "comedi:x.toml"}, 2, "needs --params"},
      {{"position", "--step", "0.1 rad", "--params", folder / "bad.bin"},
       3,
       "the parameter table is refused"},
      {{"trajectory", folder / "far.csv"}, 3, "outside the joint's"},
      {{"replay", folder / "far.csv"}, 3, "no recording of a run"},
      {{"position", "--step", "0.1 rad", "-o", folder / "there.csv"}, 2, "there.csv"},
      {{"torque", "--torque", "1 rad"}, 2, "--torque"},
      {{"trajectory", folder / "nowhere.csv"}, 3, "nowhere.csv"},
      {{"replay", folder / "nowhere.csv"}, 3, "nowhere.csv"},
      {{"position", "--step", "0.1 rad", "--params", folder / "nowhere.toml"}, 3, "nowhere.toml"},
  };
  for (const auto& one : cases) {
    const auto r = run(one.words);
    EXPECT_EQ(r.exit_code, one.exit_code) << one.says << "\n" << r.err << r.out;
    EXPECT_NE(r.err.find(one.says), std::string::npos) << r.err;
  }
  EXPECT_EQ(read_text(folder / "there.csv"), "time [s]\n");
}

TEST(IsacRun, latency_prints_the_machines_table) {
  const ScratchFolder folder;
  const auto r = run({"latency", "--duration", "0.3 s", "--rate", "1000", "--json", folder / "out.json"});
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_NE(r.out.find("p99.9"), std::string::npos);
  const Json json = answer_of(folder / "out.json");
  EXPECT_EQ(json["schema"], "isac.run.latency/1");
  EXPECT_GT(json["wake_ups"].get<int>(), 0);
  EXPECT_LE(json["lateness_us"]["p50"].get<double>(), json["lateness_us"]["max"].get<double>());
  EXPECT_TRUE(json["real_time"]["text"].is_string());
}

TEST(IsacRun, runs_degraded_without_permission_and_says_so_or_refuses_when_asked) {
  if (geteuid() != 0)
    GTEST_SKIP() << "only root can take real time away from itself; run as root to see this";
  const ScratchFolder folder;
  std::filesystem::permissions(folder.path(), std::filesystem::perms::all);
  // setpriv leaves the program without CAP_SYS_NICE and CAP_IPC_LOCK, as an ordinary user has it.
  const auto as_nobody = [&](const std::string& more) {
    const std::string out = folder / "out";
    const std::string call =
        "cd " + folder.path().string() +
        " && setpriv --reuid=65534 --regid=65534 --clear-groups --bounding-set -all --inh-caps -all prlimit "
        "--rtprio=0 --memlock=65536 " ISAC_BIN_DIR
        "/isac-run hand --pace real --duration '0.2 s' --heartbeat '20 s' " +
        more + " >" + out + " 2>&1";
    const int status = std::system(call.c_str());
    return std::pair{WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_text(out)};
  };
  const auto [code, said] = as_nobody("");
  if (said.find("setpriv") != std::string::npos || said.find("Permission denied") != std::string::npos)
    GTEST_SKIP() << "the program cannot be started as another user here: " << said;
  EXPECT_EQ(code, 0) << said;
  EXPECT_NE(said.find("no SCHED_FIFO"), std::string::npos) << said;
  const auto [refused, why] = as_nobody("--require-rt");
  EXPECT_EQ(refused, 4) << why;
  EXPECT_NE(why.find("real time was required and is not permitted"), std::string::npos) << why;
}

}  // namespace
}  // namespace isac::test
