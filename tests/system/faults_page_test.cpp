// docs/faults.md names a proof for each behaviour; this holds every one of them to tests that exist.
#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "run_program.hpp"

namespace isac::test {
namespace {

TEST(FaultsPage, every_behaviour_has_proofs_that_exist) {
  const std::string page = read_text(std::string(ISAC_SOURCE_DIR) + "/docs/faults.md");
  const std::string guest = read_text(std::string(ISAC_SOURCE_DIR) + "/tests/comedi/guest.cpp");
  std::istringstream lines(page);
  const std::regex proof("`((?:card_|[a-z_]+_test)[a-z_]*)(?: ([^`]+))?`");
  std::set<int> behaviours;
  for (std::string line; std::getline(lines, line);) {
    int number = 0;
    if (std::sscanf(line.c_str(), "| %d |", &number) != 1) continue;
    behaviours.insert(number);
    int proofs = 0;
    for (std::sregex_iterator found(line.begin(), line.end(), proof), end; found != end; ++found, ++proofs) {
      const bool built = std::filesystem::exists(std::string(ISAC_BIN_DIR) + "/" + (*found)[1].str());
      if (!built && (*found)[1] == "card_comedi") continue;  // a machine without libcomedi
      const std::string filter = (*found)[2].matched ? (*found)[2].str() : "*";
      std::istringstream parts(filter);
      for (std::string one; std::getline(parts, one, ':');) {
        const auto listed = run_program({(*found)[1].str(), "--gtest_list_tests", "--gtest_filter=" + one});
        EXPECT_EQ(listed.exit_code, 0) << (*found)[1] << " is not built";
        EXPECT_NE(listed.out.find("\n  "), std::string::npos)
            << "behaviour " << number << ": no test is called " << one << " in " << (*found)[1];
      }
    }
    EXPECT_GT(proofs, 0) << "behaviour " << number << " is not proven";
  }
  EXPECT_EQ(behaviours.size(), 18u);
  for (const char* name : {"SIGKILL", "abort", "SIGSEGV", "hang", "stall_two_cards", "stall_one_card",
                           "testbed", "soft_arm", "line", "enc_jump", "empty", "fail_read"})
    EXPECT_NE(guest.find("\"" + std::string(name) + "\""), std::string::npos) << name;
}

}  // namespace
}  // namespace isac::test
