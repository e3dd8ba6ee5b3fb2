#include <algorithm>
#include <cmath>

#include "isac/report/document.hpp"
#include "isac/report/fit_reports.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/plotter.hpp"
#include "isac/report/report_head.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

/// References in Pa are drawn in kPa.
struct Reference {
  double factor = 1;
  std::string unit;
};

Reference reference_of(const estimate::ChannelCalibration& channel) {
  // sensitivity: reference units per reading unit, "Pa/count"
  const std::string unit = channel.sensitivity.unit.substr(0, channel.sensitivity.unit.find('/'));
  if (unit == "Pa") return {1e-3, "kPa"};
  return {1, unit};
}

Figure channel_figure(const estimate::ChannelCalibration& channel) {
  const Reference reference = reference_of(channel);
  const std::string reading_unit = channel.offset.unit;
  std::vector<double> at, mean, error, rest, rest_error;
  for (const auto& level : channel.levels) {
    at.push_back(level.reference * reference.factor);
    mean.push_back(level.mean);
    error.push_back(1.96 * level.std_error);
    rest.push_back(level.residual);
  }
  Figure figure{.caption = "Channel " + channel.name +
                           ": mean reading at each level and the fitted line; right, what the line "
                           "leaves over, with 95 % bars.",
                .columns = 2,
                .panel_height = 200};
  const Range range = range_of(at);
  const std::vector<double> ends = {range.low, range.high};
  std::vector<double> fitted;
  for (const double x : ends)
    fitted.push_back(channel.offset.value + channel.gain.value * x / reference.factor);
  Panel straight{.x = {.label = "Reference", .unit = reference.unit},
                 .y = {.label = "Reading", .unit = reading_unit}};
  straight.curves = {line("line", colour::kModel, ends, fitted),
                     dots("measured", "#222222", at, mean, 300, 5)};
  Panel residual{.x = straight.x, .y = {.label = "Residual", .unit = reading_unit}, .lines = {{.at = 0}}};
  residual.curves = {error_bars("", colour::kSecond, at, rest, error)};
  figure.panels = {std::move(straight), std::move(residual)};
  return figure;
}

void add_channels(Document& page, const std::vector<estimate::ChannelCalibration>& channels) {
  Table table{.caption = "Channels: reading = offset + gain · reference.",
              .columns = {{"Channel"},
                          {"Offset", true},
                          {"±", true},
                          {"Unit"},
                          {"Gain", true},
                          {"±", true},
                          {"Unit"},
                          {"Full scale", true},
                          {"Nonlinearity (%)", true},
                          {"Linear"}}};
  for (const auto& channel : channels) {
    const Rounded offset = with_error(channel.offset.value, channel.offset.std_error);
    const Rounded gain = with_error(channel.gain.value, channel.gain.std_error);
    if (channel.linearity == estimate::Linearity::kCurved) table.emphasised.push_back(table.rows.size());
    const char* linear = channel.linearity == estimate::Linearity::kLinear   ? "yes"
                         : channel.linearity == estimate::Linearity::kCurved ? "no"
                                                                             : "not testable";
    table.rows.push_back({channel.name, offset.value, offset.error, pretty_unit(channel.offset.unit),
                          gain.value, gain.error, pretty_unit(channel.gain.unit),
                          with_error(channel.full_scale.value, channel.full_scale.std_error).value,
                          number(100 * channel.nonlinearity, 2), linear});
  }
  page.table(table);
}

void add_middle(Document& page, const estimate::MiddleCalibration& middle) {
  add_parameters(page, std::vector<Estimated>{middle.middle, middle.side_difference},
                 "Encoder middle, and the difference between approaches from either side.");
  std::vector<double> number_of, half(middle.approaches.size(), 0.0);
  for (std::size_t i = 0; i < middle.approaches.size(); ++i) number_of.push_back(static_cast<double>(i + 1));
  Figure figure{.caption = "Rest position of the encoder at each approach; dashed: the middle.",
                .panel_height = 170};
  Panel panel{.x = {.label = "Approach", .unit = "-", .whole = true},
              .y = {.label = "Encoder", .unit = "count"}};
  panel.curves = {dots("", colour::kSecond, number_of, middle.approaches, 500, 5)};
  if (std::isfinite(middle.middle.value)) panel.lines = {{.at = middle.middle.value, .label = "middle"}};
  figure.panels = {std::move(panel)};
  page.add_figure(std::move(figure));
}

}  // namespace

std::string render_calibration_report(const CalibrationReportInput& input) {
  require_gnuplot();
  Document page = open_page(input.head, "Calibration");
  std::vector<std::string> warnings, verdicts;
  for (const auto& channel : input.channels) {
    for (const Warning& warning : channel.warnings) warnings.push_back(channel.name + ": " + warning.text);
    if (!channel.sentence.empty()) verdicts.push_back(channel.name + ": " + channel.sentence);
  }
  for (const auto& middle : input.middles)
    for (const Warning& warning : middle.warnings)
      warnings.push_back(middle.middle.name + ": " + warning.text);
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
