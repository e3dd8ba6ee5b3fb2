// docs/formats.md cannot drift: its recordings are read or refused as it says, its units and names are those of the code.
#include <gtest/gtest.h>

#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/column_catalogue.hpp"
#include "isac/record/csv_reader.hpp"

namespace {

std::vector<std::string> lines_of(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

const std::vector<std::string>& document() {
  static const std::vector<std::string> lines = lines_of(std::string(ISAC_SOURCE_DIR) + "/docs/formats.md");
  return lines;
}

struct Example {
  std::string text;
  std::string instruction;  ///< of the comment line before the block: "options: …" or "refused: …"
  std::size_t line = 0;
};

std::vector<Example> csv_examples() {
  std::vector<Example> examples;
  const auto& lines = document();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i] != "```csv") continue;
    Example example;
    example.line = i + 1;
    const std::string& before = i > 0 ? lines[i - 1] : lines[i];
    if (before.starts_with("<!-- ") && before.ends_with(" -->"))
      example.instruction = before.substr(5, before.size() - 9);
    for (++i; i < lines.size() && lines[i] != "```"; ++i) example.text += lines[i] + "\n";
    examples.push_back(example);
  }
  return examples;
}

// "--map a="b c":s --map d=e:deg" as options.
isac::record::ReadOptions options_of(const std::string& words) {
  isac::record::ReadOptions options;
  const std::string flag = "--map ";
  for (std::size_t at = words.find(flag); at != std::string::npos;) {
    const std::size_t next = words.find(" " + flag, at + 1);
    const std::size_t begin = at + flag.size();
    options.map.push_back(
        isac::record::parse_column_map(words.substr(begin, next == std::string::npos ? next : next - begin)));
    at = next == std::string::npos ? next : next + 1;
  }
  return options;
}

TEST(FormatsDocument, has_recordings_that_are_read_or_refused_as_it_says) {
  int read = 0;
  int refused = 0;
  for (const Example& example : csv_examples()) {
    SCOPED_TRACE("docs/formats.md:" + std::to_string(example.line));
    const std::string refusal = "refused: ";
    if (!example.instruction.starts_with(refusal)) {
      const auto run =
          isac::record::parse_recording(example.text, "slow.csv", options_of(example.instruction));
      EXPECT_GE(run.rows(), 2U);
      ++read;
      continue;
    }
    std::istringstream words(example.instruction.substr(refusal.size()));
    std::string code;
    long line = 0;
    long column = 0;
    words >> code >> line >> column;
    try {
      (void)isac::record::parse_recording(example.text, "slow.csv");
      ADD_FAILURE() << "was read";
    } catch (const isac::Error& error) {
      EXPECT_EQ(error.code(), code);
      EXPECT_EQ(error.place().line, line);
      EXPECT_EQ(error.place().column, column);
      ++refused;
    }
  }
  EXPECT_GE(read, 4);
  EXPECT_GE(refused, 2);
}

TEST(FormatsDocument, quotes_an_error_sentence_word_for_word) {
  std::string quoted;
  for (const std::string& line : document()) {
    if (line.starts_with("    slow.csv:")) quoted = line.substr(4);
  }
  try {
    (void)isac::record::parse_recording("time [s],angle [m]\n0,1\n", "slow.csv");
    FAIL();
  } catch (const isac::Error& error) {
    EXPECT_EQ(quoted, error.what());
  }
}

// The words in back quotes of a line.
std::vector<std::string> quoted_words(const std::string& line) {
  std::vector<std::string> words;
  for (std::size_t open = line.find('`'); open != std::string::npos;) {
    const std::size_t close = line.find('`', open + 1);
    if (close == std::string::npos) break;
    words.push_back(line.substr(open + 1, close - open - 1));
    open = line.find('`', close + 1);
  }
  return words;
}

// The rows of the table whose header line begins with `first`.
std::vector<std::string> table(const std::string& first) {
  std::vector<std::string> rows;
  const auto& lines = document();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (!lines[i].starts_with(first)) continue;
    for (i += 2; i < lines.size() && lines[i].starts_with("|"); ++i) rows.push_back(lines[i]);
  }
  return rows;
}

TEST(FormatsDocument, lists_units_that_the_code_reads_one_dimension_in_a_row) {
  std::size_t units = 0;
  for (const std::string& row : table("| quantity | units |")) {
    std::optional<isac::Dimension> dimension;
    for (const std::string& text : quoted_words(row)) {
      const auto unit = isac::parse_unit(text);
      ASSERT_TRUE(unit) << text;
      if (!dimension) dimension = unit->dimension;
      EXPECT_EQ(unit->dimension, *dimension) << text;
      ++units;
    }
  }
  EXPECT_GE(units, 40U);
}

TEST(FormatsDocument, lists_names_that_the_code_knows) {
  std::size_t names = 0;
  for (const std::string& row : table("| names | what | units |")) {
    const std::string first_cell = row.substr(0, row.find('|', 1));
    for (const std::string& name : quoted_words(first_cell)) {
      EXPECT_TRUE(isac::record::find_known_column(name)) << name;
      ++names;
    }
  }
  EXPECT_GE(names, 25U);
  for (const char* outside :
       {"theta0", "theta7", "phi7", "tau0", "enc6", "ai8", "ao12", "ai01", "ai", "ai-1", "Angle", "p3"}) {
    EXPECT_FALSE(isac::record::find_known_column(outside)) << outside;
  }
}

TEST(FormatsDocument, lists_every_code_that_the_bad_fixtures_bring_about) {
  std::set<std::string> listed;
  for (const std::string& row : table("| code | what was found |")) {
    for (const std::string& word : quoted_words(row)) listed.insert(word);
  }
  for (const std::string& row : lines_of(std::string(ISAC_SOURCE_DIR) + "/fixtures/bad/expected.csv")) {
    std::istringstream cells(row);
    std::string file;
    std::string program;
    std::string code;
    std::getline(cells, file, ';');
    std::getline(cells, program, ';');
    std::getline(cells, code, ';');
    EXPECT_TRUE(file == "file" || listed.contains(code)) << code << " of " << file;
  }
}

}  // namespace
