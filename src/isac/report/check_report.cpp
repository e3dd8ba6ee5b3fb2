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

constexpr std::size_t kPanelsPerFigure = 6;

struct Statistics {
  std::size_t present = 0, missing = 0;
  double mean = 0, square = 0, least = 0, greatest = 0;
  [[nodiscard]] double deviation() const {
    return present > 1 ? std::sqrt(square / static_cast<double>(present - 1)) : std::nan("");
  }
};

Statistics statistics(const std::vector<double>& values) {
  Statistics out;
  for (const double v : values) {
    if (!std::isfinite(v)) {
      ++out.missing;
      continue;
    }
    out.least = out.present == 0 ? v : std::min(out.least, v);
    out.greatest = out.present == 0 ? v : std::max(out.greatest, v);
    ++out.present;
    const double before = v - out.mean;  // Welford's update
    out.mean += before / static_cast<double>(out.present);
    out.square += before * (v - out.mean);
  }
  return out;
}

/// Pressures are shown in kPa, everything else in its SI unit.
double shown_factor(const std::string& unit) {
  return unit == "Pa" ? 1e-3 : 1;
}
std::string column_unit(const std::string& unit) {
  return unit == "Pa" ? "kPa" : unit;
}

struct Base {  // what stands on the x axis
  std::vector<double> values = {};
  Axis axis = {};
  bool has_time = false;
};

Base base_of(const series::Recording& recording) {
  if (const series::Column* time = recording.find("time"); time != nullptr)
    return {time->values, {.label = "Time t", .unit = "s", .tight = true}, true};
  Base out{.axis = {.label = "Row", .unit = "-", .tight = true}};
  for (std::size_t i = 0; i < recording.rows(); ++i) out.values.push_back(static_cast<double>(i + 1));
  return out;
}

void add_statistics(Document& page, const series::Recording& recording) {
  Table table{.caption = "Signals of " + file_name(recording.source) + ".",
              .columns = {{"Signal"},
                          {"Unit"},
                          {"Samples", true},
                          {"Missing", true},
                          {"Least", true},
                          {"Mean", true},
                          {"Greatest", true},
                          {"Standard deviation", true}}};
  for (const series::Column& column : recording.columns) {
    const Statistics s = statistics(column.values);
    const double factor = shown_factor(column.unit);
    if (s.present == 0) {
      table.emphasised.push_back(table.rows.size());
      table.rows.push_back({column.name, pretty_unit(column_unit(column.unit)), "0",
                            whole(static_cast<double>(s.missing)), "–", "–", "–", "–"});
      continue;
    }
    if (s.missing > 0) table.emphasised.push_back(table.rows.size());
    table.rows.push_back({column.name, pretty_unit(column_unit(column.unit)),
                          whole(static_cast<double>(s.present)), whole(static_cast<double>(s.missing)),
                          number(s.least * factor),
                          number(std::abs(s.mean) < 1e-9 * s.deviation() ? 0 : s.mean * factor),
                          number(s.greatest * factor), number(s.deviation() * factor, 3)});
  }
  page.table(table);
}

/// Where samples are missing, as a share of each of 200 stretches of the record; empty when none is.
Panel missing_panel(const series::Recording& recording, const Base& base) {
  Panel panel{.x = base.axis, .y = {.label = "Missing", .unit = "%", .low = 0, .high = 105}, .height = 60};
  const Range range = range_of(base.values);
  std::vector<double> at;
  for (const series::Column& column : recording.columns)
    for (std::size_t i = 0; i < std::min(column.values.size(), base.values.size()); ++i)
      if (!std::isfinite(column.values[i])) at.push_back(base.values[i]);
  if (at.empty()) return panel;
  const Histogram gone = histogram(at, range, 200);
  const Histogram all = histogram(base.values, range, 200);
  Curve bars{.mark = Mark::kBars, .colour = colour::kModel, .x = gone.centre, .y = gone.count};
  for (std::size_t k = 0; k < bars.y.size(); ++k)
    bars.y[k] = all.count[k] > 0
                    ? 100 * bars.y[k] / (all.count[k] * static_cast<double>(recording.columns.size()))
                    : 0;
  panel.curves = {std::move(bars)};
  return panel;
}

void add_signals(Document& page, const series::Recording& recording, const Base& base) {
  std::vector<Panel> panels;
  for (const series::Column& column : recording.columns) {
    if (column.name == "time") continue;
    Panel panel{.x = base.axis, .y = {.label = clean_utf8(column.name), .unit = column_unit(column.unit)}};
    const double factor = shown_factor(column.unit);
    if (factor == 1) {
      panel.curves = {line("", colour::kSecond, base.values, column.values)};
    } else {
      std::vector<double> values = column.values;
      for (double& v : values) v *= factor;
      panel.curves = {line("", colour::kSecond, base.values, values)};
    }
    panel.curves.front().size = 1.2;
    panels.push_back(std::move(panel));
  }
  Panel missing = missing_panel(recording, base);
  if (!missing.curves.empty()) panels.push_back(std::move(missing));
  for (std::size_t first = 0; first < panels.size(); first += kPanelsPerFigure) {
    const std::size_t last = std::min(first + kPanelsPerFigure, panels.size());
    Figure figure{
        .caption =
            "Signals of " + file_name(recording.source) + " over the whole record" +
            (panels.size() > kPanelsPerFigure
                 ? ", part " + whole(static_cast<double>(first / kPanelsPerFigure + 1))
                 : std::string()) +
            ". Each pixel column shows the least and the greatest value in it, so no spike is lost; gaps are "
            "missing samples.",
        .panel_height = 90,
        .shared_x = true};
    figure.panels.assign(panels.begin() + static_cast<std::ptrdiff_t>(first),
                         panels.begin() + static_cast<std::ptrdiff_t>(last));
    page.add_figure(std::move(figure));
  }
}

void add_time_steps(Document& page, const series::Recording& recording, const Base& base) {
  if (!base.has_time || base.values.size() < 3) return;
  std::vector<double> step;
  for (std::size_t i = 1; i < base.values.size(); ++i)
    step.push_back(1e3 * (base.values[i] - base.values[i - 1]));
  const double median = quantile(step, 0.5);
  const Range all = range_of(step);
  page.paragraph("Time step: median " + number(median, 4) + " ms (" + number(1e3 / median, 4) +
                 " Hz), least " + number(*std::min_element(step.begin(), step.end()), 4) + " ms, greatest " +
                 number(*std::max_element(step.begin(), step.end()), 4) + " ms; " +
                 whole(static_cast<double>(
                     std::count_if(step.begin(), step.end(), [&](double s) { return s > 1.5 * median; }))) +
                 " steps longer than one and a half medians.");
  const double jitter = quantile(step, 0.999) - quantile(step, 0.001);
  if (!(jitter > 1e-6 * median)) return;  // a perfect clock needs no picture
  Figure figure{.caption = "Time steps of " + file_name(recording.source) +
                           ": left, how often (the middle 99.8 %); right, over the record.",
                .columns = 2,
                .panel_height = 150};
  const Histogram bars = histogram(step, {quantile(step, 0.001), quantile(step, 0.999)}, 50);
  Panel often{.x = {.label = "Time step", .unit = "ms", .tight = true},
              .y = {.label = "Rows", .unit = "-", .low = 0}};
  often.curves = {Curve{.mark = Mark::kBars, .colour = "#9fb8cc", .x = bars.centre, .y = bars.count}};
  Panel course{.x = base.axis, .y = {.label = "Time step", .unit = "ms", .low = std::min(0.0, all.low)}};
  course.curves = {line("", colour::kSecond, std::span(base.values).subspan(1), step, 300)};
  course.curves.front().size = 1;
  figure.panels = {std::move(often), std::move(course)};
  page.add_figure(std::move(figure));
}

void add_metadata(Document& page, const series::Recording& recording) {
  Table table{.columns = {{"Head of the file"}, {"Value"}}};
  for (const auto& [key, value] : recording.metadata) table.rows.push_back({key, value});
  if (!recording.sha256.empty()) table.rows.push_back({"SHA-256", recording.sha256});
  if (!table.rows.empty()) page.table(table);
}

}  // namespace

std::string render_check_report(const CheckReportInput& input) {
  require_gnuplot();
  Document page = open_page(input.head, "Check of recordings");
  Table files{.caption = "Files.",
              .columns = {{"File"},
                          {"Experiment"},
                          {"Rows", true},
                          {"Signals", true},
                          {"Duration (s)", true},
                          {"Remarks", true}}};
  for (std::size_t k = 0; k < input.recordings.size(); ++k) {
    const series::Recording& recording = input.recordings[k];
    const series::Column* time = recording.find("time");
    const bool timed = time != nullptr && !time->values.empty();
    const std::size_t remarks = k < input.findings.size() ? input.findings[k].size() : 0;
    if (remarks > 0) files.emphasised.push_back(k);
    files.rows.push_back({file_name(recording.source), recording.meta("experiment", "–"),
                          whole(static_cast<double>(recording.rows())),
                          whole(static_cast<double>(recording.columns.size()) - (timed ? 1 : 0)),
                          timed ? number(time->values.back() - time->values.front(), 4) : "–",
                          whole(static_cast<double>(remarks))});
  }
  page.table(files);
  for (std::size_t k = 0; k < input.recordings.size(); ++k) {
    const series::Recording& recording = input.recordings[k];
    page.heading(file_name(recording.source));
    const Warnings none;
    const Warnings& findings = k < input.findings.size() ? input.findings[k] : none;
    if (findings.empty()) {
      page.box(BoxKind::kGood, "Validation", {"Nothing to remark."});
    } else {
      page.box(BoxKind::kWarning, "Validation", warning_texts(findings));
    }
    add_metadata(page, recording);
    add_statistics(page, recording);
    const Base base = base_of(recording);
    add_signals(page, recording, base);
    add_time_steps(page, recording, base);
  }
  close_page(page, input.head);
  return page.html();
}

}  // namespace isac::report
