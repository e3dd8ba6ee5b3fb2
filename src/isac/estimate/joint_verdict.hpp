/// @file
/// From numbers to answers: which parameters are known, why others are not, and which sweep would mend it; warnings.
///
/// Threads: pure. Errors: none. Source: identifiability.hpp, seed 3.5.
#pragma once

#include <vector>

#include "isac/estimate/joint_core.hpp"
#include "isac/estimate/joint_fit.hpp"

namespace isac::estimate {

/// Parameters in reporting units, in the order of `options.terms`.
[[nodiscard]] std::vector<Estimated> judge_parameters(const JointRows& rows, const JointTerms& terms,
                                                      const JointCore& core, const JointFitOptions& options,
                                                      std::vector<int>& order);

/// Of the estimates, row by row in the order of `parameters`, whose columns are `order`; NaN where one of the two is not identifiable.
[[nodiscard]] std::vector<double> correlations(const std::vector<Estimated>& parameters,
                                               const std::vector<int>& order, const JointCore& core);

[[nodiscard]] ValidityBox validity_box(const JointRows& rows);

/// Remarks on data and parameters (range of validity, signs, lost rows, too few blocks).
void add_warnings(const JointRows& rows, const JointTerms& terms, const JointCore& core,
                  const JointFitOptions& options, JointFit& fit);

}  // namespace isac::estimate
