/// @file
/// What was scored, written into a page of the documentation: tables and the reliability diagram.
///
/// The tables stand between the page's lines kTablesFrom and kTablesTo, which stay; the rest of the page is its author's.
#pragma once

#include <filesystem>
#include <string>

#include "score.hpp"

namespace blind {

inline constexpr const char* kTablesFrom = "<!-- blind_score: tables -->";
inline constexpr const char* kTablesTo = "<!-- blind_score: end -->";

/// `page` with `tables` in that place, headings one level lower, for the page has a title of its own. Throws std::runtime_error where
/// the two lines are missing or the other way round.
std::string page_with_tables(const std::string& page, const std::string& tables);

/// The reliability diagram as SVG: share of right names over what was stated, with Wilson's interval of 95 %, against the diagonal.
/// Throws what isac::report::render_svg throws.
std::string reliability_diagram(const Reliability& names);

/// Puts report(cases) into the page, and the diagram beside it, into a folder of the page's name (docs/explain.md: docs/explain/reliability.svg).
/// Both files are replaced whole. Throws std::exception where a file cannot be read or written; then the page is as it was.
void write_page(const std::filesystem::path& page, const std::vector<Case>& cases);

}  // namespace blind
