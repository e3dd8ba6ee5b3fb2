#include "page.hpp"

#include <fstream>
#include <iterator>
#include <stdexcept>

#include "isac/record/csv_writer.hpp"

namespace blind {
namespace {

/// The line `mark` in `text` from `at` on: where it begins.
std::size_t find_line(const std::string& text, const std::string& mark, std::size_t at) {
  for (std::size_t hit = text.find(mark, at); hit != std::string::npos; hit = text.find(mark, hit + 1)) {
    const std::size_t end = hit + mark.size();
    if ((hit == 0 || text[hit - 1] == '\n') && (end == text.size() || text[end] == '\n')) return hit;
  }
  return std::string::npos;
}

std::string one_level_lower(const std::string& markdown) {
  std::string out;
  for (std::size_t at = 0; at < markdown.size();) {
    const std::size_t end = std::min(markdown.find('\n', at), markdown.size() - 1) + 1;
    if (markdown[at] == '#') out += '#';
    out.append(markdown, at, end - at);
    at = end;
  }
  return out;
}

}  // namespace

std::string page_with_tables(const std::string& page, const std::string& tables) {
  const std::size_t from = find_line(page, kTablesFrom, 0);
  const std::size_t to = from == std::string::npos ? from : find_line(page, kTablesTo, from);
  if (to == std::string::npos)
    throw std::runtime_error(std::string("the page has no line '") + kTablesFrom + "' with a line '" +
                             kTablesTo + "' after it, between which tables could stand");
  std::string lower = one_level_lower(tables);
  while (!lower.empty() && lower.back() == '\n') lower.pop_back();
  return page.substr(0, from) + kTablesFrom + "\n\n" + lower + "\n\n" + page.substr(to);
}

void write_page(const std::filesystem::path& page, const std::vector<Case>& cases) {
  std::ifstream in(page, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + page.string());
  const std::string before{std::istreambuf_iterator<char>(in), {}};
  const Reliability names = reliability(cases);
  const std::filesystem::path picture = names.bins.empty() ? "" : page.stem() / "reliability.svg";
  const std::string after = page_with_tables(before, report(cases, picture.generic_string()));
  if (!picture.empty()) {
    const std::filesystem::path file = page.parent_path() / picture;
    std::filesystem::create_directories(file.parent_path());
    isac::record::write_atomically(file, reliability_diagram(names));
  }
  isac::record::write_atomically(page, after);
}

}  // namespace blind
