// The periodic loop on a card of a few lines: what it commands, how it ends, and that it never allocates.
#include "isac/runtime/experiment_loop.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <new>

#include "counted_new.hpp"
#include "fake_rig.hpp"
#include "isac/record/csv_reader.hpp"

namespace isac::runtime {
namespace {

namespace fs = std::filesystem;
constexpr double kKgf = kPascalPerKgfCm2;

class Loop : public testing::Test {
 protected:
  Loop() {
    std::string pattern = (fs::temp_directory_path() / "isac-loop-XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    auto card = std::make_unique<test::FakeCard>();
    auto person = std::make_unique<test::FakePerson>();
    card_ = card.get();
    person_ = person.get();
    rig_.card = std::move(card);
    rig_.person = std::move(person);
    map_ = std::make_unique<SignalMap>(record::Rig{}, card_->shape());
    options_.limits = {
        .pressure = 5 * kKgf, .delta_pressure = 2 * kKgf, .angle = 1.2, .speed = 9.0, .force = 150.0};
    options_.virtual_time = true;
    series::ExcitationOptions excitation;
    excitation.duration = 4.0;
    program_ = series::make_programs("free", excitation).at(0);
  }
  ~Loop() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  LoopResult play() {
    ExperimentLoop loop(rig_, *map_, program_, options_, live_, stop_);
    LoopResult result = loop.lead_in();
    if (result.end != LoopResult::End::kDone) return result;
    LogWriter writer(folder_ / "run.csv", {}, map_->shape(), false);
    result = loop.record(writer);
    writer.finish();
    return result;
  }
  series::Recording recorded() const { return record::read_recording(folder_ / "run.csv"); }

  fs::path folder_;
  card::Opened rig_;
  test::FakeCard* card_;
  test::FakePerson* person_;
  std::unique_ptr<SignalMap> map_;
  LoopOptions options_;
  series::Program program_;
  RecordingLive live_;
  std::atomic<bool> stop_{false};
};

TEST_F(Loop, plays_the_program_sample_by_sample) {
  const LoopResult result = play();
  EXPECT_EQ(result.end, LoopResult::End::kDone);
  EXPECT_EQ(result.rows, 2000u);  // 4 s at 500 Hz
  EXPECT_EQ(result.late, 0u);
  const series::Recording back = recorded();
  ASSERT_EQ(back.rows(), 2000u);
  const auto& time = back.column("time").values;
  const auto& p2 = back.column("p2_cmd").values;
  const double code = 5.0 * kKgf / 4095.0;
  for (std::size_t i = 0; i < time.size(); i += 37) {
    EXPECT_NEAR(time[i], 0.002 * static_cast<double>(i), 1e-9);
    EXPECT_NEAR(p2[i], program_.at(time[i]).p2, 0.51 * code) << time[i];  // the valve's resolution
  }
}

TEST_F(Loop, brings_the_pressures_up_slowly_before_it_records) {
  double steepest = 0.0, before = 0.0;
  bool recording = false;
  card_->on_wait = [&](test::FakeCard& card) {
    recording = recording || live_.recording.load();
    const double now = card.written.output[0];
    if (!recording) steepest = std::max(steepest, std::abs(now - before));
    before = now;
  };
  EXPECT_EQ(play().end, LoopResult::End::kDone);
  // 3 kg/cm² (2457 codes) in 1.5 s are 3.3 codes a sample.
  EXPECT_GT(steepest, 0.0);
  EXPECT_LE(steepest, 4.0);
  EXPECT_NEAR(recorded().column("p1").values[0], 3.0 * kKgf,
              0.01 * kKgf);  // up before the first sample; one input code
}

TEST_F(Loop, allocates_nothing_while_it_records) {
  int ticks = 0;
  long allocations = -1;
  card_->on_wait = [&ticks, &allocations, this](test::FakeCard&) {
    if (!live_.recording.load()) return;
    ++ticks;
    if (ticks == 10) test::watch_allocations();
    if (ticks == 1900) allocations = test::watched_allocations();
  };
  EXPECT_EQ(play().end, LoopResult::End::kDone);
  EXPECT_GE(ticks, 1900);
  EXPECT_EQ(allocations, 0);
  test::watch_allocations();
  ::operator delete(::operator new(4));  // the counter counts
  EXPECT_EQ(test::watched_allocations(), 1);
}

TEST_F(Loop, ends_at_a_limit_within_ten_milliseconds_and_says_which) {
  card_->on_wait = [this](test::FakeCard& card) {
    if (live_.elapsed.load() >= 1.0) card.force_2 = test::FakeCard::force_code(161);
  };
  const LoopResult result = play();
  EXPECT_EQ(result.end, LoopResult::End::kLimit);
  EXPECT_EQ(result.fault.kind, Fault::Kind::kForce);
  EXPECT_NEAR(result.fault.value, 161.0, 0.1);  // two codes
  EXPECT_NEAR(result.fault.time, 1.012, 0.003);
}

TEST_F(Loop, ends_at_a_limit_while_it_gets_ready) {
  card_->force_1 = test::FakeCard::force_code(161);
  const LoopResult result = play();
  EXPECT_EQ(result.end, LoopResult::End::kLimit);
  EXPECT_EQ(result.rows, 0u);
  EXPECT_FALSE(fs::exists(folder_ / "run.csv"));
}

TEST_F(Loop, ends_when_the_card_fails_and_keeps_what_it_has) {
  card_->fail_after = 2000;
  const LoopResult result = play();
  EXPECT_EQ(result.end, LoopResult::End::kCard);
  EXPECT_EQ(result.status, Status::kDeviceError);
  EXPECT_GT(result.rows, 100u);
  EXPECT_EQ(recorded().rows(), result.rows);
}

TEST_F(Loop, ends_when_a_replayed_recording_ends) {
  card_->fail_after = 2000;
  card_->failure = Status::kEndOfData;
  EXPECT_EQ(play().end, LoopResult::End::kCardEnded);
}

TEST_F(Loop, ends_when_it_is_told_to) {
  card_->on_wait = [this](test::FakeCard&) {
    if (live_.elapsed.load() >= 0.5) stop_ = true;
  };
  const LoopResult result = play();
  EXPECT_EQ(result.end, LoopResult::End::kStopRequested);
  EXPECT_NEAR(static_cast<double>(result.rows), 251.0, 2.0);
}

TEST_F(Loop, skips_whole_periods_when_it_comes_late_and_counts_them) {
  bool stalled = false;
  card_->on_wait = [&](test::FakeCard& card) {
    if (live_.elapsed.load() < 1.0 || stalled) return;
    stalled = true;
    card.stall_ns = 21'000'000;  // ten and a half periods
  };
  const LoopResult result = play();
  EXPECT_EQ(result.end, LoopResult::End::kDone);
  EXPECT_EQ(result.late, 10u);
  EXPECT_EQ(result.rows, 1990u);
  const auto time = recorded().column("time").values;
  EXPECT_NEAR(time.back(), 3.998, 1e-6);  // the program ends when it should, without a burst to catch up
}

TEST_F(Loop, asks_the_person_before_the_pressures_rise_when_a_clamp_comes_off) {
  bool asked_first = false;
  card_->on_wait = [&](test::FakeCard& card) {
    if (card.writes == 0 && !person_->tasks.empty()) asked_first = true;
  };
  EXPECT_EQ(play().end, LoopResult::End::kDone);
  EXPECT_TRUE(asked_first);
  ASSERT_EQ(person_->tasks.size(), 1u);
  EXPECT_EQ(person_->tasks[0], card::Task::Kind::kRelease);
}

TEST_F(Loop, asks_for_a_sweep_under_pressure_and_to_let_go_at_its_end) {
  series::ExcitationOptions excitation;
  excitation.duration = 2.0;
  program_ = series::make_programs("bundle", excitation).at(0);
  EXPECT_EQ(play().end, LoopResult::End::kDone);
  ASSERT_EQ(person_->tasks.size(), 2u);
  EXPECT_EQ(person_->tasks[0], card::Task::Kind::kSweepByHand);
  EXPECT_EQ(person_->tasks[1], card::Task::Kind::kRest);
  EXPECT_GT(card_->written.output[0], 0u);  // still held: venting is the guard's business
}

TEST_F(Loop, vents_whichever_way_a_scope_is_left) {
  try {
    const VentGuard guard(*card_);
    static_cast<void>(play());
    throw 1;
  } catch (int) {
  }
  EXPECT_EQ(card_->vents, 1);
  EXPECT_EQ(card_->written.output[0], 0u);
}

}  // namespace
}  // namespace isac::runtime
