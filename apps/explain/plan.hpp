/// @file
/// The next experiment as a plan that isac-log records.
#pragma once

#include "isac/explain/explanation.hpp"
#include "isac/series/plan_programs.hpp"

namespace isac::apps {

/// Units turned to SI; without runs where nothing needs to be told apart, or only a change of the rig helps.
[[nodiscard]] series::Plan plan_of(const explain::Explanation& answer);

}  // namespace isac::apps
