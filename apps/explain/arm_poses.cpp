#include "explain/arm_poses.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/dataset.hpp"
#include "common/program.hpp"
#include "common/summary.hpp"
#include "isac/core/error.hpp"
#include "isac/estimate/pose_explain.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/params.hpp"
#include "isac/report/pose_explain_report.hpp"

namespace isac::apps {
namespace {

using Json = nlohmann::ordered_json;
using estimate::PoseExplanation;
using estimate::PoseFinding;
using estimate::PoseVerdict;

constexpr std::size_t kMostRejected = 12;  // of the answer; the others are farther behind still

/// Values and standard errors of the section [masses].
void take_masses(const std::string& path, estimate::MassArm& arm, std::vector<double>& errors) {
  const record::Params params = record::read_params(path);
  const record::ParamsSection* section = params.find("masses", "");
  if (section == nullptr)
    throw Error(ErrorKind::kBadInput, "masses_missing",
                "has no section [masses]; isac-identify masses -o params.toml writes it", {path, 0, 0});
  errors.assign(arm.mass_names.size(), 0);
  for (std::size_t k = 0; k < arm.mass_names.size(); ++k) {
    for (const Estimated& value : section->values) {
      if (value.name != arm.mass_names[k] || !value.identifiable) continue;
      arm.chain.masses[k].mass = value.value;
      errors[k] = value.std_error > 0 ? value.std_error : 0;
    }
  }
}

const char* word_of(PoseVerdict verdict) {
  switch (verdict) {
    case PoseVerdict::kNone:
      return "none";
    case PoseVerdict::kNamed:
      return "named";
    case PoseVerdict::kNotSeparable:
      return "not_separable";
    case PoseVerdict::kUnknown:
      return "unknown";
  }
  return "unknown";
}

Json finding_json(const PoseFinding& f) {
  Json out = {{"id", f.id}, {"name", f.name}, {"subsystem", "arm"}};
  out["joint"] = f.joint < 0 ? Json(nullptr) : Json(f.joint + 1);
  out["confidence"] = json_number(f.confidence);
  out["behind_best"] = json_number(f.behind);
  out["left_p_value"] = json_number(f.left_p);
  out["parameters"] = record::json_parameters(f.parameters);
  return out;
}

Json findings_json(const std::vector<PoseFinding>& findings, std::size_t from, std::size_t most) {
  Json out = Json::array();
  for (std::size_t i = from; i < findings.size() && out.size() < most; ++i)
    out.push_back(finding_json(findings[i]));
  return out;
}

Json text_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

std::string format_poses(const PoseExplanation& answer) {
  Json extra;
  extra["verdict"] = word_of(answer.verdict);
  extra["summary"] = report::pose_verdict_sentence(answer);
  Json signals = Json::array(), where = Json::array();
  double excess = 0;
  for (const estimate::PoseJointGap& gap : answer.gaps)
    excess += std::max(gap.before * gap.before - gap.noise * gap.noise, 0.0);
  for (const estimate::PoseJointGap& gap : answer.gaps) {
    const std::string signal = "tau" + std::to_string(gap.joint + 1);
    signals.push_back({{"signal", signal},
                       {"unit", "N m"},
                       {"rmse", json_number(gap.before)},
                       {"after", json_number(gap.after)},
                       {"noise_floor", json_number(gap.noise)}});
    const double share =
        excess > 0 ? std::max(gap.before * gap.before - gap.noise * gap.noise, 0.0) / excess : 0;
    if (answer.verdict != PoseVerdict::kNone && share > 0.1)
      where.push_back(
          {{"subsystem", "joint"}, {"signal", signal}, {"variable", "pose"}, {"share", json_number(share)}});
  }
  extra["disagreement"] = {{"detected", answer.verdict != PoseVerdict::kNone},
                           {"p_value", json_number(answer.p_value)},
                           {"signals", signals},
                           {"where", where}};
  extra["effects"] = findings_json(answer.findings, 0, 1);
  extra["alternatives"] = findings_json(answer.findings, 1, answer.findings.size());
  extra["rejected"] = findings_json(answer.rejected, 0, kMostRejected);
  extra["lookalikes"] = answer.lookalikes;
  extra["unknown"] = nullptr;
  if (answer.verdict == PoseVerdict::kUnknown)
    extra["unknown"] = {{"subsystem", "arm"}, {"depends_on", Json::array({"pose"})}, {"share", 1}};
  extra["not_testable"] = answer.not_testable;
  extra["could_hide"] = Json::array();
  for (const PoseFinding& f : answer.could_hide)
    extra["could_hide"].push_back({{"id", f.id},
                                   {"name", f.name},
                                   {"size", json_number(f.parameters[0].value)},
                                   {"unit", f.parameters[0].unit}});
  extra["outliers"] = answer.outliers;
  extra["next_experiment"] = text_or_null(report::pose_next_sentence(answer));
  extra["gap"] = {{"unit", "N m"},
                  {"before", json_number(answer.before)},
                  {"after", json_number(answer.after)},
                  {"noise_floor", json_number(answer.noise)},
                  {"heldout_before", nullptr},
                  {"heldout_after", nullptr}};
  record::Answer frame;
  frame.schema = "isac.explain/1";
  frame.fit = {.rmse = answer.after, .unit = "N m", .samples = static_cast<double>(answer.torques)};
  frame.warnings = answer.warnings;
  return record::format_answer(frame, extra);
}

void print_poses(const PoseExplanation& answer) {
  fmt::print("{}\n", report::pose_verdict_sentence(answer));
  fmt::print("gap        {:.4g} N m rms over {} torques of {} poses, {:.4g} with the best; noise {:.4g}\n",
             answer.before, answer.torques, answer.poses, answer.after, answer.noise);
  for (const PoseFinding& f : answer.findings)
    fmt::print("fits       {}: {} (confidence {:.2f})\n", f.name, report::pose_amount(f),
               std::min(f.confidence, 0.99));
  for (std::size_t i = 0; i < answer.rejected.size() && i < 3; ++i)
    fmt::print("not        {}: {:.1f} behind (9 is three standard deviations)\n", answer.rejected[i].name,
               answer.rejected[i].behind);
  for (const PoseFinding& f : answer.could_hide)
    if (f.id == "hand_load" || f.id == "angle_zero")
      fmt::print("could hide {}: {:.3g} {}\n", f.name, f.parameters[0].value, f.parameters[0].unit);
  std::string list;
  for (const std::string& name : answer.not_testable) list += (list.empty() ? "" : ", ") + name;
  if (!list.empty()) fmt::print("untested   {}\n", list);
  list.clear();
  for (const std::string& name : answer.outliers) list += (list.empty() ? "" : ", ") + name;
  if (!list.empty()) fmt::print("left out   {}: no hypothesis explains it\n", list);
  const std::string next = report::pose_next_sentence(answer);
  if (!next.empty()) fmt::print("next       {}\n", next);
  print_warnings(answer.warnings);
}

}  // namespace

void add_arm_options(CLI::App& app, ArmExplainWords& words) {
  const std::string group = "An arm in poses (instead of a joint that moves)";
  app.add_option("--arm", words.arm, "arm.toml: the recordings are poses, a row each (docs/arm.md)")
      ->group(group);
  app.add_option("--masses", words.masses,
                 "params.toml with [masses]: what they weigh and how well that is known")
      ->group(group);
  app.add_option("--actuators", words.actuators,
                 "params.toml with [[joint]] \"1\", \"2\" …: A and B with their errors")
      ->group(group);
  app.add_option("--torque-noise", words.noise,
                 "of one torque, e.g. \"0.1 N m\" (default: the arm file's, else from the poses)")
      ->group(group);
  app.add_option("--torques", words.torques, "tau is gravity's, the actuators', or auto")
      ->check(CLI::IsMember({"auto", "gravity", "actuator"}))
      ->group(group);
  app.add_option("--angles", words.angles, "theta (arm), phi (actuators), or auto")
      ->check(CLI::IsMember({"auto", "theta", "phi"}))
      ->group(group);
  app.add_flag("--by-model", words.by_model, "tau was computed by the actuators' model")->group(group);
  CLI::Option* doubt =
      app.add_flag("--doubt-masses", words.doubt_masses, "a wrong mass is an explanation too")->group(group);
  app.add_flag("--free-masses", words.free_masses, "the masses are not known at all")
      ->group(group)
      ->excludes(doubt);
}

int explain_arm(const ArmExplainWords& words, const std::string& json, const std::string& report_path) {
  for (const std::string& path : {json, report_path}) require_writable(path);
  Poses input = read_poses(words, false);
  estimate::PoseExplainOptions options;
  options.fit = input.options;
  options.doubt_masses = words.doubt_masses;
  if (!words.masses.empty()) take_masses(words.masses, input.arm, options.mass_errors);
  if (words.free_masses)
    options.mass_errors.assign(input.arm.mass_names.size(), std::numeric_limits<double>::infinity());
  const PoseExplanation answer = estimate::explain_poses(input.arm, input.poses, options);
  if (!report_path.empty()) {
    report::PoseExplainReportInput page;
    page.head.rig = input.file.name;
    page.head.created = now_iso8601();
    page.answer = &answer;
    page.joints = input.arm.joints;
    record::write_atomically(report_path, report::render_pose_explain_report(page));
  }
  if (!json.empty()) write_text(json, format_poses(answer));
  if (json != "-") print_poses(answer);
  return 0;
}

}  // namespace isac::apps
