/// @file
/// One self-contained HTML5 page: headings, cards, tables with numbers under each other at the decimal point,
/// warnings, numbered figures with captions, and what to do next.
///
/// No script, no external resource, a print style. All text that comes in is plain and is escaped here.
/// Figures are drawn in one go when html() is called; empty ones are left out (add_figure says so).
/// Threads: a value. Errors: html() throws what render_svg() throws, so there is never half a page.
/// Example: `Document d("Joint identification", {}); d.paragraph("…"); auto page = d.html();`
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "isac/report/figure.hpp"

namespace isac::report {

struct Card {
  std::string label = {}, value = {}, note = {};
};

struct TableColumn {
  std::string header = {};
  bool numeric = false;  ///< aligned at the decimal point
};

struct Table {
  std::string caption = {};
  std::vector<TableColumn> columns = {};
  std::vector<std::vector<std::string>> rows = {};
  std::vector<std::size_t> emphasised =
      {};  ///< indices of rows to set off (the best model, a refused parameter)
};

enum class BoxKind { kNote, kGood, kWarning, kNext };

class Document {
 public:
  Document(std::string title, std::string subtitle);

  void heading(const std::string& text);
  void subheading(const std::string& text);
  void paragraph(const std::string& text);
  void equation(const std::vector<std::string>& lines);
  void bullets(const std::vector<std::string>& items);
  void cards(const std::vector<Card>& items);
  void table(const Table& table);
  /// Square table of −1…1 with shaded cells; NaN is shown as a dash.
  void correlation(const std::string& caption, const std::vector<std::string>& names,
                   const std::vector<double>& values);
  void box(BoxKind kind, const std::string& title, const std::vector<std::string>& items);
  /// False when the figure is empty and was left out.
  bool add_figure(Figure figure);

  [[nodiscard]] std::size_t figures() const noexcept { return figures_.size(); }
  [[nodiscard]] std::string html() const;

 private:
  void block(std::string html) { blocks_.push_back({std::move(html), kNoFigure}); }

  static constexpr std::size_t kNoFigure = static_cast<std::size_t>(-1);
  struct Block {
    std::string html;
    std::size_t figure;
  };
  std::string title_, subtitle_;
  std::vector<Block> blocks_ = {};
  std::vector<Figure> figures_ = {};
  std::size_t tables_ = 0;
};

/// The page's inline style sheet.
[[nodiscard]] const char* style_sheet() noexcept;

}  // namespace isac::report
