// isac-tune: gains for a joint, from an experiment on the rig or from identified parameters (docs/how-to/tune.md).
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "common/program.hpp"
#include "common/quantity.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/csv_writer.hpp"
#include "isac/report/plotter.hpp"
#include "isac/report/tune_report.hpp"
#include "isac/runtime/stop_signals.hpp"
#include "isac/tune/gain_ramp.hpp"
#include "isac/tune/relay.hpp"
#include "isac/tune/step_series.hpp"
#include "tune/answer.hpp"
#include "tune/inputs.hpp"
#include "tune/rig_loop.hpp"

namespace {

using namespace isac;

struct Words {
  std::string method, rule = "optimise", card, rig, params, joint, output, log, report, json,
                      pace = "virtual";
  std::string amplitude = "0.2 kg/cm2", centre = "0 kg/cm2", kick = "0.03 rad", first_gain = "1.5 kg/cm2",
              hold = "1.5 s";
  std::string longest = "120 s";
  double rate = 1000, uncertainty = 3, overshoot = 10, modulus = 0.5, share = 95, least_integral = 0.1;
  int cycles = 10, rounds = 3, draws = 200;
  std::uint64_t seed = 1;
  bool rate_given = false;
};

[[nodiscard]] bool on_the_rig(const Words& w) {
  return w.method == "relay" || w.method == "ramp" || w.method == "step";
}

record::Rig rig_of(const Words& words) {
  record::Rig rig = record::read_rig(words.rig);
  if (!std::isfinite(rig.joint.initial_pressure)) rig.joint.initial_pressure = 3.0 * kPascalPerKgfCm2;
  return rig;
}

/// The experiment of a call, within the rig's limits.
std::unique_ptr<tune::Experiment> experiment_of(const Words& w, const record::Rig& rig, double rate) {
  const double centre = apps::parse_quantity(w.centre, dimension::kPressure, "--centre");
  const double amplitude = apps::parse_quantity(w.amplitude, dimension::kPressure, "--amplitude");
  const double room =
      std::min({rig.limits.delta_pressure - std::abs(centre), rig.joint.initial_pressure - std::abs(centre),
                rig.limits.pressure - rig.joint.initial_pressure - std::abs(centre)});
  if (!(amplitude > 0) || amplitude > room)
    throw Error(ErrorKind::kUsage, "amplitude_out_of_limits",
                fmt::format("--amplitude of {:.3g} kg/cm2 about {:.3g} does not fit the limits; it must lie "
                            "between 0 and {:.3g} kg/cm2",
                            amplitude / kPascalPerKgfCm2, centre / kPascalPerKgfCm2,
                            std::max(0.0, room) / kPascalPerKgfCm2));
  tune::ExperimentSettings settings{.centre = centre,
                                    .reach = std::min(room, 2 * amplitude),
                                    .settle = 1.5,
                                    .longest = apps::parse_quantity(w.longest, dimension::kTime, "--longest"),
                                    .interval = 1 / rate};
  const double step = 2 * kPi / rig.encoder.steps_per_turn;
  if (w.method == "relay")
    return std::make_unique<tune::RelayExperiment>(settings,
                                                   tune::RelaySettings{.amplitude = amplitude,
                                                                       .least_hysteresis = 2 * step,
                                                                       .cycles = w.cycles,
                                                                       .longest_cycles = 4 * w.cycles + 10});
  if (w.method == "step") {
    const double hold = apps::parse_quantity(w.hold, dimension::kTime, "--hold");
    if (!(hold > 0))
      throw Error(ErrorKind::kUsage, "hold_not_positive", "--hold must be longer than 0 s, e.g. \"1.5 s\"");
    return std::make_unique<tune::StepSeries>(
        settings, tune::StepSettings{.height = amplitude, .hold = hold, .rounds = w.rounds});
  }
  const double kick = apps::parse_quantity(w.kick, dimension::kAngle, "--kick");
  const double gain = apps::parse_quantity(w.first_gain, dimension::kPressure, "--first-gain");
  if (!(kick > 0) || !(gain > 0))
    throw Error(ErrorKind::kUsage, "ramp_not_positive",
                "--kick and --first-gain must be greater than 0, e.g. \"0.03 rad\" and \"1.5 kg/cm2\"");
  settings.reach = room;
  return std::make_unique<tune::GainRamp>(settings, tune::GainRampSettings{.first_gain = gain, .kick = kick});
}

/// Everything that is known once the rig has stood still again.
struct Found {
  std::optional<tune::PlantFit> fit;
  tune::DescribingFunction describing;
  apps::RigRunOutcome run;
  tune::ExperimentRecord record;  ///< of an experiment that failed
  std::string refusal;
};

Found excite(const Words& w, const record::Rig& rig) {
  apps::RigRun run;
  run.card = !w.card.empty() ? w.card : !rig.card.device.empty() ? rig.card.device : "sim:";
  run.rig = rig;
  run.limits = {.pressure = rig.limits.pressure,
                .delta_pressure = rig.limits.delta_pressure,
                .angle = rig.limits.angle,
                .speed = rig.limits.speed,
                .force = rig.limits.force};
  run.log = w.log;
  run.method = w.method;
  run.rate = !w.rate_given && std::isfinite(rig.card.sample_rate) ? rig.card.sample_rate : w.rate;
  run.pace_real = w.pace == "real";
  if (!(run.rate >= 100) || run.rate > 1e5)
    throw Error(ErrorKind::kUsage, "rate_nonsense",
                fmt::format("the sample rate must lie between 100 and 100000 Hz, not {:g}", run.rate));
  const auto experiment = experiment_of(w, rig, run.rate);
  Found found;
  found.run = apps::run_on_rig(run, *experiment);
  if (experiment->state() == tune::Experiment::State::kFailed) {
    found.refusal = "the " + w.method + " failed: " + experiment->failure();
    found.record = experiment->record();
    return found;
  }
  tune::PlantFitOptions options;
  options.noise = experiment->noise();
  const auto* relay = dynamic_cast<const tune::RelayExperiment*>(experiment.get());
  const auto* ramp = dynamic_cast<const tune::GainRamp*>(experiment.get());
  if (relay != nullptr) found.describing = relay->describing_function();
  if (relay != nullptr) options.time_scale = found.describing.period;
  if (ramp != nullptr) options.time_scale = ramp->regressed()->period;
  if (w.method == "step") options.time_scale = apps::parse_quantity(w.hold, dimension::kTime, "--hold") / 6;
  found.fit = tune::fit_plant(experiment->excited(), options);
  found.refusal = found.fit->refusal;
  if (found.refusal.empty() && ramp != nullptr)
    found.refusal =
        tune::second_opinion(*ramp, {tune::value_of(*found.fit, "K_crit").value * kPascalPerKgfCm2,
                                     tune::value_of(*found.fit, "T_crit").value});
  return found;
}

/// What the parameters promise against what the rig showed.
void compare(const apps::TunedJoint& known, const tune::PlantFit& fit, Warnings& warnings) {
  const auto promised = tune::ultimate(tune::plant_loop(known.model));
  if (!promised) return;
  const double k = tune::value_of(fit, "K_crit").value * kPascalPerKgfCm2,
               t = tune::value_of(fit, "T_crit").value;
  if (std::abs(k / promised->gain - 1) < 0.15 && std::abs(t / promised->period - 1) < 0.10) return;
  warnings.push_back(
      {"parameters_disagree",
       fmt::format("The parameters promise K_crit {:.3g} kg/cm2 per rad and T_crit {:.3g} s, the rig showed "
                   "{:.3g} and {:.3g} s; identify "
                   "the joint anew, for the model-based controller believes the parameters.",
                   promised->gain / kPascalPerKgfCm2, promised->period, k / kPascalPerKgfCm2, t)});
}

tune::Rule rule_of(const std::string& word) {
  if (word == "procedure") return tune::Rule::kProcedure;
  return word == "ziegler-nichols" ? tune::Rule::kZieglerNichols : tune::Rule::kOptimise;
}

std::string now_iso8601() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

void deploy(const Words& w, const apps::TunedJoint& joint, const tune::Gains& gains) {
  namespace fs = std::filesystem;
  // A fresh file begins as a copy of the parameters it came from, so that one file holds all a controller needs.
  record::Params params;
  if (!w.params.empty() && fs::exists(w.params) && !fs::exists(w.output))
    params = record::read_params(w.params);
  params.created = now_iso8601();
  record::ParamsSection section;
  section.name = "gains";
  section.values = apps::gains_section(gains);
  const record::Params in_file = fs::exists(w.output) ? record::read_params(w.output) : params;
  int joints = 0;
  for (const record::ParamsSection& s : in_file.sections) joints += s.name == "joint" ? 1 : 0;
  for (const record::ParamsSection& s : in_file.sections)
    if (s.name == "gains" && s.label == joint.label) section.label = s.label;
  if (joints > 1) section.label = joint.label;
  std::erase_if(params.sections,
                [&](const auto& s) { return s.name == "gains" && s.label == section.label; });
  params.sections.push_back(std::move(section));
  record::update_params(w.output, params);
}

void print_summary(std::FILE* out, const Words& w, const apps::TuneAnswer& a) {
  if (a.fit != nullptr) {
    for (const auto* list : {&a.fit->parameters, &a.fit->derived})
      for (const Estimated& e : *list)
        if (std::isfinite(e.std_error))
          fmt::print(out, "  {:<10} {:>10.4g} +- {:<8.2g} {}\n", e.name, e.value, e.std_error, e.unit);
        else
          fmt::print(out, "  {:<10} {:>10.4g} (error not known) {}\n", e.name, e.value, e.unit);
  }
  if (a.tuning != nullptr) {
    const auto row = [&](const tune::Candidate& c) {
      if (c.figures.draws == 0) return;
      const tune::Assessment& f = c.figures;
      fmt::print(out,
                 "  {:<30} tracking {:>7.1f} mrad  overshoot {:>6.1f} %  modulus margin {:.2f}  effort "
                 "{:>5.1f} kg/cm2/s  "
                 "stable {:>5.1f} %  within limits {:>5.1f} %\n",
                 c.name, 1e3 * f.tracking, 100 * f.overshoot_p95, f.modulus_p05, f.effort / kPascalPerKgfCm2,
                 100 * f.stable_share, 100 * f.good_share);
    };
    if (a.tuning->before) row(*a.tuning->before);
    for (const tune::Candidate& c : a.tuning->candidates) row(c);
    if (a.tuning->chosen) {
      fmt::print(out, "gains:");
      for (const Estimated& e : apps::gains_section(a.tuning->candidates[*a.tuning->chosen].gains))
        fmt::print(out, "  {} {:.4g} {}", e.name, e.value, e.unit);
      fmt::print(out, "\n");
    }
  }
  for (const Warning& warning : a.warnings) fmt::print(out, "warning: {}\n", warning.text);
  if (!a.refusal.empty())
    fmt::print(out, "the old gains stay: {}\n", a.refusal);
  else if (a.deployed.empty())
    fmt::print(out, "the gains hold their limits; -o params.toml deploys them\n");
  else
    fmt::print(out, "the gains hold their limits and are in {}\n", w.output);
}

int tune_gains(Words words) {
  for (const std::string& path : {words.output, words.log, words.report, words.json})
    apps::require_writable(path);
  if (words.params.empty()) words.params = words.output;
  if (!words.report.empty()) report::require_gnuplot();
  const record::Rig rig = rig_of(words);
  const runtime::StopSignals signals;
  const auto known = apps::read_joint(words.params, words.joint, rig);
  if (!on_the_rig(words) && !known)
    throw Error(ErrorKind::kAnswerIsNo, "parameters_missing",
                "--method " + words.method +
                    " needs an identified joint; give --params params.toml from isac-identify joint, or "
                    "measure: --method relay",
                {words.params, 0, 0});

  apps::TuneAnswer answer;
  answer.method = words.method;
  answer.rule = words.rule;
  answer.log = words.log;
  std::optional<apps::TunedJoint> joint = known;
  Found found;
  if (on_the_rig(words)) {
    found = excite(words, rig);
    answer.run = &found.run;
    answer.describing = found.describing;
    answer.refusal = found.refusal;
    if (found.fit) answer.fit = &*found.fit;
    if (found.refusal.empty()) {
      joint = apps::joint_of(*found.fit, rig, known);
      if (known) compare(*known, *found.fit, answer.warnings);
    }
  }
  if (joint) answer.joint = &*joint;
  tune::Limits limits{
      .overshoot = words.overshoot / 100, .modulus = words.modulus, .share = words.share / 100};
  std::optional<tune::Tuning> tuning;
  if (answer.refusal.empty() && joint) {
    answer.warnings.insert(answer.warnings.end(), joint->warnings.begin(), joint->warnings.end());
    std::array<double, tune::kDrawnParameters> errors = joint->relative_errors;
    for (double& e : errors) e = std::hypot(e, words.uncertainty / 100);
    tune::TuningOptions options{
        .rule = rule_of(words.rule), .limits = limits, .draws = words.draws, .seed = words.seed};
    options.least_integral = words.least_integral;
    options.stop = [] { return runtime::StopSignals::requested().load(); };
    // The controller will believe the parameters it is given; the joint is what the experiment showed.
    if (on_the_rig(words) && known) options.measured = joint->model;
    tuning = tune::tune_joint(known ? known->model : joint->model, tune::independent(errors), joint->gains,
                              options);
    answer.tuning = &*tuning;
    answer.refusal = tuning->refusal;
  }
  if (answer.refusal.empty() && !words.output.empty()) {
    deploy(words, *joint, tuning->candidates[*tuning->chosen].gains);
    answer.deployed = words.output;
  }
  if (!words.report.empty()) {  // what was done is drawn, however it ended
    report::TuneReportInput input;
    input.head.rig = rig.name;
    input.head.created = now_iso8601();
    if (tuning) {
      input.model = &joint->model;
      input.tuning = &*tuning;
    }
    input.refusal = answer.refusal;
    input.fit = answer.fit;
    input.record = found.record;
    input.limits = limits;
    input.experiment = words.method == "ramp"   ? "gain ramp"
                       : words.method == "step" ? "series of steps"
                                                : words.method;
    input.deployed = answer.deployed;
    input.warnings = answer.warnings;
    record::write_atomically(words.report, report::render_tune_report(input));
  }
  if (!words.json.empty()) apps::write_text(words.json, apps::format_tuning(answer));
  if (words.json != "-") print_summary(stdout, words, answer);
  return answer.refusal.empty() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Finds the gains of a joint's controller, on the rig or from its parameters, and keeps the old ones "
      "unless the new hold their limits.",
      "isac-tune"};
  app.set_version_flag("--version", ISAC_VERSION);
  Words w;
  app.add_option("--method", w.method,
                 "Where the joint's dynamics come from: relay, ramp or step (an experiment on the rig), "
                 "model or optimise (params.toml)")
      ->required()
      ->check(CLI::IsMember({"relay", "ramp", "step", "model", "optimise"}));
  app.add_option("--rule", w.rule,
                 "How gains follow: optimise (search), procedure (the seed's 6.3) or ziegler-nichols")
      ->check(CLI::IsMember({"optimise", "procedure", "ziegler-nichols"}))
      ->capture_default_str();
  app.add_option("--card", w.card, "The card, e.g. sim: (default: the rig file's, else sim:)");
  app.add_option("--rig", w.rig, "The rig file, rig.toml")->required();
  app.add_option("--params", w.params, "Identified parameters, params.toml (default: that of -o)");
  app.add_option("--joint", w.joint, "Label of the joint in params.toml (default: the first)");
  app.add_option("-o,--output", w.output,
                 "params.toml whose section [gains] is replaced, if the gains hold their limits");
  app.add_option("--log", w.log, "CSV of every tick of the experiment");
  app.add_option("--report", w.report, "HTML report");
  app.add_option("--json", w.json, "The answer as JSON to a file, or - for standard output");
  app.add_option("--pace", w.pace, "sim: as fast as it can (virtual) or by the wall clock (real)")
      ->check(CLI::IsMember({"virtual", "real"}));
  CLI::Option* rate =
      app.add_option("--rate", w.rate, "Ticks per second (default: the rig file's, else 1000)");

  app.add_option("--amplitude", w.amplitude, "Of Delta p: the relay's, or the height of steps")
      ->capture_default_str()
      ->group("Experiment");
  app.add_option("--centre", w.centre, "Delta p about which all happens")
      ->capture_default_str()
      ->group("Experiment");
  app.add_option("--cycles", w.cycles, "Even cycles of the relay")
      ->check(CLI::Range(4, 1000))
      ->capture_default_str()
      ->group("Experiment");
  app.add_option("--hold", w.hold, "step: of each step; six periods T_crit or more")
      ->capture_default_str()
      ->group("Experiment");
  app.add_option("--rounds", w.rounds, "step: of up, back, down, back and short ones")
      ->check(CLI::Range(1, 100))
      ->capture_default_str()
      ->group("Experiment");
  app.add_option("--first-gain", w.first_gain, "ramp: first gain, per rad; an eighth of K_crit or so")
      ->capture_default_str()
      ->group("Experiment");
  app.add_option("--kick", w.kick, "ramp: change of the reference at every level")
      ->capture_default_str()
      ->group("Experiment");
  app.add_option("--longest", w.longest, "Of the experiment; then it is given up")
      ->capture_default_str()
      ->group("Experiment");

  app.add_option("--overshoot", w.overshoot, "Of a step of 0.3 rad, %")
      ->check(CLI::Range(0.1, 100.0))
      ->capture_default_str()
      ->group("Limits of the gains");
  app.add_option("--modulus", w.modulus, "Least distance of the loop from -1")
      ->check(CLI::Range(0.05, 0.95))
      ->capture_default_str()
      ->group("Limits of the gains");
  app.add_option("--share", w.share, "Of the drawn joints that must hold both, %")
      ->check(CLI::Range(1.0, 100.0))
      ->capture_default_str()
      ->group("Limits of the gains");
  app.add_option("--least-integral", w.least_integral,
                 "K_I/K_P of the position loop, 1/s; more brings a load's droop back sooner and tracks worse")
      ->check(CLI::Range(0.0, 5.0))
      ->capture_default_str()
      ->group("Limits of the gains");
  app.add_option("--uncertainty", w.uncertainty,
                 "Standard deviation added to each parameter's own, %: wear, temperature, load")
      ->check(CLI::Range(0.0, 30.0))
      ->capture_default_str()
      ->group("Limits of the gains");
  app.add_option("--draws", w.draws, "Joints drawn to judge by")
      ->check(CLI::Range(20, 100000))
      ->capture_default_str()
      ->group("Limits of the gains");
  app.add_option("--seed", w.seed, "Of the draws")->capture_default_str()->group("Limits of the gains");
  app.footer(
      "Ctrl-C at any moment vents the valves, closes the log and leaves the gains as they were.\n"
      "Exit codes: 0 tuned, 1 the old gains stay, 2 wrong call, 3 bad file, 4 stopped by the card or a "
      "safety limit.");
  return isac::apps::run_program(app, argc, argv, w.json, [&] {
    w.rate_given = rate->count() > 0;
    return tune_gains(w);
  });
}
