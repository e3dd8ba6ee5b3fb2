#include <array>
#include <cctype>
#include <string>
#include <string_view>
#include <utility>

#include "isac/report/plotter.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

void replace_all(std::string& text, std::string_view from, const std::string& to) {
  std::string out;
  std::size_t at = 0;
  for (;;) {
    const std::size_t hit = text.find(from, at);
    out.append(text, at, hit == std::string::npos ? std::string::npos : hit - at);
    if (hit == std::string::npos) break;
    out += to;
    at = hit + from.size();
  }
  text = std::move(out);
}

/// Everything from `from` to the end of the next `to` taken out, as often as it occurs.
void cut_all(std::string& text, std::string_view from, std::string_view to) {
  std::string out;
  std::size_t at = 0;
  for (;;) {
    const std::size_t hit = text.find(from, at);
    const std::size_t end = hit == std::string::npos ? hit : text.find(to, hit + from.size());
    if (end == std::string::npos) break;
    out.append(text, at, hit - at);
    at = end + to.size();
  }
  text = out.append(text, at, std::string::npos);
}

/// `<g …>` followed by nothing but white space and `</g>`: gnuplot opens a group for every change of pen.
void drop_empty_groups(std::string& text) {
  std::string out;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t open = text.find("<g ", at);
    const std::size_t close = open == std::string::npos ? open : text.find('>', open);
    if (close == std::string::npos) break;
    std::size_t next = close + 1;
    while (next < text.size() && std::isspace(static_cast<unsigned char>(text[next])) != 0) ++next;
    if (text.compare(next, 4, "</g>") == 0) {
      out.append(text, at, open - at);
      at = next + 4;
      while (at < text.size() && text[at] == '\n') ++at;
    } else {
      out.append(text, at, close + 1 - at);
      at = close + 1;
    }
  }
  text = out.append(text, at, std::string::npos);
}

}  // namespace

std::string embeddable_svg(const std::string& gnuplot_svg, const std::string& id, const std::string& alt) {
  const std::size_t view = gnuplot_svg.find("viewBox=");
  const std::size_t canvas = gnuplot_svg.find("<g id=\"gnuplot_canvas\">");
  if (view == std::string::npos || canvas == std::string::npos) return {};
  const std::size_t quote = gnuplot_svg.find('"', view + 9);
  const std::string box = gnuplot_svg.substr(view, quote + 1 - view);
  std::string body = gnuplot_svg.substr(canvas);
  const std::string key = "id=\"" + id;

  cut_all(body, "<filter id=", "</filter>");
  cut_all(body, "<title>", "</title>");
  cut_all(body, " id=\"p_plot_", "\"");  // ids repeat from panel to panel
  replace_all(body, "<g id=\"gnuplot_canvas\">", "<g>");
  replace_all(body, " id='gp", " id='" + id + "-gp");
  replace_all(body, "href='#gp", "href='#" + id + "-gp");
  replace_all(body, " font-family=\"Arial\"", "");
  replace_all(body, "font-family=\"Arial Bold\"", "font-weight=\"600\"");
  replace_all(body, ".00\"", "\"");
  replace_all(body, " stroke-linecap=\"round\" stroke-linejoin=\"round\"", "");
  replace_all(body, " stroke-dasharray='2,4' class=\"gridline\"", "");  // a light grid, not a dotted one
  replace_all(body, "<text> ", "<text>");
  for (int pass = 0; pass < 3; ++pass) drop_empty_groups(body);

  std::string head =
      "<svg " + box +
      " xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" role=\"img\" "
      "stroke-linecap=\"round\" stroke-linejoin=\"round\" font-family=\"Helvetica, Arial, 'Liberation "
      "Sans', 'DejaVu Sans', sans-serif\" " +
      key + "\" aria-labelledby=\"" + id + "-title\">\n<title id=\"" + id + "-title\">" + escape(alt) +
      "</title>\n";
  return head + body;
}

}  // namespace isac::report
