// The hand of the simulated person: smooth, bounded, never the same twice.
#include "isac/simulate/hand.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "isac/core/units.hpp"

namespace isac::simulate {
namespace {

/// φ every 2 ms for `seconds` after the lead-in.
std::vector<Motion> swept(Hand& hand, double seconds) {
  double t = 0;
  while (!hand.ready(t)) hand.forget_before(t += 0.002);
  std::vector<Motion> motion;
  for (int k = 0; k < seconds / 0.002; ++k) {
    hand.forget_before(t);
    motion.push_back(hand.at(t));
    t += 0.002;
  }
  return motion;
}

TEST(Hand, quintic_meets_its_end_conditions) {
  const Motion from{.angle = 0.2, .velocity = -1.5, .acceleration = 7};
  const Quintic q(from, -0.6, 0.8);
  const Motion start = q.at(0), end = q.at(0.8);
  EXPECT_DOUBLE_EQ(start.angle, 0.2);
  EXPECT_DOUBLE_EQ(start.velocity, -1.5);
  EXPECT_DOUBLE_EQ(start.acceleration, 7);
  EXPECT_NEAR(end.angle, -0.6, 1e-14);  // rounding only
  EXPECT_NEAR(end.velocity, 0, 1e-13);
  EXPECT_NEAR(end.acceleration, 0, 1e-12);
}

TEST(Hand, velocity_and_acceleration_are_the_derivatives_of_the_angle_across_all_strokes) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Hand hand({}, seed);
    hand.sweep(0, {.angle = 0.1, .velocity = 0.5, .acceleration = -3}, false,
               {.amplitude = 0.4, .middle = 0.2, .speed = 6.28, .vary_speed = true});
    const double h = 1e-5;
    for (double t = h; t < 20; t += 0.00137) {
      hand.forget_before(t - h);
      const Motion a = hand.at(t - h), b = hand.at(t), c = hand.at(t + h);
      // h² φ'''/6: the jerk of a fast stroke reaches 1e4 rad/s³, its derivative 1e6 rad/s⁴; plus rounding 1e-16/h.
      ASSERT_NEAR((c.angle - a.angle) / (2 * h), b.velocity, 1e-6) << t;
      // The jerk may step from stroke to stroke, then the difference is off by half its step times h.
      ASSERT_NEAR((c.velocity - a.velocity) / (2 * h), b.acceleration, 0.2) << t;
    }
  }
}

TEST(Hand, takes_a_moving_joint_up_without_a_jump) {
  Hand hand({}, 3);
  const Motion now{.angle = -0.3, .velocity = 2, .acceleration = 40};
  hand.sweep(7.5, now, false, {.amplitude = 0.3, .middle = 0, .speed = 1});
  const Motion m = hand.at(7.5);
  EXPECT_NEAR(m.angle, now.angle, 1e-14);
  EXPECT_NEAR(m.velocity, now.velocity, 1e-13);
  EXPECT_NEAR(m.acceleration, now.acceleration, 1e-11);
}

TEST(Hand, goes_on_without_a_jump_when_asked_for_another_sweep) {
  Hand hand({}, 4);
  hand.sweep(0, {}, false, {.amplitude = 0.3, .middle = 0, .speed = 3});
  for (double t = 0; t < 5.3; t += 0.01) hand.forget_before(t);
  const Motion before = hand.at(5.3);
  hand.sweep(5.3, before, true, {.amplitude = 0.2, .middle = 0.5, .speed = 1});
  const Motion after = hand.at(5.3);
  EXPECT_NEAR(after.angle, before.angle, 1e-12);
  EXPECT_NEAR(after.velocity, before.velocity, 1e-11);
  EXPECT_NEAR(after.acceleration, before.acceleration, 1e-9);
}

TEST(Hand, sweep_keeps_the_promised_amplitude_and_speed_and_reaches_both) {
  for (const double speed : {0.1 * kPi, 1.0, 2 * kPi}) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      SCOPED_TRACE(testing::Message() << speed << " rad/s, seed " << seed);
      Hand hand({}, seed);
      hand.sweep(0, {}, false, {.amplitude = 0.4, .middle = 0.3, .speed = speed});
      double lowest = 9, highest = -9, fastest = 0;
      for (const Motion& m : swept(hand, 30)) {
        lowest = std::min(lowest, m.angle);
        highest = std::max(highest, m.angle);
        fastest = std::max(fastest, std::abs(m.velocity));
      }
      EXPECT_LE(highest, 0.7 + 0.0004);
      EXPECT_GE(lowest, -0.1 - 0.0004);
      EXPECT_GE(highest - lowest, 0.75);
      EXPECT_LE(fastest, speed);
      // 0.92 of the stroke's limit, which leaves room for wander (8 %) and tremor (0.03 rad/s).
      EXPECT_GE(fastest, (speed > 0.5 ? 0.85 : 0.7) * speed);
    }
  }
}

TEST(Hand, bundle_holds_all_speeds_in_both_directions) {
  Hand hand({}, 11);
  hand.sweep(0, {}, false, {.amplitude = 0.4, .middle = 0, .speed = 2 * kPi, .vary_speed = true});
  std::array<int, 20> up{}, down{};  // speeds through the middle third, in steps of 5 %
  for (const Motion& m : swept(hand, 300)) {
    if (std::abs(m.angle) > 0.13) continue;
    const auto bin =
        std::min<std::size_t>(19, static_cast<std::size_t>(std::abs(m.velocity) / (2 * kPi) * 20));
    ++(m.velocity > 0 ? up : down)[bin];
  }
  for (std::size_t bin = 1; bin < 17; ++bin) {  // the top is cut by the room for wander and tremor
    EXPECT_GT(up[bin], 0) << bin;
    EXPECT_GT(down[bin], 0) << bin;
  }
}

TEST(Hand, is_never_periodic_and_differs_from_seed_to_seed) {
  Hand a({}, 1), b({}, 2);
  const Sweep sweep{.amplitude = 0.4, .middle = 0, .speed = 2};
  a.sweep(0, {}, false, sweep);
  b.sweep(0, {}, false, sweep);
  const auto motion = swept(a, 40), other = swept(b, 40);
  // Best match of the second half with any shift of up to 15 s (beyond half a stroke): far from the tremor's 0.3 mrad.
  double best = 1e9;
  for (std::size_t shift = 150; shift < 7500; shift += 5) {
    double sum = 0;
    for (std::size_t k = 10000; k < 20000; k += 10) {
      const double d = motion[k].angle - motion[k - shift].angle;
      sum += d * d;
    }
    best = std::min(best, std::sqrt(sum / 1000));
  }
  EXPECT_GT(best, 0.005);
  double difference = 0;
  for (std::size_t k = 0; k < motion.size(); ++k) {
    difference = std::max(difference, std::abs(motion[k].angle - other[k].angle));
  }
  EXPECT_GT(difference, 0.1);
}

TEST(Hand, trembles_between_8_and_12_hertz_when_it_holds_and_not_when_it_clamps) {
  for (const bool clamp : {false, true}) {
    Hand hand({}, 5);
    hand.hold(0, {}, false, 0.4, clamp);
    const auto motion = swept(hand, 10);
    double mean = 0, square = 0;
    int crossings = 0;
    for (std::size_t k = 0; k < motion.size(); ++k) {
      const double x = motion[k].angle - 0.4;
      mean += x;
      square += x * x;
      if (k > 0 && (motion[k].velocity > 0) != (motion[k - 1].velocity > 0)) ++crossings;
    }
    if (clamp) {
      EXPECT_NEAR(std::sqrt(square / 5000), 0, 1e-15);
    } else {
      EXPECT_GT(std::sqrt(square / 5000), 5e-5);
      EXPECT_LT(std::sqrt(square / 5000), 4e-4);
      EXPECT_GE(crossings / 20.0, 7.5);  // two turning points a period, 10 s
      EXPECT_LE(crossings / 20.0, 12.5);
    }
  }
}

TEST(Hand, never_goes_past_the_end_positions) {
  Hand hand({}, 6);
  hand.sweep(0, {}, false, {.amplitude = 2, .middle = 0.8, .speed = 3});
  for (const Motion& m : swept(hand, 20)) ASSERT_LE(std::abs(m.angle), 1.15 + 0.0004);
}

}  // namespace
}  // namespace isac::simulate
