#include "isac/runtime/safety.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "isac/core/error.hpp"

namespace isac::runtime {
namespace {

constexpr double kPeriod = 0.002;

Limits limits() {
  return {.pressure = 5.0, .delta_pressure = 2.0, .angle = 1.0, .speed = 6.0, .force = 200.0};
}
Physical quiet() {
  return {.angle = 0.0, .p1 = 3.0, .p2 = 3.0, .F1 = 90.0, .F2 = 90.0};
}

/// Feeds `now` for `seconds`, after a second of quiet; the fault that comes of it.
Fault after(const Physical& now, double seconds) {
  SafetyMonitor monitor(limits());
  double t = 0.0;
  for (; t < 1.0; t += kPeriod) EXPECT_TRUE(monitor.check(t, quiet()));
  for (const double end = t + seconds; t < end; t += kPeriod) monitor.check(t, now);
  return monitor.fault();
}

struct Broken {
  Physical now;
  Fault::Kind kind;
  double value;
};

class SafetyStops : public testing::TestWithParam<Broken> {};

TEST_P(SafetyStops, after_ten_milliseconds_and_not_for_one_noisy_sample) {
  EXPECT_EQ(after(GetParam().now, 0.5 * kPeriod).kind, Fault::Kind::kNone);
  EXPECT_EQ(after(GetParam().now, 0.007).kind, Fault::Kind::kNone);
  const Fault fault = after(GetParam().now, 0.1);
  EXPECT_EQ(fault.kind, GetParam().kind);
  EXPECT_DOUBLE_EQ(fault.value, GetParam().value);
  EXPECT_NEAR(fault.time, 1.010, 0.003);  // ten milliseconds, to one sample either side
  EXPECT_NE(describe(fault).find("--limit"), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(All, SafetyStops,
                         testing::Values(Broken{{0, 5.1, 3.5, 90, 90}, Fault::Kind::kPressure, 5.1},
                                         Broken{{0, 3, 5.2, 90, 90}, Fault::Kind::kPressure, 5.2},
                                         Broken{{0, 0.3, 4.9, 90, 90}, Fault::Kind::kDeltaPressure, 2.3},
                                         Broken{{0, 4.9, 0.3, 90, 90}, Fault::Kind::kDeltaPressure, 2.3},
                                         Broken{{0, 3, 3, 201, 90}, Fault::Kind::kForce, 201},
                                         Broken{{0, 3, 3, 90, -201}, Fault::Kind::kForce, 201}));

TEST(Safety, stops_a_joint_beyond_its_angle) {
  SafetyMonitor monitor(limits());
  Physical now = quiet();
  now.angle = -1.01;  // from the first sample on, so that no speed is seen
  double t = 0.0;
  while (monitor.check(t, now)) t += kPeriod;
  EXPECT_EQ(monitor.fault().kind, Fault::Kind::kAngle);
  EXPECT_NEAR(t, 0.010, 1e-9);
}

TEST(Safety, stops_a_joint_that_runs_away_and_lets_one_encoder_step_pass) {
  SafetyMonitor slow(limits()), fast(limits());
  Physical now = quiet();
  const double step = 2.0 * kPi / 8000.0;
  double t = 0.0;
  for (int i = 0; i < 500; ++i, t += kPeriod) {  // one step up and down each sample: 0.39 rad/s raw
    now.angle = (i % 2) * step;
    ASSERT_TRUE(slow.check(t, now));
  }
  t = 0.0;
  for (now.angle = -0.5; now.angle < 0.9; now.angle += 7.0 * kPeriod, t += kPeriod) {
    if (!fast.check(t, now)) break;
  }
  EXPECT_EQ(fast.fault().kind, Fault::Kind::kSpeed);
  EXPECT_NEAR(fast.fault().value, 7.0, 1.0);  // the filter is within 1 rad/s after two of its time constants
  EXPECT_LT(t, 0.05);
}

TEST(Safety, stops_at_once_when_a_value_is_no_number) {
  Physical now = quiet();
  now.F2 = std::nan("");
  EXPECT_EQ(after(now, 0.5 * kPeriod).kind, Fault::Kind::kNotFinite);
}

TEST(Safety, keeps_the_first_fault) {
  SafetyMonitor monitor(limits());
  Physical now = quiet();
  now.F1 = 300.0;
  double t = 0.0;
  while (monitor.check(t, now)) t += kPeriod;
  now = quiet();
  EXPECT_FALSE(monitor.check(t + 1.0, now));
  EXPECT_EQ(monitor.fault().kind, Fault::Kind::kForce);
}

TEST(Safety, refuses_limits_that_are_no_positive_numbers) {
  EXPECT_NO_THROW(check_limits(limits()));
  for (const double bad : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    for (double Limits::*member :
         {&Limits::pressure, &Limits::delta_pressure, &Limits::angle, &Limits::speed, &Limits::force}) {
      Limits nonsense = limits();
      nonsense.*member = bad;
      EXPECT_THROW(check_limits(nonsense), Error) << bad;
    }
  }
}

}  // namespace
}  // namespace isac::runtime
