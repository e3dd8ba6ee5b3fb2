#include "isac/record/csv_rows.hpp"

#include <fast_float/fast_float.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "isac/record/csv_number.hpp"
#include "isac/record/csv_text.hpp"

namespace isac::record {
namespace {

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kStageCells = 2048;  // 16 kB: half of a usual first-level cache

const char* line_feed(const char* p) noexcept {
  while (*p != '\n') ++p;
  return p;
}

std::string_view line_at(const char* row) noexcept {
  return {row, static_cast<std::size_t>(line_feed(row) - row)};
}

bool is_nan_word(std::string_view text) noexcept {
  return text.size() == 3 && (text[0] | 0x20) == 'n' && (text[1] | 0x20) == 'a' && (text[2] | 0x20) == 'n';
}

}  // namespace

void refuse_long_line(const std::string& file, long line) {
  throw Error(ErrorKind::kBadInput, "line_too_long",
              "the line is longer than 1 MB; check that this is a CSV file with line feeds", {file, line, 1});
}

RowParser::RowParser(Header header, std::string file, long next_line)
    : header_(std::move(header)),
      file_(std::move(file)),
      stage_rows_(std::clamp<std::size_t>(kStageCells / header_.columns.size(), 1, 512)),
      stage_(stage_rows_ * header_.columns.size()),
      decimal_sign_known_(header_.separator == ','),
      last_time_(-std::numeric_limits<double>::infinity()),
      next_line_(next_line) {
  std::size_t next = header_.time == kNoColumn ? 0 : 1;
  for (std::size_t column = 0; column < header_.columns.size(); ++column) {
    order_.push_back(column == header_.time ? 0 : next++);
  }
}

std::vector<series::Column> RowParser::empty_columns() const {
  std::vector<series::Column> columns(header_.columns.size());
  for (std::size_t i = 0; i < order_.size(); ++i) {
    columns[order_[i]].name = header_.columns[i].name;
    columns[order_[i]].unit = header_.columns[i].unit;
  }
  return columns;
}

// In a semicolon or tab file the first '.' or ',' among the rows says which of the two is the decimal sign.
void RowParser::decide_decimal_sign(const char* p, const char* end) noexcept {
  while (p < end && !decimal_sign_known_) {
    const char* stop = line_feed(p);
    const char* found = *p == '#' ? stop : std::find_if(p, stop, [](char c) { return c == '.' || c == ','; });
    if (found != stop) {
      decimal_sign_ = *found;
      decimal_sign_known_ = true;
    }
    p = stop + 1;
  }
}

const char* RowParser::parse(const char* p, const char* end, std::size_t most_rows,
                             std::vector<series::Column>& columns, Metadata& metadata, bool cut_off) {
  cut_off_end_ = cut_off ? end - 1 : nullptr;
  if (!decimal_sign_known_) decide_decimal_sign(p, end);
  const std::size_t last = header_.columns.size() - 1;
  const std::size_t stride = stage_rows_;
  const char separator = header_.separator;
  const char decimal_sign = decimal_sign_;
  double* const stage = stage_.data();
  std::size_t staged = 0;
  std::size_t left = most_rows;

  while (p < end && left > 0) {
    if (static_cast<unsigned char>(*p) <= '#') [[unlikely]] {  // '#', blank, quote, line end
      const std::string_view line = line_at(p);
      if (*p == '#' || trimmed(line).empty()) {
        const bool blank_cells = separator == '\t' && line.find('\t') != std::string_view::npos;
        if (*p == '#' || !blank_cells) {
          if (line.size() > kLongestLine) refuse_long_line(file_, next_line_);
          if (*p == '#') metadata.add_line(line, {file_, next_line_, 1});
          p += line.size() + 1;
          ++next_line_;
          continue;
        }
      }
    }
    const char* const row = p;
    double* cell = stage + staged;
    for (std::size_t column = 0; column <= last; ++column, cell += stride) {
      const unsigned length = cell_length(p, separator);
      const char* stop = p + length;
      const bool at_wanted_end = *stop == (column == last ? '\n' : separator);
      double value = 0.0;
      if (!at_wanted_end || !read_short_decimal(p, length, decimal_sign, value)) {
        const char* const number_end = read_plain_decimal(p, decimal_sign, value);
        const bool plain =
            number_end == stop || (column == last && number_end == stop - 1 && *number_end == '\r');
        if (!plain || !at_wanted_end) [[unlikely]] {
          const Cell slow = slow_cell(row, p, column);
          stop = slow.end;
          value = slow.value;
        }
      }
      *cell = value;
      p = stop + 1;
    }
    if (static_cast<std::size_t>(p - row) > kLongestLine) refuse_long_line(file_, next_line_);
    if (header_.time != kNoColumn) check_time(row, stage[header_.time * stride + staged]);
    ++next_line_;
    --left;
    if (++staged == stride) {
      flush(staged, columns);
      staged = 0;
    }
  }
  flush(staged, columns);
  rows_ += most_rows - left;
  return p;
}

// Everything that is not a plain decimal followed by what must follow it.
RowParser::Cell RowParser::slow_cell(const char* row, const char* p, std::size_t column) const {
  const bool last = column + 1 == header_.columns.size();
  const char* stop = p;
  while (*stop == ' ') ++stop;
  if (*stop == '"') {
    ++stop;
    while (*stop != '"' && *stop != '\n') ++stop;
  }
  while (*stop != header_.separator && *stop != '\n') ++stop;
  if (!last && *stop == '\n') refuse_length(row, stop, column + 1);
  if (last && *stop != '\n') refuse_length(row, stop, column + 2);

  std::string_view text = trimmed({p, static_cast<std::size_t>(stop - p)});
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"')
    text = trimmed(text.substr(1, text.size() - 2));
  if (text.empty() || is_nan_word(text)) return {stop, kMissing};

  std::string_view digits = text;
  if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
  double value = 0.0;
  const fast_float::parse_options format{fast_float::chars_format::general, decimal_sign_};
  const auto result =
      fast_float::from_chars_advanced(digits.data(), digits.data() + digits.size(), value, format);
  const ColumnPlan& plan = header_.columns[column];
  if (result.ptr != digits.data() + digits.size() || !std::isfinite(value * plan.scale + plan.offset))
    refuse_cell(row, text, column);
  return {stop, value};
}

void RowParser::check_time(const char* row, double time) {
  const ColumnPlan& plan = header_.columns[header_.time];
  const double now = time * plan.scale;
  if (now > last_time_) [[likely]] {
    last_time_ = now;
    return;
  }
  const char* cell = row;
  for (std::size_t column = 0; column < header_.time; ++column)
    cell = std::strchr(cell, header_.separator) + 1;
  if (std::isnan(time)) {
    throw Error(ErrorKind::kBadInput, "time_missing", "the row has no time; fill it in, or remove the row",
                place(row, cell));
  }
  throw Error(ErrorKind::kBadInput, "time_not_increasing",
              "time " + shortest(time) + " follows " + shortest(last_time_ / plan.scale) +
                  " but must strictly increase; sort the rows, or remove those that are repeated",
              place(row, cell));
}

void RowParser::flush(std::size_t count, std::vector<series::Column>& columns) const {
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const double* from = stage_.data() + i * stage_rows_;
    const ColumnPlan& plan = header_.columns[i];
    std::vector<double>& values = columns[order_[i]].values;
    const std::size_t begin = values.size();
    values.insert(values.end(), from, from + count);
    if (plan.scale == 1.0 && plan.offset == 0.0) continue;
    for (std::size_t k = begin; k < values.size(); ++k) values[k] = values[k] * plan.scale + plan.offset;
  }
}

Place RowParser::place(const char* row, const char* at) const {
  return {file_, next_line_, character_column(line_at(row), static_cast<std::size_t>(at - row))};
}

void RowParser::refuse_length(const char* row, const char* at, std::size_t found) const {
  const std::string wanted = std::to_string(header_.columns.size());
  if (found < header_.columns.size() && at == cut_off_end_) {
    throw Error(ErrorKind::kBadInput, "line_cut_off",
                "the file ends in the middle of this row, after " + std::to_string(found) + " of " + wanted +
                    " cells; remove the row, or copy the file again",
                place(row, at));
  }
  if (found > header_.columns.size()) {
    found = 1;
    for (const char* p = row; *p != '\n'; ++p) found += *p == header_.separator ? 1U : 0U;
  }
  const std::string hint = header_.separator == ',' && found > header_.columns.size()
                               ? "; write numbers with a decimal point, or separate the columns by "
                                 "semicolons if they have decimal commas"
                               : "; leave a cell empty for a missing sample, but write its separator";
  throw Error(ErrorKind::kBadInput, "row_length",
              "the row has " + std::to_string(found) + " cells and the header " + wanted + hint,
              place(row, at));
}

void RowParser::refuse_cell(const char* row, std::string_view cell, std::size_t column) const {
  const Place where = place(row, cell.data());
  const std::string in_column = " in the column " + shown(header_.columns[column].name);
  check_text(cell, where);
  double value = 0.0;
  const auto result = fast_float::from_chars_advanced(
      cell.data(), cell.data() + cell.size(), value,
      fast_float::parse_options{fast_float::chars_format::general, decimal_sign_});
  if (result.ptr == cell.data() + cell.size()) {
    throw Error(ErrorKind::kBadInput, "number_not_finite",
                shown(cell) + in_column +
                    " is infinite or too large; write nan or leave the cell empty for a missing sample",
                where);
  }
  const char other_sign = decimal_sign_ == '.' ? ',' : '.';
  if (header_.separator != ',' && cell.find(other_sign) != std::string_view::npos) {
    throw Error(ErrorKind::kBadInput, "number_decimal_sign",
                shown(cell) + in_column + " has a '" + other_sign + "', but this file's decimal sign is '" +
                    decimal_sign_ + "'; use one decimal sign and do not group digits",
                where);
  }
  throw Error(ErrorKind::kBadInput, "number_malformed",
              shown(cell) + in_column +
                  " is not a number; write one, or leave the cell empty (or nan) for a missing sample",
              where);
}

}  // namespace isac::record
