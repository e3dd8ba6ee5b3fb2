/// @file
/// Where simulation and measurement disagree: the regions that hold the explainable part of a chain's squared residual.
///
///   share(region) = Σ_region w_i / Σ w_i,   w_i = r_before,i² − r_after,i²
///
/// r_after is the final model's residual where effects were added; otherwise the noise of the quietest quarter of the blocks
/// takes its place. For each variable the range of bins is chosen that says most, Σ share·ln(share/share of the rows): a range
/// that holds half of the disagreement in half of the rows says nothing. Standing still (0) is a direction beside up (1) and down (-1), -1 to 1 is moving, and what
/// follows a reversal is measured by the travel since it, so that moving and holding are told apart.
/// Units: as Region. Threads: pure. Errors: none.
/// Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

/// Regions of each chain that disagrees, the one that says most first.
[[nodiscard]] std::vector<Region> regions(const Predictor& predictor, const Library& library,
                                          const Found& found);

/// The ranges, at most one of each variable, in which one chain's rows hold a weight; the one that says most first.
[[nodiscard]] std::vector<Region> regions_of(const Prepared& data, Chain chain,
                                             const Eigen::VectorXd& weight);

/// "muscle" of torque, "pcu" of the pressures, "joint" of motion.
[[nodiscard]] const char* subsystem_of(Chain chain) noexcept;
/// "at angle from 0.31 to 0.92 rad"; "standing still".
[[nodiscard]] std::string in_words(const Region& region);

}  // namespace isac::explain
