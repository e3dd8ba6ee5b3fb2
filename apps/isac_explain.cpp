// isac-explain: where simulation and measurement disagree, what is missing, and the proof (docs/reference/isac-explain.md).
#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "common/dataset.hpp"
#include "common/program.hpp"
#include "explain/additions.hpp"
#include "explain/answer.hpp"
#include "explain/inputs.hpp"
#include "explain/summary.hpp"
#include "isac/explain/explain.hpp"
#include "isac/record/params.hpp"

namespace {

using namespace isac;

struct Words : apps::ExplainWords {
  std::string json, params;
  int threads = 2;
  std::uint64_t seed = 1;
  bool verbose = false;
};

int run(Words words) {
  for (const std::string& path : {words.json, words.params}) apps::require_writable(path);
  words.hash = !words.params.empty();
  apps::ExplainInputs inputs = apps::read_inputs(words);

  explain::ExplainOptions options;
  options.rig = inputs.facts;
  options.baseline = inputs.baseline;
  options.excluded = words.excluded;
  options.threads = words.threads;
  options.seed = words.seed;
  options.traces = false;
  apps::Progress progress(words.verbose);
  options.progress = [&progress](const std::string& line) { progress.say(line); };
  const explain::Explanation answer = explain::explain(inputs.runs, inputs.heldout, options);
  inputs.runs = {};
  progress.end();

  const std::vector<std::string> compensation = apps::compensation_of(answer);
  if (!words.params.empty())
    record::update_params(words.params, apps::params_of(answer, inputs, apps::now_iso8601()));
  if (!words.json.empty()) apps::write_text(words.json, apps::format_explanation(answer, compensation));
  if (words.json != "-") apps::print_explanation(answer, compensation);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Finds where simulation and measurement disagree, names the missing effect, and shows on held-out runs "
      "how much of "
      "the gap it closes.",
      "isac-explain"};
  app.set_version_flag("--version", ISAC_VERSION);
  Words words;
  app.add_option("dataset", words.dataset,
                 "A dataset folder (rig.toml, *.csv, heldout/*.csv), or recordings (CSV)")
      ->required();
  app.add_option("--model", words.model,
                 "model.toml: another baseline than the seed's, as terms and an output");
  app.add_option("--rig", words.rig, "rig.toml; a dataset folder's own is found by itself");
  app.add_option("--heldout", words.heldout,
                 "Recordings for the proof, never fitted; beside a folder's heldout/");
  app.add_option("--map", words.maps, "Foreign column, e.g. angle=\"Joint Pos (deg)\":deg");
  app.add_option("--exclude", words.excluded, "Effects that are not to be considered, by their ids");
  app.add_option("--json", words.json, "Answer as JSON into a file, - for standard output");
  app.add_option("-o,--params", words.params, "params.toml to write or update, with the effects added");
  app.add_option("--threads", words.threads, "Threads to use")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option("--seed", words.seed, "Seed of every random draw; the same seed gives the same answer")
      ->capture_default_str();
  app.add_flag("--verbose", words.verbose, "Say on standard error what is tried and ruled out, line by line");
  app.footer("Exit codes: 0 done, 1 no usable data, 2 wrong call, 3 bad file.");
  return apps::run_program(app, argc, argv, words.json, [&] { return run(words); });
}
