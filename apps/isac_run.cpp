// isac-run: drives joints by the identified model, watched by a supervisor that can always close the valves (docs/how-to/run.md).
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>
#include <thread>

#include "common/program.hpp"
#include "common/quantity.hpp"
#include "isac/card/card.hpp"
#include "isac/core/error.hpp"
#include "isac/runtime/stop_signals.hpp"
#include "run/answer.hpp"
#include "run/words.hpp"

namespace {

using namespace isac;

/// One line of status that is rewritten on a terminal; a line per second of the run elsewhere.
class Console final : public runtime::RunObserver {
 public:
  Console(std::FILE* out, int joints) : out_(out), terminal_(::isatty(::fileno(out)) == 1), joints_(joints) {}

  void started(const runtime::RealTime* real_time, const std::vector<std::string>& remarks) override {
    if (real_time != nullptr) fmt::print(out_, "Real time: {}.\n", real_time->words());
    for (const std::string& remark : remarks) fmt::print(out_, "Note: {}\n", remark);
    std::fflush(out_);
  }

  void status(const runtime::Live& live) override {
    const double seconds = 1e-9 * static_cast<double>(live.time_ns.load());
    if (!terminal_ && static_cast<long>(seconds) == last_line_) return;
    last_line_ = static_cast<long>(seconds);
    static constexpr const char* kPhases[] = {"checking", "run-up", "control", "vented"};
    std::string line = fmt::format("{:8.2f} s  {:<8}", seconds, kPhases[live.phase.load() & 3]);
    for (std::size_t j = 0; j < static_cast<std::size_t>(joints_); ++j) {
      line += fmt::format("  {:+.3f}/{:+.3f} rad  dp {:+.2f}", live.angle[j].load(), live.aim[j].load(),
                          live.delta_pressure[j].load() / kPascalPerKgfCm2);
    }
    line += fmt::format(" kg/cm2  {} late", live.late.load());
    fmt::print(out_, "{}{}{}", terminal_ ? "\r\033[K" : "", line, terminal_ ? "" : "\n");
    std::fflush(out_);
  }

  bool agrees() override {
    if (!asked_) {
      fmt::print(out_, "{}Is everybody clear of the joint? Press Enter to arm, Ctrl-C to leave.\n",
                 terminal_ ? "\r\033[K" : "");
      std::fflush(out_);
      asked_ = true;
    }
    pollfd key{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    if (::poll(&key, 1, 0) <= 0) return false;
    char letter = 0;
    const ssize_t got = ::read(STDIN_FILENO, &letter, 1);
    if (got == 0) {  // nobody is there and nobody will come
      raise(SIGTERM);
      return false;
    }
    return got == 1 && letter == '\n';
  }

 private:
  std::FILE* out_;
  bool terminal_;
  int joints_;
  bool asked_ = false;
  long last_line_ = -1;
};

int run(const apps::RunWords& words, const std::string& mode) {
  const apps::AskedRun asked = apps::asked_run(words, mode);
  apps::require_writable(words.json);
  const runtime::StopSignals signals;
  std::FILE* out = words.json == "-" ? stderr : stdout;  // standard output then belongs to the answer
  for (const Warning& warning : asked.warnings) fmt::print(stderr, "warning: {}\n", warning.text);
  Console console(out, asked.run.joints);
  const runtime::ControlOutcome outcome =
      runtime::run_control(asked.run, console, runtime::StopSignals::requested());
  fmt::print(out, "{}{}", ::isatty(::fileno(out)) == 1 ? "\r\033[K" : "",
             apps::run_words(asked.run, outcome));
  if (!words.json.empty())
    apps::write_text(words.json, apps::format_run(asked.run, outcome, mode, asked.warnings));
  return apps::exit_code_of(asked.run, outcome);
}

int latency(const apps::RunWords& words) {
  apps::LatencyRun measured;
  measured.seconds =
      words.duration.empty() ? 10.0 : apps::parse_quantity(words.duration, dimension::kTime, "--duration");
  measured.rate = words.rate;
  if (!(measured.seconds > 0.0) || measured.seconds > 3600.0 || !(measured.rate >= 1.0) ||
      measured.rate > 20000.0) {
    throw Error(ErrorKind::kUsage, "latency_nonsense",
                "--duration must be up to 3600 s and --rate 1 to 20000 Hz");
  }
  apps::require_writable(words.json);
  const runtime::StopSignals signals;
  std::thread thread([&] {
    measured.real_time = runtime::prepare_real_time(words.priority);
    measured.jitter =
        runtime::measure_jitter(measured.seconds, measured.rate, runtime::StopSignals::requested());
  });
  thread.join();
  fmt::print(words.json == "-" ? stderr : stdout, "{}", apps::latency_words(measured));
  if (!words.json.empty()) apps::write_text(words.json, apps::format_latency(measured));
  return 0;
}

void add_json(CLI::App& app, apps::RunWords& words) {
  app.add_option("--json", words.json, "Write the answer as JSON to a file, or - for standard output");
}

void add_common(CLI::App& app, apps::RunWords& words) {
  app.add_option(
      "--params", words.params,
      "Parameters and gains: params.toml or the packed table (sim: and replay: without: the seed's)");
  app.add_option("--rig", words.rig, "The rig file: limits, calibration, card");
  app.add_option("--arm", words.arm, "The arm file: masses for the compensation, links for a line, limits");
  app.add_option("-o,--output", words.log, "Record the run as CSV (never replaces a file)");
  app.add_option(
      "--flight", words.flight,
      "Where the last cycles go when the run does not end as planned (default: beside the recording)");
  add_json(app, words);
}

void add_live(CLI::App& app, apps::RunWords& words) {
  app.add_option("--card", words.card,
                 "sim:OPTIONS, replay:FILE, comedi:TABLE (default: the rig file's, else sim:)");
  app.add_option("--duration", words.duration, "Of the motion, e.g. \"5 s\"");
  app.add_option("--rate", words.rate, "Cycles per second; the position loop runs at every tenth")
      ->capture_default_str();
  app.add_option("--controller", words.controller,
                 "mbpi: torque from the model; cmbpi: the same with the arm's weight compensated (default "
                 "with --arm); "
                 "pi: torque measured; pid: angle to pressure")
      ->check(CLI::IsMember({"mbpi", "cmbpi", "pi", "pid"}));
  app.add_option(
      "--pid", words.pid,
      "K_P, K_I, K_D of --controller pid per rad, rad s, rad/s: \"0.4, 7, 0.08 kg/cm2\" (the seed's: the "
      "default without --params)");
  app.add_flag("--predictor", words.predictor,
               "Predict the valves' dead time away (needs it and the inertia)");
  app.add_option("--pace", words.pace,
                 "sim:, replay: as fast as it can (virtual) or by the wall clock (real)")
      ->check(CLI::IsMember({"virtual", "real"}))
      ->capture_default_str();
  app.add_option("--following", words.following, "Largest following error for 0.5 s (default \"0.35 rad\")");
  app.add_option(
      "--heartbeat", words.heartbeat,
      "Silence of the loop after which the supervisor vents (default \"10 ms\"; sim:, replay: \"10 s\")");
  app.add_option("--priority", words.priority, "SCHED_FIFO priority of the loop, 1 to 98")
      ->check(CLI::Range(1, 98))
      ->capture_default_str();
  app.add_flag("--require-rt", words.require_rt, "Refuse to run without SCHED_FIFO and locked memory");
  app.add_flag("--yes", words.yes, "Arm without asking");
  app.add_flag("--ask", words.ask, "Ask before arming, on sim: and replay: too");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Drives joints by the identified model, watched by a supervisor that can always close the valves.",
      "isac-run"};
  app.set_version_flag("--version", ISAC_VERSION);
  app.require_subcommand(1);
  app.footer([] {
    return "Cards:\n" + card::open_help() +
           "\nExit codes: 0 ended as planned, 1 a replayed run gave other commands, 2 wrong call, 3 bad "
           "file, 4 stopped by a "
           "fault, the card or the supervisor.";
  });
  apps::RunWords words;

  CLI::App* position =
      app.add_subcommand("position", "Hold or move the angle: a step, a sine, or points of a CSV");
  position->add_option("--step", words.step, "Height, e.g. \"0.3 rad\"");
  position->add_option("--sine", words.sine, "Amplitude, e.g. \"0.15 rad\"");
  position->add_option("--frequency", words.frequency, "Of the sine")->capture_default_str();
  position->add_option("--csv", words.points, "Columns time and angle, or phi1 ... of all joints");
  position->add_option("--joint", words.joint, "Which joint moves; the others hold")->capture_default_str();
  CLI::App* trajectory =
      app.add_subcommand("trajectory", "Points of joint angles, all checked before anything moves");
  trajectory->add_option("points", words.points, "CSV with time and angle, or phi1 ... of all joints")
      ->required();
  CLI::App* line = app.add_subcommand(
      "line", "The hand along straight pieces, points 2 mm apart, all checked before anything moves");
  line->add_option("way", words.way, "Pieces: \"by 0, 0, 0.1 m\" from where it is, \"to 0.3, 0.2, 0.4 m\"")
      ->required();
  line->add_option("--speed", words.speed, "Of the hand")->capture_default_str();
  line->add_option(
      "--start", words.start,
      "Six joint angles from which the way begins, e.g. \"0, 0.1, 0, 0, 0, 0 rad\" (default: the middle)");
  CLI::App* torque = app.add_subcommand("torque", "Hold a torque");
  torque->add_option("--torque", words.torque, "E.g. \"1.5 N m\"")->required();
  torque->add_option("--joint", words.joint, "Which joint; the others have 0 N m")->capture_default_str();
  CLI::App* hand = app.add_subcommand("hand", "Torque 0: the joint is led by hand");
  for (CLI::App* live : {position, trajectory, line, torque, hand}) {
    add_common(*live, words);
    add_live(*live, words);
  }
  CLI::App* replay = app.add_subcommand(
      "replay", "Replay a recorded run through the controller and compare its commands bit for bit");
  replay->add_option("run", words.replayed, "A recording of isac-run")->required();
  add_common(*replay, words);
  CLI::App* jitter = app.add_subcommand("latency", "How late this machine wakes up a loop");
  jitter->add_option("--duration", words.duration, "Default \"10 s\"");
  jitter->add_option("--rate", words.rate, "Wake-ups per second")->capture_default_str();
  jitter->add_option("--priority", words.priority, "SCHED_FIFO priority")
      ->check(CLI::Range(1, 98))
      ->capture_default_str();
  add_json(*jitter, words);

  return apps::run_program(app, argc, argv, words.json, [&] {
    const std::string mode = app.get_subcommands().front()->get_name();
    return mode == "latency" ? latency(words) : run(words, mode);
  });
}
