/// @file
/// A quantity is a number and its unit in one text: "38 mm", "3.0 kg/cm2", "-0.0488 N/count".
///
/// Values come back in SI. A unit may carry one more division than core/units.hpp reads ("kg/cm2/count", "kgf/cm2/N m"), because
/// a gain is a unit of a signal over a unit of another. Numbers are read by fast_float, so no locale can change them.
/// Threads: pure functions. Errors: parse_quantity says what is wrong in `problem`, in words for a sentence; nothing throws
/// but std::bad_alloc. Source: docs/formats.md. Example: `parse_quantity("38 mm").value == 0.038`.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "isac/core/units.hpp"

namespace isac::record {

struct Quantity {
  enum class Problem { kNone, kNoNumber, kNotFinite, kNoUnit, kUnknownUnit } problem = Problem::kNone;
  double value = 0;  ///< SI
  Unit unit;
  std::string unit_text;
};

[[nodiscard]] Quantity parse_quantity(std::string_view text);

/// parse_unit, and one more division at the last `/`.
[[nodiscard]] std::optional<Unit> parse_compound_unit(std::string_view text) noexcept;

/// "a pressure", "a length", … for sentences; "a quantity of another kind" for what has no name.
[[nodiscard]] std::string_view name_of(const Dimension& dimension) noexcept;
/// The units that would do: "Pa, kPa, MPa, bar, mbar, psi, atm or kg/cm2".
[[nodiscard]] std::string_view units_of(const Dimension& dimension) noexcept;
/// A unit for an example in an error message: "mm" for a length.
[[nodiscard]] std::string_view usual_unit(const Dimension& dimension) noexcept;

/// The shortest decimal text that reads back to the same double; "nan", "inf", and always a float in TOML's eyes ("1.0").
[[nodiscard]] std::string exact_number(double value);

/// The word of `known` nearest to `word` by edits, or empty when none is near enough to be meant.
template <typename Words>
[[nodiscard]] std::string nearest_word(std::string_view word, const Words& known);

/// Insertions, deletions and replacements that lead from `a` to `b`.
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b);

template <typename Words>
std::string nearest_word(std::string_view word, const Words& known) {
  constexpr std::size_t kLongestMistake = 64;  // a longer word is no misspelling, and would cost time
  std::string best;
  if (word.size() > kLongestMistake) return best;
  std::size_t least =
      word.size() / 3 + 2;  // a third of the letters wrong is still a typing error, more is another word
  for (const auto& candidate : known) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance < least) {
      least = distance;
      best = std::string(candidate);
    }
  }
  return best;
}

}  // namespace isac::record
