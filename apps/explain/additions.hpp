/// @file
/// What was found, added: to params.toml, and to what the controller can compensate.
///
///   [[joint]]    the baseline's torque parameters as they are beside the effects; wheel, p0 and inertia as constants
///   [pcu]        K_C and T_C of the valve unit; a transport delay found stands here too, where the predictor reads it
///   [[effects]]  one section per effect added, labelled by its id, parameters in reporting units
///
/// `sim:params=FILE`, `isac-identify export` and the controller's feed-forward read these (docs/formats.md).
/// Threads: pure functions. Errors: none.
#pragma once

#include <string>
#include <vector>

#include "explain/inputs.hpp"
#include "isac/record/params.hpp"

namespace isac::apps {

[[nodiscard]] record::Params params_of(const explain::Explanation& answer, const ExplainInputs& inputs,
                                       const std::string& created);

/// For every effect added, one sentence: what the controller does about it, or why it can do nothing.
[[nodiscard]] std::vector<std::string> compensation_of(const explain::Explanation& answer);

}  // namespace isac::apps
