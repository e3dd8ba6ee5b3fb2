/// @file
/// Where simulation and measurement disagree, what is missing, and the proof on runs that were never fitted.
///
///   1 is there a gap      score test by sign flips over blocks of time, every effect's response at once (screen.hpp)
///   2 where               by chain, then by angle, speed, pressure, direction, time
///   3 what could it be    the catalogue, each effect as it would show in every chain (hypothesis.hpp, predict.hpp)
///   4 which is it         joint refits by Ceres (fit.hpp), the set that cannot be ruled out (compare.hpp), forward, swap, backward
///   5 what cannot be told apart, and the experiment that would (experiment.hpp)
///   6 none of them        unknown, with what it depends on (unknown.hpp)
///   7, 8 add and show     parameters, gap before and after on held-out runs (proof.hpp)
///
/// Units: explanation.hpp. Threads: uses `threads`; deterministic for a seed, whatever their number.
/// Errors: throws isac::Error (no usable data; unknown term).
/// Source: docs/explain.md, docs/derivations/explain.md.
/// Example: `auto answer = explain(runs, HeldOut(heldout), {.rig = facts});`
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"
#include "isac/explain/prepared.hpp"
#include "isac/series/excitation.hpp"

namespace isac::explain {

struct ExplainOptions {
  RigFacts rig{};
  BaselineModel baseline{};
  std::vector<std::string> excluded{};  ///< effects that are not to be considered
  double significance = 0.01;           ///< of the whole search, for "something is missing"
  /// Smaller than this share of the noise floor is immaterial.
  double material = 0.10;
  int most_effects = 3;
  int threads = 2;
  std::uint64_t seed = 1;
  bool traces = true;                  ///< fill the columns for pictures
  series::ExcitationOptions limits{};  ///< of the rig: what an experiment that is asked for must keep
  bool next_experiment = true;         ///< look for the experiment that separates what is tied
  /// What is being tried, what is ruled out and why; one line each.
  std::function<void(const std::string&)> progress{};
};

[[nodiscard]] Explanation explain(std::span<const series::Recording> runs, const HeldOut& heldout,
                                  const ExplainOptions& options);

}  // namespace isac::explain
