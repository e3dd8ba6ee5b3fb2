#include "isac/record/csv_writer.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>
#include <string>

#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"

namespace {

namespace fs = std::filesystem;
using isac::Error;
using isac::record::AppendLog;
using isac::record::LogColumn;
using isac::record::read_recording;
using isac::record::write_atomically;
using isac::record::write_recording;
using isac::series::Recording;

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

class CsvWriter : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("isac_writer_" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  [[nodiscard]] fs::path file(const char* name) const { return folder_ / name; }
  [[nodiscard]] static std::string bytes(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
  }
  /// Names in the folder, hidden ones too: what a failed write left behind.
  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  template <typename Act>
  static std::string code_of(Act act) {
    try {
      act();
    } catch (const Error& error) {
      EXPECT_EQ(error.text().find('\n'), std::string::npos);
      return error.code();
    }
    return "none";
  }

  fs::path folder_;
};

using AppendLogOnDisk = CsvWriter;

Recording sample() {
  Recording run;
  run.metadata = {{"experiment", "free"}, {"note", "a: b # c, \"d\""}};
  run.columns = {{"time", "s", {0.0, 0.1, 1.0 / 3.0}},
                 {"angle", "rad", {-0.0, kMissing, 5e-324}},
                 {"odd, name", "", {1, 2, 3}}};
  return run;
}

void expect_same_bits(const Recording& a, const Recording& b) {
  ASSERT_EQ(a.columns.size(), b.columns.size());
  EXPECT_EQ(a.metadata, b.metadata);
  for (std::size_t c = 0; c < a.columns.size(); ++c) {
    EXPECT_EQ(a.columns[c].name, b.columns[c].name);
    EXPECT_EQ(a.columns[c].unit, b.columns[c].unit);
    ASSERT_EQ(a.columns[c].values.size(), b.columns[c].values.size());
    for (std::size_t i = 0; i < a.rows(); ++i) {
      const double x = a.columns[c].values[i];
      const double y = b.columns[c].values[i];
      ASSERT_TRUE((std::isnan(x) && std::isnan(y)) ||
                  std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y))
          << x << " " << y;
    }
  }
}

TEST_F(CsvWriter, gives_every_double_back_bit_for_bit) {
  Recording run = sample();
  std::mt19937_64 random(3);
  for (int i = 0; i < 20000; ++i) {
    double value = std::bit_cast<double>(random());
    if (std::isinf(value)) value = kMissing;
    run.columns[0].values.push_back(1.0 + i);
    run.columns[1].values.push_back(value);
    run.columns[2].values.push_back(static_cast<double>(random() % 1000) / 8.0);
  }
  write_recording(file("run.csv"), run);
  expect_same_bits(read_recording(file("run.csv")), run);
  EXPECT_EQ(files(), 1U);
}

TEST_F(CsvWriter, quotes_names_that_would_be_misread) {
  Recording run;
  run.columns = {{"time", "s", {0}},  {"a;b", "", {1}}, {"x [y]", "", {2}},
                 {"\"q\"", "V", {3}}, {"12", "", {4}},  {"# c", "N m", {5}}};
  run.metadata["note"] = "x";
  write_recording(file("run.csv"), run);
  expect_same_bits(read_recording(file("run.csv")), run);
}

TEST_F(CsvWriter, refuses_what_the_reader_would_refuse_and_leaves_nothing) {
  const auto code = [&](auto change) {
    Recording run = sample();
    change(run);
    return code_of([&] { write_recording(file("run.csv"), run); });
  };
  EXPECT_EQ(code([](Recording& r) { r.columns[1].values[0] = std::numeric_limits<double>::infinity(); }),
            "number_not_finite");
  EXPECT_EQ(code([](Recording& r) { r.columns[1].values.pop_back(); }), "columns_unequal");
  EXPECT_EQ(code([](Recording& r) { r.columns[1].unit = "bar"; }), "unit_wrong");
  EXPECT_EQ(code([](Recording& r) { r.columns[2].name = " padded "; }), "column_unwritable");
  EXPECT_EQ(code([](Recording& r) { r.columns[2].name = "angle"; }), "unit_missing");
  EXPECT_EQ(code([](Recording& r) { r.columns[2] = r.columns[1]; }), "column_duplicate");
  EXPECT_EQ(code([](Recording& r) { r.metadata["a:b"] = "c"; }), "metadata_unwritable");
  EXPECT_EQ(code([](Recording& r) { r.metadata["started"] = "today"; }), "started_not_iso8601");
  EXPECT_EQ(code([](Recording& r) { r.columns.clear(); }), "no_rows");
  EXPECT_EQ(files(), 0U);
}

TEST_F(CsvWriter, replaces_a_file_whole_and_keeps_the_old_one_when_asked) {
  write_atomically(file("a.txt"), "one");
  write_atomically(file("a.txt"), "two", true);
  EXPECT_EQ(bytes(file("a.txt")), "two");
  EXPECT_EQ(bytes(file("a.txt.bak")), "one");
  write_atomically(file("a.txt"), "three", true);
  EXPECT_EQ(bytes(file("a.txt.bak")), "two");
  EXPECT_EQ(files(), 2U);
}

TEST_F(CsvWriter, keeps_a_symbolic_link_and_the_mode_of_the_file) {
  write_atomically(file("real.txt"), "one");
  ASSERT_EQ(::chmod(file("real.txt").c_str(), 0640), 0);
  fs::create_symlink("real.txt", file("link.txt"));
  write_atomically(file("link.txt"), "two");
  EXPECT_TRUE(fs::is_symlink(file("link.txt")));
  EXPECT_EQ(bytes(file("real.txt")), "two");
  EXPECT_EQ(fs::status(file("real.txt")).permissions(), fs::perms(0640));
}

TEST_F(CsvWriter, says_disk_full_where_no_room_is_left_and_never_replaces_a_device) {
  EXPECT_EQ(code_of([&] { write_recording("/dev/full", sample()); }), "disk_full");
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
  write_atomically("/dev/null", "gone");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST_F(CsvWriter, names_what_is_wrong_with_the_place_to_write_to) {
  EXPECT_EQ(code_of([&] { write_atomically(file("no/such/folder/a.txt"), "x"); }), "folder_missing");
  EXPECT_EQ(code_of([&] { write_atomically(folder_, "x"); }), "file_is_directory");
  EXPECT_EQ(code_of([&] { AppendLog(file("no/log.csv"), {{"time", "s"}}, {}); }), "folder_missing");
}

// Runs `act` in a child process that may write at most `bytes` to any file: a full disk without a disk.
template <typename Act>
int exit_code_with_file_limit(rlim_t bytes, Act act) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::signal(SIGXFSZ, SIG_IGN);  // so that write() says EFBIG
    const rlimit limit{bytes, bytes};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    int code = 0;
    try {
      act();
    } catch (const Error& error) {
      code = error.code() == "disk_full" ? 42 : 43;
    }
    ::_exit(code);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_F(CsvWriter, leaves_the_old_file_when_the_disk_fills_half_way) {
  write_atomically(file("run.csv"), "old");
  Recording big = sample();
  for (int i = 0; i < 100000; ++i) {
    big.columns[0].values.push_back(1.0 + i);
    big.columns[1].values.push_back(0.1 * i);
    big.columns[2].values.push_back(0.3 * i);
  }
  EXPECT_EQ(exit_code_with_file_limit(1 << 20, [&] { write_recording(file("run.csv"), big); }), 42);
  EXPECT_EQ(bytes(file("run.csv")), "old");
  EXPECT_EQ(files(), 1U);
}

TEST_F(AppendLogOnDisk, writes_rows_that_can_be_read_at_any_moment_and_says_when_it_was_closed) {
  AppendLog log(file("log.csv"), {{"time", "ms", 1}, {"angle", "deg", 3}, {"p1", "kg/cm2"}},
                {{"experiment", "free"}, {"log", "other"}});
  log.append(std::vector<double>{0.0, 12.3456, 3.25});
  log.append(std::vector<double>{0.5, std::numeric_limits<double>::infinity(), kMissing});
  EXPECT_EQ(bytes(file("log.csv")),
            "# log: append-only\n# experiment: free\ntime [ms],angle [deg],p1 "
            "[kg/cm2]\n0.0,12.346,3.25\n0.5,nan,nan\n");
  const Recording open = read_recording(file("log.csv"));
  EXPECT_EQ(open.rows(), 2U);
  EXPECT_FALSE(open.metadata.contains("closed"));
  EXPECT_EQ(log.rows(), 2U);
  log.close();
  log.close();
  const Recording closed = read_recording(file("log.csv"));
  EXPECT_EQ(closed.meta("closed").size(), std::string("2003-05-01T14:30:00Z").size());
  EXPECT_EQ(code_of([&] { log.append(std::vector<double>{1, 2, 3}); }), "log_closed");
}

TEST_F(AppendLogOnDisk, refuses_rows_that_would_spoil_the_file) {
  AppendLog log(file("log.csv"), {{"time", "s", 2}, {"F1", "N"}}, {});
  log.append(std::vector<double>{0.0, 1});
  EXPECT_EQ(code_of([&] {
              log.append(std::vector<double>{0.001, 1});
            }),
            "time_not_increasing")
      << "both would print 0.00";
  EXPECT_EQ(code_of([&] { log.append(std::vector<double>{kMissing, 1}); }), "time_not_increasing");
  EXPECT_EQ(code_of([&] { log.append(std::vector<double>{1.0}); }), "row_length");
  log.append(std::vector<double>{0.01, 2});
  log.close();
  EXPECT_EQ(read_recording(file("log.csv")).rows(), 2U);
}

TEST_F(AppendLogOnDisk, never_overwrites_a_recording) {
  { AppendLog(file("log.csv"), {{"time", "s"}}, {}).append(std::vector<double>{0}); }
  const std::string before = bytes(file("log.csv"));
  EXPECT_EQ(code_of([&] { AppendLog(file("log.csv"), {{"time", "s"}}, {}); }), "file_exists");
  EXPECT_EQ(bytes(file("log.csv")), before);
  std::ofstream(file("empty.csv")).close();
  EXPECT_EQ(code_of([&] {
              AppendLog(file("empty.csv"), {{"time", "s"}}, {});
            }),
            "none")
      << "a reserved name is no recording";
}

TEST_F(AppendLogOnDisk, makes_no_file_when_its_columns_are_wrong) {
  EXPECT_EQ(code_of([&] {
              AppendLog(file("log.csv"), {{"time", "s"}, {"angle", "bar"}}, {});
            }),
            "unit_wrong");
  EXPECT_EQ(code_of([&] { AppendLog(file("log.csv"), {{"time", "s"}, {"angle", ""}}, {}); }), "unit_missing");
  EXPECT_EQ(files(), 0U);
}

TEST_F(AppendLogOnDisk, survives_sigkill_with_at_most_the_last_line_torn) {
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    AppendLog log(file("log.csv"), {{"time", "s", 4}, {"angle", "rad"}}, {{"experiment", "free"}});
    for (int i = 0;; ++i) {
      log.append(std::vector<double>{1e-3 * i, std::sin(0.001 * i)});
      if (i == 500 && ::write(ready[1], "x", 1) != 1) ::_exit(1);
    }
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  ::close(ready[0]);
  ::close(ready[1]);

  const Recording run = read_recording(file("log.csv"));
  ASSERT_GE(run.rows(), 501U);
  EXPECT_FALSE(run.metadata.contains("closed"));
  for (std::size_t i = 0; i < run.rows(); ++i) {
    ASSERT_EQ(run.column("angle").values[i], std::sin(0.001 * static_cast<int>(i)))
        << "shortest form reads back exactly";
  }
}

TEST_F(AppendLogOnDisk, keeps_whole_lines_only_when_the_disk_fills) {
  const auto fill = [&] {
    AppendLog log(file("log.csv"), {{"time", "s"}, {"angle", "rad"}}, {});
    for (int i = 0; i < 100000; ++i) log.append(std::vector<double>{1.0 * i, 1.0 / 3.0});
  };
  EXPECT_EQ(exit_code_with_file_limit(10007, fill), 42);
  const std::string text = bytes(file("log.csv"));
  EXPECT_GT(text.size(), 9900U);
  EXPECT_EQ(text.back(), '\n') << "the part of a line that went out was taken back";
  EXPECT_GT(read_recording(file("log.csv")).rows(), 300U);
  EXPECT_EQ(exit_code_with_file_limit(10, [&] { AppendLog(file("none.csv"), {{"time", "s"}}, {}); }), 42);
  EXPECT_FALSE(fs::exists(file("none.csv"))) << "a log without a head is no log";
  EXPECT_EQ(code_of([&] { AppendLog("/dev/full", {{"time", "s"}}, {}); }), "disk_full");
}

}  // namespace
