#include <algorithm>
#include <cmath>
#include <utility>

#include "isac/core/units.hpp"
#include "isac/report/document.hpp"
#include "isac/report/fit_reports.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/plotter.hpp"
#include "isac/report/report_head.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

/// One axis of a channel: pressures are shown in kg/cm², what the line leaves over of them in g/cm².
struct ChannelUnit {
  double factor = 1;
  std::string unit;
};

ChannelUnit channel_unit(const std::string& unit) {
  if (unit == "Pa") return {1 / kPascalPerKgfCm2, "kg/cm2"};
  return {1, unit};
}

ChannelUnit shown_residual(const std::string& unit) {
  if (unit == "Pa") return {1e3 / kPascalPerKgfCm2, "g/cm2"};
  return {1, unit};
}

std::string reference_unit(const estimate::ChannelCalibration& channel) {
  // sensitivity: reference units per reading unit, "Pa/count"
  return channel.sensitivity.unit.substr(0, channel.sensitivity.unit.find('/'));
}

bool is_valve(const estimate::ChannelCalibration& channel) {
  return channel.offset.unit == "Pa";
}

Figure channel_figure(const estimate::ChannelCalibration& channel) {
  const ChannelUnit reference = channel_unit(reference_unit(channel)),
                    reading = channel_unit(channel.offset.unit),
                    left_over = shown_residual(channel.offset.unit);
  std::vector<double> at, mean, error, rest;
  for (const auto& level : channel.levels) {
    at.push_back(level.reference * reference.factor);
    mean.push_back(level.mean * reading.factor);
    error.push_back(1.96 * level.std_error * left_over.factor);
    rest.push_back(level.residual * left_over.factor);
  }
  const std::string what = is_valve(channel) ? "settled pressure at each code" : "mean reading at each level";
  Figure figure{.caption = "Channel " + channel.name + ": " + what +
                           " and the fitted line; right, what the line leaves over, with 95 % bars.",
                .columns = 2,
                .panel_height = 200};
  const Range range = range_of(at);
  const std::vector<double> ends = {range.low, range.high};
  std::vector<double> fitted;
  for (const double x : ends)
    fitted.push_back((channel.offset.value + channel.gain.value * x / reference.factor) * reading.factor);
  Panel straight{.x = {.label = is_valve(channel) ? "Code" : "Reference", .unit = reference.unit},
                 .y = {.label = is_valve(channel) ? "Pressure" : "Reading", .unit = reading.unit}};
  straight.curves = {line("line", colour::kModel, ends, fitted),
                     dots("measured", "#222222", at, mean, 300, 5)};
  Panel residual{.x = straight.x, .y = {.label = "Residual", .unit = left_over.unit}, .lines = {{.at = 0}}};
  residual.curves = {error_bars("", colour::kSecond, at, rest, error)};
  figure.panels = {std::move(straight), std::move(residual)};
  return figure;
}

/// "201.24 ± 0.32"
std::string value_and_error(const Estimated& e, double factor) {
  const Rounded rounded = with_error(e.value * factor, e.std_error * factor);
  return rounded.value + " ± " + rounded.error;
}

void add_channels(Document& page, const std::vector<estimate::ChannelCalibration>& channels) {
  Table table{.caption =
                  "Sensors: reading = offset + gain · reference. Valves: pressure = offset + gain · code. "
                  "± is the standard error.",
              .columns = {{"Channel"},
                          {"Offset", true},
                          {"Unit"},
                          {"Gain", true},
                          {"Unit"},
                          {"Off the line (%)", true},
                          {"A line?"}}};
  for (const auto& channel : channels) {
    const ChannelUnit reading = channel_unit(channel.offset.unit),
                      reference = channel_unit(reference_unit(channel));
    // A valve's gain is shown over its whole range, for one code moves nothing that a gauge can show.
    const double codes = is_valve(channel) ? 4095 : 1;
    if (channel.linearity == estimate::Linearity::kCurved) table.emphasised.push_back(table.rows.size());
    const bool tested = channel.linearity != estimate::Linearity::kNotTestable;
    const char* linear = !tested                                             ? "two levels"
                         : channel.linearity == estimate::Linearity::kLinear ? "yes"
                                                                             : "no";
    table.rows.push_back(
        {channel.name, value_and_error(channel.offset, reading.factor), pretty_unit(reading.unit),
         value_and_error(channel.gain, codes * reading.factor / reference.factor),
         is_valve(channel) ? pretty_unit(reading.unit) + " / 4095"
                           : pretty_unit(reading.unit) + " per " + pretty_unit(reference.unit),
         tested ? number(100 * channel.nonlinearity, 2) : "–", linear});
  }
  page.table(table);
}

void add_middle(Document& page, const estimate::MiddleCalibration& middle) {
  std::vector<Estimated> values = {middle.middle, middle.side_difference};
  std::string corrected;
  if (middle.shift.identifiable && std::isfinite(middle.shift.value)) {
    corrected = ", less what the pressure difference turned the bar";
    values.push_back(middle.shift);
    Estimated& shift = values.back();
    shift.unit = "count per kg/cm2";
    for (double* part : {&shift.value, &shift.std_error, &shift.ci_low, &shift.ci_high})
      *part *= kPascalPerKgfCm2;
  }
  add_parameters(page, values,
                 "Encoder middle, the difference between approaches from either side, and how far a pressure "
                 "difference shifts it.");
  std::vector<double> number_of, half(middle.approaches.size(), 0.0);
  for (std::size_t i = 0; i < middle.approaches.size(); ++i) number_of.push_back(static_cast<double>(i + 1));
  Figure figure{
      .caption = "Rest position of the encoder at each approach" + corrected + "; dashed: the middle.",
      .panel_height = 170};
  Panel panel{.x = {.label = "Approach", .unit = "-", .whole = true},
              .y = {.label = "Encoder", .unit = "count"}};
  panel.curves = {dots("", colour::kSecond, number_of, middle.approaches, 500, 5)};
  if (std::isfinite(middle.middle.value)) panel.lines = {{.at = middle.middle.value, .label = "middle"}};
  figure.panels = {std::move(panel)};
  page.add_figure(std::move(figure));
}

/// Says whose warning it is, once.
std::string named(const std::string& name, const std::string& text) {
  return text.rfind(name + ":", 0) == 0 ? text : name + ": " + text;
}

}  // namespace

std::string render_calibration_report(const CalibrationReportInput& input) {
  require_gnuplot();
  Document page = open_page(input.head, "Calibration");
  std::vector<std::string> warnings, verdicts;
  for (const auto& channel : input.channels) {
    for (const Warning& warning : channel.warnings) warnings.push_back(named(channel.name, warning.text));
    if (!channel.sentence.empty()) verdicts.push_back(channel.name + ": " + channel.sentence);
  }
  for (const auto& middle : input.middles)
    for (const Warning& warning : middle.warnings) warnings.push_back(warning.text);
  page.box(BoxKind::kWarning, "Before you use these numbers", warnings);
  if (!input.channels.empty()) {
    page.heading("Sensors and valves");
    add_channels(page, input.channels);
    page.bullets(verdicts);
    for (const auto& channel : input.channels) page.add_figure(channel_figure(channel));
  }
  if (!input.middles.empty()) page.heading("Encoder middle position");
  for (const auto& middle : input.middles) add_middle(page, middle);
  std::vector<std::string> next = input.next_steps;
  if (next.empty())
    next.push_back(
        "Put the offsets and gains into the rig file's calibration section before the next recording.");
  page.box(BoxKind::kNext, "What to do next", next);
  close_page(page, input.head);
  return page.html();
}

}  // namespace isac::report
