/// @file
/// The moment at which an encoder slipped: within a run, between two, and where the fitted runs leave it open.
///
/// Within a run it is where the torque's residual, summed up, turns most. Between two fitted runs every moment is the same to them, and a run at
/// rest stands anywhere within a step of the encoder: before and after it are alike as well. A held-out run that lies there was recorded before the slip or after it, and no fit can say which. Every such moment at
/// which the fitted rows fit as well (t < 1.645, everything refitted) is asked; the held-out rows decide where one leads by t > 1.645.
///
/// One of a few moments is all that is taken from the held-out runs: the size of the slip, and everything else, stays as fitted.
/// t: compare.hpp's. Units: s of the day. Threads: pure. Errors: none; without such runs nothing changes.
/// Source: docs/derivations/explain.md, "The moment of a slip".
#pragma once

#include <Eigen/Core>
#include <string>

#include "isac/explain/proof.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

inline constexpr std::size_t kSlipMoment = 1;  ///< of the values of a slip: s, t_s

/// A slip that happens once in a day. (One that falls on the same moment of every run is another.)
[[nodiscard]] bool is_slip(const Hypothesis& hypothesis);

/// Adds to the encoder's slip the moment within a run at which the torque's residual jumps most and stays.
void place_slip(Library& library, const Prepared& data, const Eigen::VectorXd& residual);

/// Moves the slip in `found.model`, if one was named. What to tell of it, in sentences: where the held-out runs chose, and where no run tells the
/// moment; else empty.
[[nodiscard]] std::string settle_slip(const Predictor& predictor, const Library& library, const Proof& proof,
                                      Found& found);

/// Where every fitted run that could tell was recorded after the slip, an offset fits as well and has fewer parameters, and a drift may. If the held-out rows have
/// the slip ahead by three sigma, it takes the place of what was named alone, and they say which rivals are left. What to tell of it; else empty.
[[nodiscard]] std::string slip_instead(const Predictor& predictor, const Library& library, const Proof& proof,
                                       Found& found);

/// Where a named slip lies between two runs and only one run was recorded before it, or after: whatever that run shows by itself looks like a
/// slip. A sentence; else empty.
[[nodiscard]] std::string told_by_one_run(const Predictor& predictor, const Proof& proof, const Found& found);

}  // namespace isac::explain
