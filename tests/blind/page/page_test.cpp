#include "page.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

namespace blind {
namespace {

Case named(const std::string& hidden, const std::string& said, double confidence) {
  Case one;
  one.truth.key = "clear/white/" + hidden + "/1.0";
  one.truth.kind = "single";
  one.truth.noise = "white";
  one.truth.side = "process";
  one.truth.ratio = 0.75;
  one.truth.ids = {hidden};
  one.answer.verdict = "named";
  one.answer.detected = true;
  one.answer.effects = {said};
  one.answer.confidences = {confidence};
  return one;
}

const std::string kPage =
    std::string("# Title\n\nOurs.\n\n") + kTablesFrom + "\nold\n" + kTablesTo + "\n\n## Ours too\n";

TEST(Page, takes_tables_between_its_two_lines_and_keeps_the_rest) {
  const std::string page =
      page_with_tables(kPage, "# Blind\n\n| a |\n\n## Confusion\n\n| # not a heading |\n\n");
  EXPECT_EQ(page, std::string("# Title\n\nOurs.\n\n") + kTablesFrom +
                      "\n\n## Blind\n\n| a |\n\n### Confusion\n\n| # not a heading |\n\n" + kTablesTo +
                      "\n\n## Ours too\n");
  EXPECT_EQ(page_with_tables(page, "# Blind\n\n| a |\n\n## Confusion\n\n| # not a heading |\n\n"), page)
      << "writing the same once more changes nothing";
}

TEST(Page, without_a_place_for_tables_is_refused) {
  EXPECT_THROW(page_with_tables("# Title\n", "| a |\n"), std::runtime_error);
  EXPECT_THROW(page_with_tables(std::string(kTablesTo) + "\n" + kTablesFrom + "\n", "| a |\n"),
               std::runtime_error);
  EXPECT_THROW(page_with_tables(std::string("speaks of ") + kTablesFrom + "\n" + kTablesTo + "\n", "| a |\n"),
               std::runtime_error);
}

class WrittenPage : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "blind-page-XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    std::ofstream(folder_ / "explain.md") << kPage;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::string text(const std::string& name) const {
    std::ifstream in(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  std::filesystem::path folder_;
};

TEST_F(WrittenPage, has_its_reliability_diagram_beside_it) {
  write_page(folder_ / "explain.md", {named("creep", "creep", 0.95), named("leak", "crosstalk", 0.55)});
  EXPECT_NE(text("explain.md").find("(explain/reliability.svg)"), std::string::npos) << text("explain.md");
  EXPECT_NE(text("explain.md").find("| leak | 1 | 0 | crosstalk (1) |"), std::string::npos);
  const std::string picture = text("explain/reliability.svg");
  EXPECT_TRUE(picture.starts_with("<svg ")) << picture.substr(0, 80);
  EXPECT_NE(picture.find("Confidence stated"), std::string::npos);
  EXPECT_TRUE(picture.find("</svg>") != std::string::npos);
}

TEST_F(WrittenPage, of_nothing_named_has_no_diagram) {
  Case none = named("creep", "creep", 0.95);
  none.truth.kind = "none";
  none.truth.ids = {};
  none.answer = {};
  none.answer.verdict = "none";
  write_page(folder_ / "explain.md", {none});
  EXPECT_EQ(text("explain.md").find("reliability.svg"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "explain"));
}

TEST_F(WrittenPage, stays_as_it_was_where_a_file_is_in_the_way) {
  std::ofstream(folder_ / "explain") << "no folder";
  EXPECT_THROW(write_page(folder_ / "explain.md", {named("creep", "creep", 0.95)}), std::exception);
  EXPECT_EQ(text("explain.md"), kPage);
  EXPECT_THROW(write_page(folder_ / "nowhere.md", {named("creep", "creep", 0.95)}), std::runtime_error);
}

}  // namespace
}  // namespace blind
