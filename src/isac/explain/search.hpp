/// @file
/// The search: gate, shortlist, joint refits, the set that is left, and one effect after another until nothing is.
///
/// Forward: the best candidate is added while the residual still shows something significant and material; swap: each added
/// effect is given up once for a better one; backward: each is dropped once and must be missed. At most `most_effects`.
/// Threads: uses options.threads. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "isac/explain/compare.hpp"
#include "isac/explain/explain.hpp"
#include "isac/explain/floors.hpp"
#include "isac/explain/gate.hpp"
#include "isac/explain/ranking.hpp"
#include "isac/explain/screen.hpp"

namespace isac::explain {

struct Step {
  std::vector<Trial> trials;  ///< best first
  Screen screen;
  Gate gate;
  double units =
      0;  ///< of noise that the best of them, or functions without a name, close; 0 where nothing was refitted
};

struct Found {
  Fit baseline, model;
  Weights weights;
  Floors floors;
  std::vector<Step> steps;  ///< one for each effect that was added, and the last that was not
  std::vector<int> added;   ///< hypotheses, in order
  bool adequate = true;     ///< nothing significant and material is left
  /// Beside dry friction is left what nobody can tell from it where a joint turns slowly, and no more.
  bool blurred = false;
  bool comes_and_goes = false;  ///< something named was not of one size throughout (constancy.hpp)
  bool another_pair =
      false;  ///< what closed most alone left little, or too little for a second name: two others took its place
  Gate gate;  ///< of the baseline
  /// Why what was named may be none of the catalogue, though nothing significant is left; empty: nothing says so.
  std::vector<std::string> doubts;
  double none_of_them = 0.08;  ///< of the belief, that a doubted name is none of the catalogue
  /// Ended early: an effect of the valves was found and more is missing, so the torque's pressures are to be quieted beside that effect first.
  bool worth_another_look = false;
  bool colour_beside_best = false;  ///< the noise's colour was read off beside an effect
  std::vector<Step> settled;        ///< then: steps of the pressures' own rows, which that changes nothing of
  /// Ended at its beginning: the force sensors' zero wanders, so the torque of free runs is wanted beside their motion (prepared.hpp).
  bool wants_torque_of_free_runs = false;
  /// What had hidden it, one effect or two: of this look's library.
  std::vector<std::pair<int, Values>> hid_the_zero;
  std::set<std::string> contenders;  ///< then: ids of what stood near the top of any screen
  std::set<int> hardly_general;      ///< hypotheses that their own simple cases do as well as, and so told
  std::vector<TrialNote> notes;
};

/// Which of two looks at the same data a search is.
struct Look {
  bool provisional = false;  ///< may end early (Found::worth_another_look)
  /// Of an earlier look that ended early: these are screened first, all others before nothing is said to be left over.
  std::set<std::string> contenders;
  std::vector<Step> settled;  ///< its steps that need not be taken again; of a library of the same hypotheses
  Gate gate;                  ///< of the baseline, by that look
  Weights weights;            ///< of that look, whose colour of the pressures stands
  bool colour_beside_best = false;  ///< its noise's colour was read off beside an effect
  bool another_pair = false;        ///< Found::another_pair
  /// What it found, of a library of the same hypotheses: beside it the colour is read off where it had to be read off beside an effect.
  std::vector<std::pair<int, Values>> found;
  std::vector<TrialNote> notes;  ///< what was said up to them
};

/// `library` gains shapes that only the baseline's residual can tell.
[[nodiscard]] Found search(const Predictor& predictor, Library& library, Prepared& data,
                           const ExplainOptions& options, const Look& look = {});

}  // namespace isac::explain
