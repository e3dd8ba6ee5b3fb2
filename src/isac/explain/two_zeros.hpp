/// @file
/// Zeros of both pressure sensors, and a valve's zero with one sensor's: the same equations.
///
///   p_k as read − p_k as commanded = b_k  (k = 1, 2)   is   b + z and b,   b: the valves' zero, z: one sensor's
///
/// Where a zero of both is found and neither is small beside the other (a fifth) nor of the other sign, the valves' zero is told beside it, with half
/// of its belief: no recording in which the valves control the pressure tells the two apart. (Zeros that are alike are a valve's zero alone: ranking.hpp.)
/// Threads: pure. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"

namespace isac::explain {

/// A sentence for the summary; empty where there is nothing to tell.
[[nodiscard]] std::string tell_a_valves_zero(const std::vector<std::string>& excluded, Explanation& e);

}  // namespace isac::explain
