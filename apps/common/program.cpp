#include "common/program.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>

#include "isac/core/error.hpp"
#include "isac/record/answer.hpp"
#include "isac/record/csv_writer.hpp"

namespace isac::apps {
namespace {

/// One error, both ways of saying it.
int report_error(const CLI::App& app, const Error& error, const std::string& json_path) {
  if (!json_path.empty()) {
    try {
      write_text(json_path, record::format_error(error));
    } catch (const std::exception& second) {
      fmt::print(stderr, "{}: {}\n", app.get_name(), second.what());
    }
  }
  if (json_path != "-") fmt::print(stderr, "{}: {}\n", app.get_name(), error.what());
  return static_cast<int>(error.kind());
}

/// CLI11 has parsed nothing when a call's words are wrong, so --json is looked up by hand.
std::string json_path_of(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--json" && i + 1 < argc) return argv[i + 1];
    if (word.rfind("--json=", 0) == 0) return word.substr(7);
  }
  return {};
}

/// What to say where CLI11 only knows that no subcommand was found.
std::string unknown_subcommand(const CLI::App& app, int argc, char** argv) {
  const auto known = app.get_subcommands([](const CLI::App*) { return true; });
  if (known.empty() || argc < 2 || argv[1][0] == '-') return {};
  std::string names;
  for (const CLI::App* one : known) {
    if (one->get_name() == argv[1]) return {};
    names += (names.empty() ? "" : ", ") + one->get_name();
  }
  return "'" + std::string(argv[1]) + "' is none of " + names;
}

}  // namespace

void write_text(const std::string& path, const std::string& text) {
  if (path == "-") {
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fputc('\n', stdout) == EOF ||
        std::fflush(stdout) != 0) {
      throw Error(ErrorKind::kBadInput, "output_failed",
                  "standard output cannot be written; is the disk full or the reader gone?");
    }
    return;
  }
  record::write_atomically(path, text + "\n");
}

void require_writable(const std::string& path) {
  if (path.empty() || path == "-") return;
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    throw Error(ErrorKind::kUsage, "output_is_a_folder", "the output is a folder; name a file in it",
                {path, 0, 0});
  }
  const fs::path folder = fs::path(path).has_parent_path() ? fs::path(path).parent_path() : fs::path(".");
  if (!fs::is_directory(folder, ignored)) {
    throw Error(ErrorKind::kUsage, "output_folder_missing",
                "the folder '" + folder.string() + "' does not exist; create it or name another",
                {path, 0, 0});
  }
}

int run_program(CLI::App& app, int argc, char** argv, const std::string& json_path,
                const std::function<int()>& body) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    fmt::print("{}", app.help());
    return 0;
  } catch (const CLI::CallForAllHelp&) {
    fmt::print("{}", app.help("", CLI::AppFormatMode::All));
    return 0;
  } catch (const CLI::CallForVersion& version) {
    fmt::print("{}\n", version.what());
    return 0;
  } catch (const CLI::ParseError& wrong) {
    std::string text = unknown_subcommand(app, argc, argv);
    if (text.empty()) text = wrong.what();
    while (!text.empty() && (text.back() == '\n' || text.back() == '.')) text.pop_back();
    return report_error(app, Error(ErrorKind::kUsage, "usage", text + "; see --help"),
                        json_path_of(argc, argv));
  }
  try {
    return body();
  } catch (const Error& error) {
    return report_error(app, error, json_path);
  } catch (const std::bad_alloc&) {
    return report_error(app,
                        Error(ErrorKind::kBadInput, "out_of_memory",
                              "not enough memory for this input; use fewer or shorter recordings"),
                        json_path);
  } catch (const std::exception& other) {
    return report_error(app, Error(ErrorKind::kBadInput, "unexpected", other.what()), json_path);
  }
}

}  // namespace isac::apps
