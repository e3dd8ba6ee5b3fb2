/// @file
/// Work on several threads that stay: what a thread keeps for itself (inputs of runs, predict_inputs.cpp) is there at the next call.
///
/// Threads: the workers serve one call at a time; a call from within another's work (but for work that is a single piece), or beside it, does its work itself. Deterministic where
/// work(i) touches what is i's only. Errors: the first exception that work throws, once all others have returned. Source: none.
#pragma once

#include <cstddef>
#include <functional>

namespace isac::explain {

/// Calls work(i) once for each i below `count`, on up to `threads` threads, of which the caller's is one.
void share_work(int threads, std::size_t count, const std::function<void(std::size_t)>& work);

}  // namespace isac::explain
