#include "include_rules.hpp"

#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace isac::architecture {
namespace {

/// "models" of "src/isac/models/arm/chain.hpp", "apps/embedded" and "apps" of files there.
std::string room_of_file(const std::string& file) {
  static const std::regex in_src("^src/isac/([^/]+)/.*");
  std::smatch found;
  if (std::regex_match(file, found, in_src)) return found[1];
  if (file.starts_with("apps/embedded/")) return "apps/embedded";
  return file.starts_with("apps/") ? "apps" : "";
}

/// "models" of "isac/models/effects.hpp", empty for what is not of this house.
std::string room_of_include(const std::string& target) {
  static const std::regex ours("^isac/([^/]+)/.*");
  std::smatch found;
  return std::regex_match(target, found, ours) ? found[1].str() : "";
}

std::string place(const Include& include) {
  return include.file + ":" + std::to_string(include.line) + ": ";
}

}  // namespace

Rules read_rules(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw std::runtime_error("cannot read " + path.string());
  Rules rules;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    std::string verb, what, link, word;
    words >> verb >> what >> link;
    if (verb == "allow" && link == "->") {
      auto& rooms = rules.allowed[what];
      while (words >> word) rooms.insert(word);
    } else if ((verb == "only" || verb == "never") && link == "in" && (words >> word)) {
      (verb == "only" ? rules.only : rules.never).push_back({std::regex(what), std::regex(word), line});
    } else if (verb == "once" && link.empty()) {
      rules.once.emplace_back(std::regex(what), line);
    } else {
      throw std::runtime_error(path.string() + ": no rule: " + line);
    }
  }
  return rules;
}

std::vector<Include> includes_of(const std::string& file, const std::string& text) {
  static const std::regex directive(R"(^\s*#\s*include\s*([<"])([^>"]+)[>"].*)");
  std::vector<Include> found;
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::smatch match;
    if (std::regex_match(line, match, directive)) found.push_back({file, number, match[2], match[1] == "\""});
  }
  return found;
}

std::vector<Include> read_includes(const std::filesystem::path& root, const std::string& folder) {
  std::vector<Include> all;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
    const std::string extension = entry.path().extension();
    if (extension != ".hpp" && extension != ".cpp" && extension != ".h" && extension != ".c") continue;
    std::ifstream in(entry.path());
    const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    const auto found = includes_of(std::filesystem::relative(entry.path(), root).generic_string(), text);
    all.insert(all.end(), found.begin(), found.end());
  }
  return all;
}

std::vector<std::string> broken_rules(const Rules& rules, const std::vector<Include>& includes) {
  std::vector<std::string> broken;
  std::vector<std::set<std::string>> users(rules.once.size());
  for (const Include& include : includes) {
    const std::string from = room_of_file(include.file), to = room_of_include(include.target);
    if (!to.empty() && to != from) {
      const auto rooms = rules.allowed.find(from);
      if (rooms == rules.allowed.end()) {
        broken.push_back(place(include) + "the room " + from + " has no arrows; write them into arrows.txt");
      } else if (!rooms->second.contains(to)) {
        broken.push_back(place(include) + "the arrow " + from + " -> " + to + " is not allowed (" +
                         include.target + ")");
      }
    }
    if (include.quoted && to.empty() && include.file.starts_with("src/"))
      broken.push_back(place(include) + "\"" + include.target + "\" does not name its room (isac/<room>/…)");
    for (const auto& rule : rules.only)
      if (std::regex_search(include.target, rule.include) && !std::regex_search(include.file, rule.files))
        broken.push_back(place(include) + include.target + " breaks \"" + rule.text + "\"");
    for (const auto& rule : rules.never)
      if (std::regex_search(include.target, rule.include) && std::regex_search(include.file, rule.files))
        broken.push_back(place(include) + include.target + " breaks \"" + rule.text + "\"");
    for (std::size_t i = 0; i < users.size(); ++i)
      if (std::regex_search(include.target, rules.once[i].first)) users[i].insert(include.file);
  }
  for (std::size_t i = 0; i < users.size(); ++i)
    if (users[i].size() > 1)
      broken.push_back(*users[i].rbegin() + ": a second file breaks \"" + rules.once[i].second + "\"");
  return broken;
}

}  // namespace isac::architecture
