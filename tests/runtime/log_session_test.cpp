// A whole session with its three threads on the simulated rig; run under the thread sanitizer.
#include "isac/runtime/log_session.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/csv_reader.hpp"

namespace isac::runtime {
namespace {

namespace fs = std::filesystem;

class Watcher : public SessionObserver {
 public:
  bool about_to_record(const series::Program&, std::size_t, std::size_t, bool by_hand) override {
    EXPECT_FALSE(by_hand);
    ++begun;
    return begun <= most;
  }
  void prompt(const std::string& sentence) override { prompts.push_back(sentence); }
  void progress(const series::Program&, const RecordingLive& live) override {
    EXPECT_GE(live.elapsed.load(), 0.0);
    if (stop_when_recording != nullptr && live.recording.load()) *stop_when_recording = true;
  }
  void judged(const RecordingOutcome&) override { ++judgements; }

  int begun = 0, judgements = 0, most = 100;
  std::vector<std::string> prompts;
  std::atomic<bool>* stop_when_recording = nullptr;
};

class Session : public testing::Test {
 protected:
  Session() {
    std::string pattern = (fs::temp_directory_path() / "isac-session-XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    options_.folder = folder_ / "out";
    options_.rig.name = "testbed";
    options_.rig.joint.initial_pressure = 3.0 * kPascalPerKgfCm2;
    options_.limits = {.pressure = options_.rig.limits.pressure,
                       .delta_pressure = options_.rig.limits.delta_pressure,
                       .angle = options_.rig.limits.angle,
                       .speed = options_.rig.limits.speed,
                       .force = options_.rig.limits.force};
    options_.hand_speed_limit = 1.5 * options_.limits.speed;
    plan("pose", 0.0, 1.5);
  }
  ~Session() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  void plan(const char* experiment, double duration, double hold = 0.0) {
    series::ExcitationOptions excitation;
    if (duration > 0.0) excitation.duration = duration;
    if (hold > 0.0) excitation.hold = hold;
    excitation.angles = {0.0, 0.2};
    options_.programs = series::make_programs(experiment, excitation);
  }
  std::vector<RecordingOutcome> run() { return run_session(options_, watcher_, stop_); }
  std::string code_of_refusal() {
    try {
      static_cast<void>(run());
    } catch (const Error& error) {
      return error.code();
    }
    return "none";
  }

  fs::path folder_;
  SessionOptions options_;
  Watcher watcher_;
  std::atomic<bool> stop_{false};
};

TEST_F(Session, records_prompts_and_judges) {
  const auto outcomes = run();
  ASSERT_EQ(outcomes.size(), 1u);
  EXPECT_EQ(outcomes[0].loop.rows, 1500u);  // two poses of 1.5 s at 500 Hz
  EXPECT_EQ(outcomes[0].dropped, 0u);
  EXPECT_EQ(watcher_.prompts.size(), 2u);
  EXPECT_EQ(watcher_.judgements, 1);
  const series::Recording back = record::read_recording(outcomes[0].file);
  EXPECT_EQ(back.rows(), 1500u);
  EXPECT_EQ(back.meta("experiment"), "pose");
  EXPECT_EQ(back.meta("rig"), "testbed");
  EXPECT_EQ(back.meta("card"), "sim:");
  EXPECT_EQ(back.meta("rate"), "500 Hz");
  EXPECT_EQ(back.meta("started").size(), std::string("2026-11-21T00:00:00.000Z").size());
  // The second pose is reached and held.
  EXPECT_NEAR(back.column("angle").values.back(), 0.2, 0.01);
}

TEST_F(Session, stops_when_it_is_told_to_and_keeps_what_it_has) {
  plan("bundle", 100.0);
  options_.pace_real = true;  // slow enough to be caught in the middle
  watcher_.stop_when_recording = &stop_;
  const auto outcomes = run();
  ASSERT_EQ(outcomes.size(), 1u);
  EXPECT_EQ(outcomes[0].loop.end, LoopResult::End::kStopRequested);
  EXPECT_LT(outcomes[0].loop.rows, 50000u);
  EXPECT_EQ(record::read_recording(outcomes[0].file).rows(), outcomes[0].loop.rows);
  EXPECT_FALSE(outcomes[0].verdict.keep());
}

TEST_F(Session, does_nothing_when_the_person_declines) {
  watcher_.most = 0;
  EXPECT_TRUE(run().empty());
  EXPECT_TRUE(fs::is_empty(options_.folder));
}

TEST_F(Session, refuses_to_replace_a_recording_unless_told_to) {
  EXPECT_EQ(code_of_refusal(), "none");
  EXPECT_EQ(code_of_refusal(), "file_exists");
  options_.overwrite = true;
  EXPECT_EQ(code_of_refusal(), "none");
  EXPECT_TRUE(fs::exists(options_.folder / "pose.csv.bak"));
}

TEST_F(Session, refuses_an_output_that_cannot_be) {
  std::ofstream(folder_ / "file") << "x";
  options_.folder = folder_ / "file" / "out";
  EXPECT_EQ(code_of_refusal(), "output_folder");
  options_.folder = folder_ / "huge";
  options_.programs[0].duration = 1e13;  // 900 TB
  EXPECT_EQ(code_of_refusal(), "disk_full");
  EXPECT_FALSE(fs::exists(options_.folder));
}

TEST_F(Session, refuses_a_sample_rate_that_is_none) {
  for (const double rate : {0.0, -5.0, std::nan(""), 1e6}) {
    options_.rate = rate;
    EXPECT_EQ(code_of_refusal(), "rate_nonsense");
  }
  EXPECT_FALSE(fs::exists(options_.folder));
}

TEST_F(Session, leaves_no_file_when_a_limit_stops_it_before_the_first_sample) {
  options_.limits.pressure = 1.0 * kPascalPerKgfCm2;
  EXPECT_EQ(code_of_refusal(), "limit");
  EXPECT_TRUE(fs::is_empty(options_.folder));
}

TEST_F(Session, records_at_the_rate_asked_for_and_with_the_cards_counts) {
  options_.rate = 200.0;
  options_.raw = true;
  const series::Recording back = record::read_recording(run().at(0).file);
  EXPECT_EQ(back.rows(), 600u);
  // What the counts say by hand is what the physical column says.
  const auto& counts = back.column("enc0").values;
  const auto& angle = back.column("angle").values;
  for (std::size_t i = 1; i < angle.size(); i += 50) {
    double moved = counts[i] - counts[0];
    if (moved > 1 << 23) moved -= 1 << 24;
    if (moved < -(1 << 23)) moved += 1 << 24;
    EXPECT_NEAR(angle[i] - angle[0], moved * 2.0 * kPi / 8000.0, 2e-7);  // seven digits behind the point
  }
}

}  // namespace
}  // namespace isac::runtime
