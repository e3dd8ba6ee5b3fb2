/// @file
/// Counts the allocations of a watched thread: counted_new.cpp replaces operator new for the whole program.
#pragma once

namespace isac::test {

/// Begins to watch this thread, from 0.
void watch_allocations() noexcept;
/// Allocations since then; ends the watch.
long watched_allocations() noexcept;

}  // namespace isac::test
