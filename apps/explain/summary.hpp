/// @file
/// What isac-explain says on the terminal: a live line while it works, then the answer as a lab engineer reads it.
#pragma once

#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"

namespace isac::apps {

/// What is being tried, on standard error: one line that is rewritten on a terminal, plain lines with `verbose` elsewhere.
class Progress {
 public:
  explicit Progress(bool verbose);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void say(const std::string& line);
  /// Takes the live line away.
  void end();

 private:
  bool terminal_, verbose_, drawn_ = false;
};

void print_explanation(const explain::Explanation& answer, const std::vector<std::string>& compensation);

/// How to record the plan that was written to `path`, or why there is none (empty).
void print_plan(const explain::Explanation& answer, const std::string& path);

}  // namespace isac::apps
