// What check says of a recording's signals.
#include "isac/series/signal_summary.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace isac::series {
namespace {

Recording recording_of(const std::string& name, const std::vector<double>& values, double interval = 0.002) {
  Recording recording;
  std::vector<double> time;
  for (std::size_t i = 0; i < values.size(); ++i) time.push_back(interval * static_cast<double>(i));
  recording.columns = {{"time", "s", time}, {name, "N", values}};
  return recording;
}

std::size_t count(const RecordingSummary& summary, const std::string& code) {
  return static_cast<std::size_t>(
      std::count_if(summary.remarks.begin(), summary.remarks.end(),
                    [&code](const Warning& remark) { return remark.code == code; }));
}

TEST(SignalSummary, mean_and_deviation_survive_a_large_offset) {
  std::vector<double> values;
  for (int i = 0; i < 1000; ++i) values.push_back(1e9 + (i % 2 == 0 ? 0.5 : -0.5));
  const auto summary = summarise(recording_of("F1", values));
  EXPECT_NEAR(summary.signals[0].mean, 1e9, 1e-3);
  EXPECT_NEAR(summary.signals[0].std, 0.5, 1e-3);  // one pass of sums of squares would have lost all digits
  EXPECT_NEAR(summary.rate, 500, 1e-6);
}

TEST(SignalSummary, a_clipped_noisy_sensor_is_named_and_one_that_is_not_clipped_is_not) {
  std::mt19937 random(7);
  std::normal_distribution<double> gauss(0, 1);
  std::vector<double> clipped, free;
  for (int i = 0; i < 5000; ++i) {
    const double force = 100 * std::sin(0.01 * i) + gauss(random);
    free.push_back(force);
    clipped.push_back(std::min(force, 80.0));
  }
  EXPECT_EQ(count(summarise(recording_of("F1", clipped)), "signal_at_stop"), 1u);
  EXPECT_EQ(count(summarise(recording_of("F1", free)), "signal_at_stop"), 0u);
}

TEST(SignalSummary, an_encoder_at_rest_and_a_held_command_are_not_at_a_stop) {
  std::vector<double> steps;
  for (int i = 0; i < 5000; ++i) steps.push_back((i / 500) % 3);
  EXPECT_EQ(count(summarise(recording_of("p1_cmd", steps)), "signal_at_stop"), 0u);
  std::vector<double> encoder;
  for (int i = 0; i < 5000; ++i)
    encoder.push_back(std::floor(400 * std::clamp(std::sin(0.002 * i), -0.8, 0.8)) / 1000);
  EXPECT_EQ(count(summarise(recording_of("angle", encoder)), "signal_at_stop"), 0u);
}

TEST(SignalSummary, gaps_constants_and_missing_samples_are_said) {
  std::vector<double> values(1000, 3.0);
  Recording recording = recording_of("p1", values);
  for (std::size_t i = 500; i < 1000; ++i) recording.columns[0].values[i] += 0.1;
  recording.columns.push_back({"p2", "Pa", std::vector<double>(1000, std::nan(""))});
  recording.columns.push_back({"F1", "N", values});
  recording.columns.back().values[3] = std::nan("");
  const auto summary = summarise(recording);
  EXPECT_EQ(count(summary, "time_gap"), 1u);
  EXPECT_EQ(count(summary, "signal_constant"), 2u);
  EXPECT_EQ(count(summary, "signal_empty"), 1u);
  EXPECT_EQ(count(summary, "samples_missing"), 1u);
  EXPECT_EQ(summary.signals[1].missing, 1000u);
  EXPECT_TRUE(summarise(Recording{}).signals.empty());
}

}  // namespace
}  // namespace isac::series
