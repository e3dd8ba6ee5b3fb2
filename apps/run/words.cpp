#include "run/words.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>

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
  if (mode == "replay") {  // at the rate, and with the controller, of then
    const series::Recording recorded =
        record::read_recording(words.replayed, {.map = {}, .require_time = true, .hash = false});
    if (recorded.find("angle_wanted") == nullptr && recorded.find("angle_wanted_1") == nullptr) {
      throw Error(ErrorKind::kBadInput, "not_a_run",
                  "is no recording of a run (it has no column angle_wanted); give a file that isac-run wrote",
                  {words.replayed, 0, 0});
    }
    wishes.rate = std::strtod(recorded.meta("rate", "2000").c_str(), nullptr);
    wishes.measured_torque = recorded.meta("controller") == "pi";
    wishes.following = std::strtod(recorded.meta("following", "0.35").c_str(), nullptr);
  } else {
    wishes.measured_torque = words.controller == "pi";
    wishes.following = quantity_or(words.following, wishes.following, dimension::kAngle, "--following");
  }
  if (!(wishes.rate >= 50.0) || wishes.rate > 20000.0)
    wrong("rate_nonsense", fmt::format("--rate must be 50 to 20000 Hz, not {:g}", wishes.rate));

  std::string source = "the seed's testbed and gains (section 5.3)";
  if (!words.params.empty()) {
    runtime::LoadedTable loaded = runtime::load_table(words.params);
    source = loaded.source;
    asked.warnings = std::move(loaded.warnings);
    run.joints = loaded.table.joint_count;
    run.settings = runtime::control_settings(loaded.table, run.rig, wishes, asked.warnings);
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
    run.motion = motion_of(words, mode, run);
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
                  {"controller", wishes.measured_torque ? "pi" : "mbpi"},
                  {"following", fmt::format("{} rad", wishes.following)},
                  {"parameters", source},
                  {"program", "isac-run " ISAC_VERSION}};
  if (!run.rig.name.empty()) run.metadata["rig"] = run.rig.name;
  return asked;
}

}  // namespace isac::apps
