/// @file
/// Counts the allocations of a watched thread: counted_new.cpp replaces operator new for the whole program.
#pragma once

namespace isac::test {

extern thread_local bool watched;
extern thread_local long allocations;

}  // namespace isac::test
