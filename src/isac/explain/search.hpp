/// @file
/// The search: gate, shortlist, joint refits, the set that is left, and one effect after another until nothing is.
///
/// Forward: the best candidate is added while the residual still shows something significant and material; swap: each added
/// effect is given up once for a better one; backward: each is dropped once and must be missed. At most `most_effects`.
/// Threads: uses options.threads. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <string>
#include <vector>

#include "isac/explain/compare.hpp"
#include "isac/explain/explain.hpp"
#include "isac/explain/floors.hpp"
#include "isac/explain/ranking.hpp"
#include "isac/explain/screen.hpp"

namespace isac::explain {

struct Gate {
  bool significant = false, material = false;
  double p_value = 1;
  double size = 0;  ///< rms of the largest explainable part over the floor, in its best chain
  Chain chain = Chain::kTorque;
  std::string what;  ///< whose response that is
  double dense_size =
      0;  ///< of the largest generic function (beside an effect: response too) that flips of blocks speak for
};

struct Step {
  std::vector<Trial> trials;  ///< best first
  Screen screen;
  Gate gate;
};

struct Found {
  Fit baseline, model;
  Weights weights;
  Floors floors;
  std::vector<Step> steps;  ///< one for each effect that was added, and the last that was not
  std::vector<int> added;   ///< hypotheses, in order
  bool adequate = true;     ///< nothing significant and material is left
  Gate gate;                ///< of the baseline
  std::vector<TrialNote> notes;
};

/// `library` gains shapes that only the baseline's residual can tell.
[[nodiscard]] Found search(const Predictor& predictor, Library& library, Prepared& data,
                           const ExplainOptions& options);

}  // namespace isac::explain
