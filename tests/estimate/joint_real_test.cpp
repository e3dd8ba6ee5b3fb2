// EMPS: a motor-driven axis (Janot, Gautier, Brunot 2019), 1 kHz, with the published parameters of F = M a + Fv v + Fc sgn v + c.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "isac/estimate/joint_fit.hpp"
#include "isac/record/csv_reader.hpp"

using namespace isac;

namespace {

estimate::JointRun read(const std::string& path) {
  const series::Recording recording = record::read_recording(path);
  estimate::JointRun run;
  run.name = path;
  run.time = recording.column("time").values;
  run.angle = recording.column("position").values;
  run.output = recording.column("force_motor").values;
  return run;
}

}  // namespace

TEST(JointReal, emps_gives_the_published_parameters_by_default) {
  const char* folder = std::getenv("ISAC_REAL_DATA");
  if (folder == nullptr) GTEST_SKIP() << "ISAC_REAL_DATA does not name the folder of real recordings";
  const std::string emps = std::string(folder) + "/emps/";
  estimate::JointFitOptions options;
  options.terms = {"inertia", "viscous_damping", "coulomb_friction", "offset"};
  options.output_unit = "N";
  options.position_unit = "m";
  const auto fit = estimate::fit_joint(std::vector{read(emps + "data_emps.csv")},
                                       std::vector{read(emps + "data_emps_pulses.csv")}, options);
  ASSERT_EQ(fit.parameters.size(), 4u);
  const double published[4] = {95.11, 203.50, 20.394, -3.165}, share[4] = {0.02, 0.03, 0.05, 0.10};
  const char* units[4] = {"kg", "N s/m", "N", "N"};
  for (std::size_t k = 0; k < 4; ++k) {
    const Estimated& e = fit.parameters[k];
    ASSERT_TRUE(e.identifiable) << e.reason;
    EXPECT_EQ(e.unit, units[k]);
    EXPECT_NEAR(e.value, published[k], share[k] * std::abs(published[k])) << e.name;
    std::printf("%s = %.5g +- %.2g %s (published %.5g)\n", e.name.c_str(), e.value, e.std_error,
                e.unit.c_str(), published[k]);
  }
  std::printf("rmse %.3g N on the fitted record, %.3g N on the pulses record\n", fit.rmse, fit.heldout_rmse);
  // The pulses record carries force pulses that are not in force_motor; the drive reaches 100 N.
  EXPECT_LT(fit.rmse, 5.0);
  EXPECT_LT(fit.heldout_rmse, 15.0);
}
