#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/record/sha256.hpp"

namespace {

using isac::record::BlockReader;
using isac::series::Recording;

TEST(Sha256, gives_the_published_values) {
  EXPECT_EQ(isac::record::sha256_hex("abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");  // FIPS 180-2
  EXPECT_EQ(isac::record::sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(FileHasher, hashes_a_large_file_aside_and_stops_where_the_file_ended_when_it_was_opened) {
  const auto path =
      std::filesystem::temp_directory_path() / ("isac_large_" + std::to_string(::getpid()) + ".csv");
  std::string text = "time [s],angle [rad]\n";
  constexpr std::size_t kRows = 500000;  // above 4 MB, from where a second thread hashes
  for (std::size_t i = 0; i < kRows; ++i) text += std::to_string(i) + ",0.25\n";
  ASSERT_GT(text.size(), std::size_t{4} << 20U);
  std::ofstream(path, std::ios::binary) << text;
  {
    BlockReader abandoned(path, {}, 100);  // must not wait for, or trip over, the thread
    Recording block;
    EXPECT_TRUE(abandoned.next(block));
  }
  BlockReader reader(path);
  std::ofstream(path, std::ios::binary | std::ios::app) << "500000,0.25\n500001,0.";
  Recording block;
  std::size_t rows = 0;
  while (reader.next(block)) rows += block.rows();
  EXPECT_EQ(rows, kRows);
  EXPECT_EQ(block.sha256, isac::record::sha256_hex(text));
  EXPECT_EQ(isac::record::sha256_of_file(path), isac::record::sha256_hex(text + "500000,0.25\n500001,0."));

  BlockReader shrinking(path);
  std::filesystem::resize_file(path, 100);
  EXPECT_THROW(
      {
        while (shrinking.next(block)) {
        }
      },
      isac::Error);
  std::filesystem::remove(path);
}

}  // namespace
