// Hidden effects: each one of the catalogue can be put into the rig, and does there what its equation says.
#include "isac/models/effects.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/simulate/rig.hpp"

namespace isac::simulate {
namespace {

constexpr double kP = kPascalPerKgfCm2;

RigConfig with(std::vector<HiddenEffect> effects) {
  RigConfig config;
  config.sensors.noise = NoiseKind::kNone;
  config.effects = std::move(effects);
  return config;
}

std::uint32_t code_of(double kg_cm2) {
  return static_cast<std::uint32_t>(std::lround(kg_cm2 / 5 * 4095));
}
double pressure_of(double kg_cm2) {
  return code_of(kg_cm2) * 5 * kP / 4095;
}

void advance(Rig& rig, double t) {
  ASSERT_EQ(rig.advance_to(t), Status::kOk);
}

double force(const Codes& codes, std::size_t i) {
  return (codes.input[2 * i] - 205.0) * 200 / 4096;
}

/// All codes of a run that fills, sweeps, steps and lets go.
std::vector<std::uint32_t> everything(const RigConfig& config) {
  Rig rig(config);
  std::vector<std::uint32_t> all;
  const auto watch = [&](double until) {
    for (double t = rig.time() + 0.01; t < until; t += 0.01) {
      EXPECT_EQ(rig.advance_to(t), Status::kOk);
      const Codes c = rig.read();
      all.push_back(c.encoder);
      all.insert(all.end(), c.input.begin(), c.input.end());
    }
  };
  EXPECT_EQ(rig.command({code_of(3), code_of(3)}), Status::kOk);
  watch(2);
  rig.sweep({.amplitude = 1.1, .middle = 0, .speed = 5});
  watch(6);
  EXPECT_EQ(rig.command({code_of(2), code_of(4.95)}), Status::kOk);
  watch(10);
  rig.release();
  watch(12);
  EXPECT_EQ(rig.command({code_of(2.5), code_of(3.5)}), Status::kOk);
  watch(13);
  EXPECT_EQ(rig.command({code_of(0.1), code_of(0.6)}), Status::kOk);
  watch(15);
  return all;
}

TEST(HiddenEffects, every_effect_of_the_catalogue_shows_in_the_codes) {
  const auto plain = everything(with({}));
  for (const auto& info : models::effect_catalogue()) {
    SCOPED_TRACE(info.id);
    HiddenEffect effect{.id = info.id, .parameters = {}};
    if (effect.id == "end_stop") effect.parameters = {50, 0.3, -0.3};  // within reach of the free joint
    if (effect.id == "supply_droop")
      effect.parameters = {4 * kP, 0.2, 1.0};  // below what the valves are asked for
    EXPECT_NE(everything(with({effect})), plain);
  }
}

TEST(HiddenEffects, effects_at_their_null_values_are_not_there) {
  const auto plain = everything(with({}));
  for (const auto& info : models::effect_catalogue()) {
    SCOPED_TRACE(info.id);
    HiddenEffect effect{.id = info.id, .parameters = {}};
    bool finite = true;
    for (int k = 0; k < info.parameter_count; ++k) {
      const auto& p = info.parameters[k];
      const double value = std::isnan(p.null_value) ? p.typical : p.null_value;
      finite = finite && std::isfinite(value);
      effect.parameters.push_back(std::isfinite(value) ? value : 1e12);  // a limit far away
    }
    const auto codes = everything(with({effect}));
    ASSERT_EQ(codes.size(), plain.size());
    // Another path through the integrator may move a code by one step here and there.
    int apart = 0;
    for (std::size_t k = 0; k < codes.size(); ++k) {
      apart += std::abs(static_cast<double>(codes[k]) - static_cast<double>(plain[k])) > 1.5 &&
               !(k % 9 == 0 && codes[k] + plain[k] > (1u << 23));  // counts around zero wrap
    }
    EXPECT_EQ(apart, 0);
  }
}

TEST(HiddenEffects, dead_time_adds_to_that_of_the_tubes) {
  auto config = with({{"dead_time", {0.05}}});
  for (auto& valve : config.valves) valve.dead_time = 0.02;
  Rig rig(config);
  ASSERT_EQ(rig.command({code_of(4), 0}), Status::kOk);
  advance(rig, 0.0699);
  EXPECT_EQ(rig.truth().pressure[0], 0);
  advance(rig, 0.24);
  EXPECT_NEAR(rig.truth().pressure[0], pressure_of(4) * (1 - std::exp(-0.17 / 0.17)), 1e-6 * 4 * kP);
}

TEST(HiddenEffects, second_lag_gives_the_closed_form_of_two_lags) {
  Rig rig(with({{"second_order_lag", {0.05}}}));
  ASSERT_EQ(rig.command({code_of(4), 0}), Status::kOk);
  for (const double t : {0.01, 0.1, 0.5}) {
    advance(rig, t);
    const double exact = 1 - (0.17 * std::exp(-t / 0.17) - 0.05 * std::exp(-t / 0.05)) / (0.17 - 0.05);
    EXPECT_NEAR(rig.truth().pressure[0], exact * pressure_of(4), 1e-6 * 4 * kP) << t;
  }
}

TEST(HiddenEffects, flow_limit_makes_the_first_part_of_a_large_step_straight) {
  const double limit = 10 * kP;  // Pa/s; the lag alone would begin with 4/0.17 = 23.5 kg/cm² a second
  Rig rig(with({{"flow_limit", {limit}}}));
  ASSERT_EQ(rig.command({code_of(4), 0}), Status::kOk);
  for (const double t : {0.05, 0.2}) {
    advance(rig, t);
    EXPECT_NEAR(rig.truth().pressure[0], limit * t, 1e-6 * 4 * kP);
  }
}

TEST(HiddenEffects, leak_settles_below_the_command) {
  Rig rig(with({{"leak", {0.5}}}));
  ASSERT_EQ(rig.command({code_of(3), 0}), Status::kOk);
  advance(rig, 5);
  EXPECT_NEAR(rig.truth().pressure[0], pressure_of(3) / (1 + 0.5 * 0.17), 1e-6 * 3 * kP);
}

TEST(HiddenEffects, valve_hysteresis_remembers_the_direction_of_the_command) {
  Rig rig(with({{"valve_hysteresis", {0.1 * kP}}}));
  ASSERT_EQ(rig.command({code_of(3), 0}), Status::kOk);
  advance(rig, 4);
  const double from_below = rig.truth().pressure[0];
  ASSERT_EQ(rig.command({code_of(4), 0}), Status::kOk);
  advance(rig, 8);
  ASSERT_EQ(rig.command({code_of(3), 0}), Status::kOk);
  advance(rig, 12);
  EXPECT_NEAR(rig.truth().pressure[0] - from_below, 0.2 * kP, 1e-4 * kP);  // twice the half-width of the play
}

TEST(HiddenEffects, deadband_leaves_the_pressure_short_of_the_command) {
  Rig rig(with({{"valve_deadband", {0.1 * kP}}}));
  ASSERT_EQ(rig.command({code_of(3), 0}), Status::kOk);
  advance(rig, 5);
  EXPECT_NEAR(rig.truth().pressure[0], pressure_of(3) - 0.1 * kP, 1e-4 * kP);
}

TEST(HiddenEffects, moving_joint_pumps_the_muscles_in_opposite_directions) {
  Rig rig(with({{"volume_coupling", {0.2 * kP}}}));
  ASSERT_EQ(rig.command({code_of(3), code_of(3)}), Status::kOk);
  advance(rig, 3);
  rig.sweep({.amplitude = 0.4, .middle = 0, .speed = 6});
  double greatest = 0;
  for (int k = 0; k < 500; ++k) {
    advance(rig, 3 + 0.01 * k);
    const PlantState s = rig.truth();
    const double p1 = s.pressure[0] - pressure_of(3), p2 = s.pressure[1] - pressure_of(3);
    EXPECT_NEAR(p1 + p2, 0, 1e-5 * kP);
    greatest = std::max(greatest, std::abs(p2));
  }
  EXPECT_GT(greatest, 0.05 * kP);
  EXPECT_LT(greatest, 0.2 * kP * 0.8);  // all of the stroke of 0.8 rad kept in
}

TEST(HiddenEffects, threshold_pressure_takes_torque_and_not_the_reading) {
  auto config = with({{"threshold_pressure", {0.5 * kP}}});
  config.pressure = {0.2 * kP, 3 * kP};
  const Rig rig(config);
  EXPECT_NEAR(rig.truth().torque, 174.2 * 0.019 * (2.5 - 0) / 2, 1e-9);
  EXPECT_NEAR(rig.truth().pressure[0], 0.2 * kP, 1e-9);
}

TEST(HiddenEffects, sensor_lag_delays_the_forces_like_the_closed_form) {
  Rig rig(with({{"sensor_lag", {0.05}}}));
  advance(rig, 1);
  rig.sensors().hang_weight(100.0);
  for (int k = 1; k <= 500; ++k) advance(rig, 1 + 1e-4 * k);  // fine steps: the weight is hung at once
  // One lag of 50 ms after the step, less the amplifier's 0.16 ms and half a step; a converter's step of 0.05 N.
  EXPECT_NEAR(force(rig.read(), 0), 100 * (1 - std::exp(-(0.05 - 0.00021) / 0.05)), 0.05);
}

TEST(HiddenEffects, time_skew_shows_the_angle_of_a_moment_ago) {
  Rig rig(with({{"time_skew", {0.02}}}));
  rig.sweep({.amplitude = 0.4, .middle = 0, .speed = 3});
  std::vector<double> angle;
  for (int k = 0; k < 4000; ++k) {
    advance(rig, 0.002 * (k + 1));
    angle.push_back(rig.truth().joint.angle);
    const auto count = static_cast<std::int32_t>(rig.read().encoder << 8) / 256;
    if (k < 20) continue;
    // Floor of the encoder, and the interpolation of the history.
    ASSERT_NEAR((count + 0.5) * 2 * kPi / 8000, angle[static_cast<std::size_t>(k) - 10], kPi / 8000 + 1e-6)
        << k;
  }
}

TEST(HiddenEffects, spikes_come_in_the_share_asked_for_on_one_sensor_at_a_time) {
  auto config = with({{"spikes", {0.02, 60.0}}});
  config.seed = 5;
  Rig rig(config);
  ASSERT_EQ(rig.command({code_of(3), code_of(3)}), Status::kOk);
  advance(rig, 3);
  int spikes = 0;
  for (int k = 0; k < 20000; ++k) {
    const Codes c = rig.read();
    const bool first = std::abs(force(c, 0) - 95) > 30, second = std::abs(force(c, 1) - 95) > 30;
    ASSERT_FALSE(first && second);
    spikes += first || second;
  }
  EXPECT_NEAR(spikes, 400, 100);  // binomial: standard deviation 20
}

TEST(HiddenEffects, gravity_moves_the_joint_and_stays_out_of_the_force_sensors) {
  auto config = with({{"gravity_imbalance", {0.0, 0.5}}});
  Rig rig(config);
  ASSERT_EQ(rig.command({code_of(3), code_of(3)}), Status::kOk);
  advance(rig, 5);
  const PlantState s = rig.truth();
  EXPECT_NEAR(s.torque, 0.5 * std::cos(s.joint.angle), 1e-6);  // muscles hold what the sensors show
  EXPECT_LT(s.joint.angle, -0.05);
}

TEST(HiddenEffects, reading_states_that_cannot_be_integrated_are_refused) {
  EXPECT_THROW(Rig(with({{"sensor_lag", {1e-6}}})), Error);
  EXPECT_THROW(Rig(with({{"time_skew", {2.0}}})), Error);
}

}  // namespace
}  // namespace isac::simulate
