// The step fit on recordings that nobody on this project made; the same defaults for all.
#include <gtest/gtest.h>

#include <array>

#include "isac/estimate/pcu_fit.hpp"
#include "real_columns.hpp"

namespace isac::estimate {
namespace {

PcuRun load(const std::string& file, std::size_t pressure, std::size_t command) {
  const auto columns = test::read_columns(test::real_data() + "/" + file);
  PcuRun run;
  run.name = file;
  if (columns.size() <= pressure) return run;
  run.time = columns[0];
  for (double p : columns[pressure]) run.pressure.push_back(1e3 * p);  // kPa in the files
  if (command > 0)
    for (double u : columns[command]) run.command.push_back(1e3 * u);
  return run;
}

class PcuReal : public ::testing::Test {
 protected:
  void SetUp() override {
    if (test::real_data().empty())
      GTEST_SKIP() << "set ISAC_REAL_DATA to the folder with real recordings to run this test";
  }
  static PcuFit fit(const std::string& file, std::size_t pressure, std::size_t command = 0) {
    const PcuFit f = fit_pcu(std::array{load(file, pressure, command)});
    const Estimated& lag = *f.find("T_C");
    std::printf("%s: T_C %.4f s [%.4f, %.4f], start %.4f s, rmse %.3g kPa, %s\n", file.c_str(), lag.value,
                lag.ci_low, lag.ci_high, f.steps[0].start.value, 1e-3 * f.rmse,
                f.steps[0].adequacy.sentence.c_str());
    return f;
  }
};

// Expected lags: an independent fit (SciPy, Nelder–Mead over lag and start) gave 0.04596, 0.52223, 0.40084 s.
TEST_F(PcuReal, regulator_step_to_300_kPa_has_a_lag_near_0_046_s) {
  const PcuFit f = fit("pam_valve_step_porcaro/step_measured.csv", 6, 3);
  EXPECT_NEAR(f.find("T_C")->value, 0.046, 0.001);
  EXPECT_FALSE(f.find("dead_time")->identifiable);  // the command stands from the first row on
  EXPECT_NEAR(f.steps[0].start.value, 0.038, 0.002);
}

TEST_F(PcuReal, fill_4_has_a_lag_near_0_52_s) {
  const PcuFit f = fit("festo20_fill/fill_4.csv", 1);
  EXPECT_NEAR(f.find("T_C")->value, 0.522, 0.005);
  EXPECT_TRUE(f.first_order);
}

TEST_F(PcuReal, fill_5_has_a_lag_near_0_40_s) {
  const PcuFit f = fit("festo20_fill/fill_5.csv", 1);
  EXPECT_NEAR(f.find("T_C")->value, 0.401, 0.005);
  EXPECT_TRUE(f.first_order);
}

TEST_F(PcuReal, fill_1_is_said_not_to_be_first_order) {
  const PcuFit f = fit("festo20_fill/fill_1.csv", 1);
  EXPECT_FALSE(f.first_order);
  EXPECT_EQ(f.steps[0].adequacy.best, StepShape::kFlowLimited);
  EXPECT_NE(f.steps[0].adequacy.sentence.find("constant slope"), std::string::npos);
}

}  // namespace
}  // namespace isac::estimate
