// isac-explain: where simulation and measurement disagree, what is missing, and the proof (docs/reference/isac-explain.md).
#ifdef __linux__
#include <malloc.h>
#endif

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "common/dataset.hpp"
#include "common/program.hpp"
#include "explain/additions.hpp"
#include "explain/answer.hpp"
#include "explain/arm_poses.hpp"
#include "explain/inputs.hpp"
#include "explain/plan.hpp"
#include "explain/summary.hpp"
#include "isac/explain/explain.hpp"
#include "isac/explain/step_records.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/record/params.hpp"
#include "isac/record/plan_file.hpp"
#include "isac/report/explain_report.hpp"

namespace {

using namespace isac;

struct Words : apps::ExplainWords {
  std::string json, params, report, plan;
  int threads = 2;
  std::uint64_t seed = 1;
  bool verbose = false;
};

report::ExplainReportInput report_input(const explain::Explanation& answer, const apps::ExplainInputs& inputs,
                                        const std::vector<std::string>& compensation, const Words& words) {
  report::ExplainReportInput input;
  input.head.title = inputs.title.empty() ? "What is missing" : "What is missing: " + inputs.title;
  input.head.created = apps::now_iso8601();
  input.answer = &answer;
  input.position_unit = inputs.baseline.position_unit;
  input.compensation = compensation;
  input.params_file = apps::short_name(words.params);
  if (answer.next_experiment && !answer.next_experiment->runs.empty())
    input.plan_file = apps::short_name(words.plan);
  return input;
}

int run(Words words) {
#ifdef __GLIBC__
  // Responses of a hundred thousand rows come and go: memory that was once given is kept, instead of page faults for each anew.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
#endif
  for (const std::string& path : {words.json, words.params, words.report, words.plan})
    apps::require_writable(path);
  words.hash = !words.params.empty();
  apps::ExplainInputs inputs = apps::read_inputs(words);

  explain::ExplainOptions options;
  options.rig = inputs.facts;
  options.baseline = inputs.baseline;
  options.limits = inputs.limits;
  options.excluded = words.excluded;
  options.threads = words.threads;
  options.seed = words.seed;
  options.traces = !words.report.empty();
  apps::Progress progress(words.verbose);
  options.progress = [&progress](const std::string& line) { progress.say(line); };
  const explain::Explanation answer = explain::only_pressures(inputs.runs)
                                          ? explain::explain_steps(inputs.runs)
                                          : explain::explain(inputs.runs, inputs.heldout, options);
  inputs.runs = {};
  progress.end();

  const std::vector<std::string> compensation = apps::compensation_of(answer);
  if (!words.report.empty())
    record::write_atomically(
        words.report, report::render_explain_report(report_input(answer, inputs, compensation, words)));
  if (!words.params.empty())
    record::update_params(words.params, apps::params_of(answer, inputs, apps::now_iso8601()));
  const series::Plan plan = apps::plan_of(answer);
  const bool planned = !words.plan.empty() && !plan.runs.empty();
  if (planned) record::write_plan(words.plan, plan);
  if (!words.json.empty()) apps::write_text(words.json, apps::format_explanation(answer, compensation));
  if (words.json != "-") {
    apps::print_explanation(answer, compensation);
    if (!words.plan.empty()) apps::print_plan(answer, planned ? words.plan : std::string());
  }
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
  app.add_option("--report", words.report, "HTML report to write");
  app.add_option("--plan", words.plan,
                 "plan.toml to write: the experiment to record next, for isac-log --plan");
  app.add_option("--threads", words.threads, "Threads to use")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option("--seed", words.seed, "Seed of every random draw; the same seed gives the same answer")
      ->capture_default_str();
  app.add_flag("--verbose", words.verbose, "Say on standard error what is tried and ruled out, line by line");
  apps::ArmExplainWords arm;
  apps::add_arm_options(app, arm);
  app.footer("Exit codes: 0 done, 1 no usable data, 2 wrong call, 3 bad file.");
  return apps::run_program(app, argc, argv, words.json, [&] {
    if (arm.arm.empty()) return run(words);
    arm.runs = words.dataset;
    arm.maps = words.maps;
    return apps::explain_arm(arm, words.json, words.report);
  });
}
