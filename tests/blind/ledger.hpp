/// @file
/// The ledger: what is scored of a dataset and its answer, in one short line of JSON. A line of results holds the whole answer (9 to 24 kB), which is
/// good for looking into and too much to keep; a line of the ledger some 500 bytes, so that what several days measured with one program
/// can be kept beside the sources and counted together.
///
///     {"key":"clear/white/creep/1.0","program":"0.1.0","truth":{"kind":"single","noise":"white",…},"answer":{"verdict":"named",…}}
///
/// What is empty, zero or false is left out; numbers have five digits, p-values all. The gap stands for the signal that the answer speaks of, alone.
#pragma once

#include <optional>
#include <string>

#include "score.hpp"

namespace blind {

/// One line, without its end. `program` says which program answered.
std::string ledger_line(const Case& one, const std::string& program);

/// Nothing where the line is not one of a ledger. Throws std::runtime_error where it is one and lacks something.
std::optional<Case> read_ledger_line(const std::string& line);

}  // namespace blind
