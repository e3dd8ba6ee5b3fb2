// The three programs as a user runs them, with a script in the place of isac-explain.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace blind {
namespace {

class Programs : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "blind-programs-XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// The exit code; what was said stands in the file `said`.
  int run(const std::string& words) {
    const std::string line =
        std::string(ISAC_BIN_DIR) + "/" + words + " > " + path("said") + " 2> " + path("complaint");
    const int status = std::system(line.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] std::string path(const std::string& name) const { return (folder_ / name).string(); }

  std::string script(const std::string& name, const std::string& body) {
    std::ofstream(path(name)) << "#!/bin/sh\n" << body << "\n";
    std::filesystem::permissions(path(name), std::filesystem::perms::owner_all);
    return path(name);
  }
  [[nodiscard]] std::string text(const std::string& name) const {
    std::ifstream in(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  [[nodiscard]] std::vector<std::string> lines(const std::string& name) const {
    std::ifstream in(path(name));
    std::vector<std::string> all;
    for (std::string line; std::getline(in, line);) all.push_back(line);
    return all;
  }

  /// Says that nothing is missing, and keeps the words it was called with.
  std::string contented() {
    return script(
        "contented",
        "echo \"$@\" >> " + path("calls") + "\ntest -f \"$1/rig.toml\" || exit 3\n" +
            R"(echo '{"schema":"isac.explain/1","verdict":"none","disagreement":{"detected":false,)"
            R"("signals":[{"signal":"torque","rmse":0.01,"noise_floor":0.01,"p_value":0.4}],"where":[]},"effects":[],)"
            R"("alternatives":[],"unknown":null,"not_testable":[],"could_hide":[],"next_experiment":null,"gap":null}')");
  }

  std::filesystem::path folder_;
};

TEST_F(Programs, judge_every_dataset_once_and_go_on_where_they_stopped) {
  const std::string call = "blind_run --results " + path("results") + " --explain " + contented() +
                           " --tier none --noise white --count ";
  ASSERT_EQ(run(call + "2 --jobs 2"), 0) << text("complaint");
  EXPECT_EQ(lines("results").size(), 2u);
  // A line that was cut off is done again.
  std::ofstream(path("results"), std::ios::app) << R"({"key":"none/white//1.2","label":{)";
  ASSERT_EQ(run(call + "3"), 0) << text("complaint");
  EXPECT_EQ(lines("results").size(), 4u);
  EXPECT_EQ(lines("calls").size(), 3u);
  ASSERT_EQ(run("blind_score " + path("results")), 0) << text("complaint");
  EXPECT_NE(text("said").find("| white | 3/3 = 100.0 %"), std::string::npos) << text("said");
  EXPECT_FALSE(std::filesystem::exists(lines("calls")[0].substr(0, lines("calls")[0].find(' '))))
      << "datasets are removed";
}

TEST_F(Programs, hand_on_what_is_hidden_and_make_tables_of_the_answers) {
  const std::string results = path("results");
  ASSERT_EQ(run("blind_run --results " + results + " --explain " + contented() +
                " --tier clear --effect leak --noise coloured -- --without {ids}"),
            0)
      << text("complaint");
  EXPECT_NE(text("calls").find("--json - --without leak"), std::string::npos) << text("calls");
  ASSERT_EQ(run("blind_score " + results), 0) << text("complaint");
  EXPECT_NE(text("said").find("| leak | 1 | 0 | (none) (1) |"), std::string::npos) << text("said");
}

TEST_F(Programs, take_the_name_of_what_is_hidden_away_from_the_very_datasets_of_clear) {
  const std::string results = path("results");
  ASSERT_EQ(run("blind_run --results " + results + " --explain " + contented() +
                " --tier clear,leave-one-out --effect force_offset --noise white"),
            0)
      << text("complaint");
  const std::vector<std::string> calls = lines("calls"), all = lines("results");
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(calls[0].find("--exclude"), std::string::npos);
  EXPECT_TRUE(calls[1].ends_with("--json - --exclude force_offset")) << calls[1];
  const auto label = [](const std::string& line) {
    return line.substr(line.find("\"label\""), line.find("\"oracle\"") - line.find("\"label\""));
  };
  EXPECT_EQ(label(all[0]), label(all[1]));
  ASSERT_EQ(run("blind_score " + results), 0) << text("complaint");
  EXPECT_NE(text("said").find("name taken out"), std::string::npos) << text("said");
}

TEST_F(Programs, ask_the_oracle_only_where_a_name_can_be_right) {
  ASSERT_EQ(run("blind_run --oracle --results " + path("results") + " --explain " + contented() +
                " --tier none,outside --effect root_damping --noise white"),
            0)
      << text("complaint");
  const std::vector<std::string> all = lines("results");
  ASSERT_EQ(all.size(), 2u);
  EXPECT_TRUE(all[1].starts_with(
      "{\"key\":\"unknown/white/root_damping/"));  // the tier's name of old: its seeds stay
  for (const std::string& line : all) EXPECT_NE(line.find("\"oracle\":null"), std::string::npos);
}

TEST_F(Programs, end_an_answer_that_takes_too_long) {
  ASSERT_EQ(run("blind_run --results " + path("results") + " --explain " + script("slow", "exec sleep 60") +
                " --tier none --noise white --timeout 0.3"),
            0);
  ASSERT_EQ(run("blind_score " + path("results")), 0);
  EXPECT_NE(text("said").find("without an answer: 1 (killed: too slow)"), std::string::npos) << text("said");
}

TEST_F(Programs, say_by_their_exit_code_what_went_wrong) {
  const std::string call = "blind_generate --out " + path("dataset") + " --label " + path("label");
  EXPECT_EQ(run(call + " --effect viscous_damping"), 1);
  EXPECT_FALSE(std::filesystem::exists(path("dataset"))) << "nothing is hidden, so nothing is written";
  EXPECT_NE(text("label").find(R"("testable":false)"), std::string::npos);
  EXPECT_EQ(run(call + " --effect gremlins"), 2);
  EXPECT_NE(text("complaint").find("gremlins"), std::string::npos);
  EXPECT_EQ(run(call + " --ratio"), 2);
  EXPECT_EQ(run("blind_score " + path("nowhere")), 3);
}

TEST_F(Programs, run_the_whole_benchmark_and_write_its_page_by_one_command) {
  const std::string usual = script(
      "usual",
      R"(echo '{"B0 refit only":{"schema":"isac.explain/1","verdict":"none","disagreement":{"detected":false,)"
      R"("signals":[],"where":[]},"effects":[],"alternatives":[],"unknown":null,"gap":null,"seconds":0.1}}')");
  std::ofstream(path("page.md"))
      << "# Ours\n\n<!-- blind_score: tables -->\n<!-- blind_score: end -->\n\nOurs too.\n";
  const std::string call =
      "EMPTY=2 PAIRS=1 BIN=" ISAC_BIN_DIR " RESULTS=" + path("results") + " PAGE=" + path("page.md") +
      " EXPLAIN=" + contented() + " BASELINES=" + usual + " sh " +
      ISAC_SOURCE_DIR "/tests/blind/benchmark.sh 77 --noise white --effect leak,root_damping > " +
      path("said") + " 2> " + path("complaint");
  ASSERT_EQ(std::system(call.c_str()), 0) << text("complaint");
  const std::string page = text("page.md");
  for (const char* part :
       {"| white | 2/2 = 100.0 %", "| clear | white | 0/1", "| faint | white | 0/1", "### Two effects hidden",
        "### An effect outside the catalogue", "### The effect's own name taken out",
        "| B0 refit only | 2/2 = 100.0 %", "| leak | 2 | 0 | (none) (2) |", "\nOurs too.\n"})
    EXPECT_NE(page.find(part), std::string::npos) << part << "\n" << page;
  // Once more: nothing is asked again, the page stays.
  const std::size_t calls = lines("calls").size();
  ASSERT_EQ(std::system(call.c_str()), 0) << text("complaint");
  EXPECT_EQ(lines("calls").size(), calls);
  EXPECT_EQ(text("page.md"), page);
}

TEST_F(Programs, make_the_tables_that_stand_in_the_documentation_of_what_was_measured) {
  const std::string root = ISAC_SOURCE_DIR, page = root + "/docs/explain.md";
  std::filesystem::copy_file(page, path("explain.md"));
  ASSERT_EQ(run("blind_score --seed 9312,9316,9420,9421,9422 --into " + path("explain.md") + " " + root +
                "/tests/blind/measured/fresh/*.jsonl"),
            0)
      << text("complaint");
  std::ifstream in(page);
  const std::string told{std::istreambuf_iterator<char>(in), {}};
  EXPECT_EQ(text("explain.md"), told);
  EXPECT_GT(std::count(told.begin(), told.end(), '\n'), 200);
  // Of seed 6201, on which the program was mended, the page gives numbers and the ledger makes the tables.
  ASSERT_EQ(run("blind_score " + root + "/tests/blind/measured/*.jsonl"), 0) << text("complaint");
  EXPECT_NE(text("said").find("| clear | all | 205/208"), std::string::npos);
  int methods = 0;
  for (const std::string& line : lines("said"))
    if (line.starts_with("| B") || line.starts_with("| isac-explain")) {
      ++methods;
      EXPECT_NE(told.find(line + "\n"), std::string::npos) << "docs/explain.md lacks: " << line;
    }
  EXPECT_EQ(methods, 8);
}

TEST(Blindness, is_kept_no_source_here_includes_anything_of_the_toolkit) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(ISAC_SOURCE_DIR "/tests/blind")) {
    if (entry.path().extension() != ".cpp" && entry.path().extension() != ".hpp") continue;
    ++files;
    std::ifstream in(entry.path());
    for (std::string line; std::getline(in, line);)
      EXPECT_FALSE(line.starts_with("#include \"isac") || line.starts_with("#include <isac") ||
                   line.starts_with("#include \".."))
          << entry.path() << ": " << line;
  }
  EXPECT_GT(files, 20);
}

}  // namespace
}  // namespace blind
