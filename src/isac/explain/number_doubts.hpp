/// @file
/// What the numbers of a named effect say against its name: they do not need the effect that they belong to.
///
///   both ways alike   |x_up − x_down| < 2 √(s_up² + s_down²) of every pair: nothing in them differs by direction
///   falls by nothing  the same of T_s and T_c: friction at rest is none but that of sliding
///   level with the axis   |G_sin| < 1.645 s and s < 0.15 |G_cos|: an unbalanced mass whose torque does not turn with the angle, by coincidence
///   only together     |x − x₀| < 1.645 s of every amplitude that has an error of its own, two amplitudes and one such at least: no one of them is
///                     told, and what they make together something simpler may make as well
///
/// x₀: where an amplitude does nothing (EffectInfo); s: standard errors that hold under coloured noise (uncertainty.hpp).
/// Units: the parameters'. Threads: pure. Errors: none; a number without an error says nothing.
/// Source: docs/derivations/explain.md.
#pragma once

#include <string>
#include <vector>

#include "isac/core/estimated.hpp"
#include "isac/models/effects.hpp"

namespace isac::explain {

/// Sentences for Explanation::doubts; none where the numbers are as the name has them. `numbers`: as the effect's parameters.
[[nodiscard]] std::vector<std::string> doubts_of_numbers(const models::EffectInfo& effect,
                                                         const std::vector<Estimated>& numbers);

}  // namespace isac::explain
