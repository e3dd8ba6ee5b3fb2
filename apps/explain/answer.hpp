/// @file
/// The answer of isac-explain as JSON, schema isac.explain/1 (docs/formats.md). Threads: pure. Errors: std::bad_alloc only.
#pragma once

#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"

namespace isac::apps {

/// `compensation`: sentences of additions.hpp.
[[nodiscard]] std::string format_explanation(const explain::Explanation& answer,
                                             const std::vector<std::string>& compensation);

}  // namespace isac::apps
