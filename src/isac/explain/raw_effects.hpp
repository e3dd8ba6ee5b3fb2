/// @file
/// Effects that only the recording's rate shows, which the search's low-passed rows cannot see: mains_hum and
/// periodic_disturbance by their line, spikes by single samples. Added to an explanation where they are significant, material
/// and shrink the gap on runs that were never fitted.
///
/// A line's amplitude and frequency are those of the fitted runs; on another run its phase is that of the run's clock if it
/// repeats, else the run's own (the one number that is read from it). Spikes are taken out by the limit of the fitted runs.
/// Units: as explanation.hpp. Threads: pure. Errors: none.
/// Source: spectrum.hpp, outliers.hpp; docs/derivations/explain.md.
#pragma once

#include "isac/explain/explain.hpp"
#include "isac/explain/proof.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

/// Beside the named model, do they take so much from held-out rows of the chain that these are no worse than before? `gap`: of the named
/// model alone.
[[nodiscard]] bool is_mended_by_raw_effects(const Predictor& predictor, const Found& found,
                                            const Proof& proof, Chain chain, const ExplainOptions& options,
                                            const Gap& gap);

void add_raw_effects(const Predictor& predictor, const Found& found, const Proof& proof,
                     const ExplainOptions& options, Explanation& e);

}  // namespace isac::explain
