// isac-identify masses: masses of an arm from poses it was held in, and the poses that would tell them better.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/dataset.hpp"
#include "common/poses.hpp"
#include "common/program.hpp"
#include "common/quantity.hpp"
#include "common/summary.hpp"
#include "identify/commands.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/estimate/mass_fit.hpp"
#include "isac/estimate/pose_design.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/arm_file.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/params.hpp"
#include "isac/report/masses_report.hpp"

namespace isac::apps {
namespace {

constexpr int kMostPoses = 500;          // of a design; more is a mistake in the call
constexpr std::size_t kPosesShown = 24;  // on the terminal; the answer and the report have all
constexpr double kMuscleShare =
    0.9;  // of the limit of Δp that a planned pose may ask: the masses are not known yet
constexpr double kSpareAngle =
    9 * kPi / 180;  // rad, to the limits: isac-log approaches a pose from both sides

struct MassesCall : PoseWords {
  std::vector<std::string> unknowns;
  std::string params, report, plan, criterion = "A", limit = "2 kg/cm2";
  int design = 8;
  bool add = false, plain = false;
};

nlohmann::ordered_json angles_json(const estimate::ArmVector& angles, int joints) {
  nlohmann::ordered_json out = nlohmann::ordered_json::array();
  for (int j = 0; j < joints; ++j) out.push_back(json_number(angles[static_cast<std::size_t>(j)]));
  return out;
}

nlohmann::ordered_json by_mass(const std::vector<std::string>& names, const std::vector<double>& values) {
  nlohmann::ordered_json out = nlohmann::ordered_json::object();
  for (std::size_t k = 0; k < values.size(); ++k) out[names[k]] = json_number(values[k]);
  return out;
}

void add_design(nlohmann::ordered_json& extra, const estimate::PoseDesign& design,
                const estimate::PoseDesignOptions& options, const estimate::MassArm& arm) {
  extra["next_poses"] = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < design.theta.size(); ++i)
    extra["next_poses"].push_back({{"theta", angles_json(design.theta[i], arm.joints)},
                                   {"phi", angles_json(design.phi[i], arm.joints)},
                                   {"unit", "rad"}});
  if (!design.theta.empty()) {
    extra["design"] = {{"criterion", options.criterion == estimate::DesignCriterion::kD ? "D" : "A"},
                       {"torque_noise", {{"value", json_number(options.torque_noise[0])}, {"unit", "N m"}}},
                       {"std_errors", by_mass(arm.mass_names, design.std_errors)},
                       {"with_recorded", by_mass(arm.mass_names, design.with_recorded)},
                       {"random_poses", by_mass(arm.mass_names, design.random_std_errors)}};
  }
}

nlohmann::ordered_json details_of(const estimate::MassFit& fit, const estimate::PoseDesign& design,
                                  const estimate::PoseDesignOptions& options, const estimate::MassArm& arm) {
  using nlohmann::ordered_json;
  ordered_json extra;
  extra["condition"] = json_number(fit.condition);
  add_design(extra, design, options, arm);
  extra["torques"] = fit.sign == estimate::TorqueSign::kActuator ? "actuator" : "gravity";
  extra["torque_noise"] = {{"value", json_number(fit.torque_noise)},
                           {"unit", "N m"},
                           {"estimated", fit.noise_estimated},
                           {"degrees_of_freedom", fit.degrees_of_freedom}};
  extra["std_error_parts"] = {{"random", by_mass(arm.mass_names, fit.random_errors)},
                              {"actuator_model", by_mass(arm.mass_names, fit.model_errors)}};
  extra["friction"] = angles_json(fit.friction, arm.joints);
  extra["poses"] = ordered_json::array();
  for (const estimate::MassPoseResult& pose : fit.poses)
    extra["poses"].push_back({{"name", pose.name},
                              {"p_value", json_number(pose.p_value)},
                              {"outlier", pose.outlier || pose.left_out},
                              {"left_out", pose.left_out}});
  extra["residuals"] = ordered_json::array();
  for (const estimate::MassRow& row : fit.rows)
    extra["residuals"].push_back({{"pose", fit.poses[row.pose].name},
                                  {"joint", row.joint + 1},
                                  {"measured", json_number(row.measured)},
                                  {"predicted", json_number(row.predicted)},
                                  {"residual", json_number(row.residual)}});
  extra["sensitivity"] = ordered_json::array();
  for (const estimate::MassSensitivity& s : fit.sensitivities)
    extra["sensitivity"].push_back(
        {{"cause", s.cause}, {"unit", s.unit}, {"kg_per_unit", by_mass(arm.mass_names, s.per_unit)}});
  return extra;
}

/// Residuals pose by pose; of many poses those out of line and the worst of the others.
void print_poses(const estimate::MassFit& fit) {
  struct Line {
    std::size_t pose = 0;
    double squares = 0, count = 0, largest = 0;
    int joint = 0;
  };
  std::vector<Line> lines(fit.poses.size());
  for (std::size_t p = 0; p < lines.size(); ++p) lines[p].pose = p;
  for (const estimate::MassRow& row : fit.rows) {
    Line& line = lines[row.pose];
    line.squares += row.residual * row.residual;
    line.count += 1;
    if (std::abs(row.residual) < std::abs(line.largest)) continue;
    line.largest = row.residual;
    line.joint = row.joint;
  }
  const auto odd = [&](const Line& line) {
    return fit.poses[line.pose].outlier || fit.poses[line.pose].left_out;
  };
  if (lines.size() > kPosesShown) {
    std::stable_sort(lines.begin(), lines.end(), [&](const Line& a, const Line& b) {
      return odd(a) != odd(b) ? odd(a) : fit.poses[a.pose].p_value < fit.poses[b.pose].p_value;
    });
    const auto all_odd = static_cast<std::size_t>(std::count_if(lines.begin(), lines.end(), odd));
    lines.resize(std::max(all_odd, kPosesShown));
  }
  fmt::print("{:<22} {:>10}  {:<24} {:>8}\n", "pose", "rms N m", "largest", "p");
  for (const Line& line : lines) {
    const estimate::MassPoseResult& pose = fit.poses[line.pose];
    if (!(line.count > 0)) continue;
    fmt::print("{:<22} {:10.3g}  {:<24} {:8.2g}{}\n", pose.name, std::sqrt(line.squares / line.count),
               fmt::format("{:+.3g} on joint {}", line.largest, line.joint + 1), pose.p_value,
               pose.left_out  ? "  left out: the others contradict it"
               : pose.outlier ? "  out of line"
                              : "");
  }
  if (lines.size() < fit.poses.size())
    fmt::print("({} more poses in line; all are in --json and --report)\n", fit.poses.size() - lines.size());
}

void print_design(const estimate::PoseDesign& design, const estimate::MassArm& arm) {
  if (design.theta.empty()) return;
  const auto list = [&](const std::vector<double>& errors) {
    std::string out;
    for (std::size_t k = 0; k < errors.size(); ++k)
      out += fmt::format("{}{} {:.4f}", k == 0 ? "" : ", ", arm.mass_names[k], errors[k]);
    return out;
  };
  fmt::print("next {} poses, arm angles in deg; standard errors {} kg (as many random poses: {} kg)\n",
             design.theta.size(), list(design.std_errors), list(design.random_std_errors));
  for (const estimate::ArmVector& theta : design.theta) {
    for (int j = 0; j < arm.joints; ++j)
      fmt::print("{:9.2f}", theta[static_cast<std::size_t>(j)] * 180 / kPi + 0.0);
    fmt::print("\n");
  }
}

void take_unknowns(const MassesCall& call, estimate::MassFitOptions& options) {
  options.robust = !call.plain;
  for (const std::string& unknown : call.unknowns) {
    if (unknown == "load") {
      options.load = true;
    } else if (unknown == "offsets") {
      options.offsets = true;
    } else {
      options.zeros = true;
    }
  }
}

estimate::PoseDesignOptions design_options(const MassesCall& call, const estimate::MassFitOptions& fit) {
  estimate::PoseDesignOptions options;
  options.poses = call.design;
  options.criterion = call.criterion == "D" ? estimate::DesignCriterion::kD : estimate::DesignCriterion::kA;
  options.add_to_recorded = call.add;
  if (!call.plan.empty()) {  // poses that the arm's own muscles are to hold
    options.delta_pressure_limit =
        kMuscleShare * parse_quantity(call.limit, dimension::kPressure, "--limit-delta-pressure");
    options.spare_angle = kSpareAngle;
  }
  for (std::size_t j = 0; j < estimate::kArmJoints; ++j)
    if (std::isfinite(fit.torque_noise[j])) options.torque_noise[j] = fit.torque_noise[j];
  return options;
}

/// The proposed poses as a recording without torques: what isac-log --plan holds.
void write_plan(const std::string& path, const estimate::PoseDesign& design, const record::ArmFile& file) {
  if (design.theta.empty()) {
    throw Error(
        ErrorKind::kAnswerIsNo, "no_poses",
        "no pose was found that the arm's muscles can hold inside its limits; check the actuators and "
        "limits of the arm file");
  }
  series::Recording plan;
  plan.metadata["experiment"] = "pose";
  if (!file.name.empty()) plan.metadata["arm"] = file.name;
  for (int j = 0; j < file.joints; ++j) {
    series::Column column{"theta" + std::to_string(j + 1), "rad", {}};
    for (const estimate::ArmVector& theta : design.theta)
      column.values.push_back(theta[static_cast<std::size_t>(j)]);
    plan.columns.push_back(std::move(column));
  }
  record::write_recording(path, plan);
}

/// Poses for an arm of which nothing is recorded yet.
int run_design(const MassesCall& call, const Poses& input, const std::string& json_path) {
  const estimate::PoseDesignOptions next = design_options(call, input.options);
  const estimate::PoseDesign design = estimate::design_poses(input.arm, next);
  write_plan(call.plan, design, input.file);
  if (!json_path.empty()) {
    record::Answer answer;
    answer.schema = "isac.masses/1";
    nlohmann::ordered_json extra;
    add_design(extra, design, next, input.arm);
    write_text(json_path, record::format_answer(answer, extra));
  }
  if (json_path != "-") print_design(design, input.arm);
  return 0;
}

int run_masses(const MassesCall& call, const std::string& json_path) {
  for (const std::string& path : {call.params, call.report, call.plan, json_path}) require_writable(path);
  Poses input = read_poses(call, !call.params.empty());
  const record::ArmFile& file = input.file;
  const estimate::MassArm& arm = input.arm;
  estimate::MassFitOptions& options = input.options;
  take_unknowns(call, options);
  if (call.runs.empty()) {
    if (call.plan.empty() || call.design == 0) {
      throw Error(
          ErrorKind::kUsage, "poses_missing",
          "poses are required: name a recording with a row per pose, or plan the first ones with --plan "
          "poses.csv; see --help");
    }
    return run_design(call, input, json_path);
  }
  const std::vector<series::Recording>& recordings = input.recordings;
  const std::vector<estimate::MassPose>& poses = input.poses;

  const estimate::MassFit fit = estimate::fit_masses(arm, poses, options);
  estimate::PoseDesignOptions next = design_options(call, options);
  const bool all_known =
      std::all_of(fit.masses.begin(), fit.masses.end(), [](const Estimated& m) { return m.identifiable; });
  if (all_known) next.recorded = fit.information;
  estimate::PoseDesign design;
  if (call.design > 0) design = estimate::design_poses(arm, next);
  if (!call.plan.empty()) write_plan(call.plan, design, file);

  std::vector<Estimated> parameters = fit.masses;
  parameters.insert(parameters.end(), fit.others.begin(), fit.others.end());
  if (!call.report.empty()) {
    report::MassesReportInput report_input;
    report_input.head.rig = file.name;
    report_input.head.created = now_iso8601();
    report_input.fit = &fit;
    report_input.design = &design;
    report_input.joints = arm.joints;
    report_input.mass_names = arm.mass_names;
    record::write_atomically(call.report, report::render_masses_report(report_input));
  }
  if (!call.params.empty()) {
    record::ParamsSection section;
    section.name = "masses";
    section.values = parameters;
    section.sources = sources_of(recordings);
    record::Params params;
    params.created = now_iso8601();
    params.sections.push_back(std::move(section));
    record::update_params(call.params, params);
  }
  record::Answer answer;
  answer.schema = "isac.masses/1";
  answer.parameters = parameters;
  answer.fit.rmse = fit.rmse;
  answer.fit.unit = "N m";
  answer.fit.nrmse = fit.nrmse;
  answer.fit.samples = static_cast<double>(fit.rows.size());
  answer.warnings = fit.warnings;
  if (!json_path.empty())
    write_text(json_path, record::format_answer(answer, details_of(fit, design, next, arm)));
  if (json_path != "-") {
    print_parameters(parameters);
    fmt::print(
        "rmse {:.3g} N m over {} torques of {} poses, {} left over to check with; condition {:.3g}; torques "
        "are {}\n",
        fit.rmse, fit.rows.size(), fit.poses.size(), fit.degrees_of_freedom, fit.condition,
        fit.sign == estimate::TorqueSign::kActuator ? "those that hold the arm" : "those of gravity");
    print_poses(fit);
    print_warnings(fit.warnings);
    print_design(design, arm);
  }
  return all_known && fit.converged ? 0 : 1;
}

}  // namespace

Body add_masses(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<MassesCall>();
  CLI::App* sub = program.add_subcommand("masses", "masses of an arm from poses, and the poses to hold next");
  sub->add_option("poses", call->runs,
                  "recordings (CSV), a row per pose: theta1… or phi1…, and tau1… or dp1…");
  sub->add_option("--arm", call->arm, "arm.toml: kinematics, masses' places, limits, actuators")->required();
  sub->add_option("--actuators", call->actuators,
                  "params.toml with [[joint]] \"1\", \"2\" …: A and B with their errors");
  sub->add_option("--angles", call->angles, "theta (arm), phi (actuators), or auto: what the file has")
      ->check(CLI::IsMember({"auto", "theta", "phi"}));
  sub->add_option("--torques", call->torques,
                  "tau is gravity's, the actuators', or auto: the sign that makes masses positive")
      ->check(CLI::IsMember({"auto", "gravity", "actuator"}));
  sub->add_flag("--by-model", call->by_model, "tau was computed by the actuators' model: its errors count");
  sub->add_option("--torque-noise", call->noise,
                  "standard deviation of one torque, e.g. \"0.1 N m\" (default: from the residuals)");
  sub->add_option("--unknowns", call->unknowns, "fit besides: load, offsets, zeros")
      ->delimiter(',')
      ->check(CLI::IsMember({"load", "offsets", "zeros"}));
  sub->add_flag("--squared", call->plain, "plain least squares instead of the robust loss");
  sub->add_option("--design", call->design, "how many poses to propose next, 0 for none")
      ->check(CLI::Range(0, kMostPoses))
      ->capture_default_str();
  sub->add_option("--criterion", call->criterion, "A: smallest relative errors, D: smallest ellipsoid")
      ->check(CLI::IsMember({"A", "D"}))
      ->capture_default_str();
  sub->add_option(
      "--plan", call->plan,
      "write the proposed poses (CSV) for isac-log --plan: only such as the muscles can hold; without "
      "recordings the first ones");
  sub->add_option("--limit-delta-pressure", call->limit, "of the muscles, for --plan")->capture_default_str();
  sub->add_flag("--add", call->add,
                "propose what adds most to the recorded poses, instead of a set that stands alone");
  sub->add_option("--map", call->maps, "foreign column, e.g. theta2=\"Shoulder (deg)\":deg");
  sub->add_option("-o,--params", call->params, "params.toml to write or update");
  sub->add_option("--report", call->report, "HTML report to write");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_masses(*call, json_path); };
}

}  // namespace isac::apps
