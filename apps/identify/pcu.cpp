// isac-identify pcu: gain, lag and dead time of the valve unit from steps of the command.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
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
#include "isac/estimate/pcu_fit.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/params.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::apps {
namespace {

struct PcuCall {
  std::vector<std::string> runs, maps;
  std::string rig, params, report, step_size, label;
  double step_at = std::nan("");
};

/// A recording's channels: p1 and p2 with their commands, or one `pressure`.
std::vector<estimate::PcuRun> channels_of(const series::Recording& recording, const PcuCall& call) {
  std::vector<estimate::PcuRun> channels;
  for (const char* name : {"p1", "p2", "pressure"}) {
    const series::Column* pressure = recording.find(name);
    if (pressure == nullptr) continue;
    estimate::PcuRun run;
    run.name = short_name(recording.source) + " " + name;
    run.sha256 = recording.sha256;
    run.time = recording.column("time").values;
    run.pressure = pressure->values;
    if (const series::Column* command = recording.find(std::string(name) + "_cmd"))
      run.command = command->values;
    run.step_at = call.step_at;
    if (!call.step_size.empty())
      run.step_command = parse_quantity(call.step_size, dimension::kPressure, "--step-size");
    channels.push_back(std::move(run));
  }
  if (channels.empty()) {
    throw Error(ErrorKind::kBadInput, "column_missing",
                "has none of the columns p1, p2 and pressure; name the one that holds the pressure with "
                "--map p1=\"<header>\":<unit> (and its command with --map p1_cmd=…)",
                {recording.source, 0, 0});
  }
  return channels;
}

nlohmann::ordered_json details_of(const estimate::PcuFit& fit) {
  using nlohmann::ordered_json;
  ordered_json extra;
  extra["first_order"] = fit.first_order;
  extra["directions_differ"] = fit.directions_differ;
  extra["steps"] = ordered_json::array();
  for (const estimate::PcuStep& step : fit.steps) {
    extra["steps"].push_back(
        {{"run", step.run},
         {"direction", step.direction == estimate::StepDirection::kFilling ? "filling" : "venting"},
         {"used", step.used},
         {"step_time", json_number(step.step_time)},
         {"T_C", json_number(step.lag.value)},
         {"T_C_std_error", json_number(step.lag.std_error)},
         {"dead_time", json_number(step.dead_time.value)},
         {"start", json_number(step.start.value)},
         {"K_C", json_number(step.gain.value)},
         {"rmse_Pa", json_number(step.rmse)},
         {"first_order", step.adequacy.first_order},
         {"text", step.used ? step.adequacy.sentence : step.why_not}});
  }
  return extra;
}

int run_pcu(const PcuCall& call, const std::string& json_path) {
  for (const std::string& path : {call.params, call.report, json_path}) require_writable(path);
  const Files files = find_files(call.runs, {}, call.rig);
  const record::ReadOptions reading{
      .map = parse_maps(call.maps), .require_time = true, .hash = !call.params.empty()};
  const auto recordings = read_all(files.runs, reading);
  std::vector<estimate::PcuRun> runs;
  std::vector<series::Recording> used;
  for (const series::Recording& recording : recordings) {
    // A dataset folder holds other sweeps too; steps of the valves are those that say so, or all where none
    // says what it is.
    const std::string experiment = recording.meta("experiment");
    if (recordings.size() > 1 && !experiment.empty() && experiment != "pcu-step") continue;
    for (auto& channel : channels_of(recording, call)) runs.push_back(std::move(channel));
    used.push_back(recording);
  }
  if (runs.empty()) {
    throw Error(ErrorKind::kAnswerIsNo, "no_usable_data",
                "none of the recordings is a pcu-step experiment; record one with isac-log pcu-step");
  }
  const estimate::PcuFit fit = estimate::fit_pcu(runs);

  if (!call.report.empty()) {
    report::PcuReportInput input;
    input.head.created = now_iso8601();
    input.fit = &fit;
    record::write_atomically(call.report, report::render_pcu_report(input));
  }
  if (!call.params.empty()) {
    record::ParamsSection section;
    section.name = "pcu";
    section.label = call.label;
    section.values = fit.parameters;
    section.sources = sources_of(used);
    record::Params params;
    params.created = now_iso8601();
    params.sections.push_back(std::move(section));
    record::update_params(call.params, params);
  }
  record::Answer answer;
  answer.schema = "isac.pcu/1";
  answer.parameters = fit.parameters;
  answer.fit = {.rmse = fit.rmse,
                .unit = "Pa",
                .nrmse = fit.nrmse,
                .samples = static_cast<double>(fit.samples),
                .heldout_rmse = std::nan("")};
  answer.warnings = fit.warnings;
  if (!json_path.empty()) write_text(json_path, record::format_answer(answer, details_of(fit)));
  if (json_path != "-") {
    print_parameters(fit.parameters);
    if (fit.samples > 0) {
      fmt::print("rmse {:.4g} Pa over {} rows of {} steps\n", fit.rmse, fit.samples, fit.steps.size());
    }
    for (const estimate::PcuStep& step : fit.steps) {
      fmt::print("{} {}: {}\n", step.used && step.adequacy.first_order ? "·" : "!", step.run,
                 step.used ? step.adequacy.sentence : step.why_not);
    }
    print_warnings(fit.warnings);
  }
  const Estimated* lag = fit.find("T_C");
  return fit.converged && lag != nullptr && lag->identifiable ? 0 : 1;
}

}  // namespace

Body add_pcu(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<PcuCall>();
  CLI::App* sub = program.add_subcommand("pcu", "gain, lag and dead time of the valve unit from steps");
  sub->add_option("runs", call->runs, "recordings (CSV) or dataset folders with p1, p1_cmd, p2, p2_cmd")
      ->required();
  sub->add_option("--rig", call->rig, "rig.toml");
  sub->add_option("--map", call->maps, "foreign column, e.g. p1=\"p_G\":kPa");
  sub->add_option("--step-at", call->step_at, "time of the step in seconds where no command was recorded");
  sub->add_option("--step-size", call->step_size, "size of that step, e.g. \"5 kg/cm2\"");
  sub->add_option("--label", call->label,
                  "joint the valve unit belongs to, as in params.toml (default: all joints)");
  sub->add_option("-o,--params", call->params, "params.toml to write or update");
  sub->add_option("--report", call->report, "HTML report to write");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_pcu(*call, json_path); };
}

}  // namespace isac::apps
