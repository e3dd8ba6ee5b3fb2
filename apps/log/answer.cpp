#include "log/answer.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

namespace isac::apps {
namespace {

using runtime::RecordingOutcome;

using Json = nlohmann::ordered_json;

Json number_or_null(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json range_or_null(double low, double high, const char* unit) {
  return {{"low", number_or_null(low)}, {"high", number_or_null(high)}, {"unit", unit}};
}

Json format_one(const RecordingOutcome& outcome) {
  const series::SweepFacts& facts = outcome.verdict.facts;
  Json remarks = Json::array();
  for (const series::SweepRemark& remark : outcome.verdict.remarks) {
    remarks.push_back({{"code", remark.code}, {"text", remark.text}, {"repeat", remark.repeat}});
  }
  Json levels = Json::array();
  for (const series::SweepFacts::Level& level : facts.levels) {
    const char* unit = level.column[0] == 'F' ? "N" : level.column[0] == 'p' ? "Pa" : "rad";
    levels.push_back({{"signal", level.column},
                      {"mean", number_or_null(level.mean)},
                      {"scatter", number_or_null(level.scatter)},
                      {"unit", unit}});
  }
  Json one = {{"file", outcome.file.string()},
              {"verdict", outcome.verdict.keep() ? "keep" : "repeat"},
              {"samples", facts.rows},
              {"dropped", outcome.dropped},
              {"late", outcome.loop.late},
              {"facts",
               {{"duration", {{"value", number_or_null(facts.duration)}, {"unit", "s"}}},
                {"angle", range_or_null(facts.angle_low, facts.angle_high, "rad")},
                {"speed", range_or_null(-facts.speed_backward, facts.speed_forward, "rad/s")},
                {"delta_pressure", range_or_null(facts.delta_pressure_low, facts.delta_pressure_high, "Pa")},
                {"force", range_or_null(facts.force_low, facts.force_high, "N")}}},
              {"remarks", std::move(remarks)}};
  if (!facts.levels.empty()) one["facts"]["levels"] = std::move(levels);
  return one;
}

}  // namespace

std::string format_outcomes(const std::vector<RecordingOutcome>& outcomes, bool complete) {
  bool keep = complete && !outcomes.empty();
  Json recordings = Json::array();
  for (const RecordingOutcome& outcome : outcomes) {
    keep = keep && outcome.verdict.keep();
    recordings.push_back(format_one(outcome));
  }
  const Json answer = {{"schema", "isac.log/1"},
                       {"verdict", keep ? "keep" : "repeat"},
                       {"complete", complete},
                       {"recordings", std::move(recordings)}};
  return answer.dump(2);
}

}  // namespace isac::apps
