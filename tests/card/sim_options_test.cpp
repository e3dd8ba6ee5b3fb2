// The words behind "sim:".
#include "isac/card/sim_options.hpp"

#include <gtest/gtest.h>

#include <string>

#include "isac/card/calibration.hpp"
#include "isac/card/card.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::card {
namespace {

Error refusal(const std::string& name) {
  try {
    static_cast<void>(open(name));
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << name << " was taken";
  return Error(ErrorKind::kAnswerIsNo, "", "");
}

TEST(SimOptions, empty_name_is_the_testbed_with_coloured_noise_and_jitter) {
  const auto config = parse_sim("");
  EXPECT_EQ(config.sensors.noise, simulate::NoiseKind::kColoured);
  EXPECT_TRUE(config.timing.jitter);
  EXPECT_FALSE(config.miscalibrated);
  EXPECT_EQ(config.seed, 1u);
  EXPECT_EQ(config.joint.A, -23450);
}

TEST(SimOptions, every_option_reaches_its_place) {
  const auto c = parse_sim(
      "seed=42,noise=white,force_noise=0.5,pressure_noise=0.01,hum=0.2,force_range=1000,jitter=off,drop=0.01,"
      "miscalibrated,effect=coulomb_friction:0.3,effect=hysteresis:0.2:0.05,A=-20000,B=150,C=0.003,D=0.2,"
      "radius=0.02,"
      "inertia=0.01,p0=2.5,K_C=0.9,T_C=0.2,T_vent=0.3,dead_time=0.03");
  EXPECT_EQ(c.seed, 42u);
  EXPECT_EQ(c.sensors.noise, simulate::NoiseKind::kWhite);
  EXPECT_EQ(c.sensors.force_noise, 0.5);
  EXPECT_DOUBLE_EQ(c.sensors.pressure_noise, 0.01 * kPascalPerKgfCm2);
  EXPECT_EQ(c.sensors.force_hum, 0.2);
  EXPECT_EQ(c.sensors.force_range, 1000);
  EXPECT_DOUBLE_EQ(c.joint.pretension, 475);
  EXPECT_FALSE(c.timing.jitter);
  EXPECT_EQ(c.timing.drop_chance, 0.01);
  EXPECT_TRUE(c.miscalibrated);
  ASSERT_EQ(c.effects.size(), 2u);
  EXPECT_EQ(c.effects[0].id, "coulomb_friction");
  EXPECT_EQ(c.effects[0].parameters, std::vector<double>{0.3});
  EXPECT_EQ(c.effects[1].parameters, (std::vector<double>{0.2, 0.05}));
  EXPECT_EQ(c.joint.A, -20000);
  EXPECT_DOUBLE_EQ(c.joint.B, 150 / kPascalPerKgfCm2);
  EXPECT_EQ(c.joint.C, 0.003);
  EXPECT_EQ(c.joint.D, 0.2);
  EXPECT_EQ(c.joint.wheel_radius, 0.02);
  EXPECT_EQ(c.joint.inertia, 0.01);
  EXPECT_DOUBLE_EQ(c.joint.initial_pressure, 2.5 * kPascalPerKgfCm2);
  for (const auto& valve : c.valves) {
    EXPECT_EQ(valve.gain, 0.9);
    EXPECT_EQ(valve.fill_lag, 0.2);
    EXPECT_EQ(valve.vent_lag, 0.3);
    EXPECT_EQ(valve.dead_time, 0.03);
  }
}

TEST(SimOptions, help_names_every_option_that_an_error_lists) {
  const std::string text = refusal("sim:colour=red").text();
  const std::string help = open_help();
  for (const char* name :
       {"seed", "noise", "force_range", "jitter", "drop", "miscalibrated", "effect", "dead_time"}) {
    EXPECT_NE(text.find(name), std::string::npos) << name;
    EXPECT_NE(help.find(std::string(name) + "="), std::string::npos) << name;
  }
}

TEST(SimOptions, wrong_words_are_refused_with_the_mend) {
  struct Case {
    const char* name;
    const char* code;
    const char* expected;
  };
  for (const auto& [name, code, expected] : {
           Case{"sim:colour=red", "sim_option_unknown", "'colour'"},
           Case{"sim:seed=three", "sim_option_value", "whole number"},
           Case{"sim:seed=-1", "sim_option_value", "whole number"},
           Case{"sim:noise=pink", "sim_option_value", "'none', 'white' or 'coloured'"},
           Case{"sim:jitter=maybe", "sim_option_value", "'on' or 'off'"},
           Case{"sim:T_C=0", "sim_option_value", "0.001 to 100"},
           Case{"sim:T_C=fast", "sim_option_value", "'fast'"},
           Case{"sim:T_C=nan", "sim_option_value", "0.001 to 100"},
           Case{"sim:A", "sim_option_value", "'on'"},
           Case{"sim:effect=stiction", "effect_unknown", "stribeck_friction"},
           Case{"sim:effect=coulomb_friction:x", "sim_option_value", "'x'"},
           Case{"sim:effect=coulomb_friction:1:2", "effect_parameters", "T_c"},
           Case{"sim:,seed=1", "sim_option_unknown", "''"},
           Case{"comedy:table.toml", "card_name", "sim:, replay:, comedi:"},
           Case{"comedi:/dev/comedi0", "card_name", "a table of signals"},
           Case{"sim", "card_name", "sim:"},
           Case{"", "card_name", "sim:"},
           Case{"replay:", "card_name", "replay:run.csv"},
       }) {
    const Error error = refusal(name);
    EXPECT_EQ(error.kind(), ErrorKind::kUsage) << name;
    EXPECT_EQ(error.code(), code) << name;
    EXPECT_NE(error.text().find(expected), std::string::npos) << name << ": " << error.text();
  }
}

TEST(Calibration, default_matches_the_wiring_of_the_simulated_rig) {
  const auto channels = default_calibration();
  ASSERT_EQ(channels.size(), 7u);
  EXPECT_EQ(channels[0].channel, "enc0");
  EXPECT_DOUBLE_EQ(channels[0].gain, 2 * kPi / 8000);
  EXPECT_EQ(channels[1].signal, "F1");
  EXPECT_EQ(channels[1].channel, "ai0");
  EXPECT_DOUBLE_EQ((4095 - channels[1].offset) * channels[1].gain, 3890 * 200.0 / 4096);
  EXPECT_EQ(channels[4].signal, "p2");
  EXPECT_EQ(channels[4].channel, "ai6");
  EXPECT_EQ(channels[6].channel, "ao1");
  EXPECT_DOUBLE_EQ(4095 * channels[6].gain, 5 * kPascalPerKgfCm2);
  EXPECT_DOUBLE_EQ(default_calibration(1000)[1].gain, 5 * channels[1].gain);
}

}  // namespace
}  // namespace isac::card
