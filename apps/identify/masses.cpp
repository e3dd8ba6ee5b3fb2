// isac-identify masses: masses of an arm from poses it was held in, and the poses that would tell them better.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/program.hpp"
#include "common/quantity.hpp"
#include "common/summary.hpp"
#include "identify/commands.hpp"
#include "identify/inputs.hpp"
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

constexpr int kMostPoses = 500;  // of a design; more is a mistake in the call

struct Call {
  std::vector<std::string> runs, maps, unknowns;
  std::string arm, actuators, params, report, angles = "auto", torques = "auto", noise, criterion = "A";
  int design = 8;
  bool by_model = false, add = false, plain = false;
};

double error_of(double value) {
  return std::isfinite(value) ? value : 0;
}

estimate::MassArm mass_arm(const record::ArmFile& file) {
  estimate::MassArm arm;
  arm.chain = file.chain;
  arm.joints = file.joints;
  arm.coupling = file.coupling;
  arm.middle = file.middle;
  arm.limits = file.limits;
  arm.mass_names = file.mass_names;
  for (const record::ArmActuator& a : file.actuators)
    arm.actuators.push_back({a.A, a.B, a.wheel_radius, error_of(a.A_error), error_of(a.B_error)});
  return arm;
}

/// A, B and their standard errors from params.toml: the sections [[joint]] labelled "1", "2" ….
void take_actuators(const std::string& path, estimate::MassArm& arm) {
  const record::Params params = record::read_params(path);
  arm.actuators.resize(static_cast<std::size_t>(arm.joints));
  for (std::size_t j = 0; j < arm.actuators.size(); ++j) {
    const record::ParamsSection* section = params.find("joint", std::to_string(j + 1));
    if (section == nullptr) {
      throw Error(ErrorKind::kBadInput, "joint_missing",
                  "has no [[joint]] with label = \"" + std::to_string(j + 1) +
                      "\"; the actuators are told from there, one section per joint",
                  {path, 0, 0});
    }
    estimate::MassActuator& actuator = arm.actuators[j];
    for (const Estimated& value : section->values) {
      const auto unit = parse_unit(value.unit);
      if (!unit || !value.identifiable) continue;
      if (value.name == "A") {
        actuator.A = value.value * unit->scale;
        actuator.A_error = error_of(value.std_error) * unit->scale;
      } else if (value.name == "B") {
        actuator.B = value.value * unit->scale;
        actuator.B_error = error_of(value.std_error) * unit->scale;
      }
    }
    for (const auto& [name, value] : section->constants)
      if (name == "wheel_radius_m") actuator.wheel_radius = value;
  }
}

bool has_any(const series::Recording& recording, const std::string& family) {
  return std::any_of(recording.columns.begin(), recording.columns.end(), [&](const series::Column& column) {
    return column.name.size() == family.size() + 1 && column.name.starts_with(family) &&
           column.name.back() >= '1' && column.name.back() <= '6';
  });
}

/// Column `family`1… of a row; a missing column is NaN where `required` is false, else an error that names it.
void take(const series::Recording& recording, const std::string& family, int joints, std::size_t row,
          bool required, estimate::ArmVector& out) {
  for (int j = 0; j < joints; ++j) {
    const std::string name = family + std::to_string(j + 1);
    const series::Column* column = required ? &recording.column(name) : recording.find(name);
    out[static_cast<std::size_t>(j)] = column != nullptr ? column->values[row] : std::nan("");
  }
}

/// A column of plain numbers; counts and `1` are both fine.
double plain(const series::Recording& recording, const std::string& name, std::size_t row, double fallback) {
  const series::Column* column = recording.find(name);
  return column != nullptr && std::isfinite(column->values[row]) ? column->values[row] : fallback;
}

bool uses_actuator_angles(const series::Recording& recording, const Call& call) {
  if (call.angles == "auto") return !has_any(recording, "theta") && has_any(recording, "phi");
  return call.angles == "phi";
}

void append_poses(const series::Recording& recording, const estimate::MassFitOptions& options, int joints,
                  bool many_files, std::vector<estimate::MassPose>& poses) {
  if (!options.from_pressures && !has_any(recording, "tau")) {
    (void)recording.column("tau1");  // throws, and says what the file has
  }
  for (std::size_t i = 0; i < recording.rows(); ++i) {
    estimate::MassPose pose;
    pose.name =
        (many_files ? short_name(recording.source) + " " : std::string()) + "row " + std::to_string(i + 1);
    pose.torque.fill(std::nan(""));
    pose.delta_pressure.fill(std::nan(""));
    take(recording, options.actuator_angles ? "phi" : "theta", joints, i, true, pose.angle);
    if (options.from_pressures) {
      take(recording, "dp", joints, i, false, pose.delta_pressure);
    } else {
      take(recording, "tau", joints, i, false, pose.torque);
    }
    pose.load = plain(recording, "load", i, 1);
    pose.target = std::lround(plain(recording, "pose", i, -1));
    const double side = plain(recording, "approach", i, 0);
    pose.approach = side > 0 ? 1 : side < 0 ? -1 : 0;
    poses.push_back(std::move(pose));
  }
}

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

nlohmann::ordered_json details_of(const estimate::MassFit& fit, const estimate::PoseDesign& design,
                                  const estimate::PoseDesignOptions& options, const estimate::MassArm& arm) {
  using nlohmann::ordered_json;
  ordered_json extra;
  extra["condition"] = json_number(fit.condition);
  extra["next_poses"] = ordered_json::array();
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

estimate::MassFitOptions fit_options(const Call& call, const record::ArmFile& file) {
  estimate::MassFitOptions options;
  options.torques_by_model = call.by_model;
  options.robust = !call.plain;
  if (call.torques == "gravity") options.sign = estimate::TorqueSign::kGravity;
  if (call.torques == "actuator") options.sign = estimate::TorqueSign::kActuator;
  for (const std::string& unknown : call.unknowns) {
    if (unknown == "load") {
      options.load = true;
    } else if (unknown == "offsets") {
      options.offsets = true;
    } else {
      options.zeros = true;
    }
  }
  for (std::size_t j = 0; j < file.actuators.size(); ++j)
    options.torque_noise[j] = file.actuators[j].torque_noise;
  if (!call.noise.empty()) {
    const double noise = parse_quantity(call.noise, dimension::kTorque, "--torque-noise");
    if (!(noise > 0))
      throw Error(ErrorKind::kUsage, "torque_noise", "--torque-noise must be greater than zero");
    options.torque_noise.fill(noise);
  }
  return options;
}

estimate::PoseDesignOptions design_options(const Call& call, const estimate::MassFitOptions& fit) {
  estimate::PoseDesignOptions options;
  options.poses = call.design;
  options.criterion = call.criterion == "D" ? estimate::DesignCriterion::kD : estimate::DesignCriterion::kA;
  options.add_to_recorded = call.add;
  for (std::size_t j = 0; j < estimate::kArmJoints; ++j)
    if (std::isfinite(fit.torque_noise[j])) options.torque_noise[j] = fit.torque_noise[j];
  return options;
}

int run_masses(const Call& call, const std::string& json_path) {
  for (const std::string& path : {call.params, call.report, json_path}) require_writable(path);
  const record::ArmFile file = record::read_arm(call.arm);
  estimate::MassArm arm = mass_arm(file);
  if (!call.actuators.empty()) take_actuators(call.actuators, arm);
  estimate::MassFitOptions options = fit_options(call, file);

  const Files files = find_files(call.runs, {}, {});
  const record::ReadOptions reading{
      .map = parse_maps(call.maps), .require_time = false, .hash = !call.params.empty()};
  const std::vector<series::Recording> recordings = read_all(files.runs, reading);
  options.actuator_angles = uses_actuator_angles(recordings.front(), call);
  options.from_pressures = !has_any(recordings.front(), "tau") && has_any(recordings.front(), "dp");
  if (options.torques_by_model && !options.from_pressures && !options.actuator_angles) {
    throw Error(ErrorKind::kUsage, "angles_wrong",
                "--by-model needs the actuators' own angles and torques: record phi1… with tau1…, or dp1… "
                "(pressure differences)");
  }
  std::vector<estimate::MassPose> poses;
  for (const series::Recording& recording : recordings)
    append_poses(recording, options, arm.joints, recordings.size() > 1, poses);

  const estimate::MassFit fit = estimate::fit_masses(arm, poses, options);
  estimate::PoseDesignOptions next = design_options(call, options);
  const bool all_known =
      std::all_of(fit.masses.begin(), fit.masses.end(), [](const Estimated& m) { return m.identifiable; });
  if (all_known) next.recorded = fit.information;
  estimate::PoseDesign design;
  if (call.design > 0) design = estimate::design_poses(arm, next);

  std::vector<Estimated> parameters = fit.masses;
  parameters.insert(parameters.end(), fit.others.begin(), fit.others.end());
  if (!call.report.empty()) {
    report::MassesReportInput input;
    input.head.rig = file.name;
    input.head.created = now_iso8601();
    input.fit = &fit;
    input.design = &design;
    input.joints = arm.joints;
    input.mass_names = arm.mass_names;
    record::write_atomically(call.report, report::render_masses_report(input));
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
    print_warnings(fit.warnings);
    print_design(design, arm);
  }
  return all_known && fit.converged ? 0 : 1;
}

}  // namespace

Body add_masses(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<Call>();
  CLI::App* sub = program.add_subcommand("masses", "masses of an arm from poses, and the poses to hold next");
  sub->add_option("poses", call->runs,
                  "recordings (CSV), a row per pose: theta1… or phi1…, and tau1… or dp1…")
      ->required();
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
  sub->add_flag("--add", call->add,
                "propose what adds most to the recorded poses, instead of a set that stands alone");
  sub->add_option("--map", call->maps, "foreign column, e.g. theta2=\"Shoulder (deg)\":deg");
  sub->add_option("-o,--params", call->params, "params.toml to write or update");
  sub->add_option("--report", call->report, "HTML report to write");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_masses(*call, json_path); };
}

}  // namespace isac::apps
