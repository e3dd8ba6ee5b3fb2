/// @file
/// Numbers and names as people read them: digits by the standard error, units with raised exponents, safe HTML text.
///
/// Threads: pure functions. Errors: std::bad_alloc only.
/// Example: `with_error(174.213, 0.42).value == "174.21"`, `.error == "0.42"`.
#pragma once

#include <string>
#include <string_view>

namespace isac::report {

/// `digits` significant digits, true minus sign, "–" for NaN; below 1e-4 and from 1e7 on as "1.2 · 10⁻⁵".
[[nodiscard]] std::string number(double value, int digits = 4);
/// `decimals` digits behind the point, true minus sign, no minus before zero.
[[nodiscard]] std::string fixed_decimals(double value, int decimals);
[[nodiscard]] std::string whole(double value);  ///< a count: "1 234 567", thin spaces
/// A p-value: two digits, "< 0.001" below.
[[nodiscard]] std::string probability(double p);

struct Rounded {
  std::string value, error;
};
/// Two significant digits of the standard error decide; without a usable error four digits of the value.
[[nodiscard]] Rounded with_error(double value, double std_error);
/// `value` to the same last digit that with_error() would show, for interval limits.
[[nodiscard]] std::string to_error_digit(double value, double std_error);

/// "N cm2/kg" → "N cm²/kg"; "-" and "1" → "".
[[nodiscard]] std::string pretty_unit(std::string_view unit);
/// The same of units within a sentence, and a true minus sign: "-0.401 N m/rad3" → "−0.401 N m/rad³".
[[nodiscard]] std::string pretty_sentence(std::string_view sentence);
/// Invalid UTF-8 and control characters replaced, so that names from foreign files cannot break a document.
[[nodiscard]] std::string clean_utf8(std::string_view text);
/// clean_utf8 and &, <, >, ", ' escaped.
[[nodiscard]] std::string escape(std::string_view text);
/// "sweeps/slow 1.csv" → "slow 1.csv": what a table shows of a path.
[[nodiscard]] std::string file_name(std::string_view path);
/// Number of characters, not bytes, of UTF-8 text (combining marks not counted).
[[nodiscard]] std::size_t glyphs(std::string_view text) noexcept;

}  // namespace isac::report
