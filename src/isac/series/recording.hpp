/// @file
/// A recording in memory: named columns of equal length in SI units, with the metadata of the file's head.
///
/// Units: every column is SI (`unit` says which); missing samples are NaN; `time` strictly increases.
/// Names with a meaning (docs/formats.md): time angle velocity p1 p2 p1_cmd p2_cmd F1 F2 torque theta1…6 phi1…6
/// tau1…6 enc0…5 ai0…7 ao0…11 pressure force contraction temperature p_supply. Others are kept and passed on.
/// Threads: a value; const access is safe from many threads. Errors: `column()` throws isac::Error (bad input) that names
/// the file and the missing column; `find()` returns nullptr instead.
/// Example: `const auto& phi = recording.column("angle").values;`
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace isac::series {

struct Column {
  std::string name;            ///< canonical name ("angle") or the file's own
  std::string unit;            ///< SI unit text of the values
  std::vector<double> values;  ///< NaN marks a missing sample
};

struct Recording {
  std::string source;                           ///< file the rows came from, for messages
  std::string sha256;                           ///< of the file's bytes, empty if not computed
  std::map<std::string, std::string> metadata;  ///< `# key: value` lines
  std::vector<Column> columns;                  ///< the first is `time` where the file has one

  [[nodiscard]] std::size_t rows() const noexcept {
    return columns.empty() ? 0 : columns.front().values.size();
  }
  [[nodiscard]] const Column* find(std::string_view name) const noexcept;
  [[nodiscard]] const Column& column(std::string_view name) const;
  /// The value of a metadata key, or `fallback`.
  [[nodiscard]] std::string meta(const std::string& key, const std::string& fallback = {}) const;
};

}  // namespace isac::series
