/// @file
/// What a named model leaves over, of the fitted runs and of those that no fit has seen: more than noise, and more than its equation's own error?
///
///   T = |Σ g_b|/√Σ g_b²    of a function of the signals, over the blocks of held-out runs, or of fitted and held-out ones together;
///                          p of the largest T by flips of blocks
///   size = |Σ g|/Σ x⊥² √(Σ x²/n) σ/floor    of that function
///
/// More blocks tell more, and a name that only bent the fitted runs towards it leaves of the others what it never closed. Only functions without a
/// name are asked: the search has asked the catalogue. The model's own slopes are projected off, of held-out rows its slopes there: a parameter that
/// is a little off for them leaves nothing (screen.hpp). Functions are of signals scaled to the range of their own runs: where held-out runs have
/// another range than fitted ones, both together weigh them unequally, which any weights may.
/// Units: sizes in noise floors. Threads: uses up to `threads`. Errors: none; p = 1 where no held-out run can be compared.
/// Source: docs/derivations/explain.md.
#pragma once

#include <string>

#include "isac/explain/proof.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

struct LeftOver {
  double p_value = 1;
  double size = 0;  ///< of the function with the largest T, in noise floors
  Chain chain = Chain::kTorque;
  std::string function;
};

struct LeftOfRuns {
  LeftOver all, held_out;
};

/// `options`: its flips, seed, threads and significance.
[[nodiscard]] LeftOfRuns left_of_runs(const Prepared& data, const Library& library, const Found& found,
                                      const Proof& proof, const ScreenOptions& options);

/// Does it cast a doubt on the name? What the first effect closed measures it: an equation that is so nearly right is right. `joint`: the baseline is
/// that of the catalogue's joint, which leaves less of itself than another machine's.
[[nodiscard]] bool casts_a_doubt(double p_value, double size, Chain chain, double first_size,
                                 bool joint) noexcept;

}  // namespace isac::explain
