#include "run/words.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>

#include "common/quantity.hpp"
#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/runtime/control_setup.hpp"

namespace isac::apps {
namespace {

[[noreturn]] void wrong(const std::string& code, const std::string& text) {
  throw Error(ErrorKind::kUsage, code, text);
}

double quantity_or(const std::string& text, double fallback, const Dimension& wanted, const char* option) {
  return text.empty() ? fallback : parse_quantity(text, wanted, option);
}

/// "a, b, c unit" → three values in SI, "a, b, c, d, e, f unit" six of them.
template <std::size_t N>
std::array<double, N> list_of(const std::string& text, const Dimension& wanted, const char* option) {
  const std::size_t unit = text.find_first_not_of("0123456789+-.,eE \t");
  const std::string behind = unit == std::string::npos ? std::string() : " " + text.substr(unit);
  std::stringstream numbers(text.substr(0, unit));
  std::array<double, N> values{};
  std::size_t count = 0;
  for (std::string one; std::getline(numbers, one, ','); ++count) {
    if (count < N) values[count] = parse_quantity(one + behind, wanted, option);
  }
  if (count != N)
    wrong("list", fmt::format("{} needs {} numbers with commas between them and a unit behind, not '{}'",
                              option, N, text));
  return values;
}

runtime::LinePiece piece_of(const std::string& text) {
  const bool by = text.starts_with("by ");
  if (!by && !text.starts_with("to ")) {
    wrong("way", "a piece of the way is \"by X, Y, Z m\" or \"to X, Y, Z m\", not '" + text + "'");
  }
  const auto [x, y, z] = list_of<3>(text.substr(3), dimension::kLength, "a piece of the way");
  return {by, {x, y, z}};
}

runtime::Motion line_of(const RunWords& words, const runtime::ControlRun& run, const record::ArmFile& arm) {
  std::vector<runtime::LinePiece> pieces;
  for (const std::string& text : words.way) pieces.push_back(piece_of(text));
  const auto start = words.start.empty() ? models::JointVector<double, 6>{}
                                         : list_of<6>(words.start, dimension::kAngle, "--start");
  runtime::Motion motion;
  motion.kind = runtime::Motion::Kind::kLine;
  motion.path =
      std::make_shared<runtime::LinePath>(runtime::reach_of(arm, run.settings, words.arm), start, pieces,
                                          parse_quantity(words.speed, {.length = 1, .time = -1}, "--speed"));
  motion.duration = quantity_or(words.duration, 1.0, dimension::kTime, "--duration");
  return motion;
}

runtime::Motion motion_of(const RunWords& words, const std::string& mode, const runtime::ControlRun& run) {
  using Kind = runtime::Motion::Kind;
  runtime::Motion motion;
  motion.joint = words.joint - 1;
  motion.duration = quantity_or(words.duration, 5.0, dimension::kTime, "--duration");
  if (!(motion.duration > 0.0)) wrong("duration", "--duration must be longer than 0 s");
  if (mode == "torque" || mode == "hand") {
    motion.kind = Kind::kTorque;
    motion.size = mode == "hand" ? 0.0 : parse_quantity(words.torque, dimension::kTorque, "--torque");
    return motion;
  }
  if (!words.points.empty()) {
    std::vector<control::JointLimits<double>> limits;
    for (int k = 0; k < run.joints; ++k)
      limits.push_back(run.settings.joint[static_cast<std::size_t>(k)].limits);
    motion.kind = Kind::kPoints;
    motion.points = runtime::read_points(words.points, limits);
    motion.duration =
        quantity_or(words.duration, motion.points.back().time + 0.5, dimension::kTime, "--duration");
    return motion;
  }
  if (words.step.empty() == words.sine.empty())
    wrong("motion", "position needs one of --step \"0.3 rad\", --sine \"0.15 rad\" and --csv FILE");
  motion.kind = words.step.empty() ? Kind::kSine : Kind::kStep;
  motion.size = words.step.empty() ? parse_quantity(words.sine, dimension::kAngle, "--sine")
                                   : parse_quantity(words.step, dimension::kAngle, "--step");
  motion.frequency = parse_quantity(words.frequency, {.time = -1}, "--frequency");
  const auto& limits = run.settings.joint[static_cast<std::size_t>(motion.joint)].limits;
  const double size = std::abs(motion.size), high = std::min(limits.angle_high, -limits.angle_low);
  if (size > high) {
    wrong("motion_beyond_limit",
          fmt::format("the motion goes to {:.3g} rad and the joint may go to {:.3g} rad; ask for less", size,
                      high));
  }
  return motion;
}

std::string now_iso() {
  const auto now = std::chrono::system_clock::now();
  const std::time_t seconds = std::chrono::system_clock::to_time_t(now);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text.data();
}

control::Structure structure_of(const std::string& controller) {
  if (controller == "pid") return control::Structure::kPid;
  return controller == "pi" ? control::Structure::kCascade : control::Structure::kModelBased;
}

control::PidGains<double> pid_of(const RunWords& words) {
  if (!words.pid.empty()) {
    const auto [p, i, d] = list_of<3>(words.pid, dimension::kPressure, "--pid");
    return {.proportional = p, .integral = i, .derivative = d};
  }
  if (!words.params.empty()) {
    wrong("pid_missing",
          "--controller pid needs --pid \"K_P, K_I, K_D kg/cm2\" (per rad, rad s, rad/s): parameters hold "
          "the gains of "
          "the cascade only");
  }
  return runtime::testbed_pid_gains();
}

std::string exact(const control::PidGains<double>& gains) {
  return fmt::format("{},{},{} Pa", gains.proportional, gains.integral, gains.derivative);
}

}  // namespace

AskedRun asked_run(const RunWords& words, const std::string& mode) {
  AskedRun asked;
  runtime::ControlRun& run = asked.run;
  run.rig = words.rig.empty() ? record::Rig{} : record::read_rig(words.rig);
  run.card = mode == "replay" ? "replay:" + words.replayed : words.card;
  if (mode != "replay" && words.card == "sim:" && !run.rig.card.device.empty())
    run.card = run.rig.card.device;
  const bool simulated = runtime::is_virtual(run.card);

  runtime::SetupWishes wishes;
  wishes.rate = words.rate;
  std::string controller = !words.controller.empty() ? words.controller
                           : words.arm.empty()       ? "mbpi"
                                                     : "cmbpi";
  wishes.predict_dead_time = words.predictor;
  if (mode == "replay") {  // at the rate, and with the controller, of then
    const series::Recording recorded =
        record::read_recording(words.replayed, {.map = {}, .require_time = true, .hash = false});
    if (recorded.find("angle_wanted") == nullptr && recorded.find("angle_wanted_1") == nullptr) {
      throw Error(ErrorKind::kBadInput, "not_a_run",
                  "is no recording of a run (it has no column angle_wanted); give a file that isac-run wrote",
                  {words.replayed, 0, 0});
    }
    wishes.rate = std::strtod(recorded.meta("rate", "2000").c_str(), nullptr);
    controller = recorded.meta("controller", "mbpi");
    if (controller == "pid") {
      RunWords then = words;
      then.pid = recorded.meta("pid");
      wishes.pid = pid_of(then);
    }
    wishes.predict_dead_time = recorded.meta("predictor") == "1";
    if (controller == "cmbpi" && words.arm.empty())
      wrong("arm_missing", "the recorded run compensated an arm; give the same --arm");
    wishes.following = std::strtod(recorded.meta("following", "0.35").c_str(), nullptr);
  } else {
    if (controller == "pid") wishes.pid = pid_of(words);
    wishes.following = quantity_or(words.following, wishes.following, dimension::kAngle, "--following");
  }
  wishes.structure = structure_of(controller);
  if (!(wishes.rate >= 50.0) || wishes.rate > 20000.0)
    wrong("rate_nonsense", fmt::format("--rate must be 50 to 20000 Hz, not {:g}", wishes.rate));

  std::string source = "the seed's testbed and gains (section 5.3)";
  const bool compensates = controller == "cmbpi";
  if (compensates && (words.arm.empty() || words.params.empty()))
    wrong("arm_missing", "--controller cmbpi compensates an arm: it needs --arm and --params");
  std::optional<record::ArmFile> arm;
  if (!words.arm.empty()) arm = record::read_arm(words.arm);
  if (mode == "line" && (!arm || words.params.empty()))
    wrong("arm_missing", "a line of the hand needs --arm and --params of six joints");
  if (!words.params.empty()) {
    runtime::LoadedTable loaded = runtime::load_table(words.params);
    source = loaded.source;
    asked.warnings = std::move(loaded.warnings);
    run.joints = loaded.table.joint_count;
    run.settings = runtime::control_settings(loaded.table, run.rig, wishes, asked.warnings);
    if (arm) runtime::compensate_arm(run.settings, *arm, loaded.table, words.arm);
    run.settings.compensate = compensates;
  } else if (simulated) {
    run.settings = runtime::testbed_control_settings(run.rig, wishes);
  } else {
    wrong("params_missing",
          "a card that is not simulated needs --params: parameters and gains of this very rig");
  }
  if (words.joint < 1 || words.joint > run.joints)
    wrong("joint", fmt::format("--joint must be 1 to {}", run.joints));

  if (mode == "replay") {
    run.replayed = words.replayed;
  } else {
    run.motion = mode == "line" ? line_of(words, run, *arm) : motion_of(words, mode, run);
  }
  run.log = words.log;
  run.flight = !words.flight.empty() ? std::filesystem::path(words.flight)
               : words.log.empty()   ? std::filesystem::path("isac-run.flight.csv")
                                     : std::filesystem::path(words.log).replace_extension(".flight.csv");
  run.pace_real = words.pace == "real";
  run.ask_to_arm = words.ask || (!simulated && !words.yes);
  run.require_real_time = words.require_rt;
  run.priority = words.priority;
  // Where nothing real moves, a computer that is busy elsewhere is no reason to stop.
  run.beat.beat = std::llround(
      1e9 * quantity_or(words.heartbeat, simulated ? 10.0 : 0.010, dimension::kTime, "--heartbeat"));
  run.metadata = {{"experiment", "closed-loop"},
                  {"started", now_iso()},
                  {"mode", mode},
                  {"card", run.card},
                  {"rate", fmt::format("{} Hz", wishes.rate)},
                  {"controller", controller},
                  {"predictor", wishes.predict_dead_time ? "1" : "0"},
                  {"following", fmt::format("{} rad", wishes.following)},
                  {"parameters", source},
                  {"program", "isac-run " ISAC_VERSION}};
  if (controller == "pid") run.metadata["pid"] = exact(wishes.pid);
  if (arm) run.metadata["arm"] = arm->name;
  if (!run.rig.name.empty()) run.metadata["rig"] = run.rig.name;
  return asked;
}

}  // namespace isac::apps
