/// @file
/// What isac-log answers with --json: verdict and facts of every recording.
///
/// {"schema":"isac.log/1","verdict":"keep"|"repeat","recordings":[{"file":…,"verdict":…,"facts":{…},"remarks":[…]},…]}
/// Numbers are numbers, null where not known. Throws: std::bad_alloc only.
#pragma once

#include <string>
#include <vector>

#include "isac/runtime/log_session.hpp"

namespace isac::apps {

/// `complete`: the session was not cut short.
[[nodiscard]] std::string format_outcomes(const std::vector<runtime::RecordingOutcome>& outcomes,
                                          bool complete);

}  // namespace isac::apps
