// The calibration circle as a person walks it: levels recorded on a rig whose gains and zeros nobody knows, the rig file made
// from them, and a joint fitted with it (docs/how-to/calibrate.md).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "isac/record/csv_reader.hpp"
#include "isac/record/rig.hpp"
#include "isac/simulate/rig_config.hpp"
#include "run_program.hpp"

namespace isac {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCard = "sim:miscalibrated=on,seed=7";

class Calibrate : public testing::Test {
 protected:
  Calibrate() {
    std::ofstream(folder_ / "rig.toml") << "format = \"isac.rig/1\"\nname = \"testbed\"\n\n[joint]\n"
                                           "chain_wheel_diameter = \"38 mm\"\n"
                                           "initial_pressure = \"3.0 kg/cm2\"\ninertia = \"0.0085 kg m2\"\n";
  }
  [[nodiscard]] test::Run log_levels(std::vector<std::string> more = {}) const {
    std::vector<std::string> words = {
        "isac-log",           "calibrate", "--card",           kCard,        "--rig",
        folder_ / "rig.toml", "-o",        folder_ / "levels", "--duration", "2 s"};
    words.insert(words.end(), more.begin(), more.end());
    return test::run_program(words);
  }
  [[nodiscard]] test::Run identify(std::vector<std::string> words) const {
    words.insert(words.begin(), "isac-identify");
    return test::run_program(words);
  }
  /// A and B by sweeps recorded and fitted with one rig file.
  [[nodiscard]] nlohmann::json joint_with(const std::string& rig, const std::string& name) const {
    const test::Run log = test::run_program({"isac-log", "constant-pressure", "--card", kCard, "--rig", rig,
                                             "-o", folder_ / name, "--delta-pressure", "-1,0,1 kg/cm2"});
    EXPECT_EQ(log.exit_code, 0) << log.out << log.err;
    const test::Run fit =
        identify({"joint", folder_ / name, "--rig", rig, "--json", folder_ / (name + ".json")});
    EXPECT_TRUE(fit.exit_code == 0 || fit.exit_code == 1) << fit.err;  // 1: the fit itself says no
    return nlohmann::json::parse(test::read_text(folder_ / (name + ".json")))["parameters"];
  }
  test::ScratchFolder folder_;
};

record::RigChannel channel(const record::Rig& rig, const std::string& signal) {
  for (const record::RigChannel& one : rig.calibration)
    if (one.signal == signal) return one;
  ADD_FAILURE() << "no channel for " << signal;
  return {};
}

TEST_F(Calibrate, recovers_every_gain_and_zero_of_a_rig_and_then_its_joint) {
  const test::Run levels = log_levels();
  ASSERT_EQ(levels.exit_code, 0) << levels.out << levels.err;
  const test::Run run =
      identify({"calibrate", folder_ / "levels", "-o", folder_ / "calibrated.toml", "--report",
                folder_ / "calibration.html", "--json", folder_ / "calibration.json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  simulate::RigConfig config;  // of kCard
  config.seed = 7;
  config.miscalibrated = true;
  const simulate::Wiring truth = simulate::wiring_of(config);
  const record::Rig rig = record::read_rig(folder_ / "calibrated.toml");
  for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
    const std::string n = std::to_string(i + 1);
    // Two seconds of 0.3 N (6 counts), half of it slow over 20 ms, give a mean to 0.6 count: 0.02 % of 3000 counts at the
    // weight. Five of those.
    EXPECT_NEAR(channel(rig, "F" + n).gain / truth.force[i].gain, 1, 1e-3);
    EXPECT_NEAR(channel(rig, "F" + n).offset, truth.force[i].offset, 3);
    // 0.004 kg/cm² are 1.6 counts: 0.16 count a level, 0.01 % of 2048 counts. Five of those.
    EXPECT_NEAR(channel(rig, "p" + n).gain / truth.pressure[i].gain, 1, 5e-4);
    EXPECT_NEAR(channel(rig, "p" + n).offset, truth.pressure[i].offset, 0.8);
    // A valve is known as well as the sensor that watches it: 0.8 count of it are 1.6 codes.
    const record::RigChannel valve = channel(rig, "p" + n + "_cmd");
    EXPECT_NEAR(valve.gain / truth.valve[i].gain, 1, 1e-3);
    EXPECT_NEAR(valve.offset, truth.valve[i].offset, 2);
  }
  // A count is the floor of the angle, so half a step below it, and Δp known to 0.001 kg/cm² is half a step.
  EXPECT_NEAR(channel(rig, "angle").offset, truth.encoder_middle - 0.5, 1);
  const auto answer = nlohmann::json::parse(test::read_text(folder_ / "calibration.json"));
  EXPECT_EQ(answer["schema"], "isac.calibration/1");
  EXPECT_GT(fs::file_size(folder_ / "calibration.html"), 10000u);

  const auto calibrated = joint_with(folder_ / "calibrated.toml", "calibrated");
  // The force gain carries 0.05 %, the pressure gain 0.02 %; the fit itself is within 0.1 % on an ideal rig.
  EXPECT_NEAR(calibrated["A"]["value"].get<double>() / -23450.0, 1, 5e-3);
  EXPECT_NEAR(calibrated["B"]["value"].get<double>() / 174.2, 1, 5e-3);
  const auto plain = joint_with(folder_ / "rig.toml", "plain");
  // What gains off by up to 3 % and a zero off by up to 18 degrees do: at least four times the tolerance above, or a refusal.
  const auto off = [&plain](const char* name, double expected) {
    const auto& value = plain[name]["value"];
    return value.is_null() ? 1.0 : std::abs(value.get<double>() / expected - 1);
  };
  EXPECT_GT(std::max(off("A", -23450.0), off("B", 174.2)), 0.02) << plain.dump(1);
}

TEST_F(Calibrate, records_each_level_with_its_counts_and_what_it_is_a_level_of) {
  ASSERT_EQ(log_levels({"--weight", "50,149.1 N", "--supply", "0,5 kg/cm2"}).exit_code, 0);
  const auto read = [this](const std::string& name) {
    return record::read_recording(fs::path(folder_ / "levels") / (name + ".csv"));
  };
  EXPECT_EQ(read("calibration-force_0N").meta("calibration"), "F1 = 0 N, F2 = 0 N");
  EXPECT_EQ(read("calibration-F2_50N").meta("calibration"), "F2 = 50 N");
  EXPECT_EQ(read("calibration-pressure_5.00").meta("calibration"), "p1 = 5 kg/cm2, p2 = 5 kg/cm2");
  EXPECT_EQ(read("calibration-middle_2").meta("calibration"), "angle = middle -");
  const series::Recording valve = read("calibration-valve_4095");
  EXPECT_EQ(valve.meta("experiment"), "calibration");
  for (const char* name : {"enc0", "ai0", "ai4", "ao0", "ao1", "p1", "F1"})
    EXPECT_NE(valve.find(name), nullptr) << name;
  for (const double code : valve.column("ao1").values) ASSERT_EQ(code, 4095);
  const series::Recording weight = read("calibration-F2_50N");
  for (const double code : weight.column("ao0").values) ASSERT_EQ(code, 0);  // vented
  const test::Run run = identify({"calibrate", folder_ / "levels", "--json", "-"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.out.find("F1: a line"), std::string::npos) << run.out;  // three levels of force tell
}

TEST_F(Calibrate, asks_to_repeat_a_level_that_was_too_short) {
  const test::Run run =
      test::run_program({"isac-log", "calibrate", "--card", kCard, "--rig", folder_ / "rig.toml", "-o",
                         folder_ / "short", "--duration", "0.4 s"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_NE(run.out.find("its mean needs 1 s or more"), std::string::npos) << run.out;
}

TEST_F(Calibrate, refuses_a_weight_or_a_supply_that_the_sensors_do_not_bear) {
  for (const auto& [words, says] :
       {std::pair<std::vector<std::string>, std::string>{{"--weight", "300 N"}, "a weight of 300 N"},
        {{"--supply", "0,7 kg/cm2"}, "a supply of 7 kg/cm2"},
        {{"--supply", "5 kg/cm2"}, "two levels"}}) {
    const test::Run run = log_levels(words);
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_NE(run.err.find(says), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(folder_ / "levels"));
  }
}

}  // namespace
}  // namespace isac
