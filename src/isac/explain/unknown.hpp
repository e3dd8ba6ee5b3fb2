/// @file
/// What none of the catalogue explains: in which chain it is, on which signals it depends, and its shape, without a name.
///
/// Greedy forward selection among generic functions of the measured signals (screen.hpp, Dictionary), each freed of what the
/// baseline can mimic, until another one takes less than a tenth of what the first did. The variables of those taken are what
/// the effect depends on; of those tried and left, what it does not.
/// Where only pressures matter, one muscle's is named if powers and bends of it alone take as much and the other's do not.
/// The shape is the baseline's residual averaged over bins of the first variable, with 95 % bands from blocks.
/// Units: those of Unknown. Threads: pure. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <string>

#include "isac/explain/explanation.hpp"
#include "isac/explain/screen.hpp"

namespace isac::explain {

/// What comes and goes depends on time, though no function of it tells when.
void add_time(Unknown& unknown);

/// Of what shows only in few moments or in one run: the one signal that powers and bends of it tell most of, clearly more than of any other;
/// empty where there is none.
[[nodiscard]] std::string signal_that_tells(const Around& baseline, Chain chain);

[[nodiscard]] Unknown describe_unknown(const Around& baseline, const Screen& screen);

}  // namespace isac::explain
