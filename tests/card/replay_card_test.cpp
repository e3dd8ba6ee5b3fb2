// A recorded run comes back code by code, and writes are held against it.
#include "isac/card/replay_card.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "isac/card/calibration.hpp"
#include "isac/core/error.hpp"
#include "isac/record/csv_writer.hpp"

namespace isac::card {
namespace {

constexpr std::int64_t kPeriod = 2'000'000;

struct Driven {
  std::vector<Sample> samples;
  std::vector<Command> commands;
};

/// A simple controller: valve codes from the last encoder count.
Command controller(const Sample& sample) {
  const auto count = static_cast<std::int32_t>(sample.encoder[0] << 8) / 256;
  Command command;
  command.output[0] = static_cast<std::uint32_t>(2457 + count / 2);
  command.output[1] = static_cast<std::uint32_t>(2457 - count / 2);
  return command;
}

Driven drive(const Opened& rig, int n) {
  Driven run;
  if (rig.person) rig.person->ask({.kind = Task::Kind::kSweepByHand, .amplitude_rad = 0.3, .speed_rad_s = 2});
  Sample sample;
  for (int k = 1; k <= n; ++k) {
    if (!ok(rig.card->wait_until(k * kPeriod)) || !ok(rig.card->read(sample))) break;
    run.samples.push_back(sample);
    run.commands.push_back(controller(sample));
    EXPECT_EQ(rig.card->write(run.commands.back()), Status::kOk);
  }
  return run;
}

/// The run as a logger writes it: raw codes, or physical columns by the nominal calibration.
series::Recording recorded(const Driven& run, bool raw) {
  series::Recording r;
  r.source = "test";
  series::Column time{"time", "s", {}};
  for (const auto& s : run.samples) time.values.push_back(static_cast<double>(s.time_ns) * 1e-9);
  r.columns.push_back(time);
  for (const auto& c : default_calibration()) {
    const auto index = static_cast<std::size_t>(c.channel.back() - '0');
    const bool out = c.channel.rfind("ao", 0) == 0, encoder = c.channel.rfind("enc", 0) == 0;
    series::Column column;
    column.name = raw ? c.channel : c.signal;
    column.unit = raw ? "count" : encoder ? "rad" : c.signal[0] == 'F' ? "N" : "Pa";
    for (std::size_t k = 0; k < run.samples.size(); ++k) {
      double code = out ? run.commands[k].output[index] : run.samples[k].input[index];
      if (encoder) code = static_cast<std::int32_t>(run.samples[k].encoder[index] << 8) / 256;
      column.values.push_back(raw ? code : (code - c.offset) * c.gain);
    }
    r.columns.push_back(column);
  }
  return r;
}

class ReplayOfARun : public testing::TestWithParam<bool> {};

TEST_P(ReplayOfARun, gives_the_same_samples_and_the_controller_the_same_commands) {
  const Driven original = drive(open("sim:seed=12"), 2000);
  ASSERT_EQ(original.samples.size(), 2000u);
  const auto path = std::filesystem::temp_directory_path() /
                    ("isac_replay_" + std::to_string(GetParam()) + "_" + std::to_string(::getpid()) + ".csv");
  record::write_recording(path, recorded(original, GetParam()));
  const Opened rig = open("replay:" + path.string());
  EXPECT_EQ(rig.person, nullptr);
  const auto report = dynamic_cast<const ReplayCard&>(*rig.card).report();
  const Driven replayed = drive(rig, 3000);
  std::filesystem::remove(path);
  ASSERT_EQ(replayed.samples.size(), original.samples.size());
  for (std::size_t k = 0; k < replayed.samples.size(); ++k) {
    ASSERT_EQ(replayed.samples[k].time_ns, original.samples[k].time_ns);
    ASSERT_EQ(replayed.samples[k].encoder, original.samples[k].encoder);
    for (const std::size_t i : {0u, 2u, 4u, 6u})
      ASSERT_EQ(replayed.samples[k].input[i], original.samples[k].input[i]);
    ASSERT_EQ(replayed.commands[k].output, original.commands[k].output);
  }
  EXPECT_EQ(report->rows_given, 2000u);
  EXPECT_EQ(report->codes_compared, 4000u);
  EXPECT_EQ(report->codes_different, 0u);
}

INSTANTIATE_TEST_SUITE_P(Columns, ReplayOfARun, testing::Bool(),
                         [](const auto& test) { return test.param ? "raw" : "physical"; });

series::Recording small(std::vector<double> time, std::vector<double> counts) {
  series::Recording r;
  r.source = "small.csv";
  r.columns = {{"time", "s", std::move(time)}, {"enc0", "count", std::move(counts)}};
  return r;
}

TEST(ReplayCard, counts_every_code_that_differs_from_the_recorded_one) {
  auto recording = small({0, 0.01, 0.02}, {1, 2, 3});
  const double missing = std::numeric_limits<double>::quiet_NaN();
  recording.columns.push_back({"ao0", "count", {10, 20, missing}});
  ReplayCard card(recording);
  const auto report = card.report();
  Sample sample;
  Command command;
  EXPECT_EQ(card.write(command), Status::kOk);  // before the first row there is nothing to compare with
  EXPECT_EQ(report->codes_compared, 0u);
  for (const std::uint32_t code : {10u, 21u, 30u}) {
    ASSERT_EQ(card.read(sample), Status::kOk);
    command.output[0] = code;
    EXPECT_EQ(card.write(command), Status::kOk);
  }
  EXPECT_EQ(report->codes_compared, 2u);
  EXPECT_EQ(report->codes_different, 1u);
}

TEST(ReplayCard, skips_rows_before_the_time_waited_for_but_none_that_its_stamp_rounded) {
  ReplayCard card(small({0, 0.0019999, 0.0040001, 0.006, 0.008}, {0, 1, 2, 3, 4}));
  Sample sample;
  ASSERT_EQ(card.wait_until(2'000'000), Status::kOk);
  ASSERT_EQ(card.read(sample), Status::kOk);
  EXPECT_EQ(sample.encoder[0], 1u);
  ASSERT_EQ(card.wait_until(7'000'000), Status::kOk);
  ASSERT_EQ(card.read(sample), Status::kOk);
  EXPECT_EQ(sample.encoder[0], 4u);
  EXPECT_EQ(card.wait_until(9'000'000), Status::kEndOfData);
}

TEST(ReplayCard, missing_samples_repeat_the_one_before_and_negative_counts_wrap) {
  const double missing = std::numeric_limits<double>::quiet_NaN();
  ReplayCard card(small({0, 1e-3, 2e-3, 3e-3}, {missing, -5, missing, 7}));
  std::vector<std::uint32_t> counts;
  Sample sample;
  while (ok(card.read(sample))) counts.push_back(sample.encoder[0]);
  const std::uint32_t minus_five = (1u << 24) - 5;
  EXPECT_EQ(counts, (std::vector<std::uint32_t>{minus_five, minus_five, minus_five, 7}));
}

TEST(ReplayCard, clock_of_day_starts_at_the_first_row) {
  ReplayCard card(small({1.7e9, 1.7e9 + 0.5}, {1, 2}));
  Sample sample;
  ASSERT_EQ(card.read(sample), Status::kOk);
  EXPECT_EQ(sample.time_ns, 0);
  ASSERT_EQ(card.read(sample), Status::kOk);
  EXPECT_EQ(sample.time_ns, 500'000'000);
}

TEST(ReplayCard, refuses_a_recording_without_channels_and_a_missing_file) {
  series::Recording r;
  r.source = "empty.csv";
  r.columns = {{"time", "s", {0, 1}}, {"colour", "-", {1, 2}}};
  try {
    ReplayCard card(r);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kBadInput);
    EXPECT_EQ(error.place().file, "empty.csv");
  }
  EXPECT_THROW(static_cast<void>(open("replay:/nonexistent/run.csv")), Error);
}

}  // namespace
}  // namespace isac::card
