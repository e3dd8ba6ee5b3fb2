// A program that was built without libcomedi says so, and reads the table first.
#include <gtest/gtest.h>

#include "isac/card/card.hpp"
#include "isac/core/error.hpp"

namespace isac::test {
namespace {

std::string refused(const std::string& name, ErrorKind kind) {
  try {
    static_cast<void>(card::open(name));
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind);
    return error.code() + ": " + error.what();
  }
  return "opened";
}

TEST(ComediAbsent, says_what_to_install) {
  EXPECT_EQ(
      refused("comedi:" ISAC_SOURCE_DIR "/data/cards/testbed.toml", ErrorKind::kStopped),
      "comedi_not_built: this program was built without libcomedi; install libcomedi-dev and build it again");
  EXPECT_NE(refused("comedi:/nowhere.toml", ErrorKind::kBadInput).find("nowhere.toml"), std::string::npos);
}

}  // namespace
}  // namespace isac::test
