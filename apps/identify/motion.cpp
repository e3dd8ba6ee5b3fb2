// isac-identify motion: a free joint from the commanded pressure difference and the measured angle, without force sensors.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/program.hpp"
#include "common/quantity.hpp"
#include "common/summary.hpp"
#include "identify/commands.hpp"
#include "identify/inputs.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/estimate/motion_fit.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/params.hpp"
#include "isac/report/motion_report.hpp"
#include "isac/series/derive.hpp"

namespace isac::apps {
namespace {

struct MotionCall {
  std::vector<std::string> runs, maps, holds, starts;
  std::string rig, params, report, gravity;
  double friction_speed = 0.05, dead_time = 0;
  bool from_rest = false, linear = false;
};

constexpr std::array<const char*, estimate::kMotionParameters> kKeys{"inertia",          "A",  "B", "C", "D",
                                                                     "coulomb_friction", "T_C"};
constexpr std::array<double, estimate::kMotionParameters> kSiPerReported{1, 1, 1 / kPascalPerKgfCm2, 1, 1,
                                                                         1, 1};

/// "inertia=0.0085" (reporting units of docs/notation.md) gives a parameter its start, and holds it there if `fixed`.
void set_parameter(const std::string& text, bool fixed, estimate::MotionOptions& options) {
  const auto equals = text.find('=');
  const std::string key = text.substr(0, equals);
  const auto found = std::find(kKeys.begin(), kKeys.end(), key);
  char* end = nullptr;
  const double value =
      equals == std::string::npos ? std::nan("") : std::strtod(text.c_str() + equals + 1, &end);
  if (found == kKeys.end() || !std::isfinite(value) || end == text.c_str() + equals + 1 || *end != '\0') {
    throw Error(
        ErrorKind::kUsage, "hold",
        (fixed ? "--hold " : "--start ") + text +
            " must be NAME=NUMBER with inertia (kg m2), A (N/m), B (N cm2/kg), C (N m s3), D (N m s), "
            "coulomb_friction (N m) or T_C (s)");
  }
  const auto index = static_cast<std::size_t>(found - kKeys.begin());
  options.start[index] = value * kSiPerReported[index];
  options.fixed[index] = fixed;
}

estimate::MotionRun motion_run(const series::Recording& recording) {
  estimate::MotionRun run;
  run.name = short_name(recording.source);
  run.sha256 = recording.sha256;
  run.time = recording.column("time").values;
  run.angle = recording.column("angle").values;
  if (const series::Column* difference = recording.find("delta_pressure_cmd")) {
    run.command = difference->values;
  } else {
    run.command =
        series::pressure_difference(recording.column("p1_cmd").values, recording.column("p2_cmd").values);
  }
  return run;
}

int run_motion(const MotionCall& call, const std::string& json_path) {
  for (const std::string& path : {call.params, call.report, json_path}) require_writable(path);
  estimate::MotionOptions options;
  for (const std::string& text : call.starts) set_parameter(text, false, options);
  for (const std::string& text : call.holds) set_parameter(text, true, options);
  options.friction_speed = call.friction_speed;
  options.dead_time = call.dead_time;
  options.initial_rest = call.from_rest;
  options.command_linear = call.linear;
  if (!call.gravity.empty())
    options.gravity_torque = parse_quantity(call.gravity, dimension::kTorque, "--gravity");

  const Files files = find_files(call.runs, {}, call.rig);
  if (files.rig.empty()) {
    throw Error(ErrorKind::kBadInput, "wheel_missing",
                "the chain wheel is not known; give --rig rig.toml with chain_wheel_diameter in [joint]");
  }
  const record::Rig rig = record::read_rig(files.rig);
  options.wheel_radius = rig.joint.wheel_radius;
  Warnings warnings;
  if (options.gravity_torque == 0 && call.holds.empty() && std::isfinite(rig.joint.inertia)) {
    options.start[estimate::kInertia] = rig.joint.inertia;
    options.fixed[estimate::kInertia] = true;
    warnings.push_back({"inertia_held", "The inertia is held at the rig's " +
                                            fmt::format("{:.4g}", rig.joint.inertia) +
                                            " kg m2: the motion tells torques only up to a common factor."});
  }
  const record::ReadOptions reading{
      .map = parse_maps(call.maps), .require_time = true, .hash = !call.params.empty()};
  std::vector<series::Recording> recordings;
  std::vector<estimate::MotionRun> runs;
  for (series::Recording& recording : read_all(files.runs, reading)) {
    const std::string experiment = recording.meta("experiment");
    if (files.runs.size() > 1 && !experiment.empty() && experiment != "free")
      continue;  // a hand or a clamp moved the joint
    runs.push_back(motion_run(recording));
    recordings.push_back(std::move(recording));
  }
  estimate::MotionFit fit = estimate::fit_motion(runs, options);
  fit.warnings.insert(fit.warnings.end(), warnings.begin(), warnings.end());

  if (!call.report.empty()) {
    report::MotionReportInput input;
    input.head.rig = rig.name;
    input.head.created = now_iso8601();
    input.fit = &fit;
    record::write_atomically(call.report, report::render_motion_report(input));
  }
  if (!call.params.empty()) {
    record::ParamsSection section;
    section.name = "motion";
    section.label = rig.name.empty() ? "joint" : rig.name;
    section.values = fit.parameters;
    section.sources = sources_of(recordings);
    record::Params params;
    params.created = now_iso8601();
    params.sections.push_back(std::move(section));
    record::update_params(call.params, params);
  }
  record::Answer answer;
  answer.schema = "isac.motion/1";
  answer.parameters = fit.parameters;
  answer.fit = {.rmse = fit.rmse,
                .unit = "rad",
                .nrmse = std::nan(""),
                .samples = static_cast<double>(fit.samples),
                .heldout_rmse = std::nan("")};
  answer.warnings = fit.warnings;
  if (!json_path.empty()) write_text(json_path, record::format_answer(answer));
  if (json_path != "-") {
    print_parameters(fit.parameters);
    fmt::print("rmse {:.4g} rad over {} rows of {} runs\n", fit.rmse, fit.samples, fit.runs.size());
    print_warnings(fit.warnings);
  }
  const bool all = std::all_of(fit.parameters.begin(), fit.parameters.end(),
                               [](const Estimated& p) { return p.identifiable; });
  return fit.converged && all ? 0 : 1;
}

}  // namespace

Body add_motion(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<MotionCall>();
  CLI::App* sub =
      program.add_subcommand("motion", "a free joint from command and angle alone, by output error");
  sub->add_option("runs", call->runs,
                  "recordings (CSV) or dataset folders with p1_cmd, p2_cmd (or delta_pressure_cmd), angle")
      ->required();
  sub->add_option("--rig", call->rig, "rig.toml; a dataset folder's own is found by itself");
  sub->add_option("--hold", call->holds,
                  "hold a parameter, e.g. inertia=0.0085 (default: the rig's inertia)");
  sub->add_option("--start", call->starts,
                  "where the search begins, e.g. A=-20000 (default: found from the data)");
  sub->add_option("--gravity", call->gravity, "known gravity torque m g l, e.g. \"1.5 N m\"");
  sub->add_option("--friction-speed", call->friction_speed, "v_s of the Coulomb friction's tanh, rad/s")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  sub->add_option("--dead-time", call->dead_time, "known dead time of the valve unit, s")
      ->check(CLI::NonNegativeNumber);
  sub->add_flag("--linear-command", call->linear,
                "the command is linear between its samples (default: held, as a controller's)");
  sub->add_flag("--from-rest", call->from_rest, "every run starts at angle, speed and pressure zero");
  sub->add_option("--map", call->maps, "foreign column, e.g. delta_pressure_cmd=u:Pa");
  sub->add_option("-o,--params", call->params, "params.toml to write or update");
  sub->add_option("--report", call->report, "HTML report to write");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_motion(*call, json_path); };
}

}  // namespace isac::apps
