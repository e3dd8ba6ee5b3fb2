// Feed-forward: the torque that undoes each effect on the desired motion, and which effects it refuses.
#include "isac/control/feed_forward.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace {

using namespace isac::control;
using namespace isac::models;
using isac::Status;

JointPoint<double> moving(double velocity) {
  return {.delta_pressure = 4e4,
          .mean_pressure = 3.2e5,
          .angle = 0.4,
          .velocity = velocity,
          .acceleration = 1.3,
          .wheel_radius = 0.019,
          .reference_pressure = 3e5,
          .stiffness = -23450,
          .pressure_gain = 174.2 / 98066.5};
}

TEST(FeedForward, undoes_every_effect_it_serves_exactly) {
  int served = 0;
  for (int effect = 0; effect < Catalogue::kSize; ++effect) {
    if (!feed_forward_serves(effect)) continue;
    ++served;
    const EffectInfo& info = Catalogue::kInfos[effect];
    double q[kMaxEffectParameters] = {};
    for (int i = 0; i < info.parameter_count; ++i) q[i] = info.parameters[i].typical;
    FeedForward<double> ff;
    ASSERT_EQ(ff.add(effect, q, info.parameter_count), Status::kOk) << info.id;
    EXPECT_EQ(ff.torque(moving(1.1)) + effect_torque<double>(effect, q, moving(1.1)), 0.0) << info.id;
  }
  EXPECT_GE(served, 15);
}

TEST(FeedForward, refuses_by_kind_what_it_cannot_serve) {
  for (const char* id : {"stiffness", "pressure", "end_stop", "tension_loss", "periodic_disturbance",
                         "offset", "hysteresis", "dead_time", "encoder_gain"}) {
    ASSERT_GE(find_effect(id), 0) << id;
    const double q[kMaxEffectParameters] = {};
    FeedForward<double> ff;
    EXPECT_EQ(ff.add(find_effect(id), q, Catalogue::kInfos[find_effect(id)].parameter_count),
              Status::kOutOfRange)
        << id;
  }
  for (const int outside : {-1, Catalogue::kSize}) EXPECT_FALSE(feed_forward_serves(outside));
}

TEST(FeedForward, friction_is_left_alone_around_rest_and_never_jumps) {
  const double tc[kMaxEffectParameters] = {0.2}, zone = 0.02;
  FeedForward<double> ff(zone);
  ASSERT_EQ(ff.add(find_effect("coulomb_friction"), tc, 1), Status::kOk);
  EXPECT_EQ(ff.torque(moving(0.0)), 0.0);
  EXPECT_EQ(ff.torque(moving(0.02)), 0.0);
  EXPECT_EQ(ff.torque(moving(-0.02)), 0.0);
  EXPECT_NEAR(ff.torque(moving(0.03)), 0.1, 1e-12);
  EXPECT_NEAR(ff.torque(moving(0.5)), 0.2, 1e-12);
  EXPECT_NEAR(ff.torque(moving(-0.5)), -0.2, 1e-12);
  double last = ff.torque(moving(-0.1));
  for (double v = -0.1; v < 0.1; v += 1e-4) {
    const double now = ff.torque(moving(v));
    ASSERT_LT(std::abs(now - last), 0.2 / zone * 1.1e-4);  // the slope of the straight part
    last = now;
  }
}

TEST(FeedForward, gravity_is_fed_forward_at_rest_too) {
  const double q[2] = {0.3, 0.1};
  FeedForward<double> ff;
  ASSERT_EQ(ff.add(find_effect("gravity_imbalance"), q, 2), Status::kOk);
  EXPECT_NEAR(ff.torque(moving(0.0)), 0.3 * std::sin(0.4) + 0.1 * std::cos(0.4), 1e-15);
}

TEST(FeedForward, refuses_bad_parameters_and_a_full_list) {
  FeedForward<double> ff;
  double q[kMaxEffectParameters] = {std::numeric_limits<double>::quiet_NaN()};
  EXPECT_EQ(ff.add(find_effect("coulomb_friction"), q, 1), Status::kNotFinite);
  q[0] = 0.1;
  EXPECT_EQ(ff.add(find_effect("coulomb_friction"), q, 2), Status::kOutOfRange);
  EXPECT_EQ(ff.size(), 0);
  for (int i = 0; i < kMaxTableEffects; ++i)
    ASSERT_EQ(ff.add(find_effect("coulomb_friction"), q, 1), Status::kOk);
  EXPECT_EQ(ff.add(find_effect("coulomb_friction"), q, 1), Status::kOutOfRange);
}

}  // namespace
