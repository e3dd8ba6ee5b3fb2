/// @file
/// The `# key: value` lines of a recording: collected, joined where a key is repeated, and checked where they have a meaning.
///
/// A line without a colon is a remark and is dropped. A repeated key keeps all its values, joined by "; ".
/// Checked: `started` is an ISO 8601 time, `experiment` is not a misspelling of a known one (other words are kept: the list
/// may grow). Throws isac::Error (bad input): started_not_iso8601, experiment_misspelt, not_utf8, file_binary,
/// metadata_too_long (1 MB in all).
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "isac/core/error.hpp"

namespace isac::record {

class Metadata {
 public:
  /// `line` begins with '#' and has no line feed.
  void add_line(std::string_view line, const Place& place);

  [[nodiscard]] const std::map<std::string, std::string>& values() const noexcept { return values_; }
  [[nodiscard]] bool has(const std::string& key, std::string_view value) const;
  void set(const std::string& key, std::string value) { values_[key] = std::move(value); }

 private:
  std::map<std::string, std::string> values_;
  std::size_t bytes_ = 0;
};

/// "2003-05-01", "2003-05-01T14:30", with seconds, fractions, and a zone Z or ±HH:MM.
[[nodiscard]] bool is_iso8601(std::string_view text) noexcept;

/// Throws not_utf8, file_binary or line_ends_cr if `text`, which begins at `place`, is not clean text of one line.
void check_text(std::string_view text, Place place);

}  // namespace isac::record
