/// @file
/// Which effects are of one family, and which are special cases of which: what parsimony and a tied verdict go by.
///
/// Threads: pure. Errors: none. Source: docs/effects.md, docs/derivations/explain.md.
#pragma once

#include <algorithm>
#include <initializer_list>
#include <string>
#include <string_view>

namespace isac::explain {

/// Is the id one of these?
[[nodiscard]] constexpr bool one_of(std::string_view id, std::initializer_list<std::string_view> ids) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

/// Rate-independent dissipation, viscous, elastic …: what a tied verdict falls back to. `effect`: index in the catalogue.
[[nodiscard]] const char* family_of(int effect) noexcept;
/// Is `simple` a special case of `general`? Both are ids.
[[nodiscard]] bool nests(const std::string& general, const std::string& simple) noexcept;
/// Are these two, in either order, together what a hysteresis that differs by direction is, with one width?
[[nodiscard]] bool is_a_loop_with_an_offset(const std::string& a, const std::string& b) noexcept;

}  // namespace isac::explain
