/// @file
/// Worst-case stack of a function from GCC's call graph (-fcallgraph-info=su): the heaviest path through who calls whom.
///
/// A call through a pointer may reach every function whose name holds `indirect`; a function of a library that is not in
/// the graph counts with `library_bytes`. Throws std::runtime_error for recursion and for stack that is not static.
#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace isac::test {

class CallGraph {
 public:
  CallGraph(const std::filesystem::path& folder, std::string indirect, int library_bytes)
      : indirect_(std::move(indirect)), library_bytes_(library_bytes) {
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      if (entry.path().extension() == ".ci") read(entry.path());
  }

  /// The function whose mangled name ends in `name`, and all it calls.
  [[nodiscard]] int bytes_below(const std::string& name) {
    for (const auto& [title, bytes] : own_)
      if (title.ends_with(name)) return worst(title);
    throw std::runtime_error("no function " + name + " in the call graph");
  }
  [[nodiscard]] std::size_t functions() const { return own_.size(); }
  [[nodiscard]] const std::set<std::string>& libraries() const { return libraries_; }

 private:
  static std::string quoted(const std::string& line, const std::string& key) {
    const std::size_t at = line.find(key + ": \"");
    if (at == std::string::npos) return {};
    const std::size_t begin = at + key.size() + 3;
    return line.substr(begin, line.find('"', begin) - begin);
  }

  void read(const std::filesystem::path& path) {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
      if (line.starts_with("node:")) {
        const std::string label = quoted(line, "label");
        const std::size_t unit = label.find(" bytes (");
        if (unit == std::string::npos) continue;  // declared here, defined elsewhere
        if (label.find("(dynamic)") != std::string::npos)
          throw std::runtime_error("stack is not static: " + label);
        const std::size_t digits = label.find_last_not_of("0123456789", unit - 1) + 1;
        own_[quoted(line, "title")] = std::stoi(label.substr(digits, unit - digits));
      } else if (line.starts_with("edge:")) {
        calls_[quoted(line, "sourcename")].insert(quoted(line, "targetname"));
      }
    }
  }

  int worst(const std::string& title) {
    if (const auto known = done_.find(title); known != done_.end()) return known->second;
    if (title == "__indirect_call") {
      int most = 0;
      for (const auto& [name, bytes] : own_)
        if (name.find(indirect_) != std::string::npos) most = std::max(most, worst(name));
      return most;
    }
    const auto own = own_.find(title);
    if (own == own_.end()) {
      libraries_.insert(title);
      return library_bytes_;
    }
    if (!open_.insert(title).second) throw std::runtime_error("recursion through " + title);
    int most = 0;
    for (const std::string& called : calls_[title]) most = std::max(most, worst(called));
    open_.erase(title);
    return done_[title] = own->second + most;
  }

  std::string indirect_;
  int library_bytes_;
  std::map<std::string, int> own_, done_;
  std::map<std::string, std::set<std::string>> calls_;
  std::set<std::string> open_, libraries_;
};

}  // namespace isac::test
