#include "isac/estimate/calibrate.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::estimate {
namespace {

/// Counts of a 12-bit card at one reference: AR(1) noise of `sigma` counts, 250 samples of 2 ms.
CalibrationLevel level(double reference, double mean, double sigma, std::mt19937_64& engine,
                       double colour = 0.0, int samples = 1000) {
  std::normal_distribution<double> normal;
  CalibrationLevel out;
  out.reference = reference;
  double noise = sigma * normal(engine);
  for (int i = 0; i < samples; ++i) {
    out.reading.push_back(std::floor(mean + noise + 0.5));
    noise = colour * noise + sigma * std::sqrt(1 - colour * colour) * normal(engine);
  }
  return out;
}

CalibrationOptions force_options() {
  CalibrationOptions o;
  o.name = "F1";
  o.reference_unit = "N";
  return o;
}

std::string refusal(const std::vector<CalibrationLevel>& levels) {
  try {
    (void)calibrate_sensor(levels, force_options());
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::kAnswerIsNo);
    EXPECT_NE(e.text().find("F1"), std::string::npos);
    return e.code();
  }
  return "none";
}

TEST(Calibrate, force_sensor_by_the_seeds_weight) {
  std::mt19937_64 engine(1);
  const std::vector<CalibrationLevel> levels{level(0, 210, 3, engine), level(149.1, 1490, 3, engine)};
  const ChannelCalibration c = calibrate_sensor(levels, force_options());
  EXPECT_NEAR(c.offset.value, 210, 4 * c.offset.std_error);           // CalF1Offset
  EXPECT_NEAR(c.full_scale.value, 1280, 4 * c.full_scale.std_error);  // CalF1Max
  EXPECT_EQ(c.full_scale_reference, 149.1);
  EXPECT_EQ(c.linearity, Linearity::kNotTestable);
  EXPECT_NEAR(c.to_reference(210 + 640), 74.55, 0.1);  // half the weight; errors of 0.1 count are 0.01 N
  EXPECT_GT(c.reference_error(850), 0);
  EXPECT_LT(c.reference_error(850), c.reference_error(4000));  // farther from what was measured
  EXPECT_EQ(c.levels[0].averages, 40u);                        // 2 s in means of 50 ms
}

TEST(Calibrate, pressure_sensor_from_six_levels_is_a_line) {
  std::mt19937_64 engine(2);
  std::vector<CalibrationLevel> levels;
  for (int k = 0; k <= 5; ++k) levels.push_back(level(k * kPascalPerKgfCm2, 150 + 700.0 * k, 4, engine, 0.7));
  const ChannelCalibration c = calibrate_sensor(levels, {.name = "p1"});
  EXPECT_EQ(c.linearity, Linearity::kLinear) << c.sentence;
  EXPECT_NEAR(c.gain.value * kPascalPerKgfCm2, 700, 4 * c.gain.std_error * kPascalPerKgfCm2);
  EXPECT_NEAR(c.sensitivity.value * c.gain.value, 1, 1e-12);
  EXPECT_TRUE(c.warnings.empty());
}

TEST(Calibrate, a_bend_is_seen_and_sized) {
  std::mt19937_64 engine(3);
  std::vector<CalibrationLevel> levels;
  for (int k = 0; k <= 5; ++k)
    levels.push_back(level(30.0 * k, 200 + 600.0 * k + 3.0 * k * (5 - k), 3, engine));
  const ChannelCalibration c = calibrate_sensor(levels, force_options());
  EXPECT_EQ(c.linearity, Linearity::kCurved) << c.sentence;
  // The parabola's 18.75 counts at the middle leave about 0.4 % of 3000 about the best line.
  EXPECT_NEAR(c.nonlinearity, 0.004, 0.002);
  EXPECT_EQ(c.warnings.front().code, "not_linear");
}

TEST(Calibrate, intervals_cover_the_truth_under_coloured_noise) {
  int offset = 0, gain = 0;
  double bias = 0, spread = 0;
  constexpr int kSeeds = 200;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    std::mt19937_64 engine(static_cast<unsigned>(seed));
    const std::vector<CalibrationLevel> levels{level(0, 210.3, 5, engine, 0.8),
                                               level(50, 610.3, 5, engine, 0.8),
                                               level(149.1, 210.3 + 8 * 149.1, 5, engine, 0.8)};
    const ChannelCalibration c = calibrate_sensor(levels, force_options());
    offset += c.offset.ci_low <= 210.3 && 210.3 <= c.offset.ci_high;
    gain += c.gain.ci_low <= 8 && 8 <= c.gain.ci_high;
    bias += (c.gain.value - 8) / kSeeds;
    spread += std::pow(c.gain.value - 8, 2) / kSeeds;
  }
  std::printf("calibration, seeds 1 to %d: offset covered %d, gain covered %d, bias %.2g, spread %.2g\n",
              kSeeds, offset, gain, bias, std::sqrt(spread));
  for (const int covered :
       {offset, gain}) {  // nominal 190; ± 4 %, what 200 draws scatter (2.5 standard deviations)
    EXPECT_GE(covered, 182);
    EXPECT_LE(covered, 198);
  }
  EXPECT_LT(std::abs(bias), 4 * std::sqrt(spread / kSeeds));  // mean of 200 within 4 of its standard errors
}

TEST(Calibrate, the_references_own_error_counts) {
  std::mt19937_64 engine(4);
  std::vector<CalibrationLevel> levels{level(0, 210, 3, engine), level(149.1, 1490, 3, engine)};
  const double alone = calibrate_sensor(levels, force_options()).gain.std_error;
  levels[1].reference_error = 1.0;  // N on 149.1 N: 0.67 % of the gain
  const ChannelCalibration c = calibrate_sensor(levels, force_options());
  EXPECT_GT(c.gain.std_error, 5 * alone);
  EXPECT_NEAR(c.gain.std_error / c.gain.value, 1.0 / 149.1, 1e-4);
}

TEST(Calibrate, a_resting_reading_is_no_surer_than_its_quantum) {
  std::mt19937_64 engine(5);
  const std::vector<CalibrationLevel> levels{level(0, 210.3, 0, engine), level(149.1, 1490.4, 0, engine)};
  const ChannelCalibration c = calibrate_sensor(levels, force_options());
  EXPECT_NEAR(c.offset.std_error, 1 / std::sqrt(12.0), 1e-9);
}

TEST(Calibrate, refuses_by_name_what_cannot_be_calibrated) {
  std::mt19937_64 engine(6);
  EXPECT_EQ(refusal({level(0, 210, 3, engine)}), "too_few_levels");
  EXPECT_EQ(refusal({level(50, 210, 3, engine), level(50, 211, 3, engine)}), "levels_equal");
  EXPECT_EQ(refusal({level(0, 210, 0.4, engine), level(149.1, 211, 0.4, engine)}), "channel_dead");
  EXPECT_EQ(refusal({level(0, 210, 3, engine), level(149.1, 4095, 3, engine)}), "channel_saturated");
  EXPECT_EQ(refusal({level(0, -2, 3, engine), level(149.1, 1490, 3, engine)}), "channel_saturated");
  CalibrationLevel empty;
  empty.reference = 149.1;
  EXPECT_EQ(refusal({level(0, 210, 3, engine), empty}), "no_usable_data");
}

std::vector<CalibrationLevel> valve_levels(double zero, double at_full, std::mt19937_64& engine) {
  std::normal_distribution<double> normal(0, 400);  // 0.004 kg/cm2
  std::vector<CalibrationLevel> levels;
  for (const double code : {0.0, 1024.0, 2048.0, 3072.0, 4095.0}) {
    CalibrationLevel l;
    l.reference = code;
    for (int i = 0; i < 500; ++i) l.reading.push_back(zero + (at_full - zero) * code / 4095 + normal(engine));
    levels.push_back(l);
  }
  return levels;
}

TEST(Calibrate, valve_gives_cal_pressure_and_asks_for_the_trimmers) {
  std::mt19937_64 engine(7);
  const double full = 5 * kPascalPerKgfCm2;
  const ValveCalibration good =
      calibrate_valve(valve_levels(0, full, engine), valve_calibration_options("valve 1"));
  EXPECT_NEAR(good.cal_pressure.value, full, 4 * good.cal_pressure.std_error);
  EXPECT_NEAR(good.zero_pressure.value, 0, 4 * good.zero_pressure.std_error);
  EXPECT_TRUE(good.line.warnings.empty());
  const ValveCalibration off =
      calibrate_valve(valve_levels(2e4, 0.9 * full, engine), valve_calibration_options("valve 1"));
  ASSERT_EQ(off.line.warnings.size(), 2u);
  EXPECT_EQ(off.line.warnings[0].code, "zero_trimmer");
  EXPECT_EQ(off.line.warnings[1].code, "span_trimmer");
  try {
    (void)calibrate_valve(valve_levels(1e5, 1e5, engine), valve_calibration_options("valve 1"));
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), "valve_never_moves");
  }
}

MiddleApproach approach(double counts, int side) {
  MiddleApproach a;
  a.from_side = side;
  for (int i = 0; i < 50; ++i) a.counts.push_back(std::floor(counts + 0.5));
  return a;
}

TEST(Calibrate, middle_is_the_mean_of_approaches_with_its_error) {
  const std::array approaches{approach(1001, 0), approach(1003, 0), approach(999, 0), approach(1001, 0)};
  const MiddleCalibration m = calibrate_middle(approaches);
  EXPECT_DOUBLE_EQ(m.middle.value, 1001);
  // Sample variance 8/3, one step of the encoder 1/12, four approaches.
  EXPECT_NEAR(m.middle.std_error, std::sqrt((8.0 / 3 + 1.0 / 12) / 4), 1e-12);
  EXPECT_FALSE(m.side_difference.identifiable);
}

TEST(Calibrate, middle_lies_halfway_when_the_side_matters) {
  const std::array approaches{approach(1010, 1), approach(1011, 1), approach(1012, 1),
                              approach(1011, 1), approach(990, -1), approach(991, -1)};
  const MiddleCalibration m = calibrate_middle(approaches);
  EXPECT_NEAR(m.middle.value, 0.5 * (1011 + 990.5), 1e-9);
  EXPECT_NEAR(m.side_difference.value, 20.5, 1e-9);
  EXPECT_EQ(m.warnings.front().code, "sides_differ");
}

TEST(Calibrate, middle_is_told_apart_from_what_valves_and_play_do_to_the_rest_position) {
  // rest = 500 + 4 counts per kPa · Δp ± 3; the valves stand 6 kPa apart from Δp = 0.
  std::vector<MiddleApproach> approaches;
  for (const double kilopascal : {6.0, -14.0, 26.0}) {
    for (const int side : {1, -1}) {
      approaches.push_back(approach(500 + 4 * kilopascal + 3 * side, side));
      approaches.back().delta_pressure = 1e3 * kilopascal;
    }
  }
  const MiddleCalibration m = calibrate_middle(approaches);
  EXPECT_NEAR(m.middle.value, 500, 1e-9);
  EXPECT_NEAR(m.shift.value, 4e-3, 1e-12);
  EXPECT_NEAR(m.side_difference.value, 6, 1e-9);
  // Half a step's rectangle is all that scatters: 1/12, over six approaches, and the way to Δp = 0 from their mean of 6 kPa,
  // which is 6²/1600 of it on top: Σ (Δp − 6)² = 2 (0 + 20² + 20²) kPa².
  EXPECT_NEAR(m.middle.std_error, std::sqrt((1.0 / 12) * (1.0 / 6 + 36.0 / 1600)), 1e-9);
  for (MiddleApproach& a : approaches) a.delta_pressure = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(calibrate_middle(approaches).shift.identifiable);
}

TEST(Calibrate, middle_says_when_the_joint_still_moves_and_refuses_one_approach) {
  MiddleApproach moving = approach(1000, 0);
  for (std::size_t i = 0; i < moving.counts.size(); ++i) moving.counts[i] += 0.5 * static_cast<double>(i);
  EXPECT_EQ(calibrate_middle(std::array{moving, approach(1010, 0)}).warnings.front().code, "still_moving");
  EXPECT_THROW((void)calibrate_middle(std::array{approach(1000, 0)}), Error);
}

TEST(WindowMeans, average_over_fifty_milliseconds_and_skip_what_is_missing) {
  std::vector<double> time, values;
  for (int i = 0; i < 110; ++i) {
    time.push_back(0.002 * i);
    values.push_back(i < 25 ? 1.0 : i < 50 ? 2.0 : i < 75 ? 3.0 : 4.0);
  }
  values[3] = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> means = window_means(time, values, 0.05);
  ASSERT_EQ(means.size(), 4u);  // 110 rows are four windows of 25 and ten rows, less than half a window
  EXPECT_DOUBLE_EQ(means[0], 1.0);
  EXPECT_DOUBLE_EQ(means[1], 2.0);
  EXPECT_DOUBLE_EQ(means[2], 3.0);
  EXPECT_DOUBLE_EQ(means[3], 4.0);
}

}  // namespace
}  // namespace isac::estimate
