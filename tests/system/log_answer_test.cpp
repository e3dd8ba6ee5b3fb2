// The JSON answer of isac-log, from outcomes made by hand.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "log/answer.hpp"

namespace isac::apps {
namespace {

using runtime::RecordingOutcome;

RecordingOutcome outcome(bool keep) {
  RecordingOutcome made;
  made.file = "folder/run.csv";
  made.verdict.facts.rows = 1000;
  made.verdict.facts.speed_forward = 5.5;
  made.verdict.remarks.push_back({"time_gaps", "3 samples are missing.", false});
  if (!keep) made.verdict.remarks.push_back({"speed_too_low", "the speed reached 1 of 6 rad/s.", true});
  return made;
}

TEST(LogAnswer, is_json_with_null_for_what_is_not_known) {
  const auto answer = nlohmann::json::parse(format_outcomes({outcome(true), outcome(false)}, true));
  EXPECT_EQ(answer["schema"], "isac.log/1");
  EXPECT_EQ(answer["verdict"], "repeat");
  EXPECT_EQ(answer["recordings"][0]["verdict"], "keep");
  EXPECT_EQ(answer["recordings"][1]["remarks"][1]["code"], "speed_too_low");
  EXPECT_EQ(answer["recordings"][0]["facts"]["speed"]["high"], 5.5);
  EXPECT_TRUE(answer["recordings"][0]["facts"]["force"]["low"].is_null());
  EXPECT_EQ(nlohmann::json::parse(format_outcomes({outcome(true)}, false))["verdict"],
            "repeat");  // cut short
  EXPECT_EQ(nlohmann::json::parse(format_outcomes({outcome(true)}, true))["verdict"], "keep");
}

}  // namespace
}  // namespace isac::apps
