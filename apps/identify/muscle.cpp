// isac-identify muscle: muscle models M1 to M6 fitted to force, pressure and contraction, ranked on held-out
// records.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
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
#include "isac/estimate/muscle_fit.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/params.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::apps {
namespace {

struct MuscleCall {
  std::vector<std::string> runs, heldout, maps, models;
  std::string params, report, zero = "fitted", force_floor;
};

/// First finite value of a column that is constant over the recording, NaN where the column is absent.
double constant_of(const series::Recording& recording, const char* name) {
  if (const series::Column* column = recording.find(name)) {
    for (const double value : column->values) {
      if (std::isfinite(value)) return value;
    }
  }
  return std::nan("");
}

estimate::MuscleRun muscle_run(const series::Recording& recording, const MuscleCall& call) {
  estimate::MuscleRun run;
  run.name = short_name(recording.source);
  run.sha256 = recording.sha256;
  run.time = recording.column("time").values;
  run.pressure = recording.column("pressure").values;
  run.force = recording.column("force").values;
  run.rest_length = constant_of(recording, "rest_length");
  if (const series::Column* contraction = recording.find("contraction")) {
    run.contraction = contraction->values;
  } else {
    const auto& length =
        recording.column("length").values;  // ε = (l0 − l)/l0, or the column that is missing is named
    if (!std::isfinite(run.rest_length)) (void)recording.column("rest_length");
    run.contraction.resize(length.size());
    for (std::size_t i = 0; i < length.size(); ++i) run.contraction[i] = 1.0 - length[i] / run.rest_length;
  }
  if (const series::Column* filling = recording.find("filling")) run.filling = filling->values;
  if (const series::Column* relative = recording.find("contraction_rel")) {
    for (std::size_t i = 0; i < relative->values.size(); ++i) {
      if (relative->values[i] > 0 && run.contraction[i] > 0) {
        run.full_contraction = run.contraction[i] / relative->values[i];
        break;
      }
    }
  }
  if (!call.force_floor.empty())
    run.force_floor = parse_quantity(call.force_floor, dimension::kForce, "--force-floor");
  return run;
}

/// A record at zero contraction cannot tell the full one; a muscle of the same rest length can.
void share_full_contraction(std::vector<estimate::MuscleRun>& runs,
                            const std::vector<estimate::MuscleRun>& others) {
  for (estimate::MuscleRun& run : runs) {
    if (std::isfinite(run.full_contraction)) continue;
    for (const auto* group : {&std::as_const(runs), &others}) {
      for (const estimate::MuscleRun& other : *group) {
        if (other.rest_length == run.rest_length && std::isfinite(other.full_contraction)) {
          run.full_contraction = other.full_contraction;
        }
      }
    }
  }
}

int run_muscle(const MuscleCall& call, const std::string& json_path) {
  for (const std::string& path : {call.params, call.report, json_path}) require_writable(path);
  estimate::MuscleFitOptions options;
  options.models = call.models;
  options.zero = call.zero == "fitted" ? estimate::ZeroHandling::kFitted : estimate::ZeroHandling::kRecorded;

  const Files files = find_files(call.runs, call.heldout, {});
  const record::ReadOptions reading{
      .map = parse_maps(call.maps), .require_time = true, .hash = !call.params.empty()};
  const auto recordings = read_all(files.runs, reading);
  std::vector<estimate::MuscleRun> runs, heldout;
  for (const auto& recording : recordings) runs.push_back(muscle_run(recording, call));
  for (const auto& recording : read_all(files.heldout, reading))
    heldout.push_back(muscle_run(recording, call));
  share_full_contraction(runs, heldout);
  share_full_contraction(heldout, runs);
  const estimate::MuscleFit fit = estimate::fit_muscle(runs, heldout, options);
  if (fit.ranking.empty()) {
    throw Error(ErrorKind::kAnswerIsNo, "no_model",
                "no model could be fitted to these recordings; run isac-identify check");
  }
  const estimate::MuscleModelResult& best = fit.ranking.front();

  if (!call.report.empty()) {
    report::MuscleReportInput input;
    input.head.created = now_iso8601();
    input.fit = &fit;
    record::write_atomically(call.report, report::render_muscle_report(input));
  }
  if (!call.params.empty()) {
    record::ParamsSection section;
    section.name = "muscle";
    section.label = best.id;
    section.values = best.parameters;
    section.sources = sources_of(recordings);
    record::Params params;
    params.created = now_iso8601();
    params.sections.push_back(std::move(section));
    record::update_params(call.params, params);
  }

  record::Answer answer;
  answer.schema = "isac.muscle/1";
  answer.parameters = best.parameters;
  double samples = 0;
  for (const auto& run : best.runs) samples += run.heldout ? 0.0 : static_cast<double>(run.samples);
  answer.fit = {.rmse = best.train_rmse,
                .unit = "N",
                .nrmse = std::nan(""),
                .samples = samples,
                .heldout_rmse = best.heldout_rmse};
  answer.warnings = fit.warnings;
  answer.warnings.insert(answer.warnings.end(), best.warnings.begin(), best.warnings.end());
  nlohmann::ordered_json extra;
  extra["model"] = {{"id", best.id}, {"name", best.name}, {"equation", best.equation}};
  extra["ranking"] = nlohmann::ordered_json::array();
  for (const auto& model : fit.ranking) {
    nlohmann::ordered_json records = nlohmann::ordered_json::array();
    for (const auto& run : model.runs) {
      records.push_back({{"file", run.name}, {"heldout", run.heldout}, {"rmse", json_number(run.rmse)}});
    }
    extra["ranking"].push_back({{"id", model.id},
                                {"name", model.name},
                                {"train_rmse", json_number(model.train_rmse)},
                                {"heldout_rmse", json_number(model.heldout_rmse)},
                                {"records", records}});
  }
  if (!json_path.empty()) write_text(json_path, record::format_answer(answer, extra));
  if (json_path != "-") {
    fmt::print("{:<44} {:>12} {:>14}\n", "model", "rmse [N]", "held out [N]");
    for (const auto& model : fit.ranking) {
      fmt::print("{:<44} {:>12.4g} {:>14}\n", model.name, model.train_rmse,
                 std::isfinite(model.heldout_rmse) ? fmt::format("{:.4g}", model.heldout_rmse) : "-");
    }
    fmt::print("\nBest: {}, {}\n", best.name, best.equation);
    print_parameters(best.parameters);
    print_warnings(answer.warnings);
  }
  return best.converged ? 0 : 1;
}

}  // namespace

Body add_muscle(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<MuscleCall>();
  CLI::App* sub =
      program.add_subcommand("muscle", "muscle models fitted to force, pressure and contraction, and ranked");
  sub->add_option("runs", call->runs,
                  "recordings (CSV) with pressure, force and contraction (or length, rest_length)")
      ->required();
  sub->add_option("--heldout", call->heldout,
                  "recordings to predict, never to fit; the ranking goes by them");
  sub->add_option("--models", call->models, "models to try (default: all)")->delimiter(',');
  sub->add_option("--zero", call->zero, "force zero of each record: fitted, or recorded as it stands")
      ->check(CLI::IsMember({"fitted", "recorded"}))
      ->capture_default_str();
  sub->add_option("--force-floor", call->force_floor,
                  "lower stop of the force sensor's reading, e.g. \"-8.735 N\"");
  sub->add_option("--map", call->maps, "foreign column, e.g. force=\"Load cell\":N");
  sub->add_option("-o,--params", call->params, "params.toml to write or update");
  sub->add_option("--report", call->report, "HTML report to write");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_muscle(*call, json_path); };
}

}  // namespace isac::apps
