#include "isac/report/document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "isac/report/plotter.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

constexpr const char* kFigureSpace = "\u2007";       // as wide as a digit
constexpr const char* kPunctuationSpace = "\u2008";  // as wide as a point

/// Bytes behind the last digit before the point or the text's end: what stands right of the decimal point.
std::size_t digits_behind_point(const std::string& text) {
  const auto point = text.find('.');
  if (point == std::string::npos) return 0;
  std::size_t n = 0;
  while (point + 1 + n < text.size() && text[point + 1 + n] >= '0' && text[point + 1 + n] <= '9') ++n;
  return n;
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_of("0123456789") != std::string::npos;
}

/// Every cell padded on the right so that the points of a right-aligned column stand under each other.
std::vector<std::string> aligned(const std::vector<std::vector<std::string>>& rows, std::size_t column) {
  std::size_t most = 0;
  for (const auto& row : rows)
    if (column < row.size()) most = std::max(most, digits_behind_point(row[column]));
  std::vector<std::string> out;
  for (const auto& row : rows) {
    std::string cell = column < row.size() ? escape(row[column]) : std::string();
    if (column < row.size() && is_number(row[column])) {
      const std::size_t have = digits_behind_point(row[column]);
      if (have == 0 && most > 0) cell += kPunctuationSpace;
      for (std::size_t i = have; i < most; ++i) cell += kFigureSpace;
    }
    out.push_back(std::move(cell));
  }
  return out;
}

const char* class_of(BoxKind kind) {
  switch (kind) {
    case BoxKind::kNote:
      return "note";
    case BoxKind::kGood:
      return "good";
    case BoxKind::kWarning:
      return "warning";
    case BoxKind::kNext:
      return "next";
  }
  return "note";
}

/// Escaped, and what stands between backticks as code: commands to type, in sentences.
std::string prose(const std::string& text) {
  std::string out;
  const std::string safe = escape(text);
  for (std::size_t at = 0; at < safe.size();) {
    const auto open = safe.find('`', at);
    const auto close = open == std::string::npos ? open : safe.find('`', open + 1);
    if (close == std::string::npos) return out + safe.substr(at);
    out += safe.substr(at, open - at) + "<code>" + safe.substr(open + 1, close - open - 1) + "</code>";
    at = close + 1;
  }
  return out;
}

/// White at 0, blue towards −1, orange towards +1: both readable under black text.
std::string shade(double r) {
  const double t = std::min(1.0, std::abs(r));
  const auto mix = [t](double full) { return static_cast<int>(std::lround(255 + t * (full - 255))); };
  return r < 0 ? fmt::format("#{:02x}{:02x}{:02x}", mix(120), mix(178), mix(222))
               : fmt::format("#{:02x}{:02x}{:02x}", mix(240), mix(170), mix(110));
}

}  // namespace

Document::Document(std::string title, std::string subtitle)
    : title_(std::move(title)), subtitle_(std::move(subtitle)) {}

void Document::heading(const std::string& text) {
  block("<h2>" + escape(text) + "</h2>\n");
}
void Document::subheading(const std::string& text) {
  block("<h3>" + escape(text) + "</h3>\n");
}
void Document::paragraph(const std::string& text) {
  block("<p>" + prose(text) + "</p>\n");
}

void Document::equation(const std::vector<std::string>& lines) {
  std::string out = "<div class=\"equation\">";
  for (const std::string& line : lines) out += "<div>" + escape(line) + "</div>";
  block(out + "</div>\n");
}

void Document::bullets(const std::vector<std::string>& items) {
  if (items.empty()) return;
  std::string out = "<ul>\n";
  for (const std::string& item : items) out += "<li>" + prose(item) + "</li>\n";
  block(out + "</ul>\n");
}

void Document::cards(const std::vector<Card>& items) {
  constexpr std::size_t kInARow = 5;  // a sixth alone below them reads like an afterthought
  std::string out = items.size() > kInARow ? "<div class=\"cards halves\">\n" : "<div class=\"cards\">\n";
  for (const Card& card : items) {
    out += "<div class=\"card\"><div class=\"label\">" + escape(card.label) + "</div><div class=\"value\">" +
           escape(card.value) + "</div>";
    if (!card.note.empty()) out += "<div class=\"note\">" + escape(card.note) + "</div>";
    out += "</div>\n";
  }
  block(out + "</div>\n");
}

void Document::table(const Table& table) {
  std::vector<std::vector<std::string>> cells;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    if (table.columns[c].numeric) {
      cells.push_back(aligned(table.rows, c));
      continue;
    }
    std::vector<std::string> plain;
    for (const auto& row : table.rows) plain.push_back(c < row.size() ? escape(row[c]) : std::string());
    cells.push_back(std::move(plain));
  }
  std::string out = "<div class=\"scroll\"><table>\n";
  if (!table.caption.empty())
    out += fmt::format("<caption><b>Table {}.</b> {}</caption>\n", ++tables_, escape(table.caption));
  out += "<thead><tr>";
  for (const TableColumn& column : table.columns)
    out += std::string(column.numeric ? "<th class=\"n\" scope=\"col\">" : "<th scope=\"col\">") +
           escape(column.header) + "</th>";
  out += "</tr></thead>\n<tbody>\n";
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    const bool set_off =
        std::find(table.emphasised.begin(), table.emphasised.end(), r) != table.emphasised.end();
    out += set_off ? "<tr class=\"set-off\">" : "<tr>";
    for (std::size_t c = 0; c < table.columns.size(); ++c)
      out += std::string(table.columns[c].numeric                          ? "<td class=\"n\">"
                         : cells[c][r].find("\u200b") != std::string::npos ? "<td class=\"b\">"
                         : glyphs(cells[c][r]) > 40                        ? "<td class=\"w\">"
                                                                           : "<td>") +
             cells[c][r] + "</td>";
    out += "</tr>\n";
  }
  block(out + "</tbody></table></div>\n");
}

void Document::correlation(const std::string& caption, const std::vector<std::string>& names,
                           const std::vector<double>& values) {
  const std::size_t n = names.size();
  if (n < 2 || values.size() != n * n) return;
  std::string out = fmt::format(
      "<div class=\"scroll\"><table class=\"correlation\">\n<caption><b>Table {}.</b> {}</caption>\n"
      "<thead><tr><td></td>",
      ++tables_, escape(caption));
  for (const std::string& name : names) out += "<th scope=\"col\">" + escape(name) + "</th>";
  out += "</tr></thead>\n<tbody>\n";
  for (std::size_t i = 0; i < n; ++i) {
    out += "<tr><th scope=\"row\">" + escape(names[i]) + "</th>";
    for (std::size_t j = 0; j < n; ++j) {
      const double r = values[i * n + j];
      if (!std::isfinite(r)) {
        out += "<td>–</td>";
      } else {
        std::string text = fmt::format("{:.2f}", r);
        if (text == "-0.00") text = "0.00";
        if (text.front() == '-') text.replace(0, 1, "−");
        out += "<td style=\"background:" + shade(r) + "\">" + text + "</td>";
      }
    }
    out += "</tr>\n";
  }
  block(out + "</tbody></table></div>\n");
}

void Document::box(BoxKind kind, const std::string& title, const std::vector<std::string>& items) {
  if (items.empty()) return;
  std::string out = std::string("<div class=\"box ") + class_of(kind) + "\"><div class=\"title\">" +
                    escape(title) + "</div>";
  if (items.size() == 1) {
    out += "<p>" + prose(items.front()) + "</p>";
  } else {
    out += "<ul>";
    for (const std::string& item : items) out += "<li>" + prose(item) + "</li>";
    out += "</ul>";
  }
  block(out + "</div>\n");
}

bool Document::add_figure(Figure figure) {
  std::erase_if(figure.panels, [](const Panel& panel) {
    Figure alone;
    alone.panels.push_back(panel);
    return is_empty(alone);
  });
  if (figure.panels.empty()) return false;
  figure.id = fmt::format("fig{}", figures_.size() + 1);
  if (figure.alt.empty()) figure.alt = figure.caption;
  blocks_.push_back({{}, figures_.size()});
  figures_.push_back(std::move(figure));
  return true;
}

std::string Document::html() const {
  const std::vector<std::string> pictures = render_svg(figures_);
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\">\n<title>" +
      escape(title_) + "</title>\n<style>" + style_sheet() + "</style>\n</head>\n<body>\n<main>\n<h1>" +
      escape(title_) + "</h1>\n";
  if (!subtitle_.empty()) out += "<p class=\"subtitle\">" + escape(subtitle_) + "</p>\n";
  for (const Block& block : blocks_) {
    if (block.figure == kNoFigure) {
      out += block.html;
      continue;
    }
    out += "<figure>\n" + pictures[block.figure] +
           fmt::format("<figcaption><b>Figure {}.</b> {}</figcaption>\n</figure>\n", block.figure + 1,
                       escape(figures_[block.figure].caption));
  }
  return out + "</main>\n</body>\n</html>\n";
}

}  // namespace isac::report
