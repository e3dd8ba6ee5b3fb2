/// @file
/// Rows of numbers: from the bytes of whole lines into columns of doubles in SI, in one pass.
///
/// Cells are read into a small table that stays in the first-level cache, and appended to the columns with their scale, a
/// few hundred rows at a time. Throws isac::Error (bad input) with line, column, what was found and what would do.
/// Threads: one per object.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "isac/record/csv_header.hpp"
#include "isac/record/csv_metadata.hpp"
#include "isac/series/recording.hpp"

namespace isac::record {

inline constexpr std::size_t kLongestLine = std::size_t{1} << 20U;  ///< bytes
[[noreturn]] void refuse_long_line(const std::string& file, long line);

class RowParser {
 public:
  RowParser(Header header, std::string file, long next_line);

  /// Empty columns in the order of delivery: `time` first, then as in the file.
  [[nodiscard]] std::vector<series::Column> empty_columns() const;

  /// Reads the lines of [p, end), of which each ends with a line feed, until `most_rows` rows are read; appends the rows to
  /// `columns` and metadata lines to `metadata`. Returns where it stopped. `cut_off`: the last line had no line feed.
  const char* parse(const char* p, const char* end, std::size_t most_rows,
                    std::vector<series::Column>& columns, Metadata& metadata, bool cut_off);

  [[nodiscard]] std::size_t rows() const noexcept { return rows_; }  ///< so far
  [[nodiscard]] long next_line() const noexcept { return next_line_; }
  [[nodiscard]] const std::string& file() const noexcept { return file_; }

 private:
  struct Cell {
    const char* end;
    double value;
  };
  void decide_decimal_sign(const char* p, const char* end) noexcept;
  Cell slow_cell(const char* row, const char* p, std::size_t column) const;
  void check_time(const char* row, double time);
  void flush(std::size_t count, std::vector<series::Column>& columns) const;
  [[nodiscard]] Place place(const char* row, const char* at) const;
  [[noreturn]] void refuse_length(const char* row, const char* at, std::size_t found) const;
  [[noreturn]] void refuse_cell(const char* row, std::string_view cell, std::size_t column) const;

  Header header_;
  std::string file_;
  std::vector<std::size_t> order_;  ///< order_[column of the file] = column of delivery
  std::size_t stage_rows_;
  std::vector<double> stage_;  ///< stage_[column · stage_rows_ + row]
  char decimal_sign_ = '.';
  bool decimal_sign_known_;
  const char* cut_off_end_ = nullptr;  ///< the line feed that the file does not have
  double last_time_;
  std::size_t rows_ = 0;
  long next_line_;
};

}  // namespace isac::record
