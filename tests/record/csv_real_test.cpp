// Recordings that nobody on this project made; the folder is named by ISAC_REAL_DATA.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "isac/record/csv_reader.hpp"

namespace {

namespace fs = std::filesystem;
using isac::record::read_recording;

TEST(RealRecordings, are_read_with_their_units_and_every_row) {
  const char* folder = std::getenv("ISAC_REAL_DATA");
  if (folder == nullptr) GTEST_SKIP() << "ISAC_REAL_DATA does not name the folder of the real recordings";
  const fs::path data = folder;

  const auto axis = read_recording(data / "emps/data_emps.csv");
  EXPECT_EQ(axis.rows(), 24841U);
  EXPECT_EQ(axis.column("voltage").unit, "V");
  EXPECT_EQ(axis.column("force_motor").unit, "N");
  EXPECT_EQ(axis.column("time").values[1], 0.001);

  const auto muscle = read_recording(data / "festo10_isometric/festo10_L20cm_kink25.csv");
  EXPECT_EQ(muscle.rows(), 3000U);
  EXPECT_EQ(muscle.column("pressure").values[0], 8.18 * 1e3);
  EXPECT_EQ(muscle.column("contraction").unit, "-");

  isac::record::ReadOptions no_time;
  no_time.require_time = false;
  const auto table = read_recording(data / "pam_valve_step_porcaro/published_tau_deadtime.csv", no_time);
  EXPECT_EQ(table.rows(), 49U);
  EXPECT_EQ(table.column("tau").values[1], 0.095);
}

TEST(RealRecordings, of_muscles_being_filled_run_through_blocks_as_through_one_read) {
  const char* folder = std::getenv("ISAC_REAL_DATA");
  if (folder == nullptr) GTEST_SKIP() << "ISAC_REAL_DATA does not name the folder of the real recordings";
  const fs::path file = fs::path(folder) / "festo20_fill/fill_1.csv";
  const auto whole = read_recording(file);
  isac::record::BlockReader reader(file, {}, 100);
  isac::series::Recording block;
  std::size_t row = 0;
  while (reader.next(block)) {
    for (double pressure : block.column("pressure").values)
      ASSERT_EQ(pressure, whole.column("pressure").values[row++]);
  }
  EXPECT_EQ(row, whole.rows());
  EXPECT_EQ(block.sha256, whole.sha256);
}

}  // namespace
