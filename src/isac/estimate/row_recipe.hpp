/// @file
/// Chooses how rows are made (window, noise of the regressors, filter) from data and options, and says it in words.
/// Threads: pure. Errors: none.
#pragma once

#include <span>
#include <string>

#include "isac/estimate/joint_fit.hpp"
#include "isac/estimate/joint_rows.hpp"
#include "isac/estimate/joint_terms.hpp"

namespace isac::estimate {

struct StatedRecipe {
  RowRecipe recipe;
  std::string words;
};

[[nodiscard]] StatedRecipe choose_recipe(std::span<const JointRun> runs, const JointTerms& terms,
                                         const JointFitOptions& options);

}  // namespace isac::estimate
