/// @file
/// One effect taken out of the final model: what is left over then, and by how many sigma of data it is missed.
///
///   s = ‖r_without − r‖/√c,  r_without: refitted without it, c: compare.hpp's
///
/// Two responses of s sigma whose cosine is ρ lie s √(1 − ρ²) apart. What lies between a name and the truth is found without a name from five
/// sigma on in nine cases of ten (3.7 pass the search's level). With s = 33 that leaves out all with √(1 − ρ²) < 0.15: of 212 effects that were
/// hidden, 17 have so near a neighbour in the catalogue.
/// Threads: pure. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

struct TakenOut {
  Eigen::VectorXd left;  ///< measured − predicted without it, in the chains' units
  Eigen::VectorXd gain;  ///< weighted squares that it takes from each row
};

/// `effect`: which of those that were added. All else stays as it was fitted.
[[nodiscard]] TakenOut taken_out(const Predictor& predictor, const Found& found, std::size_t effect);

/// What else was added, as it was fitted.
[[nodiscard]] std::vector<Active> others_than(const Found& found, std::size_t effect);

/// s; all else is fitted anew.
[[nodiscard]] double missed_by(const Predictor& predictor, const Found& found, std::size_t effect);

/// Do these recordings hold so little of it that something like it would do as well?
[[nodiscard]] bool is_told_by_few_sigma(const Candidate& effect);
/// Why the one of fewest sigma may be another than its name says, though nothing of the catalogue is as good; empty: all are large enough.
[[nodiscard]] std::string told_by_few_sigma(const std::vector<Candidate>& effects);

}  // namespace isac::explain
