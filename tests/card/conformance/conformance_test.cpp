// What every card promises, over every back end.
#include <gtest/gtest.h>

#include <array>
#include <thread>

#include "allocations.hpp"
#include "back_ends.hpp"

namespace isac::test {
namespace {

using card::Command;
using card::Sample;
using card::Shape;

constexpr std::int64_t kPeriod = 2'000'000;  // 500 Hz

class Conformance : public testing::TestWithParam<BackEnd> {
 protected:
  void SetUp() override { under_test_ = GetParam().open(); }
  card::Card& card() { return *under_test_.opened.card; }
  Command held() {
    Command command;
    EXPECT_EQ(card().outputs(command), Status::kOk);
    return command;
  }
  UnderTest under_test_;
};

TEST_P(Conformance, shape_is_sane) {
  const Shape shape = card().shape();
  EXPECT_GE(shape.encoders, 0);
  EXPECT_LE(shape.encoders, card::kEncoders);
  EXPECT_GE(shape.inputs, 0);
  EXPECT_LE(shape.inputs, card::kInputs);
  EXPECT_GE(shape.outputs, 1);
  EXPECT_LE(shape.outputs, card::kOutputs);
  EXPECT_GT(shape.encoders + shape.inputs, 0);
  EXPECT_GE(shape.encoder_modulus, 8000u);
  EXPECT_GE(shape.input_max_code, 255u);
  EXPECT_GE(shape.output_max_code, 255u);
}

TEST_P(Conformance, time_strictly_increases_and_waiting_is_kept) {
  Sample sample;
  std::int64_t before = -1;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(card().wait_until(k * kPeriod), Status::kOk);
    ASSERT_EQ(card().read(sample), Status::kOk);
    ASSERT_GT(sample.time_ns, before);
    // A replayed row may be up to a quarter of a period early, for its stamp was rounded.
    ASSERT_GE(sample.time_ns, k * kPeriod - (GetParam().ends ? kPeriod / 4 : 0));
    before = sample.time_ns;
  }
  EXPECT_LT(before, 1020 * kPeriod);
}

TEST_P(Conformance, time_strictly_increases_without_waiting) {
  Sample sample;
  std::int64_t before = -1;
  for (int k = 0; k < 100; ++k) {
    ASSERT_EQ(card().read(sample), Status::kOk);
    ASSERT_GT(sample.time_ns, before);
    before = sample.time_ns;
  }
}

TEST_P(Conformance, waiting_for_the_past_returns_at_once) {
  Sample sample;
  ASSERT_EQ(card().wait_until(100 * kPeriod), Status::kOk);
  ASSERT_EQ(card().read(sample), Status::kOk);
  const std::int64_t before = sample.time_ns;
  ASSERT_EQ(card().wait_until(0), Status::kOk);
  ASSERT_EQ(card().wait_until(-5), Status::kOk);
  ASSERT_EQ(card().read(sample), Status::kOk);
  EXPECT_LE(sample.time_ns, before + kPeriod);
}

TEST_P(Conformance, codes_lie_within_their_range) {
  const Shape shape = card().shape();
  Command command;
  Sample sample;
  for (int k = 0; k < 1500; ++k) {
    for (int i = 0; i < shape.outputs; ++i)
      command.output[i] = (k / 100 * 977u + 1000u * i) % (shape.output_max_code + 1);
    ASSERT_EQ(card().write(command), Status::kOk);
    ASSERT_EQ(card().wait_until(k * kPeriod), Status::kOk);
    ASSERT_EQ(card().read(sample), Status::kOk);
    for (const auto code : sample.input) ASSERT_LE(code, shape.input_max_code);
    for (const auto count : sample.encoder) ASSERT_LT(count, shape.encoder_modulus);
    for (int i = shape.inputs; i < card::kInputs; ++i) ASSERT_EQ(sample.input[i], 0u);
    for (int i = shape.encoders; i < card::kEncoders; ++i) ASSERT_EQ(sample.encoder[i], 0u);
  }
}

TEST_P(Conformance, write_is_held) {
  const Shape shape = card().shape();
  Command command;
  for (int i = 0; i < shape.outputs; ++i) command.output[i] = 100u * (i + 1);
  ASSERT_EQ(card().write(command), Status::kOk);
  EXPECT_EQ(held().output, command.output);
  ASSERT_EQ(card().wait_until(5 * kPeriod), Status::kOk);
  EXPECT_EQ(held().output, command.output);
}

TEST_P(Conformance, write_beyond_the_range_is_refused_and_the_old_value_kept) {
  const Shape shape = card().shape();
  Command command;
  for (int i = 0; i < shape.outputs; ++i) command.output[i] = shape.output_max_code;
  ASSERT_EQ(card().write(command), Status::kOk);
  for (int channel = 0; channel < shape.outputs; ++channel) {
    Command wrong;  // zeros elsewhere, so that a partial write would show
    wrong.output[channel] = shape.output_max_code + 1;
    EXPECT_EQ(card().write(wrong), Status::kOutOfRange);
    EXPECT_EQ(held().output, command.output);
    wrong.output[channel] = ~0u;
    EXPECT_EQ(card().write(wrong), Status::kOutOfRange);
    EXPECT_EQ(held().output, command.output);
  }
}

TEST_P(Conformance, heartbeat_moves_no_valve_and_is_refused_where_there_is_none) {
  const Shape shape = card().shape();
  Command command;
  for (int i = 0; i < shape.outputs; ++i) command.output[i] = 100u * (i + 1);
  ASSERT_EQ(card().write(command), Status::kOk);
  for (const bool level : {true, false, true})
    EXPECT_EQ(card().beat(level), shape.heartbeat ? Status::kOk : Status::kNotPermitted);
  EXPECT_EQ(held().output, command.output);
}

TEST_P(Conformance, channels_beyond_the_shape_are_ignored) {
  const Shape shape = card().shape();
  if (shape.outputs == card::kOutputs) GTEST_SKIP() << "all channels are in use";
  Command command;
  command.output[shape.outputs] = ~0u;
  command.output[0] = 7;
  EXPECT_EQ(card().write(command), Status::kOk);
  EXPECT_EQ(held().output[0], 7u);
}

TEST_P(Conformance, vent_closes_all_valves_any_number_of_times) {
  Command command;
  for (int i = 0; i < card().shape().outputs; ++i) command.output[i] = 2000;
  for (int again = 0; again < 3; ++again) {
    ASSERT_EQ(card().write(command), Status::kOk);
    EXPECT_EQ(card().vent(), Status::kOk);
    EXPECT_EQ(card().vent(), Status::kOk);
    EXPECT_EQ(held().output, Command{}.output);
    ASSERT_EQ(card().wait_until((again + 1) * 10 * kPeriod), Status::kOk);
    EXPECT_EQ(held().output, Command{}.output);
    EXPECT_TRUE(under_test_.vented());
  }
}

TEST_P(Conformance, vent_from_another_thread_reaches_the_valves) {
  Command command;
  for (int i = 0; i < card().shape().outputs; ++i) command.output[i] = 2000;
  ASSERT_EQ(card().write(command), Status::kOk);
  std::thread other([this] {
    for (int k = 0; k < 50; ++k) EXPECT_EQ(card().vent(), Status::kOk);
  });
  Sample sample;
  for (int k = 0; k < 500; ++k) {  // meanwhile the loop goes on
    EXPECT_EQ(card().wait_until(k * kPeriod), Status::kOk);
    EXPECT_EQ(card().read(sample), Status::kOk);
  }
  other.join();
  ASSERT_EQ(card().wait_until(501 * kPeriod), Status::kOk);
  EXPECT_EQ(held().output, Command{}.output);
  EXPECT_TRUE(under_test_.vented());
}

TEST_P(Conformance, destroyed_card_vents) {
  Command command;
  for (int i = 0; i < card().shape().outputs; ++i) command.output[i] = 2000;
  ASSERT_EQ(card().write(command), Status::kOk);
  ASSERT_FALSE(under_test_.vented());
  under_test_.opened.card.reset();
  EXPECT_TRUE(under_test_.vented());
}

TEST_P(Conformance, loop_allocates_nothing) {
  card::Card& c = card();
  card::Task sweep{
      .kind = card::Task::Kind::kSweepByHand, .amplitude_rad = 0.4, .speed_rad_s = 5, .vary_speed = true};
  if (under_test_.opened.person) under_test_.opened.person->ask(sweep);
  Sample sample;
  Command command;
  std::array<Status, 4> worst{};
  const std::uint64_t before = allocations();
  for (int k = 1; k < 2500; ++k) {
    for (int i = 0; i < 2; ++i) command.output[i] = 2400u + (k * 7u) % 50u;
    const std::array<Status, 4> status{c.wait_until(k * kPeriod), c.read(sample), c.write(command),
                                       k % 500 == 0 ? c.vent() : Status::kOk};
    for (std::size_t i = 0; i < 4; ++i) {
      if (!ok(status[i])) worst[i] = status[i];
    }
  }
  EXPECT_EQ(allocations(), before);
  for (const Status status : worst) EXPECT_EQ(status, Status::kOk) << describe(status);
}

TEST_P(Conformance, counter_of_allocations_counts) {
  const std::uint64_t before = allocations();
  const auto memory = std::make_unique<int>(3);
  EXPECT_EQ(allocations(), before + 1) << *memory;
}

TEST_P(Conformance, end_of_the_data_is_said_and_stays) {
  if (!GetParam().ends) {
    Sample sample;
    EXPECT_EQ(card().wait_until(30'000'000'000), Status::kOk);
    EXPECT_EQ(card().read(sample), Status::kOk);
    return;
  }
  Sample sample, untouched;
  Status status = Status::kOk;
  int rows = 0;
  while (ok(status = card().read(sample)) && rows < 1'000'000) ++rows;
  EXPECT_EQ(status, Status::kEndOfData);
  EXPECT_EQ(rows, 3000);
  untouched = sample;
  EXPECT_EQ(card().read(sample), Status::kEndOfData);
  EXPECT_EQ(sample.time_ns, untouched.time_ns);
  EXPECT_EQ(card().wait_until(sample.time_ns + kPeriod), Status::kEndOfData);
  EXPECT_EQ(card().vent(), Status::kOk);
}

INSTANTIATE_TEST_SUITE_P(BackEnds, Conformance, testing::ValuesIn(back_ends()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace isac::test
