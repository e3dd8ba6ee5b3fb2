#include "isac/runtime/signal_map.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "fake_rig.hpp"
#include "isac/core/error.hpp"

namespace isac::runtime {
namespace {

card::Shape shape() {
  return {.encoders = 1, .inputs = 8, .outputs = 2};
}

record::Rig calibrated() {
  record::Rig rig;
  rig.encoder.middle_count = 100;
  rig.calibration = {{"F1", "ai1", 10, 0.5},   {"F2", "ai3", 0, 0.25},   {"p1", "ai0", 5, 100.0},
                     {"p2", "ai7", 0, -100.0}, {"p1_cmd", "ao1", 0, 50}, {"p2_cmd", "ao0", 20, 25}};
  return rig;
}

TEST(SignalMap, reads_each_signal_from_its_channel_by_offset_and_gain) {
  SignalMap map(calibrated(), shape());
  card::Sample sample;
  sample.encoder[0] = 300;
  sample.input = {15, 110, 0, 8, 0, 0, 0, 3};
  const Physical physical = map.to_physical(sample);
  EXPECT_DOUBLE_EQ(physical.angle, 200.0 * 2.0 * kPi / 8000.0);
  EXPECT_DOUBLE_EQ(physical.p1, 1000.0);
  EXPECT_DOUBLE_EQ(physical.p2, -300.0);
  EXPECT_DOUBLE_EQ(physical.F1, 50.0);
  EXPECT_DOUBLE_EQ(physical.F2, 2.0);
}

TEST(SignalMap, follows_the_counter_across_its_end_in_both_directions) {
  record::Rig rig = calibrated();
  rig.encoder.middle_count = 0;
  SignalMap map(rig, shape());
  const double step = map.encoder_step();
  card::Sample sample;
  const auto angle_at = [&](long count) {
    sample.encoder[0] = static_cast<std::uint32_t>(count) & 0xFFFFFFu;
    return map.to_physical(sample).angle / step;
  };
  EXPECT_NEAR(angle_at(-3), -3.0, 1e-6);  // begins just below zero: not 16 million counts above
  EXPECT_NEAR(angle_at(2), 2.0, 1e-6);
  EXPECT_NEAR(angle_at(-900), -900.0, 1e-6);
}

TEST(SignalMap, rounds_commands_to_codes_and_never_leaves_their_range) {
  const SignalMap map(calibrated(), shape());
  const card::Command command = map.to_command({.p1 = 1024.0, .p2 = 1e9});
  EXPECT_EQ(command.output[1], 20u);    // 1024/50 = 20.48
  EXPECT_EQ(command.output[0], 4095u);  // clamped
  EXPECT_DOUBLE_EQ(map.commanded(command).p1, 1000.0);
  const card::Command vented = map.to_command({.p1 = std::nan(""), .p2 = -1e6});
  EXPECT_EQ(vented.output[0], 0u);
  EXPECT_EQ(vented.output[1], 0u);
}

TEST(SignalMap, tells_what_each_sensor_can_show) {
  const SignalMap map(calibrated(), shape());
  ASSERT_EQ(map.ranges().size(), 4u);
  for (const series::SensorRange& range : map.ranges()) {
    EXPECT_LT(range.low, range.high) << range.column;
    EXPECT_GT(range.step, 0.0) << range.column;
  }
  EXPECT_EQ(map.ranges()[2].column, "F1");
  EXPECT_DOUBLE_EQ(map.ranges()[2].high, (4095.0 - 10.0) * 0.5);
}

TEST(SignalMap, knows_the_testbed_without_a_calibration) {
  SignalMap map(record::Rig{}, shape());
  test::FakeCard card;
  static_cast<void>(card.write(map.to_command({.p1 = 2.0 * kPascalPerKgfCm2, .p2 = 4.0 * kPascalPerKgfCm2})));
  card::Sample sample;
  static_cast<void>(card.read(sample));
  const Physical physical = map.to_physical(sample);
  EXPECT_NEAR(physical.p1, 2.0 * kPascalPerKgfCm2, 0.003 * kPascalPerKgfCm2);  // one code of either converter
  EXPECT_NEAR(physical.p2, 4.0 * kPascalPerKgfCm2, 0.003 * kPascalPerKgfCm2);
  EXPECT_NEAR(physical.F1, 90.0, 0.05);
}

TEST(SignalMap, takes_the_encoder_from_the_calibration_where_it_has_one) {
  record::Rig rig = calibrated();
  rig.calibration.push_back({"angle", "enc1", 10.5, -0.01});  // another encoder, turned round
  card::Shape two = shape();
  two.encoders = 2;
  SignalMap map(rig, two);
  card::Sample sample;
  sample.encoder = {999, 110};
  EXPECT_DOUBLE_EQ(map.to_physical(sample).angle, -0.995);
  EXPECT_DOUBLE_EQ(map.encoder_step(), 0.01);
  EXPECT_THROW(SignalMap(rig, shape()), Error);  // this card has one encoder only
}

TEST(SignalMap, refuses_a_calibration_that_lacks_a_signal_or_names_a_missing_channel) {
  record::Rig rig = calibrated();
  rig.calibration.pop_back();
  EXPECT_THROW(SignalMap(rig, shape()), Error);
  for (const char* channel : {"ai8", "ai", "ao0", "ai1x", ""}) {
    rig = calibrated();
    rig.calibration[0].channel = channel;
    EXPECT_THROW(SignalMap(rig, shape()), Error) << channel;
  }
  rig = calibrated();
  rig.calibration[4].gain = 0.0;
  EXPECT_THROW(SignalMap(rig, shape()), Error);
}

}  // namespace
}  // namespace isac::runtime
