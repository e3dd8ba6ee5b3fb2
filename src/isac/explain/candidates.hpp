/// @file
/// The candidates of an answer: what was refitted, as it is told, and what stays in the set beside a name though the search did not leave it there.
///
/// Beliefs that these take are shares of the name's own. Units: the catalogue's. Threads: pure. Errors: none.
/// Source: docs/derivations/explain.md, *What the numbers say*, *How much of it there is*; decisions 0182 and 0184.
#pragma once

#include <cstddef>
#include <vector>

#include "isac/explain/explanation.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

[[nodiscard]] Candidate candidate_of(const Library& library, const Trial& trial, double confidence);

/// What its own numbers say may be something simpler: the simple case of it stays in the set up to three sigma behind.
void keep_simple_case(const Library& library, std::vector<Trial> trials, std::size_t added, Explanation& e);

/// Of an effect that these recordings hold few sigma of, a general case that fits no worse may be true as well: what it has beyond it is not
/// needed, and would not be seen. The two that fit best stay in the set.
void keep_general_cases(const Library& library, const std::vector<Trial>& trials, std::size_t added,
                        Explanation& e);

/// A hysteresis and an offset, named together, are what a hysteresis that differs by direction is, with one width: it stays in the set.
void keep_what_both_are(const Library& library, const Found& found, Explanation& e);

}  // namespace isac::explain
