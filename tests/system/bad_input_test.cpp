// Every kind of bad input through the program a person would hand it to: one sentence with file, line, column and the mend, exit
// code 3, and no file left behind.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "run_program.hpp"

namespace isac::test {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;

struct Bad {
  std::string file, code, phrase;
  long line = 0, column = 0;
};

const fs::path& folder_of_bad_inputs() {
  static const fs::path folder = fs::path(ISAC_SOURCE_DIR) / "fixtures" / "bad";
  return folder;
}

std::vector<Bad> bad_recordings() {
  std::vector<Bad> all;
  std::ifstream file(folder_of_bad_inputs() / "expected.csv");
  std::string row, hint, line, column;
  std::getline(file, row);  // header
  while (std::getline(file, row)) {
    Bad bad;
    std::istringstream words(row);
    std::getline(words, bad.file, ';');
    std::getline(words, hint, ';');
    std::getline(words, bad.code, ';');
    std::getline(words, line, ';');
    std::getline(words, column, ';');
    std::getline(words, bad.phrase);
    bad.line = std::stol(line);
    bad.column = std::stol(column);
    all.push_back(bad);
  }
  return all;
}

std::vector<Bad> bad_settings() {
  std::vector<Bad> all;
  std::ifstream file(folder_of_bad_inputs() / "expected_toml.csv");
  std::string row, line, column;
  while (std::getline(file, row)) {
    if (row.empty() || row[0] == '#') continue;
    Bad bad;
    std::istringstream words(row);
    std::getline(words, bad.file, ',');
    std::getline(words, bad.code, ',');
    std::getline(words, line, ',');
    std::getline(words, column, ',');
    std::getline(words, bad.phrase);
    bad.line = std::stol(line);
    bad.column = std::stol(column);
    all.push_back(bad);
  }
  return all;
}

/// The call in which a person would meet the file.
std::vector<std::string> call_for(const Bad& bad) {
  const std::string path = (folder_of_bad_inputs() / bad.file).string();
  const std::string good = std::string(ISAC_SOURCE_DIR) + "/fixtures/recordings/slow.csv";
  const std::string rig = std::string(ISAC_SOURCE_DIR) + "/fixtures/rig/testbed.toml";
  if (bad.file.rfind("csv_", 0) == 0) return {"isac-identify", "joint", path, "--rig", rig};
  if (bad.file.rfind("rig_", 0) == 0) return {"isac-identify", "joint", good, "--rig", path};
  if (bad.file.rfind("model_", 0) == 0)
    return {"isac-identify", "joint", good, "--rig", rig, "--model", path};
  if (bad.file.rfind("plan_", 0) == 0) return {"isac-log", "--plan", path, "--rig", rig};
  return {"isac-identify", "export", path};
}

void expect_answered(const Bad& bad) {
  SCOPED_TRACE(bad.file);
  const ScratchFolder scratch;
  std::vector<std::string> words = call_for(bad);
  if (words[0] == "isac-log") {
    words.insert(words.end(), {"-o", scratch / "dataset"});
  } else if (words[1] == "export") {
    words.insert(words.end(), {"-o", scratch / "tables"});
  } else {
    words.insert(words.end(), {"-o", scratch / "params.toml", "--report", scratch / "report.html"});
  }
  const auto run = run_program(words);
  EXPECT_EQ(run.exit_code, 3) << run.err;
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  EXPECT_NE(run.err.find(bad.phrase), std::string::npos)
      << "expected: " << bad.phrase << "\nfound: " << run.err;
  std::string place = bad.file;
  if (bad.line > 0) place += ":" + std::to_string(bad.line);
  if (bad.line > 0 && bad.column > 0) place += ":" + std::to_string(bad.column);
  EXPECT_NE(run.err.find(place + ": "), std::string::npos) << "expected: " << place << "\nfound: " << run.err;
  EXPECT_TRUE(fs::is_empty(scratch.path())) << "a file was left behind";

  words.insert(words.end(), {"--json", "-"});
  const auto with_json = run_program(words);
  EXPECT_EQ(with_json.exit_code, 3);
  const json answer = json::parse(with_json.out, nullptr, false);
  ASSERT_TRUE(answer.is_object() && answer.contains("error")) << with_json.out;
  EXPECT_EQ(answer["error"]["code"], bad.code);
  if (bad.line > 0) {
    EXPECT_EQ(answer["error"]["line"], bad.line);
  }
  EXPECT_TRUE(fs::is_empty(scratch.path())) << "a file was left behind";
}

TEST(BadInput, every_bad_recording_is_answered_with_one_sentence_and_leaves_nothing) {
  const auto all = bad_recordings();
  ASSERT_GE(all.size(), 30u) << "thirty kinds of bad input are promised";
  for (const Bad& bad : all) expect_answered(bad);
}

TEST(BadInput, every_bad_setting_is_answered_with_one_sentence_and_leaves_nothing) {
  const auto all = bad_settings();
  ASSERT_GE(all.size(), 25u);
  for (const Bad& bad : all) expect_answered(bad);
}

TEST(BadInput, a_missing_file_a_folder_and_a_file_without_permission_are_told_apart) {
  const ScratchFolder scratch;
  const std::string rig = std::string(ISAC_SOURCE_DIR) + "/fixtures/rig/testbed.toml";
  const auto missing = run_program({"isac-identify", "joint", scratch / "gone.csv", "--rig", rig});
  EXPECT_EQ(missing.exit_code, 3);
  EXPECT_NE(missing.err.find("gone.csv"), std::string::npos);
  fs::create_directory(scratch.path() / "rig.toml");
  const auto folder =
      run_program({"isac-identify", "joint", std::string(ISAC_SOURCE_DIR) + "/fixtures/recordings/slow.csv",
                   "--rig", scratch / "rig.toml"});
  EXPECT_EQ(folder.exit_code, 3);
  EXPECT_NE(missing.err, folder.err);
}

}  // namespace
}  // namespace isac::test
