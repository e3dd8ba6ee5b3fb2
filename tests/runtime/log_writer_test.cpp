// The ring and the writer thread; run under the thread sanitizer.
#include "isac/runtime/log_writer.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <thread>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/runtime/spsc_ring.hpp"

namespace isac::runtime {
namespace {

namespace fs = std::filesystem;

class Scratch {
 public:
  Scratch() {
    std::string pattern = (fs::temp_directory_path() / "isac-writer-XXXXXX").string();
    if (mkdtemp(pattern.data()) != nullptr) path_ = pattern;
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  [[nodiscard]] fs::path operator/(const char* name) const { return path_ / name; }

 private:
  fs::path path_;
};

TEST(SpscRing, gives_back_in_order_what_two_threads_pass_through_it) {
  SpscRing<std::uint64_t> ring(64);
  constexpr std::uint64_t kCount = 200000;
  std::thread producer([&ring] {
    for (std::uint64_t i = 0; i < kCount;) {
      if (ring.push(i)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint64_t expected = 0, value = 0;
  while (expected < kCount) {
    if (!ring.pop(value)) {
      std::this_thread::yield();
      continue;
    }
    ASSERT_EQ(value, expected);
    ++expected;
  }
  producer.join();
  EXPECT_FALSE(ring.pop(value));
}

TEST(SpscRing, refuses_when_full_and_takes_again_when_emptied) {
  SpscRing<int> ring(3);
  EXPECT_EQ(ring.capacity(), 4u);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(ring.push(i));
  EXPECT_FALSE(ring.push(4));
  int value = -1;
  EXPECT_TRUE(ring.pop(value));
  EXPECT_EQ(value, 0);
  EXPECT_TRUE(ring.push(5));
  for (const int wanted : {1, 2, 3, 5}) {
    ASSERT_TRUE(ring.pop(value));
    EXPECT_EQ(value, wanted);
  }
}

card::Shape shape() {
  return {.encoders = 1, .inputs = 8, .outputs = 2};
}

LogRow row_at(int i) {
  LogRow row;
  row.time = 0.002 * i;
  row.physical = {
      .angle = 0.001 * i, .p1 = 3 * kPascalPerKgfCm2, .p2 = kPascalPerKgfCm2, .F1 = 12.5, .F2 = -1.0};
  row.commanded = {.p1 = 2 * kPascalPerKgfCm2, .p2 = 4 * kPascalPerKgfCm2};
  row.sample.encoder[0] = static_cast<std::uint32_t>(i);
  row.sample.input[7] = 4095;
  row.command.output[1] = 17;
  return row;
}

TEST(LogWriter, writes_every_row_that_waits_for_room) {
  const Scratch scratch;
  constexpr int kRows = 5000;
  LogWriter writer(scratch / "run.csv", {{"experiment", "free"}}, shape(), false, 16);
  for (int i = 0; i < kRows; ++i) ASSERT_TRUE(writer.push_waiting(row_at(i)));
  EXPECT_EQ(writer.finish(), static_cast<std::uint64_t>(kRows));
  EXPECT_EQ(writer.dropped(), 0u);
  const series::Recording back = record::read_recording(scratch / "run.csv");
  ASSERT_EQ(back.rows(), static_cast<std::size_t>(kRows));
  EXPECT_EQ(back.meta("experiment"), "free");
  EXPECT_EQ(back.columns.size(), 8u);
  EXPECT_NEAR(back.column("angle").values[4321], 4.321, 1e-9);  // seven digits behind the point
  EXPECT_NEAR(back.column("p1").values[7], 3 * kPascalPerKgfCm2, 1e-6);
  EXPECT_NEAR(back.column("p2_cmd").values[7], 4 * kPascalPerKgfCm2, 1e-6);
}

TEST(LogWriter, counts_what_a_full_ring_loses_and_writes_the_rest) {
  const Scratch scratch;
  constexpr std::uint64_t kRows = 20000;
  LogWriter writer(scratch / "run.csv", {}, shape(), false, 16);
  std::uint64_t taken = 0;
  for (std::uint64_t i = 0; i < kRows; ++i) taken += writer.push(row_at(static_cast<int>(i))) ? 1u : 0u;
  EXPECT_EQ(writer.finish(), taken);
  EXPECT_EQ(taken + writer.dropped(), kRows);
  EXPECT_GT(writer.dropped(), 0u);  // 16 rows of room against 20000 pushed without a pause
  EXPECT_EQ(record::read_recording(scratch / "run.csv").rows(), taken);
}

TEST(LogWriter, adds_the_counts_of_the_card_when_asked) {
  const Scratch scratch;
  LogWriter writer(scratch / "raw.csv", {}, shape(), true, 16);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(writer.push_waiting(row_at(i)));
  writer.finish();
  const series::Recording back = record::read_recording(scratch / "raw.csv");
  EXPECT_EQ(back.columns.size(), 8u + 1u + 8u + 2u);
  EXPECT_EQ(back.column("enc0").values[2], 2.0);
  EXPECT_EQ(back.column("ai7").values[0], 4095.0);
  EXPECT_EQ(back.column("ao1").values[0], 17.0);
}

TEST(LogWriter, says_so_when_the_file_cannot_grow_while_the_loop_still_runs) {
  const Scratch scratch;
  rlimit former{};
  getrlimit(RLIMIT_FSIZE, &former);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = former;
  small.rlim_cur = 20000;  // bytes, about 250 rows
  setrlimit(RLIMIT_FSIZE, &small);
  bool taken = true;
  {
    LogWriter writer(scratch / "run.csv", {}, shape(), false, 16);
    for (int i = 0; i < 200000 && taken; ++i) taken = writer.push_waiting(row_at(i));
    EXPECT_FALSE(taken);
    EXPECT_TRUE(writer.failed());
    EXPECT_THROW(writer.finish(), Error);
  }
  setrlimit(RLIMIT_FSIZE, &former);
  std::signal(SIGXFSZ, handler);
}

}  // namespace
}  // namespace isac::runtime
