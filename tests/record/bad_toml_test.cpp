// Every bad TOML file of fixtures/bad gets one sentence with its place and the mend, as fixtures/bad/expected_toml.csv says.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/record/model_file.hpp"
#include "isac/record/params.hpp"
#include "isac/record/plan_file.hpp"
#include "isac/record/rig.hpp"

namespace isac::record {
namespace {

const std::filesystem::path kFolder = std::filesystem::path(ISAC_SOURCE_DIR) / "fixtures/bad";

struct Expected {
  std::string file, code, says;
  long line = 0, column = 0;
};

std::vector<Expected> expected_answers() {
  std::vector<Expected> out;
  std::ifstream stream(kFolder / "expected_toml.csv");
  for (std::string line; std::getline(stream, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream cells(line);
    Expected row;
    std::string number;
    std::getline(cells, row.file, ',');
    std::getline(cells, row.code, ',');
    std::getline(cells, number, ',');
    row.line = std::stol(number);
    std::getline(cells, number, ',');
    row.column = std::stol(number);
    std::getline(cells, row.says);
    out.push_back(row);
  }
  return out;
}

void read_by_name(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  if (name.starts_with("rig_")) {
    (void)read_rig(path);
  } else if (name.starts_with("model_")) {
    (void)read_model(path);
  } else if (name.starts_with("params_")) {
    (void)read_params(path);
  } else if (name.starts_with("plan_")) {
    (void)read_plan(path);
  } else {
    throw std::runtime_error("no reader for " + name);
  }
}

TEST(BadToml, every_file_is_answered_with_place_and_mend) {
  const auto rows = expected_answers();
  ASSERT_GE(rows.size(), 30u);
  for (const Expected& row : rows) {
    SCOPED_TRACE(row.file);
    try {
      read_by_name(kFolder / row.file);
      ADD_FAILURE() << "was accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kBadInput);
      EXPECT_EQ(error.code(), row.code);
      EXPECT_EQ(error.place().file, (kFolder / row.file).string());
      EXPECT_EQ(error.place().line, row.line);
      EXPECT_EQ(error.place().column, row.column);
      EXPECT_NE(error.text().find(row.says), std::string::npos) << error.text();
      EXPECT_EQ(error.text().find('\n'), std::string::npos) << "one sentence, one line";
    }
  }
}

TEST(BadToml, no_bad_toml_file_stands_without_its_expected_answer) {
  std::set<std::string> listed;
  for (const Expected& row : expected_answers()) listed.insert(row.file);
  for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
    if (entry.path().extension() == ".toml") {
      EXPECT_TRUE(listed.contains(entry.path().filename().string())) << entry.path();
    }
  }
}

TEST(BadToml, a_file_that_is_not_there_and_a_folder_are_named) {
  EXPECT_THROW((void)read_rig(kFolder / "no_such_file.toml"), Error);
  try {
    (void)read_rig(kFolder);
    ADD_FAILURE() << "a folder was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), "file_unreadable");
    EXPECT_NE(error.text().find("folder"), std::string::npos);
  }
}

TEST(BadToml, keys_nested_beyond_all_reason_do_not_exhaust_the_stack) {
  std::string dotted = "a";
  for (int i = 0; i < 200000; ++i) dotted += ".a";
  for (const std::string& text :
       {dotted + " = 1\n", "[" + dotted + "]\n", "a = " + std::string(200000, '[') + "\n",
        "a = '''\n" + dotted + "\n'''\nb = \"" + dotted + "\"\n" + dotted + " = 1\n"}) {
    EXPECT_THROW((void)parse_rig(text, "deep.toml"), Error);
    EXPECT_THROW((void)parse_params(text, "deep.toml"), Error);
  }
}

TEST(BadToml, dots_in_texts_comments_and_numbers_are_no_nesting) {
  const std::string text =
      "format = \"isac.rig/1\"  # a.b.c.d.e.f.g.h.i.j.k.l\nname = \"a.b.c.d.e.f.g.h.i.j.k.l\"\n[joint]\n"
      "inertia = '0.0085 kg m2'\n";
  EXPECT_EQ(parse_rig(text, "x.toml").name, "a.b.c.d.e.f.g.h.i.j.k.l");
}

}  // namespace
}  // namespace isac::record
