// isac-identify diff: is the change between two params files significant?
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/program.hpp"
#include "common/summary.hpp"
#include "identify/commands.hpp"
#include "isac/core/error.hpp"
#include "isac/estimate/compare.hpp"
#include "isac/record/params.hpp"

namespace isac::apps {
namespace {

struct DiffCall {
  std::string before, after;
};

int run_diff(const DiffCall& call, const std::string& json_path) {
  require_writable(json_path);
  const record::Params before = record::read_params(call.before);
  const record::Params after = record::read_params(call.after);
  std::vector<Estimated> old_values, new_values;
  Warnings warnings;
  for (const record::ParamsSection& section : after.sections) {
    const record::ParamsSection* match = before.find(section.name, section.label);
    if (match == nullptr) {
      warnings.push_back(
          {"section_new", "[" + section.name + " " + section.label + "] stands only in " + call.after + "."});
      continue;
    }
    const std::string prefix = section.name + (section.label.empty() ? "" : " " + section.label) + ": ";
    for (Estimated value : section.values) {
      value.name = prefix + value.name;
      new_values.push_back(value);
    }
    for (Estimated value : match->values) {
      value.name = prefix + value.name;
      old_values.push_back(value);
    }
  }
  for (const record::ParamsSection& section : before.sections) {
    if (after.find(section.name, section.label) == nullptr) {
      warnings.push_back({"section_gone", "[" + section.name + " " + section.label + "] stands only in " +
                                              call.before + "."});
    }
  }
  if (new_values.empty()) {
    throw Error(ErrorKind::kAnswerIsNo, "nothing_to_compare",
                "the two files have no section in common; compare files of the same joint or valve unit");
  }
  const auto changes = estimate::compare(old_values, new_values);

  nlohmann::ordered_json answer;
  answer["schema"] = "isac.diff/1";
  answer["changes"] = nlohmann::ordered_json::array();
  bool any = false;
  for (const auto& change : changes) {
    any = any || change.significant;
    answer["changes"].push_back({{"name", change.name},
                                 {"before", json_number(change.before)},
                                 {"after", json_number(change.after)},
                                 {"unit", change.unit},
                                 {"z", json_number(change.z)},
                                 {"p_value", json_number(change.p_value)},
                                 {"significant", change.significant},
                                 {"text", change.sentence}});
  }
  answer["significant"] = any;
  answer["warnings"] = nlohmann::ordered_json::array();
  for (const Warning& warning : warnings)
    answer["warnings"].push_back({{"code", warning.code}, {"text", warning.text}});
  if (!json_path.empty()) write_text(json_path, answer.dump(2));
  if (json_path != "-") {
    for (const auto& change : changes) fmt::print("{} {}\n", change.significant ? "!" : "·", change.sentence);
    print_warnings(warnings);
    fmt::print("{}\n", any ? "The files differ by more than their uncertainty."
                           : "No change is larger than its uncertainty.");
  }
  return 0;
}

}  // namespace

Body add_diff(CLI::App& program, std::string& json_path) {
  auto call = std::make_shared<DiffCall>();
  CLI::App* sub = program.add_subcommand("diff", "two params files: is the change significant?");
  sub->add_option("before", call->before, "params.toml")->required();
  sub->add_option("after", call->after, "params.toml")->required();
  sub->add_option("--json", json_path, "answer as JSON into a file, - for standard output");
  return [call, &json_path] { return run_diff(*call, json_path); };
}

}  // namespace isac::apps
