#include "isac/record/csv_writer.hpp"

#include <cmath>

#include "isac/core/error.hpp"
#include "isac/record/atomic_file.hpp"
#include "isac/record/csv_format.hpp"
#include "isac/record/csv_text.hpp"

namespace isac::record {
namespace {

constexpr std::size_t kPiece = std::size_t{256} << 10U;

void check_columns(const series::Recording& recording, const std::string& file) {
  if (recording.columns.empty() || recording.rows() == 0) {
    throw Error(ErrorKind::kBadInput, "no_rows", "the recording has nothing to write; record again",
                {file, 0, 0});
  }
  for (const series::Column& column : recording.columns) {
    if (column.values.size() != recording.rows()) {
      throw Error(ErrorKind::kBadInput, "columns_unequal",
                  "the column " + shown(column.name) + " has " + std::to_string(column.values.size()) +
                      " values and the first column " + std::to_string(recording.rows()) +
                      "; give all columns the same length",
                  {file, 0, 0});
    }
    for (double value : column.values) {
      if (std::isinf(value)) {
        throw Error(
            ErrorKind::kBadInput, "number_not_finite",
            "the column " + shown(column.name) + " holds an infinite value; use NaN for a missing sample",
            {file, 0, 0});
      }
    }
  }
}

}  // namespace

void write_recording(const std::filesystem::path& path, const series::Recording& recording) {
  const std::string name = path.string();
  check_columns(recording, name);
  std::string text;
  for (const auto& [key, value] : recording.metadata) text += metadata_line(key, value, name);
  std::vector<std::pair<std::string, std::string>> header;
  for (const series::Column& column : recording.columns) header.emplace_back(column.name, column.unit);
  text += header_line(header, name);

  AtomicFile file(path);
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    for (const series::Column& column : recording.columns) {
      append_number(text, column.values[row], -1);
      text += ',';
    }
    text.back() = '\n';
    if (text.size() >= kPiece) {
      file.append(text);
      text.clear();
    }
  }
  file.append(text);
  file.commit();
}

}  // namespace isac::record
