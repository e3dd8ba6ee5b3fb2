/// @file
/// The words and numbers a person sees while a sweep runs and when it is judged; pure functions, so that they are tested.
///
/// Units: shown with each number. Threads: pure (RecordingLive is read atomically). Errors: std::bad_alloc only.
/// Example: `12.3 of 40.0 s [######--------------]  speed to 0.31 rad/s  dp -1.00 kg/cm2  F 31 to 141 N`
#pragma once

#include <string>

#include "isac/runtime/log_session.hpp"

namespace isac::runtime {

/// One line, no longer than `columns` (0: no bar).
[[nodiscard]] std::string progress_line(const series::Program& program, const RecordingLive& live,
                                        int columns);

/// `text` broken at spaces so that no line is longer than `columns` (0: not broken); lines after the first are indented.
[[nodiscard]] std::string wrapped(const std::string& text, int columns, int indent);

/// "keep    file.csv", what it covers, and a line "- …" for each remark.
[[nodiscard]] std::string verdict_lines(const RecordingOutcome& outcome, bool colour, int columns);

/// The last line of a session.
[[nodiscard]] std::string summary_line(const std::vector<RecordingOutcome>& outcomes, std::size_t asked);

}  // namespace isac::runtime
