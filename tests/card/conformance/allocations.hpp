// Counts calls of operator new of this program, so that a test can say "this allocates nothing".
#pragma once

#include <cstdint>

namespace isac::test {

/// Calls of operator new by this thread so far.
[[nodiscard]] std::uint64_t allocations() noexcept;

}  // namespace isac::test
