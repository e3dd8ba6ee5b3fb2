#include "identify/inputs.hpp"

#include "isac/core/error.hpp"
#include "isac/series/derive.hpp"

namespace isac::apps {

estimate::JointRun joint_run(const series::Recording& recording, const JointSignals& signals) {
  estimate::JointRun run;
  run.name = short_name(recording.source);
  run.experiment = recording.meta("experiment");
  run.sha256 = recording.sha256;
  run.time = recording.column("time").values;
  run.angle = recording.column(signals.position).values;
  if (signals.position == "angle") {
    if (const series::Column* velocity = recording.find("velocity")) run.velocity = velocity->values;
  }

  if (signals.needs_pressure) {
    const auto& p1 = recording.column("p1").values;
    const auto& p2 = recording.column("p2").values;
    run.delta_pressure = series::pressure_difference(p1, p2);
    run.mean_pressure = series::mean_pressure(p1, p2);
  }

  const series::Column* output = recording.find(signals.output);
  if (output != nullptr) {
    run.output = output->values;
  } else if (signals.output == "torque" && recording.find("F1") != nullptr &&
             recording.find("F2") != nullptr) {
    if (!(signals.wheel_radius > 0)) {
      throw Error(ErrorKind::kBadInput, "wheel_missing",
                  "has forces but no torque, and no chain wheel is known; give --rig rig.toml with "
                  "chain_wheel_diameter",
                  {recording.source, 0, 0});
    }
    run.output = series::torque_from_forces(recording.column("F1").values, recording.column("F2").values,
                                            signals.wheel_radius);
  } else {
    run.output = recording.column(signals.output).values;  // throws and names what is missing
  }
  return run;
}

}  // namespace isac::apps
