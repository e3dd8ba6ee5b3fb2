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
#include "common/summary.hpp"
#include "identify/commands.hpp"
#include "identify/inputs.hpp"
#include "isac/card/calibration.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/rig.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::apps {
namespace {

constexpr const char* kSensors[] = {"p1", "p2"};

struct CalibrateCall {
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

/// What the metadata line of a recording says, e.g. "p1 = 5 kg/cm2, p2 = 5 kg/cm2".
void add_levels_of_file(const series::Recording& recording, const std::string& file, bool named,
                        std::vector<Level>& levels) {
  const std::string text = recording.meta("calibration");
  const std::string experiment = recording.meta("experiment");
  if (text.empty() && !named && !experiment.empty() && experiment != "calibration")
    return;  // a sweep beside them
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

Level parse_level_option(const std::string& text) {
  const auto colon = text.rfind(':');
  const Error wrong(ErrorKind::kUsage, "level",
                    "--level '" + text + "' must be SIGNAL=REFERENCE:FILE, e.g. \"F1=149.1 N:weight.csv\"");
  if (colon == std::string::npos || colon + 1 >= text.size()) throw wrong;
  return parse_level(text.substr(0, colon), text.substr(colon + 1), wrong);
}

using Recordings = std::map<std::string, series::Recording>;

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
  Warnings warnings;
};

const estimate::ChannelCalibration* find_sensor(const Found& found, const std::string& signal) {
  for (const auto& channel : found.channels)
    if (channel.name == signal) return &channel;
  return nullptr;
}

/// A pressure by the calibration of this call where the recording has the counts, else as it was logged.
std::vector<double> pressures_of(const series::Recording& recording, const std::string& signal,
                                 const record::Rig& rig, Found& found) {
  const record::RigChannel& channel = channel_of(rig.calibration, signal);
  const series::Column* raw = recording.find(channel.channel);
  if (raw == nullptr) {
    const std::vector<double>& logged = recording.column(signal).values;
    if (find_sensor(found, signal) != nullptr) {
      found.warnings.push_back(
          {"old_calibration",
           recording.source + ": has no counts '" + channel.channel + "', so " + signal +
               " is taken as it was logged, by the old calibration; record it with --raw"});
    }
    return logged;
  }
  std::vector<double> pressures;
  pressures.reserve(raw->values.size());
  for (const double count : raw->values) pressures.push_back((count - channel.offset) * channel.gain);
  return pressures;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0, count = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value;
    count += 1;
  }
  return sum / count;
}

/// "middle", "middle +", "middle -": the side that the joint came from.
int side_of(const Level& level) {
  if (level.value == "middle") return 0;
  if (level.value == "middle +") return 1;
  if (level.value == "middle -") return -1;
  throw Error(ErrorKind::kBadInput, "middle_side",
              "'angle = " + level.value + "' must be 'angle = middle', 'middle +' or 'middle -'",
              {level.file, 0, 0});
}

void calibrate_encoder(const std::vector<Level>& levels, const Recordings& recordings, record::Rig& rig,
                       Found& found) {
  constexpr double kModulus = 16777216;  // counters of 24 bits (card.hpp) wrap beside a middle at 0
  record::RigChannel channel = channel_of(rig.calibration, "angle");
  std::vector<estimate::MiddleApproach> approaches;
  for (const Level& level : levels) {
    const series::Recording& recording = recordings.at(level.file);
    estimate::MiddleApproach approach;
    approach.from_side = side_of(level);
    for (const double count : recording.column(channel.channel).values)
      approach.counts.push_back(count > kModulus / 2 ? count - kModulus : count);
    const bool pressures = std::all_of(std::begin(kSensors), std::end(kSensors), [&](const char* signal) {
      return recording.find(signal) != nullptr ||
             recording.find(channel_of(rig.calibration, signal).channel) != nullptr;
    });
    if (pressures) {
      approach.delta_pressure = 0.5 * (mean_of(pressures_of(recording, "p2", rig, found)) -
                                       mean_of(pressures_of(recording, "p1", rig, found)));
    }
    approaches.push_back(std::move(approach));
  }
  found.middles.push_back(estimate::calibrate_middle(approaches, "angle"));
  const double middle = found.middles.back().middle.value;
  rig.encoder.middle_count = static_cast<int>(std::lround(middle));
  channel.offset = middle;
  set_channel(rig, channel);
}

void calibrate_sensor(const std::string& signal, const std::vector<Level>& levels,
                      const Recordings& recordings, record::Rig& rig, Found& found) {
  record::RigChannel channel = channel_of(rig.calibration, signal);
  const bool force = signal[0] == 'F';
  std::vector<estimate::CalibrationLevel> readings;
  for (const Level& level : levels) {
    const series::Recording& recording = recordings.at(level.file);
    estimate::CalibrationLevel reading;
    reading.reference = parse_quantity(level.value, force ? dimension::kForce : dimension::kPressure, signal);
    reading.time = recording.column("time").values;
    reading.reading = recording.column(channel.channel).values;
    readings.push_back(std::move(reading));
  }
  estimate::CalibrationOptions options;
  options.name = signal;
  options.reference_unit = force ? "N" : "Pa";
  found.channels.push_back(estimate::calibrate_sensor(readings, options));
  channel.offset = found.channels.back().offset.value;
  channel.gain = found.channels.back().sensitivity.value;
  set_channel(rig, channel);
}

/// The error that the sensor's own calibration brings into a pressure read with it.
void widen(Estimated& pressure, const estimate::ChannelCalibration* sensor) {
  if (sensor == nullptr || !(pressure.std_error > 0)) return;
  const double reading = sensor->offset.value + sensor->gain.value * pressure.value;
  const double error = std::hypot(pressure.std_error, sensor->reference_error(reading));
  const double factor = error / pressure.std_error;
  pressure.ci_low = pressure.value - factor * (pressure.value - pressure.ci_low);
  pressure.ci_high = pressure.value + factor * (pressure.ci_high - pressure.value);
  pressure.std_error = error;
}

void calibrate_valve(const std::string& signal, const std::vector<Level>& levels,
                     const Recordings& recordings, record::Rig& rig, Found& found) {
  record::RigChannel channel = channel_of(rig.calibration, signal);
  const std::string sensor = signal.substr(0, 2);
  std::vector<estimate::CalibrationLevel> open, vented;
  for (const Level& level : levels) {
    const series::Recording& recording = recordings.at(level.file);
    estimate::CalibrationLevel reading;
    reading.reference = parse_quantity(level.value + " count", dimension::kCount, signal);
    reading.time = recording.column("time").values;
    reading.reading = pressures_of(recording, sensor, rig, found);
    (reading.reference > 0 ? open : vented).push_back(std::move(reading));
  }
  // No valve pulls below zero: code 0 bends the line wherever the zero trimmer stands below it.
  const bool apart = open.size() >= 2 && !vented.empty();
  if (!apart) open.insert(open.end(), vented.begin(), vented.end());
  found.valves.push_back(estimate::calibrate_valve(open, estimate::valve_calibration_options(signal)));
  estimate::ValveCalibration& valve = found.valves.back();
  if (apart) {
    // Rounded to what is shown, plus 0: no "-0.000".
    const double at_zero = std::round(mean_of(vented.front().reading) / kPascalPerKgfCm2 * 1e3) / 1e3 + 0.0;
    valve.line.sentence += fmt::format("; vented at code 0 it shows {:.3f} kg/cm2, the line {:.3f} kg/cm2",
                                       at_zero, valve.line.offset.value / kPascalPerKgfCm2);
  }
  const auto& line = valve.line;  // pressure = offset + gain · code
  channel.gain = line.gain.value;
  channel.offset = -line.offset.value / line.gain.value;
  for (Estimated* pressure : {&valve.cal_pressure, &valve.zero_pressure})
    widen(*pressure, find_sensor(found, sensor));
  set_channel(rig, channel);
}

/// Sensors first: valves and the middle are read by them.
int turn_of(const std::string& signal) {
  return signal.find("_cmd") != std::string::npos || signal == "angle" ? 1 : 0;
}

Found calibrate_all(const std::map<std::string, std::vector<Level>>& by_signal, const Recordings& recordings,
                    record::Rig& rig) {
  Found found;
  for (const int turn : {0, 1}) {
    for (const auto& [signal, levels] : by_signal) {
      if (turn_of(signal) != turn) continue;
      if (signal == "angle") {
        calibrate_encoder(levels, recordings, rig, found);
      } else if (signal == "p1_cmd" || signal == "p2_cmd") {
        calibrate_valve(signal, levels, recordings, rig, found);
      } else {
        calibrate_sensor(signal, levels, recordings, rig, found);
      }
    }
  }
  return found;
}

Estimated renamed(Estimated value, const std::string& signal, const std::string& what) {
  value.name = signal + "." + what;
  return value;
}

/// Terminal: pressures in the unit that people at the rig speak.
Estimated in_kgf(Estimated value) {
  double factor = 1;
  if (value.unit == "Pa") factor = 1 / kPascalPerKgfCm2, value.unit = "kg/cm2";
  if (value.unit == "count/Pa") factor = kPascalPerKgfCm2, value.unit = "count per kg/cm2";
  for (double* part : {&value.value, &value.std_error, &value.ci_low, &value.ci_high}) *part *= factor;
  return value;
}

int run_calibrate(const CalibrateCall& call, const std::string& json_path) {
  for (const std::string& path : {call.output, call.report, json_path}) require_writable(path);
  const Files files = find_files(call.files, {}, call.rig);
  record::Rig rig;
  if (!files.rig.empty()) rig = record::read_rig(files.rig);
  if (rig.calibration.empty()) rig.calibration = card::default_calibration();

  const record::ReadOptions reading{.map = parse_maps(call.maps), .require_time = true, .hash = false};
  Recordings recordings;
  std::vector<Level> levels;
  for (const std::string& text : call.levels) levels.push_back(parse_level_option(text));
  for (const Level& level : levels) {
    if (recordings.find(level.file) == recordings.end())
      recordings.emplace(level.file, record::read_recording(level.file, reading));
  }
  for (const auto& path : files.runs) {
    const std::string file = path.string();
    const bool named = std::find(call.files.begin(), call.files.end(), file) != call.files.end();
    if (recordings.find(file) == recordings.end())
      recordings.emplace(file, record::read_recording(file, reading));
    add_levels_of_file(recordings.at(file), file, named, levels);
  }
  std::map<std::string, std::vector<Level>> by_signal;
  for (const Level& level : levels) by_signal[level.signal].push_back(level);
  if (by_signal.empty())
    throw Error(ErrorKind::kUsage, "no_levels",
                "found no level of a calibration; give a folder of isac-log calibrate, recordings with '# "
                "calibration:', or --level");
  const Found found = calibrate_all(by_signal, recordings, rig);

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
    answer.parameters.push_back(renamed(middle.side_difference, "angle", "side_difference"));
    answer.warnings.insert(answer.warnings.end(), middle.warnings.begin(), middle.warnings.end());
  }
  answer.warnings.insert(answer.warnings.end(), found.warnings.begin(), found.warnings.end());
  if (!call.report.empty()) {
    report::CalibrationReportInput input;
    input.head.created = now_iso8601();
    input.head.rig = rig.name;
    input.channels = found.channels;
    for (const auto& valve : found.valves) input.channels.push_back(valve.line);
    input.middles = found.middles;
    for (const auto& channel : found.channels) {
      if (channel.linearity != estimate::Linearity::kNotTestable) continue;
      input.next_steps.push_back(channel.name +
                                 ": record a third level between the two, which tells whether it is a line.");
    }
    input.next_steps.push_back(
        call.output.empty() ? "Write the new calibration into a rig file with -o before the next recording."
                            : "Record from now on with --rig " + call.output + ".");
    record::write_atomically(call.report, report::render_calibration_report(input));
  }
  if (!call.output.empty()) record::write_atomically(call.output, record::format_rig(rig), true);
  if (!json_path.empty()) write_text(json_path, record::format_answer(answer, extra));
  if (json_path != "-") {
    std::vector<Estimated> shown;
    for (const Estimated& parameter : answer.parameters) shown.push_back(in_kgf(parameter));
    print_parameters(shown);
    for (const auto& sentence : extra["sentences"]) fmt::print("· {}\n", sentence.get<std::string>());
    print_warnings(answer.warnings);
    if (!call.output.empty()) fmt::print("the rig with this calibration is in {}\n", call.output);
  }
  return 0;
}

}  // namespace

Body add_calibrate(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<CalibrateCall>();
  CLI::App* sub =
      program.add_subcommand("calibrate", "offsets and gains of sensors and valves, encoder middle");
  sub->add_option("files", call->files,
                  "folders of isac-log calibrate, or recordings of raw counts, each with a line "
                  "'# calibration: F1 = 149.1 N'");
  sub->add_option("--level", call->levels,
                  "SIGNAL=REFERENCE:FILE, e.g. \"p1=5 kg/cm2:full.csv\", \"angle=middle:stiff.csv\"");
  sub->add_option("--rig", call->rig,
                  "rig.toml with the present wiring and calibration (default: the folder's)");
  sub->add_option("--map", call->maps, "foreign column, e.g. ai0=\"Channel 0\":count");
  sub->add_option("-o,--output", call->output,
                  "rig.toml to write with the new calibration (the old one is kept as .bak)");
  sub->add_option("--report", call->report, "HTML report to write");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_calibrate(*call, json_path); };
}

}  // namespace isac::apps
