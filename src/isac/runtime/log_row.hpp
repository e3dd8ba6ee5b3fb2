/// @file
/// What the loop hands to the writer for every sample: plain memory, copied through the ring.
///
/// Units: SI; time in seconds since the recording began. Real time: trivially copyable. Errors: none.
#pragma once

#include "isac/card/card.hpp"
#include "isac/runtime/signal_map.hpp"

namespace isac::runtime {

struct LogRow {
  double time = 0;
  Physical physical;
  series::Pressures commanded;
  card::Sample sample;
  card::Command command;
};

}  // namespace isac::runtime
