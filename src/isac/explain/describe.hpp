/// @file
/// An explanation in the words of a lab engineer, and the numbers that stand behind the words.
///
/// describe() fills what explain() found into: errors of parameters, signals, base and what changed in it, waterfall, traces,
/// evidence of each candidate, and the summary. Every sentence holds a number of this data.
/// Units: as explanation.hpp. Threads: pure. Errors: none.
/// Source: docs/explain.md. Example: "Torque: the baseline misses 0.0137 N m against a floor of 0.0111 N m (p = 0.001).
/// Coulomb friction, T_c = 0.0141 ± 0.0006 N m, takes it to 0.0112 N m on held-out runs."
#pragma once

#include <optional>
#include <string>

#include "isac/explain/explain.hpp"
#include "isac/explain/proof.hpp"
#include "isac/explain/search.hpp"
#include "isac/explain/uncertainty.hpp"

namespace isac::explain {

/// `numbers`: of found.model, if they are known already.
void describe(const Predictor& predictor, const Library& library, const Found& found, const Proof& proof,
              const ExplainOptions& options, const std::optional<Uncertain>& numbers, Explanation& e);

/// Evidence for and against each candidate of the explanation (evidence.cpp).
void add_evidence(const Predictor& predictor, const Library& library, const Found& found, Explanation& e);

/// The verdict in one to three sentences, from what the explanation holds already.
[[nodiscard]] std::string summary_of(const Explanation& e);
/// "D fell by 31 %: it had stood in for Coulomb friction."
[[nodiscard]] std::string change_sentence(const BaseChange& change, const std::string& effect);
/// "fits only 0.40 sigma worse", or that it fits as well.
[[nodiscard]] std::string how_much_worse(double sigma);

}  // namespace isac::explain
