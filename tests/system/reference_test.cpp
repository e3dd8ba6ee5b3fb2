// docs/reference holds what the programs say of themselves; this keeps it so. ISAC_UPDATE_REFERENCE=1 writes it anew.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "run_program.hpp"

namespace isac::test {
namespace {

struct Page {
  std::string program, title;
  std::vector<std::string> subcommands;  ///< empty: the program's own --help is all
};

std::string page_text(const Page& page) {
  std::string text = "# " + page.program + "\n\n" + page.title + "\n";
  std::vector<std::vector<std::string>> calls{{page.program, "--help"}};
  for (const std::string& word : page.subcommands) calls.push_back({page.program, word, "--help"});
  for (const auto& call : calls) {
    const auto run = run_program(call);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    std::string line = "$";
    for (const std::string& word : call) line += " " + word;
    if (call.size() == 3) text += "\n## " + page.program + " " + call[1] + "\n";
    text += "\n```text\n" + line + "\n" + run.out + "```\n";
  }
  return text;
}

TEST(Reference, is_what_the_programs_say_of_themselves) {
  const std::vector<Page> pages{
      {"isac-identify",
       "Parameters of joints, valve units, muscles, sensors and arms from recordings. Answers as JSON, exit "
       "codes and files are in "
       "[formats](../formats.md).",
       {ISAC_IDENTIFY_SUBCOMMANDS}},
      {"isac-log",
       "Records sweeps on a rig; [how to log a sweep](../how-to/log-a-sweep.md) shows it at work.",
       {}},
      {"isac-explain",
       "Finds the effect that a model lacks; [how to explain a gap](../how-to/explain.md) shows it at work, "
       "[formats](../formats.md) has its answer.",
       {}},
      {"isac-tune",
       "Finds the gains of a joint; [how to tune](../how-to/tune.md) shows it at work, "
       "[tuning](../tuning.md) what it "
       "promises and answers.",
       {}},
      {"isac-run",
       "Drives joints by the identified model under a supervisor; [how to run](../how-to/run.md) shows it at "
       "work, "
       "[faults](../faults.md) what it does when something goes wrong.",
       {"position", "trajectory", "torque", "hand", "replay", "latency"}}};
  for (const Page& page : pages) {
    const auto path = std::filesystem::path(ISAC_SOURCE_DIR) / "docs" / "reference" / (page.program + ".md");
    const std::string text = page_text(page);
    if (std::getenv("ISAC_UPDATE_REFERENCE") != nullptr) std::ofstream(path) << text;
    EXPECT_EQ(read_text(path), text) << "run this test once with ISAC_UPDATE_REFERENCE=1";
  }
}

}  // namespace
}  // namespace isac::test
