#include "isac/record/plan_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "isac/record/csv_writer.hpp"
#include "isac/record/toml_document.hpp"
#include "isac/record/toml_quantity.hpp"

namespace isac::record {
namespace {

using series::Plan;
using series::PlanRun;

constexpr std::array<std::string_view, 4> kExperiments = {"constant-pressure", "constant-angle", "free",
                                                          "pcu-step"};
constexpr std::array<std::string_view, 4> kWaveforms = {"triangle", "sine", "steps", "hold"};
constexpr std::size_t kMostRuns = 100;

enum class Bound { kAny, kNotNegative, kPositive };

/// A key of a run: where it goes, what it is, what it may be, and how a person writes it.
struct Key {
  std::string_view name;
  double PlanRun::*field;
  Dimension dimension;
  Bound bound;
  const char* unit;
};

constexpr Key kKeys[] = {
    {"duration", &PlanRun::duration, dimension::kTime, Bound::kPositive, "s"},
    {"delta_pressure", &PlanRun::delta_pressure, dimension::kPressure, Bound::kAny, "kg/cm2"},
    {"mean_pressure", &PlanRun::mean_pressure, dimension::kPressure, Bound::kPositive, "kg/cm2"},
    {"amplitude", &PlanRun::amplitude, dimension::kAngle, Bound::kPositive, "rad"},
    {"middle", &PlanRun::middle, dimension::kAngle, Bound::kAny, "rad"},
    {"peak_speed", &PlanRun::peak_speed, dimension::kAngularVelocity, Bound::kPositive, "rad/s"},
    {"pressure_swing", &PlanRun::pressure_swing, dimension::kPressure, Bound::kNotNegative, "kg/cm2"},
    {"pressure_period", &PlanRun::pressure_period, dimension::kTime, Bound::kPositive, "s"},
};

template <typename Words>
std::string listed(const Words& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " or " : ", ") + std::string(words[i]);
  return text;
}

template <typename Words>
std::string word_of(const TomlSection& section, std::string_view key, const Words& known) {
  const auto word = section.text(key);
  if (!word) return {};
  if (std::find(known.begin(), known.end(), *word) == known.end()) {
    const std::string near = nearest_word(*word, known);
    section.fail(key, "value_unknown",
                 "'" + std::string(key) + "' is " + toml_string(*word) + "; " +
                     (near.empty() ? "write " + listed(known) : "did you mean '" + near + "'?"));
  }
  return *word;
}

PlanRun read_run(const toml::table& table, const std::string& file) {
  const TomlSection section(table, "run", file,
                            {"experiment", "duration", "delta_pressure", "mean_pressure", "amplitude",
                             "middle", "peak_speed", "pressure_swing", "pressure_period", "waveform"});
  PlanRun run;
  run.experiment = word_of(section, "experiment", kExperiments);
  if (run.experiment.empty()) {
    section.fail("experiment", "value_missing",
                 "a run names no 'experiment'; write experiment = \"constant-pressure\" (or " +
                     listed(kExperiments) + ")");
  }
  if (!section.has("duration"))
    section.fail("duration", "value_missing", "a run has no 'duration'; write one, like duration = \"60 s\"");
  for (const Key& key : kKeys) {
    const auto value = section.quantity(key.name, key.dimension);
    if (!value) continue;
    const bool fits =
        key.bound == Bound::kAny || *value > 0 || (key.bound == Bound::kNotNegative && *value == 0);
    if (!fits) {
      section.fail(key.name, "value_out_of_range",
                   "'" + std::string(key.name) + "' is " + shown(*table.get(key.name)) + "; it must be " +
                       (key.bound == Bound::kPositive ? "greater than zero" : "zero or more"));
    }
    run.*key.field = *value;
  }
  if (run.duration > series::kLongestPlannedRun)
    section.fail("duration", "value_out_of_range",
                 "'duration' is longer than an hour; plan several shorter runs");
  run.waveform = word_of(section, "waveform", kWaveforms);
  return run;
}

/// "3.0 kg/cm2" where that reads back to the same bits, else in SI.
std::string quantity_text(double value, const Key& key) {
  const double scale = parse_compound_unit(key.unit)->scale;
  const double shown_value = value / scale;
  // A few digits are what a person wrote, if they give the value back.
  for (const double candidate : {std::round(shown_value * 1e6) / 1e6, shown_value})
    if (candidate * scale == value) return toml_string(exact_number(candidate) + " " + key.unit);
  return toml_string(exact_number(value) + " " + si_unit_text(key.dimension));
}

std::string run_text(const PlanRun& run) {
  std::string out = "\n[[run]]\nexperiment = " + toml_string(run.experiment) + "\n";
  const PlanRun usual;
  for (const Key& key : kKeys) {
    const double value = run.*key.field;
    const bool written = key.field == &PlanRun::duration || value != usual.*key.field;
    if (written && std::isfinite(value))
      out += std::string(key.name) + " = " + quantity_text(value, key) + "\n";
  }
  if (!run.waveform.empty()) out += "waveform = " + toml_string(run.waveform) + "\n";
  return out;
}

}  // namespace

Plan parse_plan(const std::string& text, const std::string& file) {
  const toml::table root = parse_toml(text, file);
  const TomlSection top(root, "", file, {"format", "reason", "separates", "run"});
  top.require_format("isac.plan/1");
  Plan plan;
  plan.reason = top.text("reason").value_or("");
  plan.separates = top.texts("separates");
  const auto runs = top.tables("run");
  if (runs.empty()) {
    top.fail("run", "section_missing",
             "the plan has no run; add one, with [[run]], experiment = \"constant-pressure\" and duration = "
             "\"60 s\"");
  }
  if (runs.size() > kMostRuns)
    fail_at(*runs[kMostRuns], file, "value_out_of_range",
            "is one run more than the 100 that a plan may hold; split it");
  for (const toml::table* table : runs) plan.runs.push_back(read_run(*table, file));
  return plan;
}

Plan read_plan(const std::filesystem::path& path) {
  return parse_plan(read_text_file(path), path.string());
}

std::string format_plan(const Plan& plan) {
  std::string out = "format = \"isac.plan/1\"\n";
  if (!plan.reason.empty()) out += "reason = " + toml_string(plan.reason) + "\n";
  if (!plan.separates.empty()) {
    out += "separates = [";
    for (std::size_t i = 0; i < plan.separates.size(); ++i)
      out += (i == 0 ? "" : ", ") + toml_string(plan.separates[i]);
    out += "]\n";
  }
  for (const PlanRun& run : plan.runs) out += run_text(run);
  return out;
}

void write_plan(const std::filesystem::path& path, const Plan& plan) {
  write_atomically(path, format_plan(plan), true);
}

}  // namespace isac::record
