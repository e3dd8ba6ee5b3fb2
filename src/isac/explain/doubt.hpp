/// @file
/// What speaks against a name, or against "nothing is missing", once the search has ended: runs that it has not seen, and what is left over.
///
///   refuted     rms_after > 1.002 rms_before on held-out runs (or 1.01 of the search's own baseline), and neither
///                 t ≥ 3 in rows freed of the noise's slow part, nor
///                 rms_after ≤ 1.01 rms_before and t > −1.645: they hardly show it, and noise decides, nor
///                 t ≥ 3 over the search's own baseline, or less than three sigma of the effect in these rows, where what only the recording's
///                 rate shows (raw_effects.hpp) then takes so much more that rms_after ≤ rms_before: two things are missing, and one of them was
///                 not in the rows
///   doubted     it closes less than a quarter of what can be explained there, leaves over what chance seldom does, or in a few moments what noise
///                 holds nowhere else, or functions without a name do as well (remainder.cpp), or its numbers speak against its name
///                 (number_doubts.hpp), or it is not the same in both halves of something (halves.hpp), or held-out runs, alone or with the
///                 fitted ones, leave over what chance seldom does (left_over.hpp)
///   not none    rms on held-out runs > 1.35 times that on fitted ones, freed of a zero that wanders too, or a few moments that hold what noise holds
///                 nowhere else (moments.hpp), or slow noise that is none: by its steps a zero (memory 100 s) that would wander by more than 1.5
///                 times the rms, or steps from one bin of 2 s to the next of eight times the mean square of the median run
///
/// t: compare.hpp's, of the user's baseline behind the named model. Units: the answer's. Threads: pure. Errors: none.
/// Source: docs/derivations/explain.md.
#pragma once

#include "isac/explain/explanation.hpp"
#include "isac/explain/proof.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

/// On runs that it has not seen a model closes about all of what can be explained, if it is the right one.
[[nodiscard]] bool closes_little(const Gap& gap);

/// Is what was named refuted by runs that it has not seen? `user`: the baseline that anyone would have fitted. `gap` gains the freed numbers
/// where they decide, `found` a doubt where those runs say nothing.
[[nodiscard]] bool is_refuted(const Predictor& predictor, Found& found, const ModelPoint& user,
                              const Proof& proof, Chain chain, const ExplainOptions& options, Gap& gap);

/// Of several names each must be borne by the held-out runs: one without which they fit better by 2 % rms in the chain where it shows most, and
/// that rows freed of slow noise do not show (t < 1.645), leaves its place to the best rival, up to three sigma behind it, that those runs bear;
/// where they bear none it is taken away, and a doubt tells that something more is missing.
void take_away_what_is_refuted(const Predictor& predictor, const Library& library, const Proof& proof,
                               Found& found);

/// What the model leaves of runs that it has not seen, or of all runs together, and noise does not, casts a doubt (left_over.hpp).
void doubt_what_is_left(const Predictor& predictor, const Library& library, const Proof& proof,
                        const ExplainOptions& options, Found& found);

/// What is not the same in both halves of something is doubted (halves.hpp), beside the joint that the catalogue is of: elsewhere that is evidence
/// against it, and what is the same has that for it.
void doubt_what_differs_by_half(const Predictor& predictor, const ExplainOptions& options, Found& found,
                                Explanation& e);

/// The name stands, and beside it that it may be none of the catalogue: what it leaves over says so.
void doubt(const Predictor& predictor, const Found& found, Explanation& e);

/// A model that is right for the fitted runs and far off on the others lacks what only those excite.
void look_beyond_fitted_runs(const Prepared& data, const Found& found, const Proof& proof, Explanation& e);

/// What passes for slow noise, and would wander by more than the readings hold or moves one run far more than the others, is unknown and not
/// nothing.
void look_at_slow_noise(const Predictor& predictor, const Found& found, double material, Explanation& e);

/// What shows in a few moments only, and fits no name and no function of the signals, is unknown and not nothing.
void look_at_moments(const Predictor& predictor, const Found& found, Explanation& e);

/// What depends on one signal by a curve that no name and no function is like is unknown, and not nothing.
void look_at_curves(const Prepared& data, const Found& found, const ExplainOptions& options, Explanation& e);

}  // namespace isac::explain
