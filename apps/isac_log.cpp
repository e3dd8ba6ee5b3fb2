// isac-log: records sweeps on a rig, with prompts, safety limits and a verdict after each (docs/how-to/log-a-sweep.md, calibrate.md).
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "common/program.hpp"
#include "common/quantity.hpp"
#include "isac/card/card.hpp"
#include "isac/core/error.hpp"
#include "isac/record/plan_file.hpp"
#include "isac/runtime/log_session.hpp"
#include "isac/runtime/progress.hpp"
#include "isac/runtime/stop_signals.hpp"
#include "log/answer.hpp"
#include "log/arm_poses.hpp"

namespace {

using namespace isac;

/// The words of the call that need more than CLI11: quantities with units.
struct Words {
  std::string experiment, plan, card, rig, arm, folder, json, side, pace = "virtual";
  std::string duration, hold, amplitude, speed, base;
  std::string delta_pressures, angles, heights, weights, supplies;
  std::string limit_pressure, limit_delta_pressure, limit_angle, limit_speed, limit_force;
  double rate = 500;
  std::uint64_t seed = 1;
  bool slow = false, fast = false, raw = false, overwrite = false, yes = false;
};

/// "-1,0,1 kg/cm2": numbers with one unit behind the last.
std::vector<double> parse_list(const std::string& text, const Dimension& wanted, const std::string& option) {
  std::vector<double> values;
  if (text.empty()) return values;
  const std::size_t comma = text.find_last_of(',');
  const char* last = text.c_str() + (comma == std::string::npos ? 0 : comma + 1);
  char* unit = nullptr;
  static_cast<void>(std::strtod(last, &unit));
  if (unit == last) return {apps::parse_quantity(text, wanted, option)};  // no number there: says so
  for (std::size_t begin = 0, end = 0; end != std::string::npos; begin = end + 1) {
    end = text.find(',', begin);
    const std::string one =
        end == std::string::npos ? text.substr(begin) : text.substr(begin, end - begin) + unit;
    values.push_back(apps::parse_quantity(one, wanted, option));
  }
  return values;
}

/// Seconds may be written without their unit.
double parse_seconds(const std::string& text, const std::string& option) {
  if (text.empty()) return std::numeric_limits<double>::quiet_NaN();
  const bool bare = text.find_first_not_of("+-.0123456789eE ") == std::string::npos;
  return apps::parse_quantity(bare ? text + " s" : text, dimension::kTime, option);
}

double parse_or(const std::string& text, double fallback, const Dimension& wanted,
                const std::string& option) {
  return text.empty() ? fallback : apps::parse_quantity(text, wanted, option);
}

/// Options whose default depends on whether they were given.
struct Given {
  bool rate = false, seed = false;
};

/// Recordings of a plan are numbered behind those of earlier plans in the same folder, so that they add to it.
int round_of(const std::filesystem::path& folder, bool overwrite) {
  int round = 1;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none)) {
    int number = 0;
    if (std::sscanf(entry.path().filename().c_str(), "plan%d-", &number) == 1)
      round = std::max(round, overwrite ? number : number + 1);
  }
  return round;
}

std::vector<series::Program> planned_programs(const Words& words, const series::ExcitationOptions& options) {
  const series::Plan plan = record::read_plan(words.plan);
  try {
    return series::plan_programs(plan, options, round_of(words.folder, words.overwrite));
  } catch (const Error& error) {
    throw Error(error.kind(), error.code(), error.text(), {words.plan, 0, 0});
  }
}

runtime::SessionOptions session_of(const Words& words, const Given& given) {
  runtime::SessionOptions session;
  session.rig = record::read_rig(words.rig);
  session.rig_file = words.rig;
  session.folder = words.folder;
  if (!std::isfinite(session.rig.joint.initial_pressure))
    session.rig.joint.initial_pressure = 3.0 * kPascalPerKgfCm2;
  const record::Rig& rig = session.rig;
  session.card = !words.card.empty() ? words.card : !rig.card.device.empty() ? rig.card.device : "sim:";
  if (given.seed && session.card.rfind("sim:", 0) == 0 && session.card.find("seed=") == std::string::npos) {
    session.card += (session.card.size() > 4 ? ",seed=" : "seed=") + std::to_string(words.seed);
  }
  const bool rig_rate = !given.rate && std::isfinite(rig.card.sample_rate);
  session.rate = rig_rate ? rig.card.sample_rate : words.rate;
  session.dataset = words.experiment == "all" || words.experiment == "testbed-bundle" ||
                    words.experiment == "calibrate" ||
                    !std::filesystem::exists(session.folder / "rig.toml");  // so that it can be read as it is
  session.pace_real = words.pace == "real";
  session.raw = words.raw || words.experiment == "calibrate";  // which is about nothing but counts
  session.overwrite = words.overwrite;
  session.seed = words.seed;

  session.limits.pressure =
      parse_or(words.limit_pressure, rig.limits.pressure, dimension::kPressure, "--limit-pressure");
  session.limits.delta_pressure = parse_or(words.limit_delta_pressure, rig.limits.delta_pressure,
                                           dimension::kPressure, "--limit-delta-pressure");
  session.limits.angle = parse_or(words.limit_angle, rig.limits.angle, dimension::kAngle, "--limit-angle");
  session.limits.speed =
      parse_or(words.limit_speed, rig.limits.speed, dimension::kAngularVelocity, "--limit-speed");
  session.limits.force = parse_or(words.limit_force, rig.limits.force, dimension::kForce, "--limit-force");
  // A hand wanders: it is asked for at most the rig's speed limit and stopped at 1.5 times it, unless the call sets a limit.
  session.hand_speed_limit = words.limit_speed.empty() ? 1.5 * session.limits.speed : session.limits.speed;
  runtime::check_limits(session.limits);

  series::ExcitationOptions excitation;
  excitation.initial_pressure = rig.joint.initial_pressure;
  excitation.delta_pressure_limit = session.limits.delta_pressure;
  excitation.pressure_limit = session.limits.pressure;
  excitation.angle_limit = session.limits.angle;
  excitation.speed_limit = session.hand_speed_limit / 1.5;
  excitation.duration = parse_seconds(words.duration, "--duration");
  excitation.hold = parse_seconds(words.hold, "--hold");
  excitation.amplitude = parse_or(words.amplitude, excitation.amplitude, dimension::kAngle, "--amplitude");
  excitation.speed = parse_or(words.speed, excitation.speed, dimension::kAngularVelocity, "--speed");
  excitation.base_pressure = parse_or(words.base, excitation.base_pressure, dimension::kPressure, "--base");
  excitation.delta_pressures = parse_list(words.delta_pressures, dimension::kPressure, "--delta-pressure");
  excitation.angles = parse_list(words.angles, dimension::kAngle, "--angle");
  excitation.weights = parse_list(words.weights, dimension::kForce, "--weight");
  excitation.supplies = parse_list(words.supplies, dimension::kPressure, "--supply");
  excitation.force_limit = session.limits.force;
  excitation.heights = parse_list(words.heights, dimension::kPressure, "--heights");
  excitation.slow = words.slow || !words.fast;
  excitation.fast = words.fast || !words.slow;
  excitation.seed = words.seed;
  session.programs = words.plan.empty() ? series::make_programs(words.experiment, excitation)
                                        : planned_programs(words, excitation);
  return session;
}

/// Talks to the person: prompts, one line of progress that is rewritten on a terminal, verdicts.
class Console : public runtime::SessionObserver {
 public:
  Console(std::FILE* out, bool yes) : out_(out), terminal_(::isatty(::fileno(out)) == 1), yes_(yes) {}

  bool about_to_record(const series::Program& program, std::size_t index, std::size_t count,
                       bool by_hand) override {
    fmt::print(out_, "{}[{}/{}] {}, {:.0f} s{}\n", bold(), index + 1, count, program.name, program.duration,
               plain());
    last_line_ = -1;
    if (!by_hand || yes_ || ::isatty(STDIN_FILENO) != 1) return true;
    fmt::print(out_, "  Next: {}\n  Press Enter to begin, Ctrl-C to leave.", program.stages.front().prompt);
    std::fflush(out_);
    for (;;) {
      char key = 0;
      const ssize_t got = ::read(STDIN_FILENO, &key, 1);
      if (got <= 0 || runtime::StopSignals::requested().load()) return false;
      if (key == '\n') return true;
    }
  }

  void prompt(const std::string& sentence) override {
    erase();
    fmt::print(out_, "{}\n", runtime::wrapped("  " + sentence, columns(), 2));
    std::fflush(out_);
  }

  void progress(const series::Program& program, const runtime::RecordingLive& live) override {
    if (terminal_) {
      fmt::print(out_, "\r\033[K  {}", runtime::progress_line(program, live, columns() - 3));
      std::fflush(out_);
      drawn_ = true;
      return;
    }
    constexpr int kLines = 4;  // in a file or a pipe: a line for every quarter of the recording
    const int line = static_cast<int>(live.elapsed.load() / program.duration * kLines + 1e-2);
    if (!live.recording.load() || line == last_line_) return;
    last_line_ = line;
    fmt::print(out_, "  {}\n", runtime::progress_line(program, live, 0));
    std::fflush(out_);
  }

  void judged(const runtime::RecordingOutcome& outcome) override {
    erase();
    fmt::print(out_, "{}", runtime::verdict_lines(outcome, terminal_, columns()));
    std::fflush(out_);
  }

  void erase() {
    if (drawn_) fmt::print(out_, "\r\033[K");
    drawn_ = false;
    std::fflush(out_);
  }

  /// Of the terminal; 0 for a file or a pipe.
  [[nodiscard]] int columns() const {
    if (!terminal_) return 0;
    winsize window{};
    const bool known = ::ioctl(::fileno(out_), TIOCGWINSZ, &window) == 0 && window.ws_col > 0;
    return known ? window.ws_col : 80;
  }
  [[nodiscard]] const char* bold() const { return terminal_ ? "\033[1m" : ""; }
  [[nodiscard]] const char* plain() const { return terminal_ ? "\033[0m" : ""; }

 private:
  std::FILE* out_;
  bool terminal_, yes_;
  bool drawn_ = false;
  int last_line_ = -1;
};

int log_sweeps(const Words& words, const Given& given) {
  if (words.rig.empty())
    throw Error(ErrorKind::kUsage, "rig_missing",
                "--rig rig.toml is required for a joint (--arm for an arm); see --help");
  if (words.experiment.empty() && words.plan.empty()) {
    throw Error(ErrorKind::kUsage, "experiment_missing",
                "experiment is required: name one, like constant-pressure, or a plan with --plan plan.toml; "
                "see --help");
  }
  const runtime::SessionOptions session = session_of(words, given);
  apps::require_writable(words.json);
  const runtime::StopSignals signals;
  std::FILE* out = words.json == "-" ? stderr : stdout;  // standard output then belongs to the answer
  Console console(out, words.yes);
  std::vector<runtime::RecordingOutcome> outcomes;
  try {
    outcomes = runtime::run_session(session, console, runtime::StopSignals::requested());
  } catch (...) {
    console.erase();
    throw;
  }
  console.erase();
  fmt::print(out, "{}\n", runtime::summary_line(outcomes, session.programs.size()));
  const bool complete = outcomes.size() == session.programs.size();
  if (!words.json.empty()) apps::write_text(words.json, apps::format_outcomes(outcomes, complete));
  bool keep = complete;
  for (const runtime::RecordingOutcome& outcome : outcomes) keep = keep && outcome.verdict.keep();
  return keep ? 0 : 1;
}

std::string experiments_help() {
  std::string text = "Experiments:\n";
  for (const series::ExperimentInfo& info : series::experiments())
    text += fmt::format("  {:<18} {}\n", info.name, info.what);
  return text + "\nCards:\n" + card::open_help() +
         "\nExit codes: 0 keep, 1 repeat, 2 wrong call, 3 bad file, 4 stopped by the card or a safety limit.";
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Records sweeps on a rig: tells the person what to move, keeps the limits, says whether to repeat.",
      "isac-log"};
  app.set_version_flag("--version", ISAC_VERSION);
  Words words;
  CLI::Option* experiment = app.add_option("experiment", words.experiment, "What to record (see below)");
  CLI::Option* plan =
      app.add_option("--plan", words.plan,
                     "plan.toml of isac-explain: record its runs instead of an experiment; with "
                     "--arm poses.csv of isac-identify masses --plan");
  plan->excludes(experiment);
  app.add_option("--card", words.card,
                 "The card, e.g. sim: or replay:FILE (default: the rig file's, else sim:)");
  app.add_option("--rig", words.rig, "The rig file, rig.toml: required for a joint");
  CLI::Option* arm = app.add_option(
      "--arm", words.arm, "arm.toml: hold an arm in the poses of --plan (docs/how-to/identify-masses.md)");
  arm->excludes(experiment);
  app.add_option("-o,--output", words.folder, "Folder for the recordings; made if missing")->required();
  CLI::Option* rate =
      app.add_option("--rate", words.rate, "Samples per second (default: the rig file's, else 500)");
  CLI::Option* seed =
      app.add_option("--seed", words.seed, "Seed of the excitation, and of sim: where it names none");
  app.add_flag("--raw", words.raw, "Log the card's counts too (enc, ai, ao)");
  app.add_flag("--overwrite", words.overwrite, "Replace recordings that exist (the old ones become *.bak)");
  app.add_option("--json", words.json, "Write the verdicts as JSON to a file, or - for standard output");
  app.add_option("--pace", words.pace, "sim: as fast as it can (virtual) or by the wall clock (real)")
      ->check(CLI::IsMember({"virtual", "real"}));
  app.add_flag("--yes", words.yes, "Don't wait for Enter before each recording");

  app.add_option("--duration", words.duration, "Of each recording, e.g. \"40 s\"")->group("Excitation");
  app.add_option("--delta-pressure", words.delta_pressures, "Levels, e.g. \"-1,0,1 kg/cm2\"")
      ->group("Excitation");
  app.add_flag("--slow", words.slow, "constant-pressure: only the slow sweeps (0.1 pi rad/s)")
      ->group("Excitation");
  app.add_flag("--fast", words.fast, "constant-pressure: only the fast sweeps (to 2 pi rad/s)")
      ->group("Excitation");
  app.add_option("--speed", words.speed, "Another speed of the hand, e.g. \"1 rad/s\"")->group("Excitation");
  app.add_option("--amplitude", words.amplitude, "Of the hand's sweep, e.g. \"20 deg\"")->group("Excitation");
  app.add_option("--angle", words.angles, "Clamps or poses, e.g. \"-10,0,10 deg\"")->group("Excitation");
  app.add_option("--heights", words.heights, "Of valve steps, e.g. \"2,3,4 kg/cm2\"")->group("Excitation");
  app.add_option("--base", words.base, "Pressure from which valve steps start, e.g. \"1 kg/cm2\"")
      ->group("Excitation");
  app.add_option("--weight", words.weights, "calibrate: on each force sensor (default: \"149.1 N\")")
      ->group("Excitation");
  app.add_option(
         "--supply", words.supplies,
         "calibrate: levels of the supply (default: 0 to the pressure limit, e.g. \"0,2.5,5 kg/cm2\")")
      ->group("Excitation");
  app.add_option("--side", words.side,
                 "--arm: the stretch from which a pose is approached (default: \"6 deg\")")
      ->group("Excitation");
  app.add_option("--hold", words.hold, "Of each valve step or pose, e.g. \"2 s\"")->group("Excitation");

  app.add_option("--limit-pressure", words.limit_pressure, "Of either muscle")
      ->group("Safety limits (default: the rig file's)");
  app.add_option("--limit-delta-pressure", words.limit_delta_pressure, "Half the difference of both muscles")
      ->group("Safety limits (default: the rig file's)");
  app.add_option("--limit-angle", words.limit_angle, "Either side")
      ->group("Safety limits (default: the rig file's)");
  app.add_option("--limit-speed", words.limit_speed, "Of the bar, hand-moved or not")
      ->group("Safety limits (default: the rig file's)");
  app.add_option("--limit-force", words.limit_force, "Of either muscle")
      ->group("Safety limits (default: the rig file's)");
  app.footer(experiments_help);
  return apps::run_program(app, argc, argv, words.json, [&] {
    if (!words.arm.empty()) {
      return apps::log_arm_poses({.arm = words.arm,
                                  .plan = words.plan,
                                  .card = words.card,
                                  .folder = words.folder,
                                  .json = words.json,
                                  .limit_delta_pressure = words.limit_delta_pressure,
                                  .limit_speed = words.limit_speed,
                                  .side = words.side,
                                  .rate = rate->count() > 0 ? words.rate : 200,
                                  .overwrite = words.overwrite});
    }
    return log_sweeps(words, {.rate = rate->count() > 0, .seed = seed->count() > 0});
  });
}
