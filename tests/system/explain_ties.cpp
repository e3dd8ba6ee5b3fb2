// explain_ties: hides one effect after another in the simulated rig, records the first afternoon of the tutorial, and where the
// answer leaves a tie, records what it asks for and asks again. Prints one row of a Markdown table per dataset.
//   explain_ties [seeds per effect, default 2] [random]
// With `random` each tie is also recorded with runs drawn from those that could be asked for, until it is settled as well.
// With `sweeps` for the seeds: records all sweeps of a rig with each of these and other effects, three of them held out, and asks once.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/explain/experiment_runs.hpp"
#include "isac/models/effects.hpp"
#include "isac/record/plan_file.hpp"
#include "run_program.hpp"

namespace {

using nlohmann::json;

/// As the words of sim: have them, SI; about as large as shows by ten times its error in these recordings, or as the catalogue has them.
constexpr const char* kHidden[] = {"effect=muscle_asymmetry:3.6e-6",
                                   "effect=muscle_asymmetry:-2.5e-6",
                                   "effect=pressure_dependent_friction:0.01:1",
                                   "effect=pressure_dependent_friction:0.02:1",
                                   "effect=coulomb_friction:0.01",
                                   "effect=stribeck_friction:0.008:0.014:0.3",
                                   "effect=hysteresis:0.02:0.05",
                                   "effect=creep:0.1:10",
                                   "effect=volume_coupling:2e3",
                                   "effect=asymmetric_fill_vent:1.3",
                                   "effect=valve_deadband:2e3",
                                   "effect=crosstalk:0.005",
                                   "effect=encoder_play:0.003",
                                   "effect=lever_arm_variation:0.01:0.02",
                                   "effect=torque_ripple:0.01:0:16",
                                   "effect=torque_offset",
                                   "effect=encoder_offset",
                                   "effect=encoder_drift",
                                   "effect=dead_time",
                                   "effect=second_order_lag",
                                   "effect=pressure_creep",
                                   "effect=thermal_drift",
                                   "effect=nonlinear_pressure_gain"};

/// Beside those, as large as a rig may have them.
constexpr const char* kHiddenInSweeps[] = {"effect=coulomb_friction:0.02",
                                           "effect=pressure_dependent_friction:0.02:1",
                                           "effect=stribeck_friction:0.015:0.03:0.3",
                                           "effect=hysteresis:0.02:0.05",
                                           "effect=creep:0.3:10",
                                           "effect=bearing_friction:0.02",
                                           "effect=quadratic_damping:0.02",
                                           "effect=cubic_stiffness:0.4",
                                           "effect=gravity_imbalance:0.05",
                                           "effect=torque_offset:0.02",
                                           "effect=muscle_asymmetry:3.6e-6",
                                           "effect=lever_arm_variation:0.01:0.02",
                                           "effect=torque_ripple:0.01:0:16",
                                           "effect=encoder_play:0.004",
                                           "effect=dead_time:0.01",
                                           "effect=second_order_lag:0.02",
                                           "effect=asymmetric_fill_vent:1.3",
                                           "effect=valve_deadband:4e3",
                                           "effect=volume_coupling:4e3",
                                           "effect=crosstalk:0.01"};

std::vector<std::string> names(const json& answer) {
  std::vector<std::string> out;
  for (const char* list : {"effects", "alternatives"})
    for (const json& one : answer.at(list)) out.push_back(one.at("id"));
  return out;
}

bool holds(const std::vector<std::string>& list, const std::string& name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

std::string joined(const std::vector<std::string>& list) {
  std::string text;
  for (const std::string& word : list) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "–" : text;
}

const std::string kRig = std::string(ISAC_SOURCE_DIR) + "/data/rigs/testbed.toml";

bool record(const std::string& plan, const std::string& card, const std::string& dataset) {
  const auto run =
      isac::test::run_program({"isac-log", "--plan", plan, "--card", card, "--rig", kRig, "-o", dataset});
  if (run.exit_code != 0) std::fprintf(stderr, "%s: %s\n", card.c_str(), run.err.c_str());
  return run.exit_code == 0;
}

json ask(const std::string& dataset, const std::string& plan) {
  const auto run =
      isac::test::run_program({"isac-explain", dataset, "--rig", kRig, "--plan", plan, "--json", "-"});
  return json::parse(run.out, nullptr, false);
}

int ask_of_all_sweeps() {
  std::printf("| hidden | named | or | held-out gap before, after |\n| --- | --- | --- | --- |\n");
  for (const std::string hidden : kHiddenInSweeps) {
    const isac::test::ScratchFolder folder;
    const std::string dataset = folder / "dataset";
    const auto run = isac::test::run_program(
        {"isac-log", "all", "--card", "sim:seed=11," + hidden, "--rig", kRig, "-o", dataset});
    const json answer = run.exit_code == 0 ? ask(dataset, folder / "next.toml") : json();
    if (!answer.is_object() || !answer.contains("effects")) {
      std::fprintf(stderr, "%s: no answer\n", hidden.c_str());
      return 1;
    }
    std::vector<std::string> named, or_else;
    for (const json& one : answer["effects"]) named.push_back(one["id"]);
    for (const json& one : answer["alternatives"]) or_else.push_back(one["id"]);
    const json& gap = answer["gap"];
    std::printf("| %s | %s | %s | %.4f, %.4f %s |\n", hidden.c_str() + 7,
                named.empty() ? answer["verdict"].get<std::string>().c_str() : joined(named).c_str(),
                joined(or_else).c_str(), gap["heldout_before"].get<double>(),
                gap["heldout_after"].get<double>(), gap["unit"].get<std::string>().c_str());
    std::fflush(stdout);
  }
  return 0;
}

struct Tie {
  std::string hidden, truth;
  std::vector<std::string> left;
  std::string one, other;  ///< what the plan is to tell apart
};

/// What the first afternoon leaves tied; nothing if the truth stands alone or is not among it, or if no run is asked for.
std::optional<Tie> tie_in(const std::string& hidden, const std::string& dataset, const std::string& plan,
                          std::vector<std::string>& left) {
  const json answer = ask(dataset, plan);
  if (answer.is_discarded() || !answer.contains("effects")) return std::nullopt;
  left = names(answer);
  const std::string id = hidden.substr(7, hidden.find(':') - 7);
  const auto& info =
      isac::models::effect_catalogue()[static_cast<std::size_t>(isac::models::find_effect(id))];
  const std::string truth = info.reported_as != nullptr ? info.reported_as : id;
  if (!holds(left, truth) || left.size() < 2 || !std::filesystem::exists(plan)) return std::nullopt;
  const json& pair = answer.at("separation").at("between");
  return Tie{hidden, truth, left, pair[0], pair[1]};
}

/// What a run was to rule out is gone (of a pair without the truth, one), and the truth is there, first but for what no run tells from it.
bool is_settled(const Tie& tie, const std::vector<std::string>& then) {
  const bool first_goes = tie.other == tie.truth || (tie.one != tie.truth && !holds(then, tie.one));
  return holds(then, tie.truth) && !holds(then, first_goes ? tie.one : tie.other) &&
         (then.front() == tie.truth || holds(tie.left, then.front()));
}

double seconds_of(const std::string& plan) {
  double seconds = 0;
  for (const auto& run : isac::record::read_plan(plan).runs) seconds += run.duration;
  return seconds;
}

/// The simulated testbed, as its first recordings show it.
std::vector<isac::explain::PlannedRun> possible_runs() {
  using namespace isac::explain;
  constexpr double kPressure = 3 * isac::kPascalPerKgfCm2;
  RigRange range;
  range.angle = 0.4;
  range.speed = 3;
  range.mean_force = 95;
  range.mean_pressure = kPressure;
  range.force_slope = 0.5 * 174.2 / isac::kPascalPerKgfCm2;
  range.stiffness = 23450 * 0.019 * 0.019;
  range.least_force = 5;
  range.moves_freely = range.valves = true;
  RigFacts rig;
  rig.wheel_radius = 0.019;
  rig.initial_pressure = kPressure;
  return candidate_runs(range, rig);
}

/// Seconds of runs drawn at random until the tie is settled; kGivenUp if it is not by then.
double random_seconds(const Tie& tie, const std::string& dataset, const std::string& plan, int seed) {
  constexpr double kGivenUp = 600, kEach = 40;
  const std::vector<isac::explain::PlannedRun> all = possible_runs();
  std::mt19937 random(static_cast<unsigned>(seed));
  double seconds = 0;
  for (int draw = 0; seconds < kGivenUp && draw < 60; ++draw) {
    isac::explain::PlannedRun run = all[random() % all.size()];
    run.seconds = std::max(kEach, isac::explain::least_seconds(run));
    isac::record::write_plan(plan, {.runs = {isac::explain::plan_run(run)}});
    // What the rig refuses costs nothing here, what is to be repeated is left out.
    std::vector<std::filesystem::path> before, after;
    for (const auto& file : std::filesystem::directory_iterator(dataset)) before.push_back(file.path());
    if (!record(plan, "sim:seed=" + std::to_string(1000 * seed + draw) + "," + tie.hidden, dataset)) {
      for (const auto& file : std::filesystem::directory_iterator(dataset)) after.push_back(file.path());
      for (const auto& path : after)
        if (std::find(before.begin(), before.end(), path) == before.end()) std::filesystem::remove(path);
      continue;
    }
    seconds += run.seconds;
    if (is_settled(tie, names(ask(dataset, plan + ".none")))) return seconds;
  }
  return kGivenUp;
}

}  // namespace

int main(int count, char** words) {
  if (count > 1 && std::string(words[1]) == "sweeps") return ask_of_all_sweeps();
  const int seeds = count > 1 ? std::atoi(words[1]) : 2;
  const bool at_random = count > 2 && std::string(words[2]) == "random";
  const std::string first =
      std::string(ISAC_SOURCE_DIR) + "/docs/tutorials/tell-two-effects-apart/first.toml";
  int tied = 0, settled = 0;
  double ours = 0, random = 0;
  std::printf("| hidden | seed | left before | left after | seconds | at random |\n");
  std::printf("| --- | --- | --- | --- | --- | --- |\n");
  for (int seed = 1; seed <= seeds; ++seed)
    for (const std::string hidden : kHidden) {
      const isac::test::ScratchFolder folder;
      const std::string dataset = folder / "dataset", other = folder / "other", plan = folder / "next.toml";
      if (!record(first, "sim:seed=" + std::to_string(seed) + "," + hidden, dataset)) continue;
      std::vector<std::string> left;
      const std::optional<Tie> tie = tie_in(hidden, dataset, plan, left);
      if (!tie) {
        std::printf("| %s | %d | %s | not tied | | |\n", hidden.c_str() + 7, seed, joined(left).c_str());
        std::fflush(stdout);
        continue;
      }
      if (at_random) std::filesystem::copy(dataset, other, std::filesystem::copy_options::recursive);
      const double seconds = seconds_of(plan);
      // (A run that isac-log asks to repeat counts as it was recorded.)
      record(plan, "sim:seed=" + std::to_string(100 + seed) + "," + hidden, dataset);
      const std::vector<std::string> then = names(ask(dataset, folder / "none.toml"));
      const bool done = is_settled(*tie, then);
      const double drawn = at_random ? random_seconds(*tie, other, folder / "random.toml", seed) : 0;
      ++tied;
      settled += done ? 1 : 0;
      ours += seconds;
      random += drawn;
      std::printf("| %s | %d | %s | %s%s | %.0f | %s |\n", hidden.c_str() + 7, seed, joined(left).c_str(),
                  joined(then).c_str(), done ? "" : " (not settled)", seconds,
                  at_random ? std::to_string(static_cast<int>(drawn)).c_str() : "");
      std::fflush(stdout);
    }
  std::printf("\n%d ties, %d settled, in %.0f s", tied, settled, ours);
  if (at_random) std::printf("; runs drawn at random: %.0f s, each tie given up at 600 s", random);
  std::printf("\n");
  return 0;
}
