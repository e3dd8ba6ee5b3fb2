// Kinematics and compensation on a Cortex-M4F in QEMU, counted: the figures of docs/arm.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "../../apps/embedded/kinematics_record.hpp"
#include "../system/run_program.hpp"

namespace {

using isac::embedded::KinematicsRecord;

TEST(KinematicsFirmware, counts_what_every_calculation_costs_and_comes_back_to_the_same_place) {
  const auto elf = std::filesystem::path(ISAC_MCU_DIR) / "apps/embedded/isac_kinematics_m4f.elf";
  if (!std::filesystem::exists(elf))
    GTEST_SKIP() << "the firmware was not cross-built: no arm-none-eabi-g++ (Debian: gcc-arm-none-eabi)";
  if (std::system("command -v qemu-system-arm >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "there is no qemu-system-arm (Debian: qemu-system-arm)";
  const isac::test::ScratchFolder folder;
  const std::string call =
      "cd '" + folder.path().string() +
      "' && timeout 120 qemu-system-arm -M mps2-an386 -nographic -monitor none -serial none "
      "-icount shift=8 -semihosting-config enable=on,target=native,arg=answer -kernel '" +
      elf.string() + "' >/dev/null 2>&1";
  ASSERT_EQ(std::system(call.c_str()), 0);
  const std::string answer = isac::test::read_text(folder / "answer");
  ASSERT_EQ(answer.size(), isac::embedded::kKinematicsPoses * sizeof(KinematicsRecord));
  std::vector<KinematicsRecord> records(isac::embedded::kKinematicsPoses);
  std::memcpy(static_cast<void*>(records.data()), answer.data(), answer.size());
  const auto say = [&](const char* what, std::uint32_t KinematicsRecord::*field) {
    std::vector<std::uint32_t> counts;
    for (const KinematicsRecord& record : records) counts.push_back(record.*field);
    std::ranges::sort(counts);
    std::printf("%-36s p50 %6u, worst %6u instructions\n", what, counts[counts.size() / 2], counts.back());
    return counts.back();
  };
  say("frames of six joints", &KinematicsRecord::frames);
  say("place of the hand", &KinematicsRecord::tool);
  const std::uint32_t inverse = say("inverse kinematics, all solutions", &KinematicsRecord::inverse);
  const std::uint32_t nearest = say("nearest solution inside the limits", &KinematicsRecord::nearest);
  say("gravity of six joints", &KinematicsRecord::gravity);
  const std::uint32_t compensation = say("gravity and inertia of joint one", &KinematicsRecord::compensation);
  // At 0.2 kHz a position tick has 840000 cycles at 168 MHz, at 2 kHz a control tick has 84000: a quarter of each, as for the tick.
  EXPECT_LT(inverse + nearest, 840000u / 4);
  EXPECT_LT(compensation, 84000u / 4);
  for (const KinematicsRecord& record : records) {
    EXPECT_EQ(record.solutions, 8u);
    // Float has 24 bits of half a metre; near a stretched elbow acos loses half of them.
    EXPECT_LT(record.back, 5e-4f);
  }
}

}  // namespace
