/// @file
/// The label of a dataset: what is hidden in it, as JSON (schema isac.blind/1). It stands outside the dataset's folder.
#pragma once

#include <string>

#include "dataset.hpp"
#include "oracle.hpp"

namespace blind {

/// `oracle` may be null; `noise` is the residual noise on the held-out runs, `closes` what the true model takes out of them.
std::string label_of(const Dataset& dataset, const Gap& noise, const Gap& closes, const Verdict* oracle);

}  // namespace blind
