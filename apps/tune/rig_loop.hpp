/// @file
/// Joins an experiment to a card: pressures up, experiment, valves vented; inside the safety monitor, every tick in the log.
///
/// Whatever ends it (done, Ctrl-C, a limit, the card, the log) the valves are vented and the log is closed.
/// Threads: the caller's drives the card; a writer thread empties the ring. Errors: throws isac::Error: answer is no
/// ("stopped_by_person"), stopped ("limit", "card_failed"), bad input (the log cannot be written), usage (the log exists).
#pragma once

#include <cstdint>
#include <string>

#include "isac/record/rig.hpp"
#include "isac/runtime/safety.hpp"
#include "isac/tune/experiment.hpp"

namespace isac::apps {

struct RigRun {
  std::string card = "sim:";
  record::Rig rig;
  runtime::Limits limits;
  std::string log;     ///< CSV; empty: none
  std::string method;  ///< "relay", …: for the log's head
  double rate = 1000;  ///< Hz
  bool pace_real = false;
};

struct RigRunOutcome {
  std::uint64_t rows = 0, late = 0, dropped = 0;
};

[[nodiscard]] RigRunOutcome run_on_rig(const RigRun& run, tune::Experiment& experiment);

}  // namespace isac::apps
