/// @file
/// What could still be there unseen: the largest size of each effect that the final model's residual does not contradict, and
/// the effects of which the data cannot speak at all.
///
///   â = score/norm²,  SE = √(unit/norm²),  bound = |â| + 1.645 SE   in units of the shape's size
///
/// score, norm² and unit are those of the effect's projected response (screen.hpp): what a change of the fitted parameters
/// hides as well counts as hidden. An effect is not testable if its typical size (on another rig than the seed's joint: a tenth of the
/// output) makes less than 3 sigma.
/// Units: reporting units of the effect's first amplitude. Threads: pure. Errors: none.
/// Source: docs/derivations/explain.md.
#pragma once

#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"
#include "isac/explain/search.hpp"
#include "isac/models/effects.hpp"

namespace isac::explain {

/// The effects that could hide the largest torque or pressure, largest first; those that were added are left out.
[[nodiscard]] std::vector<CouldHide> could_hide(const Prepared& data, const Library& library,
                                                const Found& found, std::size_t most);
[[nodiscard]] std::vector<std::string> not_testable(const Prepared& data, const Library& library,
                                                    const Found& found);

}  // namespace isac::explain
