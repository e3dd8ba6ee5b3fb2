/// @file
/// A small XML reader that says why a text is not well formed; enough for the SVG and HTML the report room writes.
#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace isac::report::testing {

/// Empty when every tag is closed in order, attributes are quoted and ids are unique; else what is wrong.
/// `html` knows the elements of HTML that have no end tag.
inline std::string xml_fault(std::string_view text, bool html = false) {
  std::vector<std::string> open;
  std::set<std::string> ids;
  std::size_t at = 0;
  while ((at = text.find('<', at)) != std::string_view::npos) {
    if (text.substr(at, 9) == "<!DOCTYPE") {
      at = text.find('>', at);
      continue;
    }
    std::size_t end = at + 1;
    char quote = 0;
    for (; end < text.size(); ++end) {
      const char c = text[end];
      if (quote != 0) {
        if (c == quote) quote = 0;
      } else if (c == '"' || c == '\'') {
        quote = c;
      } else if (c == '>') {
        break;
      } else if (c == '<') {
        return "a tag begins inside a tag: " + std::string(text.substr(at, 60));
      }
    }
    if (end >= text.size()) return "a tag does not end: " + std::string(text.substr(at, 60));
    const std::string_view tag = text.substr(at + 1, end - at - 1);
    const bool closing = tag.front() == '/';
    const std::string name(tag.substr(closing ? 1 : 0, tag.find_first_of(" \n\t/", 1) - (closing ? 1 : 0)));
    for (const char* mark : {" id=\"", " id='"}) {
      const auto id = tag.find(mark);
      if (id == std::string_view::npos) continue;
      const auto from = id + 5;
      const std::string value(tag.substr(from, tag.find(mark[4], from) - from));
      if (!ids.insert(value).second) return "the id " + value + " stands twice";
    }
    if (closing) {
      if (open.empty() || open.back() != name) return "</" + name + "> closes nothing";
      open.pop_back();
    } else if (tag.back() != '/' && !(html && (name == "meta" || name == "br"))) {
      open.push_back(name);
    }
    at = end + 1;
    if (name == "style" && !closing) at = text.find("</style>", at);
  }
  if (!open.empty()) return "<" + open.back() + "> is not closed";
  for (std::size_t amp = text.find('&'); amp != std::string_view::npos; amp = text.find('&', amp + 1)) {
    const auto semicolon = text.find(';', amp);
    if (semicolon == std::string_view::npos || semicolon - amp > 8) return "an & is not escaped";
  }
  return {};
}

inline std::size_t occurrences(std::string_view text, std::string_view word) {
  std::size_t n = 0;
  for (std::size_t at = text.find(word); at != std::string_view::npos; at = text.find(word, at + 1)) ++n;
  return n;
}

}  // namespace isac::report::testing
