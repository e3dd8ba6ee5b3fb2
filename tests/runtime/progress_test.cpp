#include "isac/runtime/progress.hpp"

#include <gtest/gtest.h>

#include "isac/core/units.hpp"

namespace isac::runtime {
namespace {

TEST(Progress, shows_time_speed_pressure_and_force_and_fits_the_terminal) {
  series::Program program;
  program.duration = 40.0;
  RecordingLive live;
  live.recording = true;
  live.elapsed = 10.0;
  live.peak_speed = 0.314;
  live.delta_pressure = -kPascalPerKgfCm2;
  live.force_low = 31.4;
  live.force_high = 141.0;
  EXPECT_EQ(progress_line(program, live, 0),
            " 10.0 of 40.0 s  speed to 0.31 rad/s  dp -1.00 kg/cm2  F 31 to 141 N");
  const std::string wide = progress_line(program, live, 120);
  EXPECT_NE(wide.find("[########----------------------]"), std::string::npos) << wide;  // a quarter of thirty
  for (const int columns : {20, 60, 77, 80, 100, 200}) {
    EXPECT_LE(progress_line(program, live, columns).size(), static_cast<std::size_t>(columns));
  }
}

TEST(Progress, says_that_it_gets_ready_before_the_first_sample) {
  const RecordingLive live;
  EXPECT_EQ(progress_line({}, live, 80).rfind("getting ready", 0), 0u);
}

TEST(Progress, breaks_long_text_between_words) {
  const std::string text = "  Move the bar slowly and evenly from one end to the other and back, please.";
  const std::string broken = wrapped(text, 40, 2);
  for (std::size_t begin = 0; begin < broken.size();) {
    const std::size_t end = std::min(broken.find('\n', begin), broken.size());
    EXPECT_LE(end - begin, 40u) << broken;
    begin = end + 1;
  }
  std::string joined = broken;
  for (std::size_t at; (at = joined.find("\n  ")) != std::string::npos;) joined.replace(at, 3, " ");
  EXPECT_EQ(joined, text);
  EXPECT_EQ(wrapped(text, 0, 2), text);
}

RecordingOutcome outcome(bool keep) {
  RecordingOutcome made;
  made.file = "folder/run.csv";
  made.verdict.facts.rows = 1000;
  made.verdict.facts.speed_forward = 5.5;
  made.verdict.remarks.push_back({"time_gaps", "3 samples are missing.", false});
  if (!keep) made.verdict.remarks.push_back({"speed_too_low", "the speed reached 1 of 6 rad/s.", true});
  return made;
}

TEST(Progress, says_keep_or_repeat_and_why) {
  const std::string kept = verdict_lines(outcome(true), false, 0);
  EXPECT_EQ(kept.rfind("  keep    run.csv", 0), 0u) << kept;
  EXPECT_NE(kept.find("- note: 3 samples are missing."), std::string::npos) << kept;
  const std::string repeated = verdict_lines(outcome(false), false, 0);
  EXPECT_EQ(repeated.rfind("  repeat  run.csv", 0), 0u) << repeated;
  EXPECT_NE(repeated.find("- the speed reached"), std::string::npos);
  EXPECT_EQ(summary_line({outcome(true)}, 1), "1 recording made, 1 to keep.");
  EXPECT_EQ(summary_line({outcome(true), outcome(false)}, 3),
            "2 recordings made, 1 to keep; repeat run.csv (with --overwrite); 1 of 3 not made.");
}

}  // namespace
}  // namespace isac::runtime
