// Reads #include lines and holds them against the table of arrows.
#pragma once

#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace isac::architecture {

struct Include {
  std::string file;  // path from the root, "src/isac/models/effects.hpp"
  int line = 0;
  std::string target;  // text between the quotes or brackets
  bool quoted = false;
};

struct Rules {
  struct Pattern {
    std::regex include, files;
    std::string text;
  };
  std::map<std::string, std::set<std::string>> allowed;  // room → rooms
  std::vector<Pattern> only, never;
  std::vector<std::pair<std::regex, std::string>> once;
};

/// Throws std::runtime_error with the line that is no rule.
Rules read_rules(const std::filesystem::path& path);

std::vector<Include> includes_of(const std::string& file, const std::string& text);
/// Of all .hpp, .cpp, .h and .c files below `folder` of `root`.
std::vector<Include> read_includes(const std::filesystem::path& root, const std::string& folder);

/// One sentence per broken rule, in the order of the includes.
std::vector<std::string> broken_rules(const Rules& rules, const std::vector<Include>& includes);

}  // namespace isac::architecture
