/// @file
/// Steps and fills of a valve unit alone: what a first-order lag leaves over, and which of the catalogue's shapes takes it.
///
///   p(t) = p_a + (p_b − p_a) g((t − t_s − L); T, …),  g first order, with a second lag, flow limited, or of two rates
///
/// A record of pressures without a joint, as short as half a second, has no blocks of time to flip and often no command: the
/// search of search.hpp has nothing to hold on to. Here each step is fitted with levels and onset of its own
/// (estimate/pcu_fit.hpp) and shapes are compared by what they leave, over all steps together; each parameter more must cut the
/// rms by a tenth, and a rival stays beside the best until it is 1.645 sigma behind by the scatter of blocks of half a lag
/// (compare.hpp). Shapes that the catalogue does not have are called unknown. Nothing is held out: a step's levels are its own.
/// Units: as explanation.hpp. Threads: pure. Errors: throws isac::Error (no usable data) if no pressure ever steps.
/// Source: seed 4.1; docs/derivations/pcu_fit.md, docs/derivations/explain.md.
/// Example: `if (only_pressures(runs)) answer = explain_steps(runs);`
#pragma once

#include <span>

#include "isac/explain/explanation.hpp"
#include "isac/series/recording.hpp"

namespace isac::explain {

/// Pressures (p1, p2 or `pressure`), and neither angle nor torque to hold against them.
[[nodiscard]] bool only_pressures(std::span<const series::Recording> runs);

[[nodiscard]] Explanation explain_steps(std::span<const series::Recording> runs);

}  // namespace isac::explain
