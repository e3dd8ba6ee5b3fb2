/// @file
/// Small helpers for text that came from outside: what may be shown in an error sentence, and where it stood.
///
/// Throws std::bad_alloc only. Threads: pure functions.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace isac::record {

[[nodiscard]] std::string_view trimmed(std::string_view text) noexcept;

/// `text` in single quotes, control and invalid bytes shown as \xNN, cut after `most` bytes: fit for one line.
[[nodiscard]] std::string shown(std::string_view text, std::size_t most = 40);

/// The position of the first byte that is no UTF-8, or npos.
[[nodiscard]] std::size_t find_invalid_utf8(std::string_view text) noexcept;

/// The column, counted in characters from 1, of the byte at `offset` of `line`.
[[nodiscard]] long character_column(std::string_view line, std::size_t offset) noexcept;

/// A number as people write it, shortest form that reads back the same.
[[nodiscard]] std::string shortest(double value);

}  // namespace isac::record
