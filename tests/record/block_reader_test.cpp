#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/record/sha256.hpp"

namespace {

using isac::record::BlockReader;
using isac::record::parse_recording;
using isac::record::ReadOptions;
using isac::series::Recording;

// A recording with every kind of line that a good file may have.
std::string lively_text(int rows) {
  std::mt19937 random(11);
  std::string text = "# experiment: free\n\ntime [s];angle [deg];p1 [bar];note\n";
  for (int i = 0; i < rows; ++i) {
    text += std::to_string(i) + "," + std::to_string(random() % 1000) + ";" + (random() % 5 ? "-12,5" : "") +
            ";" + std::to_string(random() % 100) + (random() % 3 ? ",125" : "") + ";" +
            (random() % 7 ? "1e-3" : " nan ") + (random() % 4 ? "\n" : "\r\n");
    if (random() % 10 == 0) text += "# event: " + std::to_string(i) + "\n";
    if (random() % 10 == 0) text += " \n";
  }
  return text + "# closed: 2003-05-01\n";
}

bool same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

TEST(BlockReader, gives_the_same_rows_for_every_block_and_piece_size) {
  const std::string text = lively_text(300);
  const Recording whole = parse_recording(text, "run.csv");
  ASSERT_EQ(whole.rows(), 300U);
  for (const std::size_t piece : {1U, 2U, 3U, 7U, 64U, 1000U, 100000U}) {
    for (const std::size_t block_rows : {1U, 2U, 7U, 299U, 300U, 301U, 100000U}) {
      BlockReader reader = BlockReader::of_bytes(text, "run.csv", {}, block_rows, piece);
      Recording block;
      std::size_t row = 0;
      while (reader.next(block)) {
        ASSERT_LE(block.rows(), block_rows);
        ASSERT_LE(row + block.rows(), whole.rows());
        for (std::size_t c = 0; c < whole.columns.size(); ++c) {
          for (std::size_t k = 0; k < block.rows(); ++k) {
            ASSERT_TRUE(same(block.columns[c].values[k], whole.columns[c].values[row + k]))
                << piece << " " << block_rows;
          }
        }
        row += block.rows();
      }
      ASSERT_EQ(row, whole.rows()) << "piece " << piece << ", block " << block_rows;
      EXPECT_EQ(block.rows(), 0U);
      EXPECT_EQ(block.sha256, isac::record::sha256_hex(text));
      EXPECT_EQ(block.metadata, whole.metadata);
      EXPECT_FALSE(reader.next(block)) << "the end stays the end";
      EXPECT_EQ(block.sha256, whole.sha256);
    }
  }
}

TEST(BlockReader, finds_the_same_error_at_the_same_place_for_every_piece_size) {
  std::string text = lively_text(40);
  text.insert(text.find("\n20,") + 1, "19.5;7;oops;1\n");
  std::string truth;
  for (const std::size_t piece : {100000U, 1U, 5U, 33U}) {
    std::string what;
    try {
      BlockReader reader = BlockReader::of_bytes(text, "run.csv", {}, 8, piece);
      Recording block;
      while (reader.next(block)) {
      }
    } catch (const isac::Error& error) {
      what = error.code() + " " + error.what();
    }
    if (truth.empty()) truth = what;
    EXPECT_FALSE(what.empty());
    EXPECT_EQ(what, truth) << piece;
  }
}

TEST(BlockReader, needs_no_more_memory_for_a_long_file_than_for_a_short_one) {
  const auto path =
      std::filesystem::temp_directory_path() / ("isac_block_" + std::to_string(::getpid()) + ".csv");
  constexpr std::size_t kRows = 400000;
  {
    std::ofstream file(path);
    file << "time [s],angle [rad],p1 [bar],p2 [bar]\n";
    for (std::size_t i = 0; i < kRows; ++i) file << i << ".25,0.5,1.25,2.5\n";
  }
  const auto peak = [] {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;  // kB
  };
  const long before = peak();
  BlockReader reader(path, {}, 4096);
  Recording block;
  std::size_t rows = 0;
  while (reader.next(block)) rows += block.rows();
  [[maybe_unused]] const long grown = peak() - before;  // sanitizers need more
  std::filesystem::remove(path);
  EXPECT_EQ(rows, kRows);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  // The rows are 12.8 MB as doubles and 9 MB as text; a block is 4096 · 4 · 8 bytes, the window half a megabyte. 4 MB leaves
  // room for the allocator and the first use of the digest.
  EXPECT_LT(grown, 4 * 1024);
#endif
}

}  // namespace
