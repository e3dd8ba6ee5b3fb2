// The arrows of the house are kept: every #include under src and apps against arrows.txt, and only agreed folders at
// the top.
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>

#include "include_rules.hpp"

namespace isac::architecture {
namespace {

const std::filesystem::path kRoot = ISAC_SOURCE_DIR;

Rules rules() {
  return read_rules(kRoot / "tests/architecture/arrows.txt");
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const auto& line : lines) text += "\n  " + line;
  return text;
}

TEST(Architecture, keeps_its_arrows) {
  std::vector<Include> all = read_includes(kRoot, "src");
  ASSERT_GT(all.size(), 100u) << "no source found";
  const auto apps = read_includes(kRoot, "apps");
  all.insert(all.end(), apps.begin(), apps.end());
  const auto broken = broken_rules(rules(), all);
  EXPECT_TRUE(broken.empty()) << joined(broken);
}

TEST(Architecture, has_a_rule_for_every_room_that_stands) {
  const Rules table = rules();
  for (const auto& entry : std::filesystem::directory_iterator(kRoot / "src/isac")) {
    if (!entry.is_directory()) continue;
    EXPECT_TRUE(table.allowed.contains(entry.path().filename().string())) << entry.path();
  }
}

TEST(Architecture, has_arrows_without_a_circle) {
  const Rules table = rules();
  // Take away rooms whose arrows all lead to rooms taken away before; a circle is what remains.
  std::set<std::string> done;
  for (bool moved = true; moved;) {
    moved = false;
    for (const auto& [room, behind] : table.allowed) {
      bool free = !done.contains(room);
      for (const auto& other : behind)
        free = free && (done.contains(other) || !table.allowed.contains(other));
      if (free) moved = done.insert(room).second;
    }
  }
  EXPECT_EQ(done.size(), table.allowed.size());
}

TEST(Architecture, has_only_the_agreed_folders_and_files_at_the_top) {
  const std::set<std::string> agreed = {"apps",
                                        "data",
                                        "docs",
                                        "fixtures",
                                        "src",
                                        "tests",
                                        "build",                  // what .gitignore names:
                                        "demo",                   // what ./run makes,
                                        "compile_commands.json",  // and what editors read
                                        "CMakeLists.txt",
                                        "CMakePresets.json",
                                        "CHANGELOG.md",
                                        "CONTRIBUTING.md",
                                        "LICENSE",
                                        "README.md",
                                        "run",
                                        "CMakeUserPresets.json"};
  for (const auto& entry : std::filesystem::directory_iterator(kRoot)) {
    const std::string name = entry.path().filename().string();
    if (name[0] == '.') continue;
    EXPECT_TRUE(agreed.contains(name)) << name << " does not belong at the top of the house";
  }
}

/// What the test says to a planted include.
std::vector<std::string> verdict(const std::string& file, const std::string& line) {
  return broken_rules(rules(), includes_of(file, "// comment\n" + line + "\n"));
}

TEST(ArchitectureTest, names_the_arrow_that_a_planted_include_breaks) {
  const auto broken = verdict("src/isac/models/effects.hpp", "#include \"isac/record/csv_reader.hpp\"");
  ASSERT_EQ(broken.size(), 1u);
  EXPECT_NE(broken[0].find("src/isac/models/effects.hpp:2:"), std::string::npos) << broken[0];
  EXPECT_NE(broken[0].find("models -> record"), std::string::npos) << broken[0];
}

TEST(ArchitectureTest, catches_every_kind_of_bad_include) {
  const std::pair<const char*, const char*> planted[] = {
      {"src/isac/estimate/joint_fit.hpp", "#include <ceres/ceres.h>"},
      {"src/isac/record/rig.cpp", "#include <ceres/ceres.h>"},
      {"src/isac/estimate/joint_fit.cpp", "# include <toml++/toml.h>"},
      {"src/isac/models/effects.hpp", "  #include <vector>"},
      {"src/isac/control/pid.hpp", "#include \"isac/core/error.hpp\""},
      {"src/isac/core/units.hpp", "#include <string>"},
      {"src/isac/card/replay_card.cpp", "#include \"isac/card/simulated_card.hpp\""},
      {"src/isac/control/pid.hpp", "#include \"isac/card/card.hpp\""},
      {"src/isac/series/recording.cpp", "#include \"recording.hpp\""},
      {"src/isac/series/recording.cpp", "#include \"../record/rig.hpp\""},
      {"src/isac/cupboard/things.cpp", "#include \"isac/core/units.hpp\""},
      {"apps/embedded/main.cpp", "#include \"isac/record/rig.hpp\""},
  };
  for (const auto& [file, line] : planted) EXPECT_FALSE(verdict(file, line).empty()) << file << " " << line;
  const auto twice = broken_rules(rules(), {{"src/isac/report/a.cpp", 1, "gnuplot-iostream.h", false},
                                            {"src/isac/report/b.cpp", 1, "gnuplot-iostream.h", false}});
  ASSERT_EQ(twice.size(), 1u);
  EXPECT_NE(twice[0].find("b.cpp"), std::string::npos);
}

TEST(ArchitectureTest, lets_allowed_includes_pass) {
  const std::pair<const char*, const char*> fine[] = {
      {"src/isac/estimate/joint_fit.cpp", "#include <ceres/ceres.h>"},
      {"src/isac/estimate/joint_fit.cpp", "#include \"isac/simulate/rig.hpp\""},
      {"src/isac/core/error.hpp", "#include <string>"},
      {"src/isac/models/effects.hpp", "#include <cmath>"},
      {"src/isac/models/effects.hpp", "// #include <vector>"},
      {"apps/isac_log.cpp", "#include \"isac/runtime/log_session.hpp\""},
      {"apps/isac_log.cpp", "#include \"common/program.hpp\""},
  };
  for (const auto& [file, line] : fine)
    EXPECT_TRUE(verdict(file, line).empty()) << joined(verdict(file, line));
}

}  // namespace
}  // namespace isac::architecture
