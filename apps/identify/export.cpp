// isac-identify export: deployment tables from params.toml; --verify reads a packed table as a controller does.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "common/program.hpp"
#include "common/summary.hpp"
#include "identify/commands.hpp"
#include "isac/core/error.hpp"
#include "isac/models/parameter_table.hpp"
#include "isac/record/params.hpp"
#include "isac/record/tables.hpp"

namespace isac::apps {
namespace {
namespace fs = std::filesystem;

struct ExportCall {
  std::string input, folder = ".", stem = "isac_parameters";
  bool verify = false;
};

int verify(const ExportCall& call, const std::string& json_path) {
  std::ifstream file(call.input, std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
  if (!file && bytes.empty()) {
    throw Error(ErrorKind::kBadInput, "unreadable",
                std::string("cannot be read (") + std::strerror(errno) + ")", {call.input, 0, 0});
  }
  models::ParameterTable table;
  const Status status = models::load_parameter_table(std::as_bytes(std::span(bytes)), table);
  if (!ok(status)) {
    throw Error(ErrorKind::kBadInput, "table_refused",
                std::string("a controller refuses this table: ") + describe(status) + "; export it again",
                {call.input, 0, 0});
  }
  nlohmann::ordered_json answer{{"schema", "isac.export/1"},
                                {"accepted", true},
                                {"joints", table.joint_count},
                                {"effects", table.effect_count},
                                {"bytes", bytes.size()}};
  if (!json_path.empty()) write_text(json_path, answer.dump(2));
  if (json_path != "-") {
    fmt::print("{}: accepted, {} bytes, {} joint{}, {} effect{}\n", call.input, bytes.size(),
               table.joint_count, table.joint_count == 1 ? "" : "s", table.effect_count,
               table.effect_count == 1 ? "" : "s");
  }
  return 0;
}

int run_export(const ExportCall& call, const std::string& json_path) {
  require_writable(json_path);
  if (call.verify) return verify(call, json_path);
  const record::Params params = record::read_params(call.input);
  Warnings warnings;
  (void)record::parameter_table(params, &warnings);  // refuses before a folder is made
  std::error_code failure;
  fs::create_directories(call.folder, failure);
  if (failure) {
    throw Error(ErrorKind::kUsage, "output_folder", "the folder cannot be made (" + failure.message() + ")",
                {call.folder, 0, 0});
  }
  const auto paths = record::write_tables(params, fs::path(call.folder) / call.stem,
                                          fs::path(call.input).filename().string());
  nlohmann::ordered_json answer{{"schema", "isac.export/1"}};
  answer["files"] = nlohmann::ordered_json::array();
  for (const fs::path& path : paths) answer["files"].push_back(path.string());
  answer["warnings"] = nlohmann::ordered_json::array();
  for (const Warning& warning : warnings)
    answer["warnings"].push_back({{"code", warning.code}, {"text", warning.text}});
  if (!json_path.empty()) write_text(json_path, answer.dump(2));
  if (json_path != "-") {
    for (const fs::path& path : paths) fmt::print("{}\n", path.string());
    print_warnings(warnings);
  }
  return 0;
}

}  // namespace

Body add_export(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<ExportCall>();
  CLI::App* sub =
      program.add_subcommand("export", "deployment tables: C header, binary with CRC, CSV, Markdown");
  sub->add_option("params", call->input, "params.toml (with --verify: the packed binary)")->required();
  sub->add_option("-o,--output", call->folder, "folder for the tables")->capture_default_str();
  sub->add_option("--name", call->stem, "file name without ending")->capture_default_str();
  sub->add_flag("--verify", call->verify,
                "read a packed binary as a controller does, and say whether it is accepted");
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_export(*call, json_path); };
}

}  // namespace isac::apps
