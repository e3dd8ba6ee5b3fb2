// isac-identify calibrate: offsets and gains of sensors and valves, and the encoder's middle (seed E.3, Calibration_x0).
#include "isac/estimate/calibrate.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/program.hpp"
#include "common/quantity.hpp"
#include "identify/commands.hpp"
#include "identify/inputs.hpp"
#include "identify/summary.hpp"
#include "isac/card/calibration.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/rig.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::apps {
namespace {

struct Call {
  std::vector<std::string> files, levels, maps;
  std::string rig, output, report;
};

/// One recording and what it is a level of: "F1 = 149.1 N", "p1_cmd = 4095", "angle = middle".
struct Level {
  std::string signal, value, file;
};

Level parse_level(const std::string& text, const std::string& file, const Error& wrong) {
  const auto equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 >= text.size()) throw wrong;
  const auto trim = [](std::string word) {
    word.erase(0, word.find_first_not_of(' '));
    word.erase(word.find_last_not_of(' ') + 1);
    return word;
  };
  return {trim(text.substr(0, equals)), trim(text.substr(equals + 1)), file};
}

std::vector<Level> levels_of(const Call& call, const std::map<std::string, series::Recording>& recordings) {
  std::vector<Level> levels;
  for (const std::string& text : call.levels) {
    const auto colon = text.rfind(':');
    const Error wrong(ErrorKind::kUsage, "level",
                      "--level '" + text + "' must be SIGNAL=REFERENCE:FILE, e.g. \"F1=149.1 N:weight.csv\"");
    if (colon == std::string::npos || colon + 1 >= text.size()) throw wrong;
    levels.push_back(parse_level(text.substr(0, colon), text.substr(colon + 1), wrong));
  }
  for (const std::string& file : call.files) {
    const std::string text = recordings.at(file).meta("calibration");
    const Error wrong(
        ErrorKind::kBadInput, "calibration_missing",
        "does not say what it is a level of; add a line '# calibration: F1 = 149.1 N', or use --level",
        {file, 0, 0});
    for (std::size_t at = 0; at <= text.size();) {  // several, comma-separated: both sensors on one supply
      const auto comma = std::min(text.find(',', at), text.size());
      levels.push_back(parse_level(text.substr(at, comma - at), file, wrong));
      at = comma + 1;
    }
  }
  return levels;
}

const record::RigChannel& channel_of(const std::vector<record::RigChannel>& channels,
                                     const std::string& signal) {
  const auto found =
      std::find_if(channels.begin(), channels.end(),
                   [&signal](const record::RigChannel& channel) { return channel.signal == signal; });
  if (found == channels.end()) {
    throw Error(ErrorKind::kUsage, "signal_unknown",
                "the rig has no channel for '" + signal + "'; add [[calibration]] signal = \"" + signal +
                    "\" to rig.toml");
  }
  return *found;
}

void set_channel(record::Rig& rig, const record::RigChannel& changed) {
  for (record::RigChannel& channel : rig.calibration) {
    if (channel.signal == changed.signal) {
      channel = changed;
      return;
    }
  }
  rig.calibration.push_back(changed);
}

/// Everything that one call found.
struct Found {
  std::vector<estimate::ChannelCalibration> channels;
  std::vector<estimate::ValveCalibration> valves;
  std::vector<estimate::MiddleCalibration> middles;
};

void calibrate_one(const std::string& signal, const std::vector<Level>& levels,
                   const std::map<std::string, series::Recording>& recordings, record::Rig& rig,
                   Found& found) {
  const bool is_valve = signal == "p1_cmd" || signal == "p2_cmd";
  record::RigChannel channel = channel_of(rig.calibration, signal);
  if (signal == "angle") {
    std::vector<estimate::MiddleApproach> approaches;
    for (const Level& level : levels) {
      approaches.push_back(
          {.counts = recordings.at(level.file).column(channel.channel).values, .from_side = 0});
    }
    found.middles.push_back(estimate::calibrate_middle(approaches, signal));
    const double middle = found.middles.back().middle.value;
    rig.encoder.middle_count = static_cast<int>(std::lround(middle));
    channel.offset = middle;
    set_channel(rig, channel);
    return;
  }
  const Dimension dimension = signal[0] == 'F' ? dimension::kForce : dimension::kPressure;
  std::vector<estimate::CalibrationLevel> readings;
  for (const Level& level : levels) {
    const series::Recording& recording = recordings.at(level.file);
    estimate::CalibrationLevel reading;
    reading.reference = is_valve ? parse_quantity(level.value + " count", dimension::kCount, signal)
                                 : parse_quantity(level.value, dimension, signal);
    reading.time = recording.column("time").values;
    reading.reading = recording.column(is_valve ? signal.substr(0, 2) : channel.channel).values;
    readings.push_back(std::move(reading));
  }
  if (is_valve) {
    found.valves.push_back(estimate::calibrate_valve(readings, estimate::valve_calibration_options(signal)));
    const auto& line = found.valves.back().line;  // pressure = offset + gain · code
    channel.gain = line.gain.value;
    channel.offset = -line.offset.value / line.gain.value;
  } else {
    estimate::CalibrationOptions options;
    options.name = signal;
    options.reference_unit = signal[0] == 'F' ? "N" : "Pa";
    found.channels.push_back(estimate::calibrate_sensor(readings, options));
    channel.offset = found.channels.back().offset.value;
    channel.gain = found.channels.back().sensitivity.value;
  }
  set_channel(rig, channel);
}

Estimated renamed(Estimated value, const std::string& signal, const std::string& what) {
  value.name = signal + "." + what;
  return value;
}

int run_calibrate(const Call& call, const std::string& json_path) {
  for (const std::string& path : {call.output, call.report, json_path}) require_writable(path);
  record::Rig rig;
  if (!call.rig.empty()) rig = record::read_rig(call.rig);
  if (rig.calibration.empty()) rig.calibration = card::default_calibration();

  const record::ReadOptions reading{.map = parse_maps(call.maps), .require_time = true, .hash = false};
  std::map<std::string, series::Recording> recordings;
  for (const std::string& file : call.files) recordings.emplace(file, record::read_recording(file, reading));
  const auto levels = levels_of(call, recordings);
  std::map<std::string, std::vector<Level>> by_signal;
  for (const Level& level : levels) {
    if (recordings.find(level.file) == recordings.end()) {
      recordings.emplace(level.file, record::read_recording(level.file, reading));
    }
    by_signal[level.signal].push_back(level);
  }
  if (by_signal.empty())
    throw Error(ErrorKind::kUsage, "no_levels", "names no levels; give recordings or --level");
  Found found;
  // Sensors before valves: a valve is calibrated with the pressures its sensor shows.
  for (const auto& [signal, of_signal] : by_signal) calibrate_one(signal, of_signal, recordings, rig, found);

  record::Answer answer;
  answer.schema = "isac.calibration/1";
  nlohmann::ordered_json extra;
  extra["sentences"] = nlohmann::ordered_json::array();
  for (const auto& channel : found.channels) {
    answer.parameters.push_back(renamed(channel.offset, channel.name, "offset"));
    answer.parameters.push_back(renamed(channel.gain, channel.name, "gain"));
    answer.warnings.insert(answer.warnings.end(), channel.warnings.begin(), channel.warnings.end());
    extra["sentences"].push_back(channel.name + ": " + channel.sentence);
  }
  for (const auto& valve : found.valves) {
    answer.parameters.push_back(renamed(valve.cal_pressure, valve.line.name, "pressure_at_4095"));
    answer.parameters.push_back(renamed(valve.zero_pressure, valve.line.name, "pressure_at_0"));
    answer.warnings.insert(answer.warnings.end(), valve.line.warnings.begin(), valve.line.warnings.end());
    extra["sentences"].push_back(valve.line.name + ": " + valve.line.sentence);
  }
  for (const auto& middle : found.middles) {
    answer.parameters.push_back(renamed(middle.middle, "angle", "middle"));
    answer.warnings.insert(answer.warnings.end(), middle.warnings.begin(), middle.warnings.end());
  }
  if (!call.report.empty()) {
    report::CalibrationReportInput input;
    input.head.created = now_iso8601();
    input.head.rig = rig.name;
    input.channels = found.channels;
    for (const auto& valve : found.valves) input.channels.push_back(valve.line);
    input.middles = found.middles;
    record::write_atomically(call.report, report::render_calibration_report(input));
  }
  if (!call.output.empty()) record::write_atomically(call.output, record::format_rig(rig), true);
  if (!json_path.empty()) write_text(json_path, record::format_answer(answer, extra));
  if (json_path != "-") {
    print_parameters(answer.parameters);
    for (const auto& sentence : extra["sentences"]) fmt::print("· {}\n", sentence.get<std::string>());
    print_warnings(answer.warnings);
  }
  return 0;
}

}  // namespace

Body add_calibrate(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<Call>();
  CLI::App* sub =
      program.add_subcommand("calibrate", "offsets and gains of sensors and valves, encoder middle");
  sub->add_option("files", call->files,
                  "recordings of raw counts, each with a line '# calibration: F1 = 149.1 N'");
  sub->add_option("--level", call->levels,
                  "SIGNAL=REFERENCE:FILE, e.g. \"p1=5 kg/cm2:full.csv\", \"angle=middle:stiff.csv\"");
  sub->add_option("--rig", call->rig, "rig.toml with the present wiring and calibration");
  sub->add_option("--map", call->maps, "foreign column, e.g. ai0=\"Channel 0\":count");
  sub->add_option("-o,--output", call->output,
                  "rig.toml to write with the new calibration (the old one is kept as .bak)");
  sub->add_option("--report", call->report, "HTML report to write");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_calibrate(*call, json_path); };
}

}  // namespace isac::apps
