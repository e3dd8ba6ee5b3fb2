#include "log/arm_poses.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "common/program.hpp"
#include "common/quantity.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/runtime/pose_session.hpp"
#include "isac/runtime/stop_signals.hpp"

namespace isac::apps {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kFar = 2 * kPi / 180;  // rad from the planned angle, worth a word

class Console final : public runtime::PoseObserver {
 public:
  explicit Console(std::FILE* out) : out_(out) {}
  void note(const std::string& sentence) override { fmt::print(out_, "{}\n", sentence); }
  void held(const runtime::HeldPose& pose, std::size_t done, std::size_t count) override {
    fmt::print(out_, "{:3} of {}  pose {} from {}: {}", done, count, pose.pose,
               pose.approach > 0 ? "below" : "above",
               pose.at_rest ? "at rest" : fmt::format("still moving, {:.2f} deg", pose.drift * 180 / kPi));
    if (pose.distance > kFar)
      fmt::print(out_, ", joint {} stays {:.1f} deg from the plan", pose.farthest + 1,
                 pose.distance * 180 / kPi);
    if (pose.saturated >= 0)
      fmt::print(out_, "; joint {}'s muscles are at the limit of their pressure: left out",
                 pose.saturated + 1);
    fmt::print(out_, "\n");
    std::fflush(out_);
  }

 private:
  std::FILE* out_;
};

/// theta1 … of every row.
std::vector<runtime::ArmAngles> read_plan(const ArmPoseWords& words, const record::ArmFile& arm) {
  const series::Recording plan =
      record::read_recording(words.plan, {.map = {}, .require_time = false, .hash = false});
  std::vector<runtime::ArmAngles> poses(plan.rows());
  for (int j = 0; j < arm.joints; ++j) {
    const series::Column& column = plan.column("theta" + std::to_string(j + 1));
    for (std::size_t i = 0; i < poses.size(); ++i) poses[i][static_cast<std::size_t>(j)] = column.values[i];
  }
  return poses;
}

/// The simulated card is the arm itself where it names no other.
std::string card_of(const ArmPoseWords& words) {
  const std::string card = words.card.empty() ? "sim:" : words.card;
  if (card.rfind("sim:", 0) != 0 || card.find("arm=") != std::string::npos) return card;
  return "sim:arm=" + words.arm + (card.size() > 4 ? "," + card.substr(4) : "");
}

std::string format_poses(const runtime::PoseSessionResult& result, const std::string& file, bool keep) {
  Json poses = Json::array();
  for (const runtime::HeldPose& pose : result.rows)
    poses.push_back(
        {{"pose", pose.pose},
         {"approach", pose.approach},
         {"at_rest", pose.at_rest},
         {"drift", {{"value", pose.drift}, {"unit", "rad"}}},
         {"distance", {{"value", pose.distance}, {"unit", "rad"}, {"joint", pose.farthest + 1}}}});
  const Json answer = {{"schema", "isac.log/1"},
                       {"verdict", keep ? "keep" : "repeat"},
                       {"complete", result.complete},
                       {"recordings", Json::array({{{"file", file},
                                                    {"verdict", keep ? "keep" : "repeat"},
                                                    {"samples", result.rows.size()},
                                                    {"poses", std::move(poses)}}})}};
  return answer.dump(2);
}

}  // namespace

int log_arm_poses(const ArmPoseWords& words) {
  if (words.plan.empty()) {
    throw Error(
        ErrorKind::kUsage, "plan_missing",
        "an arm is held in planned poses: name them with --plan poses.csv, which isac-identify masses --plan "
        "writes");
  }
  require_writable(words.json);
  runtime::PoseSessionOptions options;
  options.arm = record::read_arm(words.arm);
  options.theta = read_plan(words, options.arm);
  options.card = card_of(words);
  options.rate = words.rate;
  options.overwrite = words.overwrite;
  if (!words.limit_delta_pressure.empty())
    options.delta_pressure_limit =
        parse_quantity(words.limit_delta_pressure, dimension::kPressure, "--limit-delta-pressure");
  if (!words.limit_speed.empty())
    options.speed_limit = parse_quantity(words.limit_speed, dimension::kAngularVelocity, "--limit-speed");
  if (!words.side.empty()) options.side = parse_quantity(words.side, dimension::kAngle, "--side");
  std::error_code failed;
  std::filesystem::create_directories(words.folder, failed);
  if (failed)
    throw Error(ErrorKind::kBadInput, "output_folder",
                "the output folder cannot be made (" + failed.message() + "); name another with -o",
                {words.folder, 0, 0});
  options.file = std::filesystem::path(words.folder) / "poses.csv";
  std::FILE* out = words.json == "-" ? stderr : stdout;  // standard output then belongs to the answer
  const runtime::StopSignals signals;
  Console console(out);
  const runtime::PoseSessionResult result =
      runtime::hold_poses(options, console, runtime::StopSignals::requested());
  bool keep = result.complete;
  for (const runtime::HeldPose& pose : result.rows) keep = keep && pose.at_rest && pose.saturated < 0;
  fmt::print(out, "{} rows of {} poses in {}\n", result.rows.size(), options.theta.size(),
             options.file.string());
  if (!words.json.empty()) write_text(words.json, format_poses(result, options.file.string(), keep));
  return keep ? 0 : 1;
}

}  // namespace isac::apps
