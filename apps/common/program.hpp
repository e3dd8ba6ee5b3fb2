/// @file
/// What every program does around its one library call: turn errors into one sentence and an exit code.
///
/// Exit codes (docs/formats.md): 0 done, 1 the answer is no, 2 wrong call, 3 bad input, 4 card or safety
/// limit. Errors go to standard error in one sentence; with --json they go to its destination as
/// {"error":{…}}.
#pragma once

#include <functional>
#include <string>

namespace CLI {
class App;
}

namespace isac::apps {

/// Parses the call, runs `body`, and returns the exit code. `json_path` is read after parsing: empty, a file,
/// or "-".
int run_program(CLI::App& app, int argc, char** argv, const std::string& json_path,
                const std::function<int()>& body);

/// Writes `text` and a newline to `path`, or to standard output for "-"; a file appears whole or not at all.
void write_text(const std::string& path, const std::string& text);

/// Refuses to replace an existing file unless `overwrite`; throws isac::Error (usage).
void require_writable(const std::string& path);

}  // namespace isac::apps
