#include "explain/plan.hpp"

#include "isac/core/units.hpp"

namespace isac::apps {

series::Plan plan_of(const explain::Explanation& answer) {
  series::Plan plan;
  if (!answer.next_experiment) return plan;
  const explain::NextExperiment& next = *answer.next_experiment;
  plan.reason = next.sentence;
  for (const std::string& id : {next.separates_a, next.separates_b})
    if (!id.empty()) plan.separates.push_back(id);
  for (const explain::PlannedRun& run : next.runs) {
    plan.runs.push_back({.experiment = run.experiment,
                         .duration = run.seconds,
                         .delta_pressure = run.delta_pressure_kgcm2 * kPascalPerKgfCm2,
                         .mean_pressure = run.mean_pressure_kgcm2 * kPascalPerKgfCm2,
                         .amplitude = run.amplitude_rad,
                         .middle = run.middle_rad,
                         .peak_speed = run.peak_speed_rad_s,
                         .pressure_swing = run.pressure_swing_kgcm2 * kPascalPerKgfCm2,
                         .pressure_period = run.pressure_period_s,
                         .waveform = run.waveform});
  }
  return plan;
}

}  // namespace isac::apps
