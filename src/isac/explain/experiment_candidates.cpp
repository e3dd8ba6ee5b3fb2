#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "isac/core/units.hpp"
#include "isac/explain/experiment_runs.hpp"

namespace isac::explain {
namespace {

constexpr double kTaut = 5;              // N that keep a muscle and its sensor taut
constexpr double kMoving = 0.05;         // rad/s
constexpr double kPlannedOfLimit = 0.9;  // a planned motion stays this far inside

/// rad either way of rest that leave both muscles taut and both force sensors within their range, between two mean pressures; a tenth is
/// kept for what moves besides. Negative where a muscle hangs slack at rest.
double bearable_amplitude(const RigRange& range, const RigFacts& rig, double lowest, double highest) {
  constexpr double kShare = 0.9;
  if (!(range.mean_force > 0) || !(range.stiffness > 0)) return range.angle;
  const double spare = std::min(range.common_force(lowest) - range.least_force,
                                range.force_limit - range.common_force(highest));
  return kShare * 2 * rig.wheel_radius * spare / range.stiffness;
}

/// How the mean force of the muscles follows the mean pressure: as recorded where that varied and both muscles pulled, else as the model
/// says of Δp, which is one muscle's pressure against the other's (B/2 for each). A slack muscle's force does not follow.
void find_forces(const Predictor& predictor, const ModelPoint& model, RigRange& range) {
  constexpr double kVaried = 0.1 * kPascalPerKgfCm2;  // Pa, a standard deviation
  double n = 0, p = 0, f = 0, pp = 0, pf = 0;
  for (const PreparedRun& run : predictor.data().runs) {
    if (run.force[0].empty() || !run.has_pressure) continue;
    for (std::size_t k = 0; k < run.time.size(); ++k) {
      const double pressure = 0.5 * (run.raw_pressure[0][k] + run.raw_pressure[1][k]),
                   force = 0.5 * (run.force[0][k] + run.force[1][k]);
      if (!std::isfinite(pressure) || !std::isfinite(force)) continue;
      if (std::min(run.force[0][k], run.force[1][k]) < range.least_force) continue;
      n += 1;
      p += pressure;
      f += force;
      pp += pressure * pressure;
      pf += pressure * force;
    }
  }
  if (n == 0) return;
  range.mean_pressure = p / n;
  range.mean_force = f / n;
  const double variance = pp / n - range.mean_pressure * range.mean_pressure;
  range.force_slope = variance > kVaried * kVaried
                          ? (pf / n - range.mean_pressure * range.mean_force) / variance
                          : 0.5 * base_value(predictor, model, "B", 0.0);
}

}  // namespace

RigRange range_of(const Predictor& predictor, const ModelPoint& model,
                  const series::ExcitationOptions& limits) {
  const Prepared& data = predictor.data();
  RigRange range;
  range.limits = limits;
  double farthest = 0, fastest = 0, force = 0;
  range.least_force = kTaut;
  bool driven = false, motion = false;
  for (const PreparedRun& run : data.runs) {
    driven = driven || (run.has_torque && run.has_pressure && !run.is_free);
    for (std::size_t k = 0; k < run.angle.size(); ++k) {
      farthest = std::max(farthest, std::abs(run.angle[k]));
      fastest = std::max(fastest, std::abs(run.velocity[k]));
    }
    if (!run.time.empty()) range.day_offset = std::max(range.day_offset, run.day_offset + run.time.back());
    if (run.interval > 0) range.row_spacing = run.interval * data.stride;
    if (run.force[0].empty() || !run.has_pressure) continue;
    for (std::size_t k = 0; k < run.time.size(); ++k) {
      force = std::max({force, run.force[0][k], run.force[1][k]});
      // A vented muscle in a clamped run says nothing of a slack one that is led.
      if (std::abs(run.velocity[k]) > kMoving)
        range.least_force = std::min({range.least_force, run.force[0][k], run.force[1][k]});
    }
  }
  for (const Row& row : data.rows) {
    range.valves = range.valves || row.chain == Chain::kPressure1;
    motion = motion || row.chain == Chain::kMotion;
    range.free_torque = range.free_torque || (row.chain == Chain::kTorque && data.runs[row.run].is_free);
  }
  range.free_torque = range.free_torque || !driven;
  range.day_offset += 60;
  range.moves_freely = std::isfinite(data.rig.inertia) && data.rig.inertia > 0;
  range.angle = std::clamp(1.1 * farthest, 0.25, kPlannedOfLimit * limits.angle_limit);
  range.speed = std::clamp(1.1 * fastest, 2.0, limits.speed_limit);
  find_forces(predictor, model, range);
  const double r = data.rig.wheel_radius;
  range.stiffness = std::max(0.0, -base_value(predictor, model, "A", 0.0) * r * r);
  range.force_limit = std::max(limits.force_limit, force);
  if (!motion && range.moves_freely && std::isfinite(data.rig.angle_step)) {
    // White noise of deviation s leaves s √(3/(8 √π)) σ^−5/2 √Δt of itself in a second derivative by a Gaussian of σ.
    const double white = data.rig.angle_step / std::sqrt(12.0);
    range.free_row_noise = data.rig.inertia * white * std::sqrt(3 / (8 * std::sqrt(kPi))) *
                           std::pow(data.smoothing.motion, -2.5) * std::sqrt(range.row_spacing / data.stride);
  }
  return range;
}

std::vector<PlannedRun> candidate_runs(const RigRange& range, const RigFacts& rig) {
  constexpr double kPlain = 20, kLong = 60;  // s
  const double p0 = rig.initial_pressure / kPascalPerKgfCm2, far = 0.85 * range.angle;
  // From where the torque is nothing, the mean pressure moving by `swing` either way.
  const auto within = [&](double amplitude, double mean_kgcm2, double swing_kgcm2 = 0) {
    return std::min(amplitude, bearable_amplitude(range, rig, (mean_kgcm2 - swing_kgcm2) * kPascalPerKgfCm2,
                                                  (mean_kgcm2 + swing_kgcm2) * kPascalPerKgfCm2));
  };
  std::vector<PlannedRun> runs;
  const auto add = [&](PlannedRun run) {
    constexpr double kLeast = 0.02;  // rad: an encoder sees little of less
    if (run.amplitude_rad < kLeast) return;
    if (run.experiment == "constant-pressure")
      run.peak_speed_rad_s = std::min(run.peak_speed_rad_s, 0.9 * fastest_by_hand(run.amplitude_rad));
    run.seconds = std::max(run.seconds, std::min(kLong, least_seconds(run)));
    runs.push_back(run);
  };
  const double levels[] = {0.55 * p0, 0.75 * p0, p0, 1.2 * p0, 1.4 * p0};
  // By hand, at constant pressures and with the mean pressure moving.
  const double speeds[] = {0.04, 0.15, 0.5, 1.5, 0.9 * range.speed};
  for (const double mean : levels)
    for (const double speed : speeds)
      add({.experiment = "constant-pressure",
           .seconds = kPlain,
           .mean_pressure_kgcm2 = mean,
           .amplitude_rad = within(far, mean),
           .peak_speed_rad_s = speed,
           .waveform = "hold"});
  for (const double speed : {0.03, 0.1, 0.4, 1.5})
    for (const double part : {0.1, 0.35})
      add({.experiment = "constant-pressure",
           .seconds = kPlain,
           .mean_pressure_kgcm2 = p0,
           .amplitude_rad = within(part * far, p0),
           .peak_speed_rad_s = speed,
           .waveform = "hold"});
  for (const double speed : {0.15, 0.6, 0.8 * range.speed})
    for (const double difference : {-1.2, -0.6, 0.6, 1.2})
      add({.experiment = "constant-pressure",
           .seconds = kPlain,
           .delta_pressure_kgcm2 = difference,
           .mean_pressure_kgcm2 = p0,
           .amplitude_rad = within(0.6 * far, p0),
           .peak_speed_rad_s = speed,
           .waveform = "hold"});
  for (const double speed : {0.15, 0.6, 0.8 * range.speed})
    for (const char* waveform : {"triangle", "steps"})
      add({.experiment = "constant-pressure",
           .seconds = kPlain,
           .mean_pressure_kgcm2 = p0,
           .amplitude_rad = within(far, p0, 0.35 * p0),
           .peak_speed_rad_s = speed,
           .pressure_swing_kgcm2 = 0.35 * p0,
           .pressure_period_s = 10,
           .waveform = waveform});
  // Clamped: Δp about nothing.
  struct Wave {
    const char* waveform;
    double period;
  };
  for (const double at : {0.0, 0.45, -0.45, 0.9, -0.9})
    for (const Wave wave : {Wave{"triangle", 8}, Wave{"steps", 4}, Wave{"sine", 1}, Wave{"sine", 0.25}})
      for (const double swing : {0.4, 1.5}) {
        if (swing < 1 && at != 0) continue;
        add({.experiment = "constant-angle",
             .seconds = kPlain,
             .mean_pressure_kgcm2 = p0,
             .middle_rad = at * far,
             .pressure_swing_kgcm2 = swing,
             .pressure_period_s = wave.period,
             .waveform = wave.waveform});
      }
  for (const double mean : {0.6 * p0, 1.3 * p0})
    for (const double at : {-0.6, 0.6})
      add({.experiment = "constant-angle",
           .seconds = kPlain,
           .mean_pressure_kgcm2 = mean,
           .middle_rad = at * far,
           .pressure_swing_kgcm2 = 0.4 * p0,
           .pressure_period_s = 8,
           .waveform = "triangle"});
  // Free: decay after steps, broadband, tones.
  if (range.moves_freely)
    for (const double mean : {0.7 * p0, p0, 1.25 * p0})
      for (const double swing : {0.25, 0.8})
        for (const Wave wave : {Wave{"steps", 5}, Wave{"steps", 1.2}, Wave{"triangle", 8}, Wave{"sine", 2},
                                Wave{"sine", 0.7}, Wave{"sine", 0.25}})
          add({.experiment = "free",
               .seconds = kPlain,
               .mean_pressure_kgcm2 = mean,
               .pressure_swing_kgcm2 = swing,
               .pressure_period_s = wave.period,
               .waveform = wave.waveform});
  // The valve unit, both muscles together.
  if (range.valves)
    for (const double mean : {0.7 * p0, 1.1 * p0})
      for (const double swing : {0.05, 0.25, 1.0, 1.7})
        for (const Wave wave : {Wave{"steps", 4}, Wave{"steps", 0.6}, Wave{"triangle", 10}, Wave{"sine", 0.5},
                                Wave{"sine", 0.15}})
          add({.experiment = "pcu-step",
               .seconds = kPlain,
               .mean_pressure_kgcm2 = mean,
               .pressure_swing_kgcm2 = swing,
               .pressure_period_s = wave.period,
               .waveform = wave.waveform});
  // Long holds, for what is slow.
  for (const char* experiment : {"constant-angle", "free", "constant-pressure"}) {
    if (std::string_view(experiment) == "free" && !range.moves_freely) continue;
    for (const double period : {30.0, 80.0})
      add({.experiment = experiment,
           .seconds = kLong,
           .mean_pressure_kgcm2 = p0,
           .amplitude_rad = within(far, p0, 0.8),
           .middle_rad = std::string_view(experiment) == "constant-angle" ? 0.5 * far : kNotKnown,
           .peak_speed_rad_s = 0.4,
           .pressure_swing_kgcm2 = 0.8,
           .pressure_period_s = period,
           .waveform = "steps"});
  }
  return runs;
}

}  // namespace isac::explain
