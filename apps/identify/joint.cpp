// isac-identify joint: A, B, C, D of a joint, or the parameters of any terms of the catalogue.
#include <fmt/format.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/program.hpp"
#include "common/summary.hpp"
#include "identify/commands.hpp"
#include "identify/inputs.hpp"
#include "identify/joint_stream.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/estimate/joint_fit.hpp"
#include "isac/models/effect_queries.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/model_file.hpp"
#include "isac/record/params.hpp"
#include "isac/report/joint_report.hpp"

namespace isac::apps {
namespace {

struct JointCall {
  std::vector<std::string> runs, heldout, maps;
  std::string rig, params, report, model, output, position = "angle", loss = "huber", differentiator;
  std::vector<std::string> terms;
  double block_seconds = std::nan("");
  bool plain_regressors = false, stream = false;
};

/// "huber", "huber:0.05", "cauchy:0.05", "squared".
estimate::Loss parse_loss(const std::string& text) {
  estimate::Loss loss;
  const std::string kind = text.substr(0, text.find(':'));
  if (kind == "huber") {
    loss.kind = estimate::Loss::Kind::kHuber;
  } else if (kind == "cauchy") {
    loss.kind = estimate::Loss::Kind::kCauchy;
  } else if (kind == "squared") {
    loss.kind = estimate::Loss::Kind::kSquared;
  } else {
    throw Error(
        ErrorKind::kUsage, "loss_unknown",
        "the loss '" + text + "' is not known; use huber, cauchy or squared, with a scale as in huber:0.05");
  }
  if (const auto colon = text.find(':'); colon != std::string::npos) {
    char* end = nullptr;
    loss.scale = std::strtod(text.c_str() + colon + 1, &end);
    if (*end != '\0' || !(loss.scale > 0)) {
      throw Error(ErrorKind::kUsage, "loss_scale",
                  "the scale in --loss " + text + " must be a positive number");
    }
  }
  return loss;
}

/// "41:3": window and polynomial order.
estimate::DifferentiatorChoice parse_differentiator(const std::string& text) {
  estimate::DifferentiatorChoice choice;
  if (text.empty()) return choice;
  int used = 0;
  if (std::sscanf(text.c_str(), "%d:%d%n", &choice.window, &choice.order, &used) != 2 ||
      used != static_cast<int>(text.size()) || choice.window < 5 || choice.window % 2 == 0 ||
      choice.order < 1 || choice.order >= choice.window || choice.order > 5) {
    throw Error(
        ErrorKind::kUsage, "differentiator",
        "--differentiator " + text + " must be WINDOW:ORDER with an odd window of 5 or more, e.g. 41:3");
  }
  return choice;
}

/// Splits "force_motor:N" into the signal and its unit; the unit may be missing.
std::pair<std::string, std::string> signal_and_unit(const std::string& text) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos) return {text, {}};
  return {text.substr(0, colon), text.substr(colon + 1)};
}

bool uses_pressure(const std::vector<std::string>& terms) {
  return std::any_of(terms.begin(), terms.end(), [](const std::string& term) {
    const int effect = models::find_effect(term);
    if (effect < 0) return false;  // the fit itself names unknown terms
    return models::effect_uses_pressure(effect);
  });
}

/// Equations of the terms beyond the seed's four, for the report.
std::vector<report::TermText> texts_of(const std::vector<std::string>& terms) {
  std::vector<report::TermText> texts;
  for (const std::string& term : terms) {
    const int effect = models::find_effect(term);
    if (effect < 0 || term.size() == 1) continue;
    texts.push_back({term, models::effect_catalogue()[static_cast<std::size_t>(effect)].equation});
  }
  return texts;
}

record::Params params_of(const estimate::JointFit& fit, const record::Rig& rig,
                         const std::vector<series::Recording>& recordings, double radius) {
  record::ParamsSection joint;
  joint.name = "joint";
  joint.label = rig.name.empty() ? "joint" : rig.name;
  joint.values = fit.parameters;
  joint.sources = sources_of(recordings);
  joint.box = fit.box;
  joint.constants = {{"wheel_radius_m", radius}, {"initial_pressure_Pa", rig.joint.initial_pressure}};
  record::Params params;
  params.created = now_iso8601();
  params.sections.push_back(std::move(joint));
  return params;
}

nlohmann::ordered_json details_of(const estimate::JointFit& fit) {
  using nlohmann::ordered_json;
  ordered_json extra;
  extra["noise_floor"] = json_number(fit.noise_floor);
  extra["outliers"] = fit.outliers;
  extra["blocks"] = {{"count", fit.blocks}, {"seconds", json_number(fit.block_seconds)}};
  extra["differentiator"] = fit.differentiator;
  ordered_json correlation = ordered_json::array();
  const std::size_t n = fit.parameters.size();
  for (std::size_t i = 0; i < n && fit.correlation.size() == n * n; ++i) {
    ordered_json row = ordered_json::array();
    for (std::size_t j = 0; j < n; ++j) row.push_back(json_number(fit.correlation[i * n + j]));
    correlation.push_back(row);
  }
  extra["correlation"] = correlation;
  extra["valid"] = {{"delta_pressure_Pa",
                     {json_number(fit.box.delta_pressure_low), json_number(fit.box.delta_pressure_high)}},
                    {"angle_rad", {json_number(fit.box.angle_low), json_number(fit.box.angle_high)}},
                    {"speed_rad_s", {json_number(fit.box.speed_low), json_number(fit.box.speed_high)}}};
  if (fit.angle_zero.used) {
    extra["angle_zero"] = {{"value", json_number(fit.angle_zero.value)},
                           {"std_error", json_number(fit.angle_zero.std_error)},
                           {"half_step", json_number(fit.angle_zero.half_step)},
                           {"resting_runs", fit.angle_zero.resting_runs},
                           {"text", fit.angle_zero.sentence}};
  }
  extra["tests"] = ordered_json::array();
  for (const estimate::ResidualTest& test : fit.tests) {
    extra["tests"].push_back({{"name", test.name},
                              {"statistic", json_number(test.statistic)},
                              {"p_value", json_number(test.p_value)},
                              {"passed", test.passed},
                              {"text", test.sentence}});
  }
  extra["runs"] = ordered_json::array();
  for (const estimate::RunResidual& run : fit.runs) {
    extra["runs"].push_back({{"file", run.name}, {"heldout", run.heldout}, {"rmse", json_number(run.rmse)}});
  }
  if (!fit.cut.velocity.empty()) {
    extra["velocity_cut"] = {{"C", json_number(fit.cut.C.value)},
                             {"C_std_error", json_number(fit.cut.C.std_error)},
                             {"D", json_number(fit.cut.D.value)},
                             {"D_std_error", json_number(fit.cut.D.std_error)}};
  }
  return extra;
}

void print_summary(const estimate::JointFit& fit, const std::string& unit) {
  print_parameters(fit.parameters);
  fmt::print("rmse {:.4g} {} over {} rows", fit.rmse, unit, fit.samples);
  if (std::isfinite(fit.heldout_rmse)) fmt::print(", {:.4g} {} on held-out runs", fit.heldout_rmse, unit);
  if (std::isfinite(fit.noise_floor)) fmt::print("; noise floor {:.4g} {}", fit.noise_floor, unit);
  fmt::print("\n");
  if (fit.angle_zero.used) fmt::print("· {}\n", fit.angle_zero.sentence);
  for (const estimate::ResidualTest& test : fit.tests)
    fmt::print("{} {}\n", test.passed ? "·" : "!", test.sentence);
  print_warnings(fit.warnings);
}

int run_joint(const JointCall& call, const std::string& json_path) {
#ifdef __GLIBC__
  // Columns come and go by the dozen: memory that was once given is kept, instead of page faults for each column anew.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
#endif
  for (const std::string& path : {call.params, call.report, json_path}) require_writable(path);

  estimate::JointFitOptions options;
  JointSignals signals;
  signals.position = call.position;
  if (!call.model.empty()) {
    const record::ModelFile model = record::read_model(call.model);
    options.terms = model.terms;
    signals.output = model.output_signal;
    options.output_unit = model.output_unit;
    signals.position = model.position;
  }
  if (!call.terms.empty()) options.terms = call.terms;
  if (!call.output.empty()) {
    auto [signal, unit] = signal_and_unit(call.output);
    signals.output = signal;
    options.output_unit = unit;
  }
  options.loss = parse_loss(call.loss);
  options.differentiator = parse_differentiator(call.differentiator);
  options.block_seconds = call.block_seconds;
  options.errors_in_variables = !call.plain_regressors;
  options.effective_variance = !call.plain_regressors;
  options.parallel_filter = !call.plain_regressors;
  signals.needs_pressure = uses_pressure(options.terms);

  const Files files = find_files(call.runs, call.heldout, call.rig);
  record::Rig rig;
  if (!files.rig.empty()) rig = record::read_rig(files.rig);
  if (std::isfinite(rig.joint.wheel_radius)) options.wheel_radius = rig.joint.wheel_radius;
  if (std::isfinite(rig.joint.initial_pressure)) options.reference_pressure = rig.joint.initial_pressure;
  signals.wheel_radius = rig.joint.wheel_radius;
  const bool uses_wheel = signals.needs_pressure || signals.output == "torque";
  if (uses_wheel && !std::isfinite(rig.joint.wheel_radius)) {
    throw Error(ErrorKind::kBadInput, "wheel_missing",
                "the chain wheel is not known; give --rig rig.toml with chain_wheel_diameter in [joint]");
  }
  options.noise = estimate::NoiseLevels{};
  if (std::isfinite(rig.sensors.torque_noise)) {
    options.noise.output = rig.sensors.torque_noise;
  } else if (signals.output == "torque" && std::isfinite(rig.sensors.force_noise)) {
    options.noise.output = std::sqrt(2.0) * rig.sensors.force_noise * options.wheel_radius;  // of (F2 − F1) r
  }
  if (std::isfinite(rig.sensors.pressure_noise))
    options.noise.delta_pressure = rig.sensors.pressure_noise / std::sqrt(2.0);
  if (signals.position == "angle" && !files.rig.empty()) {
    const double step = 2 * kPi / rig.encoder.steps_per_turn;
    const double extra = std::isfinite(rig.sensors.angle_noise) ? rig.sensors.angle_noise : 0.0;
    options.noise.angle = std::hypot(step / std::sqrt(12.0), extra);
    options.noise.angle_step = step;
  }

  if (signals.output == "torque" && std::isfinite(rig.sensors.force_lag))
    options.output_lag = rig.sensors.force_lag;

  const record::ReadOptions reading{
      .map = parse_maps(call.maps), .require_time = true, .hash = !call.params.empty()};
  std::vector<estimate::JointRun> runs, heldout;
  std::vector<series::Recording> recordings;
  estimate::JointFit fit;
  if (call.stream || bytes_of(files.runs) >= kStreamFrom) {
    fit = fit_stream(files.runs, reading, signals, options, recordings);
    if (!files.heldout.empty())
      fit.warnings.push_back({"heldout_not_read",
                              "Runs this large are fitted in one pass: held-out runs were not "
                              "predicted and residuals not tested."});
  } else {
    Warnings left_out;
    for (series::Recording& recording : read_all(files.runs, reading)) {
      if (recording.meta("experiment") == "pcu-step" && files.runs.size() > 1) {
        left_out.push_back({"run_left_out", short_name(recording.source) +
                                                " holds valve steps: use it with isac-identify pcu."});
        continue;
      }
      runs.push_back(joint_run(recording, signals));
      if (options.output_unit.empty()) options.output_unit = recording.column(signals.output).unit;
      if (signals.position != "angle") options.position_unit = recording.column(signals.position).unit;
      recording.columns.clear();  // the run has what the fit needs; its name and digits stay
      recordings.push_back(std::move(recording));
    }
    for (const series::Recording& recording : read_all(files.heldout, reading)) {
      if (recording.meta("experiment") == "pcu-step") continue;
      heldout.push_back(joint_run(recording, signals));
    }

    options.keep_rows = !call.report.empty();
    fit = estimate::fit_joint(runs, heldout, options);
    fit.warnings.insert(fit.warnings.end(), left_out.begin(), left_out.end());
  }

  if (!call.report.empty()) {
    report::JointReportInput input;
    input.title = rig.name.empty() ? "Joint identification" : "Joint identification: " + rig.name;
    input.fit = &fit;
    input.runs = runs;
    input.heldout = heldout;
    input.rig = rig.name;
    input.created = now_iso8601();
    input.options = options;
    input.terms = texts_of(options.terms);
    record::write_atomically(call.report, report::render_joint_report(input));
  }
  if (!call.params.empty())
    record::update_params(call.params, params_of(fit, rig, recordings, options.wheel_radius));

  record::Answer answer;
  answer.schema = "isac.joint/1";
  answer.parameters = fit.parameters;
  answer.fit = {.rmse = fit.rmse,
                .unit = options.output_unit,
                .nrmse = fit.nrmse,
                .samples = static_cast<double>(fit.samples),
                .heldout_rmse = fit.heldout_rmse};
  answer.warnings = fit.warnings;
  if (!json_path.empty()) write_text(json_path, record::format_answer(answer, details_of(fit)));
  if (json_path != "-") print_summary(fit, options.output_unit);

  const bool all_identified = std::all_of(fit.parameters.begin(), fit.parameters.end(),
                                          [](const Estimated& p) { return p.identifiable; });
  return all_identified && fit.converged ? 0 : 1;
}

}  // namespace

Body add_joint(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<JointCall>();
  CLI::App* sub = program.add_subcommand("joint", "A, B, C, D of a joint, or any terms of the catalogue");
  sub->add_option("runs", call->runs, "recordings (CSV) or dataset folders")->required();
  sub->add_option("--rig", call->rig, "rig.toml; a dataset folder's own is found by itself");
  sub->add_option("--heldout", call->heldout, "recordings to predict, never to fit");
  sub->add_option("--terms", call->terms,
                  "terms of the catalogue, e.g. inertia,viscous_damping,coulomb_friction,offset")
      ->delimiter(',');
  sub->add_option("--model", call->model, "model.toml that names terms, output and position");
  sub->add_option("--output", call->output, "signal to explain (default torque), e.g. force_motor");
  sub->add_option("--position", call->position, "position signal")->capture_default_str();
  sub->add_option("--map", call->maps, "foreign column, e.g. angle=\"Joint Pos (deg)\":deg");
  sub->add_option("--loss", call->loss, "huber, cauchy or squared; with a scale as in huber:0.05")
      ->capture_default_str();
  sub->add_option("--differentiator", call->differentiator,
                  "Savitzky-Golay WINDOW:ORDER (default: chosen and stated)");
  sub->add_option("--block", call->block_seconds,
                  "seconds per block of the covariance (default: from the residual)")
      ->check(CLI::PositiveNumber);
  sub->add_flag("--plain-regressors", call->plain_regressors,
                "take angle, speed and pressure as free of noise");
  sub->add_flag("--stream", call->stream,
                "one pass in bounded memory (files of 400 MB and more do it by themselves)");
  sub->add_option("-o,--params", call->params, "params.toml to write or update");
  sub->add_option("--report", call->report, "HTML report to write");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_joint(*call, json_path); };
}

}  // namespace isac::apps
