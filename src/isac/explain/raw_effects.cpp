#include "isac/explain/raw_effects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "isac/core/units.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/outliers.hpp"
#include "isac/explain/ranking.hpp"
#include "isac/explain/spectrum.hpp"
#include "isac/models/effects.hpp"

namespace isac::explain {
namespace {

constexpr double kMainsLow = 45, kMainsHigh = 65;  // Hz, as the catalogue has it
constexpr std::size_t kFewestSpikes = 5;
constexpr double kBesideNamed = 0.35;  // of the gap that the named effects closed
constexpr double kBesideUnknown =
    2;  // sizes of what is left unnamed: a line that is larger is what is missing
constexpr double kHunting =
    0.04;  // of the residual's power: a real regulator's noise has a line of 0.02, a valve that hunts 0.3
constexpr double kLooks = 3;  // lines of torque, of motion, and spikes share the significance

/// Mean square that something takes out of a residual; negative where it adds.
using Taken = std::function<double(const std::vector<Series>&)>;

struct RawEffect {
  Candidate candidate;
  Chain chain = Chain::kTorque;
  double rms = 0, p_value = 1;
  double frequency = kNotKnown;  ///< Hz
  Taken taken;
};

Candidate candidate_of(const char* id) {
  const auto& info = models::effect_catalogue()[static_cast<unsigned>(models::find_effect(id))];
  Candidate c;
  c.id = c.form = id;
  c.name = info.term;
  c.subsystem = subsystem_name(info.where);
  c.equation = info.equation;
  c.confidence = kSurest;
  for (int p = 0; p < info.parameter_count; ++p) {
    Estimated e;
    e.name = info.parameters[p].name;
    e.unit = info.parameters[p].unit;
    c.parameters.push_back(std::move(e));
  }
  return c;
}

void set(Estimated& e, double value, double error) {
  e.value = value;
  if (!std::isfinite(error)) return;
  e.std_error = error;
  e.ci_low = value - 1.96 * error;
  e.ci_high = value + 1.96 * error;
}

/// What a line of known frequency and amplitude takes out of runs; the phase as the head of this file says.
double taken_by_line(const SpectralLine& line, const std::vector<Series>& runs) {
  double squares = 0, count = 0;
  for (const Series& run : runs) {
    double sine = line.sine, cosine = line.cosine;
    if (!line.repeats) {
      const Phase phase = phase_in(run, line.frequency);
      sine = line.amplitude * phase.sine;
      cosine = line.amplitude * phase.cosine;
    }
    const double turn = 2 * kPi * line.frequency;
    for (std::size_t k = 0; k < run.value.size(); ++k) {
      const double y = run.value[k];
      if (!std::isfinite(y)) continue;
      const double at = turn * (run.start + static_cast<double>(k) * run.interval);
      const double left = y - sine * std::sin(at) - cosine * std::cos(at);
      squares += y * y - left * left;
      count += 1;
    }
  }
  return count > 0 ? squares / count : 0.0;
}

/// The readings whose single samples may be spikes: both forces, else the torque's residual.
struct Read {
  std::vector<const std::vector<double>*> readings;
  bool of_forces = false;
  double of_torque = 1;  ///< mean square in the torque for a mean square over the readings
};

Read readings_of(const std::vector<Series>& runs, double wheel_radius) {
  Read read;
  for (const Series& run : runs)
    for (const std::vector<double>& force : run.force)
      if (!force.empty()) read.readings.push_back(&force);
  if (!read.readings.empty()) {
    read.of_forces = true;
    read.of_torque = 2 * wheel_radius * wheel_radius;  // two readings for each sample of the torque
    return read;
  }
  for (const Series& run : runs) read.readings.push_back(&run.value);
  return read;
}

double quantum_of(const Read& read) {
  double least = std::numeric_limits<double>::infinity();
  for (const std::vector<double>* x : read.readings)
    for (std::size_t k = 1; k < x->size(); ++k) {
      const double change = std::abs((*x)[k] - (*x)[k - 1]);
      if (change > 1e-9 * std::abs((*x)[k]) && change > 0) least = std::min(least, change);
    }
  return std::isfinite(least) ? least : 0.0;
}

RawEffect hum_or_disturbance(const Predictor& predictor, const SpectralLine& line, Chain chain) {
  const RigFacts& rig = predictor.data().rig;
  const bool forces = predictor.data().baseline.terms.empty() && std::isfinite(rig.wheel_radius);
  const bool mains =
      forces && chain == Chain::kTorque && line.frequency >= kMainsLow && line.frequency <= kMainsHigh;
  RawEffect effect;
  effect.candidate = candidate_of(mains ? "mains_hum" : "periodic_disturbance");
  effect.chain = chain;
  effect.rms = line.rms;
  effect.p_value = line.p_value;
  effect.frequency = line.frequency;
  const double scale = mains ? 1 / rig.wheel_radius : 1.0;
  auto& p = effect.candidate.parameters;
  // Where the phase does not repeat there is no s and c; s then holds the amplitude.
  set(p[0], scale * (line.repeats ? line.sine : line.amplitude), scale * line.amplitude_error);
  set(p[1], scale * (line.repeats ? line.cosine : 0.0),
      line.repeats ? scale * line.amplitude_error : kNotKnown);
  set(p[2], line.frequency, kNotKnown);
  effect.candidate.evidence.push_back(
      {true, fmt::format(
                 "One line at {} Hz, {} {} in amplitude, stands out in {} runs (p {} over all frequencies); "
                 "it holds {:.0f} % of the residual's power there.",
                 rounded(line.frequency, 4), rounded(scale * line.amplitude), p[0].unit, line.runs,
                 line.p_value < 0.001 ? "< 0.001" : "= " + rounded(line.p_value, 2), 100 * line.share)});
  effect.candidate.evidence.push_back(
      {true, line.repeats
                 ? "Its phase is that of the run's clock; neither command nor motion has a line there."
                 : "Its phase differs from run to run: it is not locked to the command."});
  effect.taken = [line](const std::vector<Series>& runs) { return taken_by_line(line, runs); };
  return effect;
}

std::vector<RawEffect> look(const Predictor& predictor, const ModelPoint& model,
                            const ExplainOptions& options) {
  std::vector<RawEffect> all;
  const Prepared& data = predictor.data();
  const std::vector<Series> torque = residual_series(predictor, model, Chain::kTorque);
  for (const SpectralLine& line : spectral_lines(torque, options.significance / kLooks))
    all.push_back(hum_or_disturbance(predictor, line, Chain::kTorque));
  if (data.has(Chain::kMotion) && all.empty())
    for (SpectralLine line :
         spectral_lines(predictor, model, Chain::kMotion, options.significance / kLooks)) {
      const double turn = 2 * kPi * line.frequency * data.smoothing.motion;
      if (turn < 1.5) all.push_back(hum_or_disturbance(predictor, line, Chain::kMotion));
    }
  const double radius = data.rig.wheel_radius;
  if (!data.baseline.terms.empty() || !std::isfinite(radius)) return all;
  const Read read = readings_of(torque, radius);
  const Outliers spikes = find_outliers(read.readings, quantum_of(read));
  if (spikes.count < kFewestSpikes) return all;
  const double newton = read.of_forces ? 1 : 1 / radius;
  RawEffect effect;
  effect.candidate = candidate_of("spikes");
  effect.rms = std::sqrt(read.of_torque) * spikes.rms;
  effect.p_value = 0.001;
  const double count = static_cast<double>(spikes.count), n = static_cast<double>(spikes.samples);
  // Of a torque's samples either of two sensors may have made one.
  const double sensors = read.of_forces ? 1 : 2;
  set(effect.candidate.parameters[0], count / n / sensors,
      spikes.among_noise ? kNotKnown : std::sqrt(count) / n / sensors);
  set(effect.candidate.parameters[1], newton * spikes.height, kNotKnown);
  effect.candidate.evidence.push_back(
      {true, fmt::format("{} single samples of {} stand {} {} or more off their neighbours, {} {} in the "
                         "middle; noise with the {} own tails leaves hardly any.",
                         spikes.count, spikes.samples, rounded(spikes.limit), read.of_forces ? "N" : "N m",
                         rounded(spikes.height), read.of_forces ? "N" : "N m",
                         read.of_forces ? "readings'" : "residual's")});
  if (spikes.among_noise)
    effect.candidate.evidence.push_back(
        {false, "Smaller ones hide in the noise: there are more of them, and smaller, than these."});
  effect.taken = [limit = spikes.limit, radius](const std::vector<Series>& runs) {
    const Read there = readings_of(runs, radius);
    const Outliers o = count_outliers(there.readings, limit);
    return there.of_torque * o.rms * o.rms;
  };
  all.push_back(std::move(effect));
  return all;
}

/// The gap of one chain as the model leaves it; `floor` in the chain's unit.
Gap open_gap(const Predictor& predictor, const ModelPoint& model, const Proof& proof, Chain chain,
             double floor) {
  const Label label = label_of(predictor.data(), chain);
  const Sums heldout = proof.residual(model, chain);
  Gap gap;
  gap.signal = label.signal;
  gap.unit = label.unit;
  gap.noise_floor = label.scale * floor;
  gap.before = gap.after = label.scale * raw_residual(predictor, model, chain).rms();
  gap.heldout_before = gap.heldout_after = label.scale * heldout.rms();
  gap.heldout_zero_model = label.scale * heldout.signal_rms();
  return gap;
}

bool torque_shows(const Predictor& predictor, const ModelPoint& model, double frequency,
                  const ExplainOptions& options) {
  constexpr double kSame = 0.02;  // of the frequency
  const std::vector<SpectralLine> lines =
      spectral_lines(residual_series(predictor, model, Chain::kTorque), options.significance / kLooks);
  return std::any_of(lines.begin(), lines.end(), [&](const SpectralLine& line) {
    return std::abs(line.frequency - frequency) < kSame * frequency;
  });
}

/// A line that stands in the pressures and not in what was asked of them: a valve that hunts. The catalogue has no name for it, and what the
/// torque shows of it is no disturbance from outside.
bool valve_hunts(const Predictor& predictor, const ModelPoint& model, const Found& found, const Proof& proof,
                 const ExplainOptions& options, Explanation& e) {
  const Prepared& data = predictor.data();
  SpectralLine strongest;
  Chain chain = Chain::kPressure1;
  for (const Chain side : {Chain::kPressure1, Chain::kPressure2}) {
    if (!data.has(side)) continue;
    for (const SpectralLine& line : spectral_lines(predictor, model, side, options.significance / kLooks)) {
      if (line.frequency >= kMainsLow || line.rms <= strongest.rms) continue;
      strongest = line;
      chain = side;
    }
  }
  const double floor = found.floors.white[static_cast<int>(chain)];
  if (!(strongest.rms >= options.material * floor)) return false;
  if (strongest.share < kHunting && !torque_shows(predictor, model, strongest.frequency, options))
    return false;
  const Label label = label_of(data, chain);
  if (e.gap.signal != label.signal) e.gap = open_gap(predictor, model, proof, chain, found.floors.all(chain));
  e.verdict = Verdict::kUnknown;
  e.detected = true;
  e.p_value = std::min(e.p_value, strongest.p_value);
  Unknown unknown;
  unknown.subsystem = "pcu";
  unknown.signal = label.signal;
  unknown.unit = label.unit;
  unknown.depends_on = {"time"};
  unknown.variable = "time";
  unknown.variable_unit = "s";
  unknown.share = strongest.share;
  e.unknown = std::move(unknown);
  e.where.push_back(
      {"pcu", label.signal, "frequency", strongest.frequency, strongest.frequency, "Hz", strongest.share});
  e.trials.push_back(
      {"periodic_disturbance",
       fmt::format("ruled out: the pressure itself swings at {} Hz, {} {} in amplitude, and its command does "
                   "not; a valve that hunts",
                   rounded(strongest.frequency, 4), rounded(label.scale * strongest.amplitude), label.unit)});
  return true;
}

/// What the user took out of the catalogue is there all the same.
void leave_without_name(const RawEffect& effect, const Label& label, Explanation& e) {
  e.verdict = Verdict::kUnknown;
  e.detected = true;
  e.p_value = std::min(e.p_value, effect.p_value);
  Unknown unknown;
  unknown.subsystem = effect.candidate.subsystem;
  unknown.signal = label.signal;
  unknown.unit = label.unit;
  if (std::isfinite(effect.frequency)) {
    unknown.depends_on = {"time"};
    unknown.variable = "time";
    unknown.variable_unit = "s";
    e.where.push_back(
        {unknown.subsystem, label.signal, "frequency", effect.frequency, effect.frequency, "Hz", kNotKnown});
  }
  e.unknown = std::move(unknown);
  e.trials.push_back({effect.candidate.id, "found at the recording's rate, and not to be considered"});
}

double less(double rms, double mean_square) {
  return std::isfinite(rms) ? std::sqrt(std::max(0.0, rms * rms - mean_square)) : rms;
}

}  // namespace

bool is_mended_by_raw_effects(const Predictor& predictor, const Found& found, const Proof& proof, Chain chain,
                              const ExplainOptions& options, const Gap& gap) {
  const double scale = label_of(predictor.data(), chain).scale;
  double taken = 0;
  for (const RawEffect& effect : look(predictor, found.model.model, options))
    if (effect.chain == chain && effect.rms >= options.material * found.floors.white[static_cast<int>(chain)])
      taken += effect.taken(proof.series(found.model.model, chain));
  return less(gap.heldout_after, scale * scale * taken) <= gap.heldout_before;
}

void add_raw_effects(const Predictor& predictor, const Found& found, const Proof& proof,
                     const ExplainOptions& options, Explanation& e) {
  const ModelPoint& model = e.effects.empty() ? found.baseline.model : found.model.model;
  const bool unnamed = e.verdict == Verdict::kUnknown, in_valves = e.unknown && e.unknown->subsystem == "pcu";
  if (e.effects.empty() && (!unnamed || in_valves) && valve_hunts(predictor, model, found, proof, options, e))
    return;
  if (unnamed && (in_valves || found.steps.empty())) return;
  std::vector<RawEffect> effects = look(predictor, model, options);
  std::stable_sort(effects.begin(), effects.end(),
                   [](const RawEffect& a, const RawEffect& b) { return a.rms > b.rms; });
  // What functions of the signals make of a line is small beside the line.
  std::optional<Unknown> beside;
  if (unnamed) {
    if (effects.empty() ||
        effects.front().rms < kBesideUnknown * found.steps.front().gate.size *
                                  found.floors.white[static_cast<int>(effects.front().chain)])
      return;
    e.verdict = Verdict::kNone;
    beside = std::exchange(e.unknown, std::nullopt);
  }
  for (RawEffect& effect : effects) {
    const std::string id = effect.candidate.id;
    const auto is = [&](const Candidate& c) { return c.id == id; };
    if (std::any_of(e.effects.begin(), e.effects.end(), is)) continue;
    const bool may_be_named =
        std::find(options.excluded.begin(), options.excluded.end(), id) == options.excluded.end();
    if (!may_be_named && !e.effects.empty()) continue;
    const double floor = found.floors.white[static_cast<int>(effect.chain)],
                 told = found.floors.all(effect.chain);
    if (!(effect.rms >= options.material * floor)) continue;
    // Beside an effect that was named, a small line is what that effect's equation leaves over.
    const double named =
        e.effects.empty() ? 0.0
                          : std::sqrt(std::max(0.0, e.gap.before * e.gap.before - e.gap.after * e.gap.after));
    if (effect.rms < kBesideNamed * named) continue;
    const double fitted = effect.taken(residual_series(predictor, model, effect.chain));
    const double held = proof.runs() > 0 ? effect.taken(proof.series(model, effect.chain)) : fitted;
    if (fitted <= 0 || held <= 0) {
      e.trials.push_back({id, "significant on the fitted runs, but does not shrink the gap on the others"});
      continue;
    }
    const Label label = label_of(predictor.data(), effect.chain);
    if (!may_be_named) {
      leave_without_name(effect, label, e);
      return;
    }
    if (e.effects.empty() && e.gap.signal != label.signal)
      e.gap = open_gap(predictor, model, proof, effect.chain, told);
    if (e.gap.signal == label.signal) {
      e.gap.after = less(e.gap.after, fitted);
      e.gap.heldout_after = less(e.gap.heldout_after, held);
      const double open = e.gap.heldout_before * e.gap.heldout_before - told * told;
      if (open > 0) e.gap.share_closed = 1 - (e.gap.heldout_after * e.gap.heldout_after - told * told) / open;
      e.waterfall.push_back({effect.candidate.name, e.gap.after, e.gap.heldout_after});
    }
    effect.candidate.evidence.push_back(
        {true, fmt::format("It takes {} {} rms out of the {} on runs that were never fitted.",
                           rounded(std::sqrt(held)), label.unit, label.signal)});
    const double all = e.gap.before * e.gap.before - e.gap.after * e.gap.after;
    if (e.gap.signal == label.signal && all > 0) effect.candidate.closes = std::clamp(fitted / all, 0.0, 1.0);
    if (std::isfinite(effect.frequency))
      e.where.push_back({effect.candidate.subsystem, label.signal, "frequency", effect.frequency,
                         effect.frequency, "Hz", effect.candidate.closes});
    e.trials.push_back({id, fmt::format("found at the recording's rate: {} times the noise floor",
                                        rounded(effect.rms / floor, 2))});
    e.effects.push_back(std::move(effect.candidate));
    e.p_value = std::min(e.p_value, effect.p_value);
    e.detected = true;
    if (e.verdict == Verdict::kNone || e.verdict == Verdict::kImmaterial) e.verdict = Verdict::kNamed;
  }
  if (unnamed && e.verdict == Verdict::kNone) {  // the line was none after all
    e.verdict = Verdict::kUnknown;
    e.unknown = std::move(beside);
  }
}

}  // namespace isac::explain
