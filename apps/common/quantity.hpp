/// @file
/// A quantity in the words of a call: "149.1 N", "5 kg/cm2", "-0.5 rad".
#pragma once

#include <string>

#include "isac/core/units.hpp"

namespace isac::apps {

/// The value in SI. Throws isac::Error (usage) that names the option, what was found and a unit that would
/// do.
[[nodiscard]] double parse_quantity(const std::string& text, const Dimension& wanted,
                                    const std::string& option);

}  // namespace isac::apps
