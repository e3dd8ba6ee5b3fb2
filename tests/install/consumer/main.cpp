// A program outside the tree: reads a recording and a rig, fits, and prints what it found.
#include <cstdio>

#include "isac/estimate/joint_fit.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/record/rig.hpp"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const isac::record::Rig rig = isac::record::read_rig(argv[1]);
  const isac::series::Recording recording = isac::record::read_recording(argv[2]);
  isac::estimate::JointRun run;
  run.name = recording.source;
  run.time = recording.column("time").values;
  run.angle = recording.column("angle").values;
  const auto& p1 = recording.column("p1").values;
  const auto& p2 = recording.column("p2").values;
  for (std::size_t i = 0; i < p1.size(); ++i) {
    run.delta_pressure.push_back(0.5 * (p2[i] - p1[i]));
    run.mean_pressure.push_back(0.5 * (p2[i] + p1[i]));
  }
  run.output = recording.column("torque").values;
  isac::estimate::JointFitOptions options;
  options.terms = {"A", "D"};
  options.wheel_radius = rig.joint.wheel_radius;
  const isac::estimate::JointFit fit = isac::estimate::fit_joint({&run, 1}, {}, options);
  std::printf("A %.6g N/m, D %.6g N m s\n", fit.parameters[0].value, fit.parameters[1].value);
  return 0;
}
