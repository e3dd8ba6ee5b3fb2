// isac-identify check: reads, validates and draws every signal, even when nothing can be fitted.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/program.hpp"
#include "common/summary.hpp"
#include "identify/commands.hpp"
#include "identify/inputs.hpp"
#include "isac/core/error.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/report/fit_reports.hpp"
#include "isac/series/signal_summary.hpp"

namespace isac::apps {
namespace {

struct CheckCall {
  std::vector<std::string> files, maps;
  std::string report;
  bool without_time = false;
};

nlohmann::ordered_json json_of(const series::Recording& recording, const series::RecordingSummary& summary) {
  nlohmann::ordered_json file;
  file["file"] = recording.source;
  file["ok"] = true;
  file["rows"] = recording.rows();
  file["seconds"] = json_number(summary.seconds);
  file["rate_Hz"] = json_number(summary.rate);
  file["sha256"] = recording.sha256;
  file["metadata"] = recording.metadata;
  file["signals"] = nlohmann::ordered_json::array();
  for (const series::SignalSummary& signal : summary.signals) {
    file["signals"].push_back({{"name", signal.name},
                               {"unit", signal.unit},
                               {"missing", signal.missing},
                               {"min", json_number(signal.min)},
                               {"max", json_number(signal.max)},
                               {"mean", json_number(signal.mean)},
                               {"std", json_number(signal.std)}});
  }
  file["remarks"] = nlohmann::ordered_json::array();
  for (const Warning& remark : summary.remarks)
    file["remarks"].push_back({{"code", remark.code}, {"text", remark.text}});
  return file;
}

void print(const series::Recording& recording, const series::RecordingSummary& summary) {
  fmt::print("{}: {} rows", recording.source, recording.rows());
  if (std::isfinite(summary.rate)) fmt::print(", {:.6g} s at {:.5g} Hz", summary.seconds, summary.rate);
  fmt::print("\n  {:<14} {:<8} {:>12} {:>12} {:>12} {:>9}\n", "signal", "unit", "min", "max", "mean",
             "missing");
  for (const series::SignalSummary& signal : summary.signals) {
    fmt::print("  {:<14} {:<8} {:>12.5g} {:>12.5g} {:>12.5g} {:>9}\n", signal.name, signal.unit, signal.min,
               signal.max, signal.mean, signal.missing);
  }
  for (const Warning& remark : summary.remarks) fmt::print("  ! {}\n", remark.text);
}

int run_check(const CheckCall& call, const std::string& json_path) {
  for (const std::string& path : {call.report, json_path}) require_writable(path);
  const Files files = find_files(call.files, {}, {});
  std::vector<std::filesystem::path> paths = files.runs;
  paths.insert(paths.end(), files.heldout.begin(), files.heldout.end());
  const record::ReadOptions reading{
      .map = parse_maps(call.maps), .require_time = !call.without_time, .hash = true};

  nlohmann::ordered_json answer;
  answer["schema"] = "isac.check/1";
  answer["files"] = nlohmann::ordered_json::array();
  std::vector<series::Recording> recordings;
  std::vector<series::RecordingSummary> summaries;
  int exit_code = 0;
  for (const auto& path : paths) {
    try {
      recordings.push_back(record::read_recording(path, reading));
    } catch (const Error& error) {  // one bad file stops nothing: the others are still looked at
      fmt::print(stderr, "isac-identify: {}\n", error.what());
      nlohmann::ordered_json file = nlohmann::ordered_json::parse(record::format_error(error));
      file["file"] = path.string();
      file["ok"] = false;
      answer["files"].push_back(file);
      exit_code = static_cast<int>(error.kind());
      continue;
    }
    summaries.push_back(series::summarise(recordings.back()));
    answer["files"].push_back(json_of(recordings.back(), summaries.back()));
    if (json_path != "-") print(recordings.back(), summaries.back());
  }
  if (!call.report.empty() && !recordings.empty()) {
    report::CheckReportInput input;
    input.head.created = now_iso8601();
    input.recordings = recordings;
    for (const auto& summary : summaries) input.findings.push_back(summary.remarks);
    record::write_atomically(call.report, report::render_check_report(input));
  }
  if (!json_path.empty()) write_text(json_path, answer.dump(2));
  return exit_code;
}

}  // namespace

Body add_check(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<CheckCall>();
  CLI::App* sub = program.add_subcommand("check", "reads, validates and draws every signal");
  sub->add_option("files", call->files, "recordings (CSV) or dataset folders")->required();
  sub->add_option("--map", call->maps, "foreign column, e.g. angle=\"Joint Pos (deg)\":deg");
  sub->add_flag("--without-time", call->without_time, "accept a file that has no time column");
  sub->add_option("--report", call->report, "HTML report to write");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_check(*call, json_path); };
}

}  // namespace isac::apps
