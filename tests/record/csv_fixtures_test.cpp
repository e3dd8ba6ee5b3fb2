// The recordings under fixtures/: the good ones say the same in every dialect, the bad ones are refused as listed.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"

namespace {

namespace fs = std::filesystem;
using isac::Error;
using isac::record::parse_column_map;
using isac::record::read_recording;
using isac::record::ReadOptions;
using isac::series::Recording;

const fs::path kFixtures = fs::path(ISAC_SOURCE_DIR) / "fixtures";

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

struct BadFile {
  friend void PrintTo(const BadFile& bad, std::ostream* out) { *out << bad.file; }
  std::string file, program, code;
  long line = 0;
  long column = 0;
  std::string phrase;
};

std::vector<BadFile> bad_files() {
  std::ifstream list(kFixtures / "bad" / "expected.csv");
  std::vector<BadFile> rows;
  std::string text;
  std::getline(list, text);  // header
  while (std::getline(list, text)) {
    std::istringstream cells(text);
    BadFile row;
    std::string line;
    std::string column;
    std::getline(cells, row.file, ';');
    std::getline(cells, row.program, ';');
    std::getline(cells, row.code, ';');
    std::getline(cells, line, ';');
    std::getline(cells, column, ';');
    std::getline(cells, row.phrase);
    row.line = std::stol(line);
    row.column = std::stol(column);
    rows.push_back(row);
  }
  return rows;
}

class BadRecording : public ::testing::TestWithParam<BadFile> {};

TEST_P(BadRecording, is_refused_with_its_place_and_the_mend_in_one_sentence) {
  const BadFile& bad = GetParam();
  const std::string path = (kFixtures / "bad" / bad.file).string();
  try {
    (void)read_recording(path);
    FAIL() << bad.file << " was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), isac::ErrorKind::kBadInput);
    EXPECT_EQ(error.code(), bad.code) << error.what();
    EXPECT_EQ(error.place().file, path);
    EXPECT_EQ(error.place().line, bad.line) << error.what();
    EXPECT_EQ(error.place().column, bad.column) << error.what();
    EXPECT_NE(error.text().find(bad.phrase), std::string::npos) << error.text();
    EXPECT_EQ(error.text().find('\n'), std::string::npos) << "one line";
    EXPECT_LT(error.text().size(), 320U) << "one sentence: " << error.text();
    EXPECT_NE(error.text().find_first_of(";,"), std::string::npos)
        << "what is wrong; how to mend it: " << error.text();
  }
}

std::string test_name(const ::testing::TestParamInfo<BadFile>& info) {
  return fs::path(info.param.file).stem().string();
}

INSTANTIATE_TEST_SUITE_P(Fixtures, BadRecording, ::testing::ValuesIn(bad_files()), test_name);

TEST(RecordingFixtures, list_every_bad_recording_and_nothing_else) {
  std::size_t listed = 0;
  for (const BadFile& bad : bad_files()) {
    EXPECT_TRUE(fs::exists(kFixtures / "bad" / bad.file)) << bad.file;
    ++listed;
  }
  std::size_t there = 0;
  for (const auto& entry : fs::directory_iterator(kFixtures / "bad")) {
    there += entry.path().filename().string().starts_with("csv_") ? 1U : 0U;
  }
  EXPECT_EQ(listed, there);
  EXPECT_GE(listed, 22U);
}

TEST(RecordingFixtures, are_the_bytes_that_the_documented_command_makes) {
  const fs::path made = fs::temp_directory_path() / ("isac_fixtures_" + std::to_string(::getpid()));
  fs::remove_all(made);
  const std::string command = "sh '" + (kFixtures / "make.sh").string() + "' '" + made.string() + "'";
  ASSERT_EQ(std::system(command.c_str()), 0);
  std::size_t compared = 0;
  for (const auto& entry : fs::recursive_directory_iterator(made)) {
    if (!entry.is_regular_file()) continue;
    const fs::path name = fs::relative(entry.path(), made);
    EXPECT_TRUE(bytes_of(entry.path()) == bytes_of(kFixtures / name)) << name;
    ++compared;
  }
  fs::remove_all(made);
  EXPECT_GE(compared, 30U);
}

void expect_same_numbers(const Recording& a, const Recording& b, const char* name, double tolerance) {
  const auto& left = a.column(name).values;
  const auto& right = b.column(name).values;
  ASSERT_EQ(left.size(), right.size());
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (std::isnan(left[i]) || std::isnan(right[i])) continue;
    ASSERT_NEAR(left[i], right[i], tolerance) << name << " " << i;
  }
}

TEST(RecordingFixtures, say_the_same_in_every_dialect) {
  const Recording plain = read_recording(kFixtures / "recordings/slow.csv");
  ASSERT_EQ(plain.rows(), 120U);
  EXPECT_EQ(plain.meta("experiment"), "constant-pressure");

  ReadOptions maps;
  for (const char* map : {"time=Zeit (s):s", "angle=Winkel (rad):rad", "p1=Druck 1:kg/cm2",
                          "p2=Druck 2:kg/cm2", "F1=Kraft 1:N", "F2=Kraft 2:N"}) {
    maps.map.push_back(parse_column_map(map));
  }
  const std::pair<const char*, ReadOptions> others[] = {{"decimal_comma.csv", maps},
                                                        {"tabs_bom_crlf.csv", {}},
                                                        {"missing_samples.csv", {}},
                                                        {"log_closed.csv", {}}};
  for (const auto& [file, options] : others) {
    const Recording other = read_recording(kFixtures / "recordings" / file, options);
    // The same digits in every file: equal doubles, no tolerance.
    for (const char* name : {"time", "angle", "p1", "p2", "F1", "F2"})
      expect_same_numbers(plain, other, name, 0.0);
  }
}

TEST(RecordingFixtures, hold_gaps_where_samples_are_missing) {
  const Recording gaps = read_recording(kFixtures / "recordings/missing_samples.csv");
  int missing = 0;
  for (double force : gaps.column("F1").values) missing += std::isnan(force) ? 1 : 0;
  EXPECT_EQ(missing, 120 / 7);
}

TEST(RecordingFixtures, drop_the_torn_line_of_the_killed_log) {
  const Recording torn = read_recording(kFixtures / "recordings/log_torn.csv");
  EXPECT_EQ(torn.rows(), 40U);
  EXPECT_EQ(torn.meta("torn_line"), "45");
  const Recording closed = read_recording(kFixtures / "recordings/log_closed.csv");
  EXPECT_EQ(closed.meta("closed"), "2003-05-01T15:00:06Z");
  EXPECT_FALSE(closed.metadata.contains("torn_line"));
}

}  // namespace
