/// @file
/// What isac-explain finds: where simulation and measurement disagree, what is missing, how much it closes, what to record.
///
/// Values only, for the program, the report and the parameters; made by explain() (explain.hpp).
/// Units: every number stands beside its unit; torque in N m, pressure in kg/cm2 (kgf/cm²), angle in rad, as the answer
/// prints them. NaN: not known. Threads: values. Errors: none.
/// Source: docs/explain.md, docs/formats.md (`isac.explain/1`).
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "isac/core/estimated.hpp"

namespace isac::explain {

inline constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

enum class Verdict {
  kNone,          ///< nothing is missing
  kImmaterial,    ///< something is there, too small to matter
  kNamed,         ///< one effect (or several, one after another), each without a rival
  kFamily,        ///< rivals are left, all of one family
  kNotSeparable,  ///< rivals of several families are left: the next experiment tells them apart
  kUnknown,       ///< none of the catalogue
};
[[nodiscard]] const char* to_string(Verdict verdict) noexcept;  ///< as in the answer: "not_separable"

/// One measured signal and how far the baseline (after its refit) is from it.
struct SignalGap {
  std::string signal;  ///< "torque", "p1", "p2", "motion" (the balance I φ̈ = T of the free joint)
  std::string unit;
  double rmse = kNotKnown;         ///< of the baseline, on the fitted runs
  double noise_floor = kNotKnown;  ///< standard deviation of what is not repeatable, from the data
  double p_value = 1;              ///< of "the residual is noise", over the whole search
  double after = kNotKnown;        ///< rmse with the effects added
  double heldout = kNotKnown;  ///< rmse of the baseline, fitted by plain least squares, on the held-out runs
  std::string
      floor_from;  ///< "repeats", "holds", "differences" (with the slow part, where there is one), "data sheet"
};

/// A region in which the disagreement sits.
struct Region {
  std::string subsystem;  ///< "muscle", "pcu", "joint", "sensor"
  std::string signal, variable;
  double low = kNotKnown, high = kNotKnown;  ///< of the variable
  std::string unit;
  double share = kNotKnown;  ///< of the signal's explainable squared residual
};

struct Evidence {
  bool supports = true;
  std::string sentence;
};

/// A candidate that was refitted together with the baseline.
struct Candidate {
  std::string id, name;   ///< of the catalogue
  std::string form;       ///< the catalogue's entry whose equation it is: `id`, or another form of it
  std::string subsystem;  ///< "muscle", "joint", "pcu", "sensor", "rig"
  std::string equation;
  double confidence = kNotKnown;      ///< calibrated (docs/explain.md)
  std::vector<Estimated> parameters;  ///< in reporting units
  double behind_best = 0;             ///< sigma by which it fits worse than the best; 0 for the best
  double closes = kNotKnown;          ///< share of the explainable squared residual
  double missed_by = kNotKnown;  ///< of what was added: sigma of data that a model refitted without it lacks
  std::vector<Evidence> evidence;  ///< sentences for and against
};

struct Unknown {
  std::string subsystem, signal;
  std::vector<std::string>
      depends_on;  ///< "angle", "velocity", "delta_pressure", "mean_pressure", "time", "memory"
  std::vector<std::string> independent;  ///< variables that were tried and do not matter
  double share = kNotKnown;              ///< of the explainable squared residual that the shape takes
  /// The shape over its first variable: centre of the bin, mean residual, half width of the 95 % band.
  std::vector<double> at, shape, band;
  std::string variable, variable_unit, unit;
};

struct CouldHide {
  std::string id;
  double size = kNotKnown;  ///< of the effect's first parameter: 95 % upper bound of what the data could hide
  std::string unit;
};

/// One run of a plan: what `isac-log --plan` holds and sweeps. Units as named.
struct PlannedRun {
  std::string experiment{};  ///< "constant-pressure", "constant-angle", "free", "pcu-step"
  double seconds = 30;
  double delta_pressure_kgcm2 = 0, mean_pressure_kgcm2 = kNotKnown;
  double amplitude_rad = 0.4, middle_rad = kNotKnown, peak_speed_rad_s = 1;
  double pressure_swing_kgcm2 = 0, pressure_period_s = 8;
  std::string waveform{};  ///< of the commanded pressure or the sweep: "triangle", "sine", "steps", "hold"
};

struct NextExperiment {
  std::string sentence;          ///< for the person at the rig
  std::vector<PlannedRun> runs;  ///< empty where only a change of the rig helps
  std::string separates_a, separates_b;
  double separation_now = kNotKnown, separation_expected = kNotKnown;  ///< sigma
};

struct Gap {
  std::string signal, unit;
  double before = kNotKnown, after = kNotKnown;
  /// As the signal's own; where an adequate model leaves more of the fitted runs (noise that remembers), that.
  double noise_floor = kNotKnown;
  double heldout_before = kNotKnown, heldout_after = kNotKnown;
  double heldout_zero_model = kNotKnown;  ///< rms of the signal itself: the model that says 0
  double share_closed = kNotKnown;        ///< 1 − (after² − floor²)/(before² − floor²), held-out
  /// Held-out too, freed of what the noise remembers; known only where its slow part decides which plain rms is larger. The share is of
  /// these then.
  double freed_before = kNotKnown, freed_after = kNotKnown;
};

/// One step of the waterfall: the gap after this effect was added.
struct WaterfallStep {
  std::string label;
  double rmse = kNotKnown, heldout_rmse = kNotKnown;
};

/// A base parameter before and after: "D fell by 31 %: it had stood in for friction".
struct BaseChange {
  std::string name, unit;
  double before = kNotKnown, after = kNotKnown;
  std::string sentence;
};

/// Columns for the pictures, decimated; one per run and signal.
struct RunTrace {
  std::string run, signal, unit;
  bool heldout = false;
  std::vector<double> time, measured, before, after;  ///< predictions of the baseline and with the effects
  std::vector<double> angle, velocity, delta_pressure, mean_pressure;  ///< rad, rad/s, kg/cm2; may be empty
};

/// What was tried, in order, for the reader who doubts.
struct TrialNote {
  std::string id, sentence;
};
/// How the sentence of a trial ends that is no effect.
inline constexpr const char* kLeftToTheRecorder = "it is how the recorder counts, and is left to that";

struct Explanation {
  Verdict verdict = Verdict::kNone;
  std::string summary;  ///< the verdict in one to three sentences
  bool detected = false;
  double p_value = 1;  ///< over the whole search
  std::vector<SignalGap> signals;
  std::vector<Region> where;
  std::vector<Candidate>
      effects;  ///< what was named, and added where `withheld` is empty, in the order added
  /// What the held-out runs say against adding what was named, as a clause: they are further off with it, and neither is that the doing of the
  /// noise's slow part nor is it enough to refute the name. Then all numbers are those of the baseline but the effects' own.
  std::string withheld;
  std::vector<Candidate> alternatives;  ///< what the data cannot rule out, best first
  std::vector<std::string>
      doubts;  ///< sentences: why what was added may be none of the catalogue; then the last alternative is "unknown"
  std::vector<Candidate> rejected;  ///< near candidates that were ruled out, nearest first
  std::optional<Unknown> unknown;
  std::vector<std::string> not_testable;
  std::vector<CouldHide> could_hide;
  std::optional<NextExperiment> next_experiment;
  Gap gap;
  std::vector<WaterfallStep> waterfall;
  std::vector<Estimated> base;  ///< the baseline's parameters with the effects added
  std::vector<BaseChange> base_changes;
  std::vector<RunTrace> traces;
  std::vector<TrialNote> trials;
  Warnings warnings;
  std::size_t samples = 0, blocks = 0, fitted_runs = 0, heldout_runs = 0;
  double seconds = 0, block_seconds = 0;  ///< of recording; of a block

  /// Is the model another than the baseline?
  [[nodiscard]] bool adds() const noexcept { return !effects.empty() && withheld.empty(); }
};

}  // namespace isac::explain
