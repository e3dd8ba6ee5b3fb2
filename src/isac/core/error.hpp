/// @file
/// The one exception of the toolkit: outside input that cannot be used, with its place and the mend.
///
/// Host only (not included by the freestanding parts of core, models and control).
/// Text is one clear sentence that says what was found, what was expected and how to mend it; the place is kept
/// apart so that a program can print `file:line:column: text` or the JSON of docs/formats.md.
/// Throws: construction may throw std::bad_alloc only.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace isac {

/// The exit code that a program ends with (docs/formats.md, "Exit codes").
enum class ErrorKind : int {
  kAnswerIsNo = 1,  ///< done, and the answer is no: not identifiable, gate failed, no usable data
  kUsage = 2,       ///< the call's words are wrong
  kBadInput = 3,    ///< a file cannot be used
  kStopped = 4,     ///< the card or a safety limit stopped the run
};

/// Where in the input; line and column count from 1, 0 means "not known".
struct Place {
  std::string file;
  long line = 0;
  long column = 0;
};

class Error : public std::runtime_error {
 public:
  /// `code` is a stable lower-case word for programs ("unit_unknown"), `text` one sentence for people.
  Error(ErrorKind kind, std::string code, std::string text, Place place = {})
      : std::runtime_error(with_place(text, place)),
        kind_(kind),
        code_(std::move(code)),
        text_(std::move(text)),
        place_(std::move(place)) {}

  [[nodiscard]] ErrorKind kind() const noexcept { return kind_; }
  [[nodiscard]] const std::string& code() const noexcept { return code_; }
  [[nodiscard]] const std::string& text() const noexcept { return text_; }
  [[nodiscard]] const Place& place() const noexcept { return place_; }

 private:
  static std::string with_place(const std::string& text, const Place& place) {
    std::string out = place.file;
    if (place.line > 0) out += ":" + std::to_string(place.line);
    if (place.line > 0 && place.column > 0) out += ":" + std::to_string(place.column);
    return out.empty() ? text : out + ": " + text;
  }

  ErrorKind kind_;
  std::string code_;
  std::string text_;
  Place place_;
};

}  // namespace isac
