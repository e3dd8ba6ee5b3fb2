#include "isac/record/answer.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

namespace isac::record {
namespace {

Answer example() {
  Answer answer;
  answer.schema = "isac.joint/1";
  Estimated known;
  known.name = "A";
  known.unit = "N/m";
  known.value = -23450;
  known.std_error = 12.5;
  known.ci_low = -23475;
  known.ci_high = -23425;
  Estimated refused;
  refused.name = "C";
  refused.unit = "N m s3";
  refused.identifiable = false;
  refused.reason = "Sweep up to 6 rad/s.";
  answer.parameters = {known, refused};
  answer.fit = {.rmse = 0.03, .unit = "N m", .nrmse = 0.004, .samples = 1e6, .heldout_rmse = 0.1};
  answer.warnings = {{"few_rows", "Only 3 rows."}};
  return answer;
}

TEST(Answer, is_written_with_the_keys_of_the_contract_in_their_order) {
  EXPECT_EQ(
      format_answer(example()),
      R"({"schema":"isac.joint/1","parameters":{"A":{"value":-23450.0,"unit":"N/m","std_error":12.5,)"
      R"("ci95":[-23475.0,-23425.0],"identifiable":true},"C":{"value":null,"unit":"N m s3","std_error":null,)"
      R"("ci95":[null,null],"identifiable":false,"reason":"Sweep up to 6 rad/s."}},)"
      R"("fit":{"rmse":0.03,"unit":"N m","nrmse":0.004,"samples":1000000,"heldout_rmse":0.1},)"
      R"("warnings":[{"code":"few_rows","text":"Only 3 rows."}]})");
}

TEST(Answer, gives_a_reason_only_beside_what_is_not_identifiable) {
  Answer answer = example();
  answer.parameters[0].reason = "these runs do not tell it";
  const std::string text = format_answer(answer);
  EXPECT_NE(text.find(R"("identifiable":true,"remark":"these runs do not tell it")"), std::string::npos)
      << text;
  EXPECT_NE(text.find(R"("identifiable":false,"reason":"Sweep)"), std::string::npos) << text;
}

TEST(Answer, numbers_read_back_to_the_same_double) {
  Answer answer = example();
  for (const double value : {0.1, 1.0 / 3, 1e-300, 1.7976931348623157e308, -23449.999999999996}) {
    answer.parameters[0].value = value;
    EXPECT_EQ(nlohmann::json::parse(format_answer(answer))["parameters"]["A"]["value"].get<double>(), value);
  }
}

TEST(Answer, infinity_is_null_because_json_has_no_word_for_it) {
  Answer answer = example();
  answer.fit.rmse = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(nlohmann::json::parse(format_answer(answer))["fit"]["rmse"].is_null());
}

TEST(Answer, extra_keys_come_last) {
  const std::string text = format_answer(example(), {{"condition", 38.0}});
  EXPECT_TRUE(text.ends_with(R"(,"condition":38.0})")) << text;
}

TEST(Answer, a_text_that_is_not_utf8_still_gives_valid_json) {
  Answer answer = example();
  answer.warnings[0].text = "file \xff\xfe.csv";
  EXPECT_TRUE(nlohmann::json::accept(format_answer(answer)));
}

TEST(Answer, an_error_says_where_and_null_where_the_place_is_not_known) {
  const Error full(ErrorKind::kBadInput, "unit_unknown", "'kilopond' is not a known unit",
                   {"rig.toml", 4, 20});
  EXPECT_EQ(
      format_error(full),
      R"({"error":{"code":"unit_unknown","text":"'kilopond' is not a known unit","file":"rig.toml","line":4,"column":20}})");
  const Error bare(ErrorKind::kUsage, "usage", "name a file");
  EXPECT_EQ(format_error(bare),
            R"({"error":{"code":"usage","text":"name a file","file":null,"line":null,"column":null}})");
}

}  // namespace
}  // namespace isac::record
