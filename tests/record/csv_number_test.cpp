// The reader's own conversion of plain decimals against two others: strtod, and the whole reader over any piece size.
#include "isac/record/csv_number.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>

#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"

namespace {

using isac::record::cell_length;
using isac::record::read_plain_decimal;
using isac::record::read_short_decimal;

std::uint64_t bits(double value) {
  std::uint64_t out = 0;
  std::memcpy(&out, &value, sizeof out);
  return out;
}

std::string padded(const std::string& text) {
  return text + std::string(64, '\0');
}

TEST(CsvNumber, of_any_plain_decimal_is_the_nearest_double) {
  std::mt19937_64 random(5);
  std::uniform_int_distribution<int> digit('0', '9');
  int short_ones = 0;
  int plain_ones = 0;
  for (int i = 0; i < 400000; ++i) {
    const int whole = static_cast<int>(random() % 9);
    const int fraction = static_cast<int>(random() % 18);
    std::string text = random() % 2 ? "-" : "";
    for (int k = 0; k < whole; ++k) text += static_cast<char>(digit(random));
    if (random() % 4) {
      text += '.';
      for (int k = 0; k < fraction; ++k) text += static_cast<char>(digit(random));
    }
    const std::string bytes = padded(text + ",");
    const double truth = std::strtod(text.c_str(), nullptr);
    double value = 0.0;
    const unsigned length = cell_length(bytes.data(), ',');
    if (length < 16 && read_short_decimal(bytes.data(), length, '.', value)) {
      ++short_ones;
      ASSERT_EQ(bits(value), bits(truth)) << text;
    }
    const char* end = read_plain_decimal(bytes.data(), '.', value);
    if (end == bytes.data() + text.size()) {
      ++plain_ones;
      ASSERT_EQ(bits(value), bits(truth)) << text;
    }
  }
  EXPECT_GT(short_ones, 50000);
  EXPECT_GT(plain_ones, 100000);
}

TEST(CsvNumber, fast_path_refuses_everything_that_is_not_digits_around_one_sign) {
  std::mt19937 random(6);
  const std::string letters = "0123456789.-+eE ,n\"\r\x80/:";
  for (int i = 0; i < 400000; ++i) {
    std::string text(1 + random() % 10, ' ');
    for (char& c : text) c = letters[random() % letters.size()];
    text.erase(std::remove(text.begin(), text.end(), ','), text.end());
    const std::string bytes = padded(text + ",");
    const bool plain = !text.empty() &&
                       text.find_first_not_of("0123456789.", text[0] == '-' ? 1 : 0) == std::string::npos &&
                       std::count(text.begin(), text.end(), '.') <= 1 &&
                       text.find_first_of("0123456789") != std::string::npos;
    double value = 0.0;
    if (read_short_decimal(bytes.data(), cell_length(bytes.data(), ','), '.', value)) {
      ASSERT_TRUE(plain) << text;
    }
    if (read_plain_decimal(bytes.data(), '.', value) == bytes.data() + text.size()) {
      ASSERT_TRUE(plain) << text;
    }
  }
}

TEST(CsvNumber, cell_length_finds_the_separator_or_the_line_feed) {
  EXPECT_EQ(cell_length(padded("1.5,2\n").data(), ','), 3U);
  EXPECT_EQ(cell_length(padded("1,5;2\n").data(), ';'), 3U);
  EXPECT_EQ(cell_length(padded("15\n,").data(), ','), 2U);
  EXPECT_EQ(cell_length(padded(",").data(), ','), 0U);
  EXPECT_EQ(cell_length(padded("1234567890123456,").data(), ','), 16U);
}

TEST(CsvNumber, of_every_shape_is_read_as_strtod_reads_it) {
  for (const char* text : {"0",
                           "-0",
                           "-0.0",
                           "1",
                           "12345678",
                           "123456789",
                           "1234567890123456789",
                           "0.1",
                           ".5",
                           "5.",
                           "-.5",
                           "1e3",
                           "1E-3",
                           "-1.5e+10",
                           "0.123456789012345678",
                           "9007199254740993",
                           "1.7976931348623157e308",
                           "2.2250738585072014e-308",
                           "4.9406564584124654e-324",
                           "0.00000000000000000001",
                           "123456.789012345678",
                           "3.14159265358979323846",
                           "90071992.54740993",
                           "9999999.99999999",
                           "0.00000001",
                           "1e-400"}) {
    const auto run =
        isac::record::parse_recording("time [s],x\n0," + std::string(text) + "\n1," + text, "n.csv");
    const double truth = std::strtod(text, nullptr);
    EXPECT_EQ(bits(run.columns[1].values[0]), bits(truth)) << text;
    EXPECT_EQ(bits(run.columns[1].values[1]), bits(truth)) << text;
  }
}

}  // namespace
