// docs/formats.md cannot drift: each of its TOML examples is read by its reader, each JSON example has the keys that are written.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "isac/record/answer.hpp"
#include "isac/record/data_tables.hpp"
#include "isac/record/model_file.hpp"
#include "isac/record/params.hpp"
#include "isac/record/plan_file.hpp"
#include "isac/record/rig.hpp"
#include "isac/record/tables.hpp"

namespace isac::record {
namespace {

std::vector<std::string> examples(const std::string& language) {
  std::vector<std::string> out;
  std::ifstream file(std::string(ISAC_SOURCE_DIR) + "/docs/formats.md");
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line == "```" + language) {
      inside = true;
      out.emplace_back();
    } else if (line == "```") {
      inside = false;
    } else if (inside) {
      out.back() += line + "\n";
    }
  }
  return out;
}

/// The example whose first line names `format`.
std::string example_of(const std::string& format) {
  for (const std::string& text : examples("toml")) {
    if (text.starts_with("format = \"" + format + "\"\n")) return text;
  }
  ADD_FAILURE() << "docs/formats.md has no example of " << format;
  return {};
}

TEST(FormatsDocument, every_toml_example_is_read_by_its_reader) {
  EXPECT_EQ(parse_rig(example_of("isac.rig/1"), "formats.md").calibration.size(), 1u);
  EXPECT_EQ(parse_model(example_of("isac.model/1"), "formats.md").terms.size(), 4u);
  EXPECT_EQ(parse_params(example_of("isac.params/1"), "formats.md").sections.size(), 5u);
  EXPECT_EQ(parse_data(example_of("isac.data/1"), "formats.md").number(0, "length"), 0.51);
  EXPECT_EQ(parse_plan(example_of("isac.plan/1"), "formats.md").runs.size(), 2u);
  EXPECT_EQ(examples("toml").size(), 5u) << "an example that no line above reads";
}

TEST(FormatsDocument, the_limits_of_the_rig_example_are_those_used_where_none_is_given) {
  const Rig shown = parse_rig(example_of("isac.rig/1"), "formats.md");
  const RigLimits used;
  // Units are converted on the one side and written in SI on the other: two roundings.
  EXPECT_DOUBLE_EQ(shown.limits.delta_pressure, used.delta_pressure);
  EXPECT_DOUBLE_EQ(shown.limits.pressure, used.pressure);
  EXPECT_DOUBLE_EQ(shown.limits.angle, used.angle);
  EXPECT_DOUBLE_EQ(shown.limits.speed, used.speed);
  EXPECT_DOUBLE_EQ(shown.limits.force, used.force);
}

TEST(FormatsDocument, the_params_example_can_be_deployed_whole_but_for_what_it_refuses) {
  const DeploymentTables tables = make_tables(parse_params(example_of("isac.params/1"), "formats.md"));
  ASSERT_EQ(tables.warnings.size(), 2u);  // C is refused in the example, and one mass of three is no set
  EXPECT_NE(tables.warnings[0].text.find("C of [joint]"), std::string::npos);
  EXPECT_NE(tables.warnings[1].text.find("[masses]"), std::string::npos);
}

std::vector<std::string> keys_of(const nlohmann::ordered_json& object) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : object.items()) keys.push_back(key);
  return keys;
}

TEST(FormatsDocument, json_examples_have_the_keys_that_are_written_in_their_order) {
  const auto all = examples("json");
  const auto shown = nlohmann::ordered_json::parse(all.at(0));
  Answer answer;
  answer.schema = "isac.joint/1";
  answer.parameters.resize(2);
  answer.parameters[0].name = "A";
  answer.parameters[1].name = "C";
  answer.parameters[1].identifiable = false;
  answer.parameters[1].reason = "Sweep up to 6 rad/s.";
  answer.warnings = {{"speed_range", "The sweeps reach only 1.2 rad/s."}};
  const auto written = nlohmann::ordered_json::parse(format_answer(answer));
  EXPECT_EQ(keys_of(written), keys_of(shown));
  EXPECT_EQ(keys_of(written["fit"]), keys_of(shown["fit"]));
  for (const char* name : {"A", "C"})
    EXPECT_EQ(keys_of(written["parameters"][name]), keys_of(shown["parameters"][name]));
  EXPECT_EQ(written["warnings"], shown["warnings"]);

  const auto error = nlohmann::ordered_json::parse(all.at(1));
  const Error same(ErrorKind::kBadInput, "unit_unknown", "'kilopond' is not a known unit",
                   {"rig.toml", 4, 20});
  EXPECT_EQ(nlohmann::ordered_json::parse(format_error(same)), error);
}

}  // namespace
}  // namespace isac::record
